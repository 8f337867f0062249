//! A mesh from depth images: a truncated signed distance field in sparse blocks of voxels (Curless and Levoy 1996; blocks as
//! by Nießner et al. 2013), and its zero surface by surface nets.
//!
//! A voxel keeps the weighted mean of (measured depth − its own depth), cut off at a few voxels, and the mean linear colour
//! of the photographs near the surface. Only blocks near a measured surface exist, by default at most [`MAX_BYTES`] of them.

mod block;
mod integrate;
mod surface;
mod view;
mod voxel;

pub use voxel::{VoxelChoice, voxel_size};

use crate::capture::import::ImportedFrame;
use crate::capture::mesh::Mesh;
use crate::error::{Error, Result};
use integrate::Field;
use rayon::prelude::*;
use view::View;

/// The usual bound on the memory of all voxels.
pub const MAX_BYTES: usize = 2 << 30;
/// Largest distance that is kept, in voxels.
pub(crate) const TRUNCATION: f64 = 4.0;

/// A fused mesh.
#[derive(Debug)]
pub struct Fused {
    /// Triangles whose front faces the cameras, with linear vertex colours; one object.
    pub mesh: Mesh,
    /// Number of depth images in it.
    pub frames: usize,
}

/// Fuses the depth of all frames that have one, in order, into a mesh with voxels of `edge` metres that take at most
/// `max_bytes` of memory.
///
/// # Errors
/// A depth image or photograph is broken, the voxels need more memory, or no surface comes out.
pub fn fuse(
    frames: &[ImportedFrame],
    edge: f64,
    max_bytes: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Fused> {
    let frames: Vec<&ImportedFrame> = frames.iter().filter(|f| f.depth.is_some()).collect();
    let mut field = Field::new(edge, max_bytes);
    // Images are decoded a few at a time, so that memory holds no more of them than there are threads.
    let batch = rayon::current_num_threads().max(1);
    for (index, some) in frames.chunks(batch).enumerate() {
        let views: Result<Vec<View>> = some.par_iter().map(|frame| View::load(frame)).collect();
        for view in views? {
            field.integrate(&view)?;
        }
        progress((index * batch + some.len()).min(frames.len()), frames.len());
    }
    let mesh = surface::extract(&field);
    if mesh.triangles.is_empty() {
        return Err(Error::new(
            "depth images",
            "no surface comes out of them",
            "check depth, poses and --voxel, or name a mesh with --mesh",
        ));
    }
    Ok(Fused {
        mesh,
        frames: frames.len(),
    })
}
