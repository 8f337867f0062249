//! Reads a capture from a folder: transforms.json, a mesh, and photographs (which are read when needed).
//!
//! ```text
//! transforms.json     camera_model, w, h, fl_x, fl_y, cx, cy, [k1 k2 p1 p2], frames[{file_path,
//!                     transform_matrix (camera-to-world, x right, y up, looking down -z),
//!                     optional per-frame intrinsics, optional exposure}], optional mesh_path, up
//! mesh.obj|ply|glb    objects = OBJ `o`/`g`, glTF nodes, or a per-face `object_id` in PLY
//! images/*            .exr, .hdr (linear), .png, .jpg (sRGB)
//! ```
//!
//! A capture from someone else is data: nothing outside its folder is opened unless the person allows it, and no
//! header is believed before it was compared with the file's length or the camera's size.

pub mod accessor;
pub mod camera_file;
pub mod confine;
mod cut_short;
mod exposure;
pub(in crate::capture) mod fields;
mod gltf;
pub mod gltf_file;
pub mod gltf_scene;
pub mod image;
pub(in crate::capture) mod lens;
pub(in crate::capture) mod mesh;
mod obj;
mod ply;
mod ply_elements;
pub(in crate::capture) mod pose;
mod transforms;

use crate::capture::read::mesh::RawMesh;
use crate::capture::reading::Reading;
use crate::capture::{Capture, Cut};
use crate::error::{Error, Result};
use confine::Confine;
use glam::DVec3;
use std::path::Path;

/// The file that makes a folder a capture: its cameras and the names of all else.
pub const CAMERAS: &str = "transforms.json";
/// The mesh, where `mesh_path` does not name one, in this order.
pub const MESHES: [&str; 3] = ["mesh.glb", "mesh.ply", "mesh.obj"];
/// A mesh whose only object has more triangles than this is taken for a scan without objects.
const MAX_TRIANGLES_OF_ONE_OBJECT: usize = 5000;

/// What a person may choose about reading.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Overrules the cameras' mean up; need not be of unit length.
    pub up: Option<DVec3>,
    /// About how many segments a mesh without objects is cut into; 1 leaves it whole.
    pub segments: Option<usize>,
    /// How the files' numbers are meant.
    pub reading: Reading,
    /// Lets file paths inside the capture lead out of its folder.
    pub allow_outside: bool,
}

/// Reads the capture in `folder`. Photographs are checked (they exist and have their camera's size) but not decoded.
///
/// # Errors
/// Anything that leaves no capture to work on: a missing or broken transforms.json, a pose that is no rigid motion, a
/// photograph of another size than its camera, no mesh, a broken mesh, a path that leaves the folder.
pub fn read(folder: &Path, options: &ReadOptions) -> Result<Capture> {
    if !folder.is_dir() {
        return Err(Error::file(
            folder,
            "is not a folder",
            "name the folder that holds transforms.json",
        ));
    }
    let confine = Confine::new(folder, options.allow_outside)?;
    let mut warnings = Vec::new();
    let transforms = transforms::read(
        &confine,
        options.up,
        options.reading.orientation,
        &mut warnings,
    )?;
    let raw = mesh::read(&transforms.mesh, &confine, &mut warnings)?;
    let cut = cut(&raw, &transforms.mesh, options.segments, &mut warnings);
    let capture = Capture {
        name: name_of(folder),
        folder: Some(folder.to_path_buf()),
        mesh: raw.mesh,
        cut,
        frames: transforms.frames,
        up: transforms.up,
        warnings,
    };
    Ok(capture.read_as(&options.reading))
}

/// How a mesh without objects is to be cut, if that is wanted; a single object of a scan's complexity counts as none.
fn cut(
    raw: &RawMesh,
    path: &Path,
    wanted: Option<usize>,
    warnings: &mut Vec<String>,
) -> Option<Cut> {
    let mesh = &raw.mesh;
    let whole = !raw.has_objects
        || (mesh.objects.len() == 1 && mesh.triangles.len() > MAX_TRIANGLES_OF_ONE_OBJECT);
    match wanted {
        Some(1) if mesh.objects.len() == 1 => None,
        Some(_) if !whole && mesh.objects.len() > 1 => {
            warnings.push(format!(
                "{}: the mesh has {} objects of its own; it is not cut into segments",
                path.display(),
                mesh.objects.len()
            ));
            None
        }
        None if !whole => None,
        _ => Some(Cut {
            file: path.to_path_buf(),
            wanted,
        }),
    }
}

/// The folder's own name, also of `.` and `..`.
fn name_of(folder: &Path) -> String {
    let absolute = folder.canonicalize();
    let path = absolute.as_deref().unwrap_or(folder);
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
