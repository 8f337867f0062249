//! Fuses depth images into a mesh: a truncated signed distance field in sparse blocks of voxels (Curless and Levoy 1996; blocks
//! as in Nießner et al. 2013), whose zero surface is extracted by surface nets.
//!
//! A voxel stores the weighted mean of (measured depth − its own depth), truncated at a few voxels, and the mean linear colour
//! of the photographs near the surface. Only blocks near a measured surface are allocated, by default at most [`MAX_BYTES`].

mod integrate;
mod surface;
mod voxel;

pub use voxel::voxel_size;

use crate::capture::mesh::Mesh;
use crate::capture::scan::ImportedFrame;
use crate::error::{Error, Result};
use integrate::{Field, View};
use rayon::prelude::*;

/// Default limit on the memory of all voxels.
pub const MAX_BYTES: usize = 2 << 30;

/// Fuses all depth images, in frame order, into a mesh with voxels of `edge` metres that take at most `max_bytes` of memory: one
/// object of triangles whose front faces the cameras, with linear vertex colours. `progress` gets the number of fused depth images
/// and of all.
///
/// # Errors
/// A depth image or photograph is broken, the voxels need more memory, or no surface comes out.
pub fn fuse(
    frames: &[ImportedFrame],
    edge: f64,
    max_bytes: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Mesh> {
    let frames: Vec<&ImportedFrame> = frames.iter().filter(|f| f.depth.is_some()).collect();
    let mut field = Field::new(edge, max_bytes);
    // Decode one image per thread at a time, to bound memory.
    let batch = rayon::current_num_threads().max(1);
    for (index, chunk) in frames.chunks(batch).enumerate() {
        let views: Result<Vec<View>> = chunk.par_iter().map(|frame| View::load(frame)).collect();
        for view in views? {
            field.integrate(&view)?;
        }
        progress(
            (index * batch + chunk.len()).min(frames.len()),
            frames.len(),
        );
    }
    let mesh = surface::extract(&field);
    if mesh.triangles.is_empty() {
        return Err(Error::new(
            "depth images",
            "they yield no surface",
            "check depth, poses and --voxel, or name a mesh with --mesh",
        ));
    }
    Ok(mesh)
}
