//! The mesh of an import: read from a file, or fused from depth images.

use crate::capture::fuse;
use crate::capture::import::folder::Folder;
use crate::capture::import::{ImportedFrame, memory_bound};
use crate::capture::mesh::Mesh;
use crate::capture::read::confine::Confine;
use crate::capture::read::mesh;
use crate::error::{Error, Result};
use std::path::Path;

/// Reads a mesh, mirrored in z with its winding turned if the scan's world is left-handed; also whether it has objects.
///
/// # Errors
/// The file is missing or broken.
pub fn read(
    path: &Path,
    folder: &Folder,
    mirrored: bool,
    said: &mut Vec<String>,
) -> Result<(Mesh, bool)> {
    // A glTF file names its buffers; they may lie beside it, or in the scan.
    let beside = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let confine = match path.starts_with(folder.confine().folder()) {
        true => folder.confine().clone(),
        false => Confine::new(beside.unwrap_or(Path::new(".")), false)?,
    };
    let mut remarks = Vec::new();
    let raw = mesh::read(path, &confine, &mut remarks)?;
    let mut mesh = raw.mesh;
    said.push(format!(
        "mesh: {}, {} triangles",
        path.display(),
        mesh.triangles.len()
    ));
    said.append(&mut remarks);
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
        said.push("the mesh is mirrored in z like the cameras".into());
    }
    Ok((mesh, raw.has_objects))
}

/// Fuses the depth of all frames that have one.
///
/// # Errors
/// No frame has depth, a depth image is broken, or the voxels asked for need too much memory.
pub fn fuse(
    source: &Path,
    frames: &[ImportedFrame],
    voxel: Option<f64>,
    said: &mut Vec<String>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Mesh> {
    if !frames.iter().any(|frame| frame.depth.is_some()) {
        return Err(Error::file(
            source,
            "there is no mesh, and no depth image to fuse one from",
            "name the mesh with --mesh FILE",
        ));
    }
    let choice = fuse::voxel_size(frames, voxel)?;
    said.push(match voxel {
        Some(edge) => format!("voxels of {edge} m"),
        None => format!(
            "voxels of {:.4} m: {} (at most {} of them; --voxel overrules)",
            choice.edge,
            choice.reason,
            memory_bound()
        ),
    });
    let fused = fuse::fuse(frames, choice.edge, fuse::MAX_BYTES, progress)?;
    said.push(format!(
        "mesh: fused from {} depth images, {} triangles",
        fused.frames,
        fused.mesh.triangles.len()
    ));
    Ok(fused.mesh)
}
