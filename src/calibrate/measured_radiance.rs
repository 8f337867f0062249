//! Outgoing radiance of surfaces as measured by the photographs: a light field on the mesh.
//!
//! A diffuse surface has the same radiance in all directions, so a photograph of a surface point measures what the point
//! sends to every other point. Paths can end there instead of at an emitter.

use crate::calibrate::gbuffer::{GBuffer, SurfacePoint};
use crate::calibrate::problem::Problem;
use crate::math::rng::splitmix64;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Cells of the coarsest level are 2^(LEVELS − 1) times as wide as those of the finest.
const LEVELS: usize = 3;
/// Width of the finest cells in pixel footprints.
const CELL_FOOTPRINTS: f32 = 1.5;

/// Mean measured radiance in a grid of cells, separate for each object and each orientation of the surface.
#[derive(Debug, Clone)]
pub struct MeasuredRadiance {
    cell: f32,
    levels: Vec<Table>,
    /// Mean photographed radiance of each object over its pure pixels, saturated ones as clipped; `None` without such pixels.
    pub object_means: Vec<Option<Vec3>>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    sum: DVec3,
    /// Samples of pure, unsaturated pixels, which `sum` adds up.
    valid: u32,
    /// All samples.
    total: u32,
}

/// Cells by key. Keys are hashes already and are not hashed again.
type Table = HashMap<u64, Cell, BuildHasherDefault<KeyHasher>>;

#[derive(Debug, Clone, Copy, Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }

    fn write_u64(&mut self, key: u64) {
        self.0 ^= key;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

impl MeasuredRadiance {
    /// Accumulates the pixels that are not held out.
    pub fn new(problem: &Problem, gbuffer: &GBuffer) -> Self {
        let mut measured = Self {
            cell: gbuffer.footprint * CELL_FOOTPRINTS,
            levels: vec![Table::default(); LEVELS],
            object_means: Vec::new(),
        };
        let mut means = vec![(DVec3::ZERO, 0u64); problem.scene.objects.len()];
        for pixel in gbuffer.pixels.iter().filter(|p| !p.held_out) {
            let photograph = &problem.photographs[pixel.frame as usize];
            let radiance = photograph.pixels[pixel.pixel as usize].as_dvec3();
            // A saturated pixel is no measurement: paths continue at such surfaces.
            let is_valid = pixel.pure && !photograph.is_saturated(pixel.pixel as usize);
            for point in pixel.points.iter().flatten() {
                for level in 0..LEVELS {
                    let key = measured.key(level, point);
                    let cell = measured.levels[level].entry(key).or_default();
                    cell.total += 1;
                    if is_valid {
                        cell.valid += 1;
                        cell.sum += radiance;
                    }
                }
            }
            if pixel.pure
                && let Some((sum, count)) = means.get_mut(pixel.object as usize)
            {
                *sum += radiance;
                *count += 1;
            }
        }
        measured.object_means = means
            .into_iter()
            .map(|(sum, n)| (n > 0).then(|| (sum / n as f64).as_vec3()))
            .collect();
        measured
    }

    /// Radiance leaving a surface point on the side of its normal; `None` where no photograph measured it.
    #[inline]
    pub fn at(&self, point: &SurfacePoint) -> Option<Vec3> {
        if self.cell <= 0.0 {
            return None;
        }
        let mut levels = self.levels.iter().enumerate();
        let cell = levels.find_map(|(level, table)| table.get(&self.key(level, point)))?;
        // Cells at the edges of objects hold mostly mixed pixels, which measure neither object.
        let is_measured = cell.valid > 0 && 2 * cell.valid >= cell.total;
        is_measured.then(|| (cell.sum / f64::from(cell.valid)).as_vec3())
    }

    #[inline]
    fn key(&self, level: usize, point: &SurfacePoint) -> u64 {
        cell_key(self.cell * (1u32 << level) as f32, point)
    }
}

/// Hash key of the cell of width `size` that a point lies in: from its position, object, and dominant signed axis of its normal.
#[inline]
pub fn cell_key(size: f32, at: &SurfacePoint) -> u64 {
    let position = (at.point / size).floor();
    let axis = at.normal.abs().max_position();
    let facing = 2 * axis as u64 + u64::from(at.normal[axis] < 0.0);
    let mut h = splitmix64(u64::from(at.object) << 3 | facing);
    for c in position.to_array() {
        h = splitmix64(h ^ (c as i64 as u64));
    }
    h
}
