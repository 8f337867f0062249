//! The distance field in blocks of voxels, and how depth images are integrated into it.

use crate::capture::photograph::Photograph;
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::depth::DepthMap;
use crate::error::{Error, Result};
use glam::{DVec2, DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Truncation distance of the field in voxels.
const TRUNCATION: f64 = 4.0;
/// Voxels along an edge of a block.
pub const SIDE: i32 = 8;
const VOLUME: usize = (SIDE * SIDE * SIDE) as usize;

/// The field at a voxel's centre.
#[derive(Debug, Clone, Copy, Default)]
pub struct Voxel {
    /// Weighted mean signed distance to the surface in units of the truncation distance, positive in front of it.
    pub distance: f32,
    /// Sum of weights; 0 where nothing was measured.
    pub weight: f32,
    /// Weighted mean linear colour.
    pub color: Vec3,
    pub color_weight: f32,
}

/// A cube of voxels.
pub struct Block {
    /// Position in units of blocks; the lowest voxel is at `SIDE` times it.
    pub at: IVec3,
    /// x fastest, then y, then z.
    pub voxels: Box<[Voxel; VOLUME]>,
}

impl Block {
    /// Index of a voxel from its coordinates within the block, each below [`SIDE`].
    pub fn index(inside: IVec3) -> usize {
        (inside.x + SIDE * (inside.y + SIDE * inside.z)) as usize
    }

    /// The position of a voxel in the whole grid.
    fn voxel(&self, index: usize) -> IVec3 {
        let i = index as i32;
        self.at * SIDE + IVec3::new(i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE))
    }
}

/// The block that contains a point, for voxels of `edge` metres; `None` where coordinates are too large for the grid.
fn block_at(point: DVec3, edge: f64) -> Option<IVec3> {
    let at = (point / (edge * f64::from(SIDE))).floor();
    (at.abs().max_element() < f64::from(1 << 24)).then(|| at.as_ivec3())
}

/// A depth image and its photograph, looked up by points in space.
pub struct View<'a> {
    frame: &'a ImportedFrame,
    photograph: Photograph,
    depth: DepthMap,
}

impl<'a> View<'a> {
    /// Decodes a frame that has depth.
    pub fn load(frame: &'a ImportedFrame) -> Result<Self> {
        let (photograph, depth) = frame.load()?;
        Ok(Self {
            frame,
            photograph,
            depth,
        })
    }

    /// The photograph's linear colour at a point in camera coordinates; `None` outside it and at unusable pixels.
    fn color_at(&self, point: DVec3) -> Option<Vec3> {
        let pixel = self.frame.lens.project(point)?.floor();
        let (width, height) = (self.photograph.width, self.photograph.height);
        let far = DVec2::new(f64::from(width), f64::from(height));
        if !(pixel.cmpge(DVec2::ZERO) & pixel.cmplt(far)).all() {
            return None;
        }
        let index = pixel.y as usize * width as usize + pixel.x as usize;
        let usable = self.photograph.is_usable(index);
        usable.then(|| self.photograph.pixels[index])
    }
}

/// A sparse truncated signed distance field. Voxel (i, j, k) sits at (i, j, k) times the edge.
pub struct Field {
    /// Edge of a voxel in metres.
    pub edge: f64,
    pub blocks: Vec<Block>,
    /// Index into `blocks` by block position.
    pub places: HashMap<IVec3, usize>,
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

    /// Integrates one view. It is an error if the blocks exceed the memory limit.
    pub fn integrate(&mut self, view: &View) -> Result<()> {
        // Allocate the blocks near the measured surface.
        let mut new = blocks_near_surface(view, self.edge);
        new.retain(|at| !self.places.contains_key(at));
        let block_bytes = size_of::<Block>() + VOLUME * size_of::<Voxel>();
        if (self.blocks.len() + new.len()).saturating_mul(block_bytes) > self.max_bytes {
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
            self.blocks.push(Block {
                at,
                voxels: Box::new([Voxel::default(); VOLUME]),
            });
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
                let point = view.frame.pose.to_world(ray.extend(1.0) * depth);
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
        let point = view
            .frame
            .pose
            .to_camera(block.voxel(index).as_dvec3() * edge);
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
    let p = view.frame.pose.to_camera(middle * edge);
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
