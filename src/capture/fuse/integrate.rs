//! Integrates depth images into the distance field.

use crate::capture::fuse::block::{Block, SIDE, block_at};
use crate::capture::fuse::view::View;
use crate::error::{Error, Result};
use glam::{DVec2, DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Truncation distance of the field in voxels.
const TRUNCATION: f64 = 4.0;

/// A sparse truncated signed distance field. Voxel (i, j, k) sits at (i, j, k) times the edge.
pub struct Field {
    /// Edge of a voxel in metres.
    pub edge: f64,
    /// All blocks, in the order of allocation.
    pub blocks: Vec<Block>,
    /// Index into `blocks` by block position.
    pub places: HashMap<IVec3, usize>,
    /// Limit on the memory of the blocks.
    max_bytes: usize,
}

impl Field {
    pub fn new(edge: f64, max_bytes: usize) -> Self {
        Self {
            edge,
            blocks: Vec::new(),
            places: HashMap::new(),
            max_bytes,
        }
    }

    /// Integrates one view.
    ///
    /// # Errors
    /// The blocks exceed the memory limit.
    pub fn integrate(&mut self, view: &View) -> Result<()> {
        // Allocate the blocks near the measured surface.
        let mut new = blocks_near_surface(view, self.edge);
        new.retain(|at| !self.places.contains_key(at));
        if (self.blocks.len() + new.len()).saturating_mul(Block::bytes()) > self.max_bytes {
            return Err(Error::new(
                "--voxel",
                format!(
                    "voxels of {} m need more than {} MiB of memory",
                    self.edge,
                    self.max_bytes >> 20
                ),
                format!("choose larger ones, such as {:.4}", self.edge * 1.5),
            ));
        }
        for at in new {
            self.places.insert(at, self.blocks.len());
            self.blocks.push(Block::new(at));
        }
        // Update every visible block, so that observed free space is cleared.
        let edge = self.edge;
        self.blocks
            .par_iter_mut()
            .for_each(|block| update(block, view, edge));
        Ok(())
    }
}

/// The blocks within the truncation distance of any measured point, without duplicates, in a fixed order.
fn blocks_near_surface(view: &View, edge: f64) -> Vec<IVec3> {
    let k = &view.depth.lens.pinhole;
    let reach = TRUNCATION * edge;
    let side = f64::from(SIDE) * edge;
    // Points spaced by at most half a block reach every block.
    let deepest = f64::from(view.depth.metres.iter().copied().fold(0.0, f32::max));
    let stride = (side * 0.5 * k.fx.min(k.fy) / deepest.max(1e-9)).floor();
    let stride = stride.clamp(1.0, 64.0) as usize;
    let mut blocks: Vec<IVec3> = (0..k.height as usize)
        .into_par_iter()
        .step_by(stride)
        .flat_map_iter(|y| {
            let mut row: Vec<IVec3> = Vec::new();
            for x in (0..k.width as usize).step_by(stride) {
                let depth = f64::from(view.depth.metres[y * k.width as usize + x]);
                let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                if depth <= 0.0 {
                    continue;
                }
                let Some(ray) = view.depth.lens.ray(pixel) else {
                    continue;
                };
                let point = view.pose.to_world(ray.extend(1.0) * depth);
                // The corners of a cube around the point reach every block that it touches, as 2 · reach ≤ the side of a block.
                for corner in 0..8 {
                    let sign = |bit: i32| f64::from((corner >> bit & 1) * 2 - 1);
                    let offset = DVec3::new(sign(0), sign(1), sign(2)) * reach;
                    row.extend(block_at(point + offset, edge));
                }
            }
            row.sort_unstable_by_key(|b| b.to_array());
            row.dedup();
            row
        })
        .collect();
    blocks.par_sort_unstable_by_key(|b| b.to_array());
    blocks.dedup();
    blocks
}

/// Averages a view's distances and colours into the voxels of a block.
fn update(block: &mut Block, view: &View, edge: f64) {
    if !may_be_seen(block, view, edge) {
        return;
    }
    let reach = TRUNCATION * edge;
    for index in 0..block.voxels.len() {
        let point = view.pose.to_camera(block.voxel(index).as_dvec3() * edge);
        let Some(pixel) = view.depth.lens.project(point) else {
            continue;
        };
        let Some(depth) = view.depth.at(pixel) else {
            continue;
        };
        let ahead = f64::from(depth) - point.z;
        if ahead < -reach {
            continue;
        }
        // The standard deviation of depth noise grows with depth², so its inverse variance falls with depth⁻⁴; depth⁻² is a
        // compromise with noise that does not grow.
        let weight = (1.0 / (f64::from(depth) * f64::from(depth)).max(1e-4)) as f32;
        let voxel = &mut block.voxels[index];
        let distance = (ahead / reach).min(1.0) as f32;
        voxel.weight += weight;
        voxel.distance += (distance - voxel.distance) * (weight / voxel.weight);
        if ahead.abs() <= reach
            && let Some(color) = view.color_at(point)
        {
            voxel.color_weight += weight;
            voxel.color += (color - voxel.color) * (weight / voxel.color_weight);
        }
    }
}

/// Whether a block may project into the view: a conservative test of its bounding sphere.
fn may_be_seen(block: &Block, view: &View, edge: f64) -> bool {
    let half = f64::from(SIDE) * 0.5;
    let radius = half * edge * 3f64.sqrt();
    let middle = (block.at * SIDE).as_dvec3() + DVec3::splat(half);
    let p = view.pose.to_camera(middle * edge);
    if p.z < -radius {
        return false;
    }
    if p.z <= radius * 2.0 {
        return true;
    }
    let k = &view.depth.lens.pinhole;
    // At this distance a sphere's image is little larger than radius / depth; the factor 1.5 covers lens distortion.
    let Some(pixel) = view.depth.lens.project(p) else {
        return true;
    };
    let reach =
        1.5 * radius / (p.z - radius) * k.fx.max(k.fy) * (1.0 + p.truncate().length() / p.z);
    pixel.x > -reach
        && pixel.y > -reach
        && pixel.x < f64::from(k.width) + reach
        && pixel.y < f64::from(k.height) + reach
}
