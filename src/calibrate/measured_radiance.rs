//! Outgoing radiance of surfaces as measured by the photographs: a light field on the mesh.
//!
//! A diffuse surface has the same radiance in all directions, so a photograph of a surface point measures what the point
//! sends to every other point. Paths can end there instead of at an emitter.

use crate::calibrate::gbuffer::{GBuffer, SurfacePoint};
use crate::calibrate::problem::Problem;
use crate::math::rng::splitmix64;
use glam::{DVec3, Vec3};

/// Cells of the coarsest level are 2^(LEVELS − 1) times as wide as those of the finest.
const LEVELS: usize = 3;
/// Width of the finest cells in pixel footprints.
const CELL_FOOTPRINTS: f32 = 1.5;

/// Mean measured radiance in a grid of cells, separate for each object and each orientation of the surface.
#[derive(Debug, Clone)]
pub struct MeasuredRadiance {
    cell: f32,
    levels: Vec<Table>,
    /// Mean photographed radiance of each object over its pure pixels, with saturated ones at their clipped value; `None`
    /// without such pixels.
    pub object_means: Vec<Option<Vec3>>,
}

/// The samples in one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    key: u64,
    sum: DVec3,
    /// Samples of pure, unsaturated pixels, which `sum` adds up.
    valid: u32,
    /// All samples.
    total: u32,
}

/// Open-addressing hash table; keys are never zero.
#[derive(Debug, Clone)]
struct Table {
    cells: Vec<Cell>,
    used: usize,
}

impl Table {
    fn new() -> Self {
        Self {
            cells: vec![Cell::default(); 1024],
            used: 0,
        }
    }

    fn slot(&self, key: u64) -> usize {
        let mask = self.cells.len() - 1;
        let mut slot = key as usize & mask;
        while self.cells[slot].key != 0 && self.cells[slot].key != key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn entry(&mut self, key: u64) -> &mut Cell {
        if self.used * 2 > self.cells.len() {
            let larger = vec![Cell::default(); self.cells.len() * 4];
            let old = std::mem::replace(&mut self.cells, larger);
            for cell in old.into_iter().filter(|c| c.key != 0) {
                let slot = self.slot(cell.key);
                self.cells[slot] = cell;
            }
        }
        let slot = self.slot(key);
        if self.cells[slot].key == 0 {
            self.cells[slot].key = key;
            self.used += 1;
        }
        &mut self.cells[slot]
    }
}

impl MeasuredRadiance {
    /// Accumulates the pixels that are not held out.
    pub fn new(problem: &Problem, gbuffer: &GBuffer) -> Self {
        let mut measured = Self {
            cell: gbuffer.footprint * CELL_FOOTPRINTS,
            levels: (0..LEVELS).map(|_| Table::new()).collect(),
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
                    let cell = measured.levels[level].entry(key);
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
        for (level, table) in self.levels.iter().enumerate() {
            let key = self.key(level, point);
            let cell = &table.cells[table.slot(key)];
            // Cells at the edges of objects hold mostly mixed pixels, which measure neither object.
            if cell.valid > 0 && 2 * cell.valid >= cell.total {
                return Some((cell.sum / f64::from(cell.valid)).as_vec3());
            }
            if cell.total > 0 {
                return None;
            }
        }
        None
    }

    #[inline]
    fn key(&self, level: usize, point: &SurfacePoint) -> u64 {
        cell_key(self.cell * (1u32 << level) as f32, point)
    }
}

/// Hash key of the cell of width `size` that a surface point lies in: from its position, object, and dominant signed axis of
/// the normal; never zero.
#[inline]
pub fn cell_key(size: f32, at: &SurfacePoint) -> u64 {
    let position = (at.point / size).floor();
    let a = at.normal.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    let facing = 2 * axis as u64 + u64::from(at.normal[axis] < 0.0);
    let mut h = splitmix64(u64::from(at.object) << 3 | facing);
    for c in position.to_array() {
        h = splitmix64(h ^ (c as i64 as u64));
    }
    h.max(1)
}
