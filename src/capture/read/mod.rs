//! Reads a capture from a folder: transforms.json, a mesh, and photographs (decoded only when needed).
//!
//! ```text
//! transforms.json     camera_model, w, h, fl_x, fl_y, cx, cy, [k1 k2 p1 p2], frames[{file_path,
//!                     transform_matrix (camera-to-world, x right, y up, looking down -z),
//!                     optional per-frame intrinsics, optional exposure}], optional mesh_path, up
//! mesh.obj|ply|glb    objects = OBJ `o`/`g`, glTF nodes, or a per-face `object_id` in PLY
//! images/*            .exr, .hdr (linear), .png, .jpg (sRGB)
//! ```
//!
//! Captures are untrusted: nothing outside the folder is opened unless allowed, and sizes in headers are checked against the
//! file's length or the camera's size before memory is allocated.

pub mod camera_file;
pub mod confine;
mod cut_short;
pub(in crate::capture) mod fields;
mod gltf;
pub mod gltf_file;
pub mod gltf_scene;
pub mod image;
pub(in crate::capture) mod lens;
pub(in crate::capture) mod mesh;
mod obj;
mod ply;
pub(in crate::capture) mod pose;
mod transforms;

use crate::capture::mesh::Mesh;
use crate::capture::reading::Reading;
use crate::capture::{Capture, Segmentation};
use crate::error::{Error, Result};
use confine::Confine;
use glam::DVec3;
use std::path::Path;

/// The file that makes a folder a capture: cameras and the names of all other files.
pub const CAMERAS: &str = "transforms.json";
/// Names of the mesh if `mesh_path` is absent, in order of preference.
pub const MESHES: [&str; 3] = ["mesh.glb", "mesh.ply", "mesh.obj"];
/// A mesh with a single object of more triangles counts as a scan without objects.
const MAX_TRIANGLES_OF_ONE_OBJECT: usize = 5000;

/// What a person may choose about reading.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Overrules the cameras' mean up; need not be of unit length.
    pub up: Option<DVec3>,
    /// Approximate number of segments of a mesh without objects; 1 does not segment it.
    pub segments: Option<usize>,
    /// Conventions of the files.
    pub reading: Reading,
    /// Whether paths in the capture may leave its folder.
    pub allow_outside: bool,
}

/// A mesh as a file stores it, before any check.
#[derive(Debug, Default)]
pub struct RawMesh {
    /// Geometry and objects; names may repeat or be empty.
    pub mesh: Mesh,
    /// Whether the file assigns triangles to objects.
    pub has_objects: bool,
    /// Largest rounding error of a position due to the file's number format, in the capture's units.
    pub rounding: f64,
    /// Warnings, without the file's name.
    pub warnings: Vec<String>,
}

/// Reads the capture in `folder`. Photographs are checked (they exist and have their camera's size) but not decoded.
///
/// # Errors
/// The capture cannot be used: a missing or broken transforms.json, a pose that is not a rigid motion, a
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
    let segmentation = segmentation(&raw, &transforms.mesh, options.segments, &mut warnings);
    let capture = Capture {
        name: name_of(folder),
        folder: Some(folder.to_path_buf()),
        mesh: raw.mesh,
        segmentation,
        frames: transforms.frames,
        up: transforms.up,
        warnings,
    };
    Ok(capture.read_as(&options.reading))
}

/// How to segment the mesh, if it has no objects. A single object with many triangles counts as none.
fn segmentation(
    raw: &RawMesh,
    path: &Path,
    wanted: Option<usize>,
    warnings: &mut Vec<String>,
) -> Option<Segmentation> {
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
        _ => Some(Segmentation {
            file: path.to_path_buf(),
            wanted,
        }),
    }
}

/// The folder's name, also for `.` and `..`.
fn name_of(folder: &Path) -> String {
    let absolute = folder.canonicalize();
    let path = absolute.as_deref().unwrap_or(folder);
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
