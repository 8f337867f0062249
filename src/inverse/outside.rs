//! Light from outside the mesh as measured by the photographs: the radiance of pixels that see past the mesh, by direction.
//!
//! Its source is either infinitely far, like a sky, or on a box around the mesh, like the parts that a scan lacks. Light from above
//! the horizon and from below it is measured apart: each point of a window shows the sky from below and the ground from above.

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::problem::Problem;
use crate::inverse::sky::{ExpectedSky, Map, Seen, solid_angle};
use crate::math::color::luminance;
use crate::scene::camera::level_up;
use crate::transport::environment::{Environment, direction_of, directions, pixel_of};
use crate::transport::surroundings::Surroundings;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Width of a cell of the map, in pixels of the first camera.
const CELL_PIXELS: f64 = 2.0;
/// Least and greatest number of columns of the map.
const COLUMNS: [usize; 2] = [32, 512];
/// Radiance over the room's mean above which a pixel shows the sun. Its disc is 46,000 times as bright as a white surface that it
/// lights, so that even a pixel that it fills to a twentieth is brighter than this.
const SUN_LIKE: f32 = 1e3;
/// Unseen directions take the mean of a block of up to 2^(LEVELS − 1) cells a side.
const LEVELS: usize = 3;

/// Rows of the blocks of cells whose means tell what unseen directions look like: 10° each.
const BLOCK_ROWS: usize = 18;

/// Mean measured radiance by direction; black in unmeasured directions.
#[derive(Debug, Clone)]
pub struct MeasuredOutside {
    /// Cells of light from below the horizon and from above it.
    halves: [Half; 2],
    /// Radiance of each cell, or its lower bound, on both sides of the horizon.
    map: Environment,
    /// Unit up vector.
    up: Vec3,
    /// Mean luminance of the mesh in the photographs.
    room: f32,
    /// The unit direction in which unsaturated photographs show the sun.
    sun: Option<Vec3>,
    /// What is expected of unmeasured directions.
    expected: Option<ExpectedSky>,
}

/// Cells of light from one side of the horizon.
#[derive(Debug, Clone)]
struct Half {
    /// Whether each cell is measured.
    known: Vec<bool>,
    /// Whether each cell has only saturated pixels, so that its radiance is a lower bound.
    censored: Vec<bool>,
    /// Whether photographs look into each cell and show no sun there.
    sunless: Vec<bool>,
}

/// Sum of radiance and number of pixels of a cell, unsaturated and saturated ones.
type Sums = [(DVec3, u32); 2];

impl MeasuredOutside {
    /// Accumulates the pixels in the fit that see nothing of the mesh; `None` if there are none. `grid` is the number of columns
    /// and rows of the unknowns of unmeasured light.
    pub fn new(
        problem: &Problem,
        gbuffer: &GBuffer,
        surroundings: Surroundings,
        grid: [usize; 2],
    ) -> Option<Self> {
        let scene = &problem.scene;
        let camera = scene.cameras.first()?;
        let columns = 2.0 * PI * camera.intrinsics.fx / CELL_PIXELS;
        let height = (columns.clamp(COLUMNS[0] as f64, COLUMNS[1] as f64) as usize) / 2;
        let height = height.next_multiple_of(1 << (LEVELS - 1));
        let width = 2 * height;

        let room = mean_of_mesh(problem, gbuffer);
        // Sum radiance in the finest cells, separately for unsaturated and saturated pixels, and apart from the sun.
        let mut sums: [Vec<Sums>; 2] = [(); 2].map(|()| vec![Sums::default(); width * height]);
        let past_the_mesh = (gbuffer.pixels.iter()).filter(|p| {
            !p.held_out && p.object == u32::MAX && p.points.iter().all(Option::is_none)
        });
        let mut sun = Vec3::ZERO;
        for pixel in past_the_mesh {
            let photograph = &problem.photographs[pixel.frame as usize];
            let camera = &scene.cameras[pixel.frame as usize];
            let ray = camera.ray(camera.corner(pixel.pixel as usize) + 0.5);
            let direction = ray.direction.normalize_or_zero();
            let map_direction = surroundings.map_direction(ray.origin, direction);
            let radiance = photograph.pixels[pixel.pixel as usize];
            let saturated = photograph.is_saturated(pixel.pixel as usize);
            if !saturated && luminance(radiance) > SUN_LIKE * room {
                sun += direction * luminance(radiance);
                continue;
            }
            let half = &mut sums[usize::from(direction.dot(scene.up) > 0.0)];
            let sum = &mut half[pixel_of(width, height, map_direction)][usize::from(saturated)];
            sum.0 += radiance.as_dvec3();
            sum.1 += 1;
        }
        if sums.iter().flatten().flatten().all(|s| s.1 == 0) {
            return None;
        }
        let [(below, dark), (above, bright)] = sums.map(|sums| Half::new(width, height, &sums));
        let map = Environment::new(width, height, dark)?.around(surroundings);
        let mut outside = Self {
            map: map.with_above(bright, scene.up)?,
            halves: [below, above],
            up: scene.up,
            room,
            sun: sun.try_normalize(),
            expected: None,
        };
        outside.expected = Some(outside.expect(level_up(&scene.cameras, scene.up), grid));
        Some(outside)
    }

    /// Radiance along a ray, or its lower bound; `None` in unmeasured directions.
    #[inline]
    pub fn at(&self, origin: Vec3, direction: Vec3) -> Option<Vec3> {
        let (half, cell) = self.cell(origin, direction);
        half.known[cell].then(|| self.map.pixels_from(direction)[cell])
    }

    /// Whether the radiance along a ray is a lower bound, since all photographs are saturated there.
    #[inline]
    pub fn is_bound(&self, origin: Vec3, direction: Vec3) -> bool {
        let (half, cell) = self.cell(origin, direction);
        half.censored[cell]
    }

    /// The unit direction in which unsaturated photographs show the sun.
    pub fn seen_sun(&self) -> Option<Vec3> {
        self.sun
    }

    /// Whether a sun may stand far away in a direction: no photograph looks there, or it shows the sun or is saturated.
    pub fn may_hold_sun(&self, direction: Vec3) -> bool {
        let (half, cell) = self.cell(Vec3::ZERO, direction);
        !half.sunless[cell]
    }

    /// Whether a sun may shine in along a ray. From far away it may. Through a box it may where photographs show light from above
    /// the horizon that is brighter than the room: elsewhere the scan lacks a wall, or nobody looked.
    #[inline]
    pub fn is_open(&self, origin: Vec3, direction: Vec3) -> bool {
        let (half, cell) = self.cell(origin, direction);
        self.map.surroundings() == Surroundings::Far
            || half.is_brighter(cell, self.map.pixels_from(direction), self.room)
    }

    /// [`Self::is_open`] of each cell for light from above the horizon; `None` far away, where all are open.
    pub fn openings(&self) -> Option<Vec<bool>> {
        let (half, pixels) = (self.half(self.up), self.map.pixels_from(self.up));
        let is_open = |cell| half.is_brighter(cell, pixels, self.room);
        let boxed = self.map.surroundings() != Surroundings::Far;
        boxed.then(|| (0..pixels.len()).map(is_open).collect())
    }

    fn cell(&self, origin: Vec3, direction: Vec3) -> (&Half, usize) {
        (self.half(direction), self.map.pixel(origin, direction))
    }

    /// The cells of a direction's side of the horizon.
    fn half(&self, direction: Vec3) -> &Half {
        &self.halves[usize::from(direction.dot(self.up) > 0.0)]
    }

    /// Measured cells on both sides of the horizon, with their radiances and whether these are lower bounds.
    fn known_cells(&self) -> impl Iterator<Item = (usize, Vec3, bool)> {
        [-self.up, self.up].into_iter().flat_map(|side| {
            let half = self.half(side);
            let cells = self.map.pixels_from(side).iter().copied().enumerate();
            cells
                .filter(|(cell, _)| half.known[*cell])
                .map(|(cell, radiance)| (cell, radiance, half.censored[cell]))
        })
    }

    /// The map, for sampling directions.
    pub fn map(&self) -> &Environment {
        &self.map
    }

    /// What is expected of the unmeasured light.
    pub fn expected(&self) -> Option<&ExpectedSky> {
        self.expected.as_ref()
    }

    /// Unmeasured radiance along a ray over the mean of its pixel of the grid, as expected.
    #[inline]
    pub fn shape(&self, origin: Vec3, direction: Vec3) -> f32 {
        self.shape_of(self.map.pixel(origin, direction))
    }

    fn shape_of(&self, cell: usize) -> f32 {
        let shape = self.expected.as_ref().map_or(&[][..], |sky| &sky.shape);
        shape.get(cell).copied().unwrap_or(1.0)
    }

    /// What is expected of the unmeasured light: from its directions by a regression. Beside saturated pixels, as how much these hide
    /// is not known, and where no sky is seen, what is measured at the same elevation.
    fn expect(&self, up: Vec3, grid: [usize; 2]) -> ExpectedSky {
        let map = Map {
            size: self.map.size(),
            known: &|cell, direction| self.half(direction).known[cell],
            grid,
        };
        let is_saturated = self.known_cells().any(|(.., is_bound)| is_bound);
        let sky = (!is_saturated).then(|| ExpectedSky::new(&self.measured(), up, &map));
        let band = PI / grid[1] as f64;
        let even = || ExpectedSky::even(grid, |direction| self.mean_at(direction, band));
        sky.flatten().unwrap_or_else(even)
    }

    /// The mean over measured directions within ± `band` / 2 radians of a direction's elevation, or over all measured directions.
    /// And whether its colour is known: most of these are no lower bounds.
    fn mean_at(&self, direction: Vec3, band: f64) -> (Vec3, bool) {
        let elevation_of = |d: Vec3| f64::from(d.dot(self.up).clamp(-1.0, 1.0)).asin();
        let elevation = elevation_of(direction);
        let [width, height] = self.map.size();
        // Sums of radiance, of solid angles, and of those with lower bounds.
        let (mut near, mut all) = ((DVec3::ZERO, 0.0, 0.0), (DVec3::ZERO, 0.0, 0.0));
        for (cell, radiance, is_bound) in self.known_cells() {
            let seen = direction_of(width, height, cell);
            let solid_angle = solid_angle(seen);
            let radiance = radiance.as_dvec3() * solid_angle;
            let bound = if is_bound { solid_angle } else { 0.0 };
            let add = |sum: &mut (DVec3, f64, f64)| {
                *sum = (sum.0 + radiance, sum.1 + solid_angle, sum.2 + bound);
            };
            add(&mut all);
            if (elevation_of(seen) - elevation).abs() < 0.5 * band {
                add(&mut near);
            }
        }
        let (sum, weight, bounds) = if near.1 > 0.0 { near } else { all };
        let mean = (sum / f64::max(weight, f64::MIN_POSITIVE)).as_vec3();
        (mean, 2.0 * bounds <= weight)
    }

    /// Measured light as means over blocks of cells.
    fn measured(&self) -> Vec<Seen> {
        let [width, height] = self.map.size();
        let rows = BLOCK_ROWS.min(height);
        let mut sums = vec![(DVec3::ZERO, DVec3::ZERO, 0.0); 2 * rows * rows];
        for (cell, radiance, _) in self.known_cells() {
            let seen = direction_of(width, height, cell);
            let solid_angle = solid_angle(seen);
            let sum = &mut sums[pixel_of(2 * rows, rows, seen)];
            sum.0 += seen.as_dvec3() * solid_angle;
            sum.1 += radiance.as_dvec3() * solid_angle;
            sum.2 += solid_angle;
        }
        let block = |(direction, radiance, weight): (DVec3, DVec3, f64)| {
            Some(Seen {
                direction: direction.try_normalize()?.as_vec3(),
                radiance: (radiance / weight).as_vec3(),
            })
        };
        sums.into_iter().filter_map(block).collect()
    }

    /// Mean of the lower bounds; black if there are none.
    pub fn mean_bound(&self) -> Vec3 {
        let bounds = || self.known_cells().filter(|(.., is_bound)| *is_bound);
        let sum: DVec3 = bounds().map(|(_, bound, _)| bound.as_dvec3()).sum();
        (sum / bounds().count().max(1) as f64).as_vec3()
    }

    /// The completed map of light that comes from `towards`, or of each cell's own direction: measured radiance, plus `excess`
    /// where it is a lower bound, and `elsewhere` in unmeasured directions.
    pub fn filled(
        &self,
        towards: Option<Vec3>,
        excess: impl Fn(Vec3) -> Vec3,
        elsewhere: impl Fn(Vec3) -> Vec3,
    ) -> Vec<Vec3> {
        (directions(self.map.size()).enumerate())
            .map(|(cell, direction)| {
                let from = towards.unwrap_or(direction);
                let half = self.half(from);
                let radiance = self.map.pixels_from(from)[cell];
                match (half.known[cell], half.censored[cell]) {
                    (true, true) => radiance + excess(from),
                    (true, false) => radiance,
                    (false, _) => elsewhere(direction) * self.shape_of(cell),
                }
            })
            .collect()
    }
}

/// Mean luminance of the mesh in the photographs.
fn mean_of_mesh(problem: &Problem, gbuffer: &GBuffer) -> f32 {
    let (mut sum, mut pixels) = (0.0, 0);
    for p in gbuffer.fitted() {
        let pixel = problem.photographs[p.frame as usize].pixels[p.pixel as usize];
        sum += f64::from(luminance(pixel));
        pixels += 1;
    }
    (sum / f64::from(pixels.max(1))) as f32
}

impl Half {
    /// Whether a cell is measured and brighter than `least`, or saturated.
    fn is_brighter(&self, cell: usize, pixels: &[Vec3], least: f32) -> bool {
        self.known[cell] && (self.censored[cell] || luminance(pixels[cell]) > least)
    }

    /// The cells, and their mean radiances. Gaps are filled from coarser blocks. Saturated pixels count only in blocks without
    /// unsaturated ones.
    fn new(width: usize, height: usize, sums: &[Sums]) -> (Self, Vec<Vec3>) {
        // Whether the mean of the block of 2^level cells a side around a cell is a lower bound, and the mean.
        let block_mean = |cell: usize, level: usize| {
            let block = 1 << level;
            let [row, column] = [cell / width, cell % width].map(|i| i / block * block);
            let block_sum = |kind: usize| {
                let cells = (row..row + block)
                    .flat_map(|row| (column..column + block).map(move |c| row * width + c));
                cells.fold((DVec3::ZERO, 0), |all, cell| {
                    let (sum, count) = sums[cell][kind];
                    (all.0 + sum, all.1 + count)
                })
            };
            let [measured, saturated] = [block_sum(0), block_sum(1)];
            let is_bound = measured.1 == 0;
            let (sum, count) = if is_bound { saturated } else { measured };
            (count > 0).then(|| (is_bound, (sum / f64::from(count)).as_vec3()))
        };
        let means: Vec<Option<(bool, Vec3)>> = (0..width * height)
            .map(|cell| (0..LEVELS).find_map(|level| block_mean(cell, level)))
            .collect();
        let half = Self {
            known: means.iter().map(Option::is_some).collect(),
            censored: means.iter().map(|m| m.is_some_and(|m| m.0)).collect(),
            sunless: (sums.iter())
                .map(|[measured, saturated]| measured.1 > 0 && saturated.1 == 0)
                .collect(),
        };
        let pixels = means.iter().map(|m| m.map_or(Vec3::ZERO, |m| m.1));
        (half, pixels.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unseen_directions_are_expected_to_look_like_what_was_seen_at_their_height() {
        let [width, height] = [16, 8];
        // One seen cell above the horizon, one below.
        let (above, below) = (16 * 2 + 3, 16 * 5 + 9);
        let mut pixels = vec![Vec3::ZERO; 128];
        (pixels[above], pixels[below]) = (Vec3::splat(4.0), Vec3::splat(1.0));
        let half = Half {
            known: (0..128).map(|c| c == above || c == below).collect(),
            censored: vec![false; 128],
            sunless: vec![false; 128],
        };
        let none = Half {
            known: vec![false; 128],
            ..half.clone()
        };
        let measured = MeasuredOutside {
            halves: [half, none],
            map: Environment::new(width, height, pixels).expect("sizes fit"),
            up: Vec3::Y,
            room: 1.0,
            sun: None,
            expected: None,
        };
        let at = |row: usize| {
            let direction = direction_of(width, height, row * 16 + 12);
            measured.mean_at(direction, PI / 8.0).0
        };
        assert!((at(2) - Vec3::splat(4.0)).length() < 1e-5);
        assert!((at(5) - Vec3::ONE).length() < 1e-5);
        // Both cells span the same solid angle.
        assert!((at(0) - Vec3::splat(2.5)).length() < 1e-4);
        // Elevations are relative to the capture's up axis.
        let sideways = MeasuredOutside {
            up: direction_of(width, height, above),
            ..measured
        };
        let off = sideways.mean_at(sideways.up, PI / 8.0).0 - Vec3::splat(4.0);
        assert!(off.length() < 1e-5, "{off}");
    }

    #[test]
    fn light_from_above_and_from_below_the_horizon_is_told_apart() {
        let half = |censored: bool| Half {
            known: vec![true, false],
            censored: vec![censored, false],
            sunless: vec![!censored, false],
        };
        let pixels = |radiance: f32| vec![Vec3::splat(radiance), Vec3::ZERO];
        let map = Environment::new(2, 1, pixels(0.5)).expect("sizes fit");
        let measured = MeasuredOutside {
            halves: [half(false), half(true)],
            map: map.with_above(pixels(3.0), Vec3::Y).expect("sizes fit"),
            up: Vec3::Y,
            room: 1.0,
            sun: None,
            expected: None,
        };
        let seen = direction_of(2, 1, 0);
        let at = |rise: f32| (seen + Vec3::Y * rise).normalize();
        assert_eq!(measured.at(Vec3::ZERO, at(-0.1)), Some(Vec3::splat(0.5)));
        assert_eq!(measured.at(Vec3::ZERO, at(0.1)), Some(Vec3::splat(3.0)));
        assert!(measured.is_bound(Vec3::ZERO, at(0.1)));
        assert!(!measured.is_bound(Vec3::ZERO, at(-0.1)));
        assert_eq!(measured.mean_bound(), Vec3::splat(3.0));
        // Far away a sun may stand anywhere; through a box it shines where the photographs are saturated.
        assert!(measured.is_open(Vec3::ZERO, at(-0.1)));
        assert_eq!(measured.openings(), None);
        let around = Surroundings::around([Vec3::NEG_ONE, Vec3::ONE].into_iter()).expect("points");
        let boxed = MeasuredOutside {
            map: measured.map.clone().around(around),
            ..measured.clone()
        };
        assert!(!boxed.is_open(Vec3::ZERO, at(-0.1)));
        assert!(boxed.is_open(Vec3::ZERO, at(0.1)));
        assert_eq!(boxed.openings(), Some(vec![true, false]));
        let filled = |towards| measured.filled(Some(towards), |d| d.abs(), |_| Vec3::splat(7.0));
        let seven = Vec3::splat(7.0);
        assert_eq!(filled(Vec3::NEG_Y), [Vec3::splat(0.5), seven]);
        assert_eq!(filled(Vec3::Y), [Vec3::splat(3.0) + Vec3::Y, seven]);
    }
}
