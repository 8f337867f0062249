//! The mesh of an import, read from a file or fused from depth images.

use crate::capture::fuse;
use crate::capture::import::folder::{Folder, inside};
use crate::capture::inputs;
use crate::capture::mesh::Mesh;
use crate::capture::read::confine::{Confine, folder_of};
use crate::capture::read::mesh;
use crate::capture::scan::ImportedFrame;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Reads a mesh; returns it and whether the file defines objects. `mirrored` negates z and reverses the winding.
pub fn read(
    path: &Path,
    folder: &Folder,
    mirrored: bool,
    remarks: &mut Vec<String>,
) -> Result<(Mesh, bool)> {
    // A glTF file may name buffers beside itself or anywhere in the scan.
    let confine = match path.starts_with(folder.confine().folder()) {
        true => folder.confine().clone(),
        false => Confine::new(folder_of(path), false)?,
    };
    inputs::note(path);
    let mut warnings = Vec::new();
    let raw = mesh::read(path, &confine, &mut warnings)?;
    let mut mesh = raw.mesh;
    remarks.push(format!(
        "mesh: {}, {} triangles",
        path.display(),
        mesh.triangles.len()
    ));
    remarks.append(&mut warnings);
    if mirrored {
        for position in &mut mesh.positions {
            position.z = -position.z;
        }
        for triangle in &mut mesh.triangles {
            triangle.swap(1, 2);
        }
        for uvs in &mut mesh.corner_uvs {
            uvs.swap(1, 2);
        }
        remarks.push("the mesh is mirrored in z like the cameras".into());
    }
    Ok((mesh, raw.has_objects))
}

/// Usual names of meshes, in order of preference.
const NAMES: [&str; 9] = [
    "mesh.glb",
    "mesh.ply",
    "mesh.obj",
    "textured.obj",
    "textured_mesh.obj",
    "poly.glb",
    "raw.glb",
    "meshed-poisson.ply",
    "meshed-delaunay.ply",
];
/// Words in the names of PLY files that are point clouds.
const POINTS: [&str; 5] = ["fused", "point", "cloud", "sparse", "input"];

/// Finds a mesh in some folders: a file with one of the usual names, or else the first file that may be a mesh.
pub fn find(
    folder: &Folder,
    places: &[&str],
    remarks: &mut Vec<String>,
) -> Result<Option<PathBuf>> {
    for place in places {
        if let Some(name) = NAMES.iter().find(|name| folder.has(&inside(place, name))) {
            return folder.existing(&inside(place, name)).map(Some);
        }
    }
    for place in places.iter().filter(|place| folder.has_folder(place)) {
        let names = folder.names(place)?;
        let is_mesh = |name: &&String| {
            let lower = name.to_ascii_lowercase();
            let end = lower.rsplit_once('.').map_or("", |(_, end)| end);
            let holds_points = POINTS.iter().any(|word| lower.contains(word));
            matches!(end, "glb" | "obj") || (end == "ply" && !holds_points)
        };
        let found: Vec<&String> = names.iter().filter(is_mesh).collect();
        if found.len() > 1 {
            remarks.push(format!(
                "mesh: the first of {} files that may be one; --mesh chooses another",
                found.len()
            ));
        }
        if let Some(name) = found.first() {
            return folder.existing(&inside(place, name)).map(Some);
        }
    }
    Ok(None)
}

/// Fuses a mesh from all depth images.
pub fn fuse(
    source: &Path,
    frames: &[ImportedFrame],
    voxel: Option<f64>,
    remarks: &mut Vec<String>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Mesh> {
    let count = frames.iter().filter(|frame| frame.depth.is_some()).count();
    if count == 0 {
        return Err(Error::file(
            source,
            "there is no mesh, and no depth image to fuse one from",
            "name the mesh with --mesh FILE",
        ));
    }
    let (edge, remark) = fuse::voxel_size(frames, voxel)?;
    remarks.push(remark);
    let mesh = fuse::fuse(frames, edge, fuse::MAX_BYTES, progress)?;
    remarks.push(format!(
        "mesh: fused from {count} depth images, {} triangles",
        mesh.triangles.len()
    ));
    Ok(mesh)
}
