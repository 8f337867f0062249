//! Environment light: a map of radiance by direction, infinitely far or on a box around the mesh, and a sun.

use crate::math::color::luminance;
use crate::math::cumulative::Cumulative;
use crate::transport::sun::{self, Sun};
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use std::f32::consts::PI;

/// An equirectangular map of incident radiance, sampled in proportion to luminance × solid angle.
///
/// Directions point towards the light in scene coordinates; the pole is y, whatever `up` is. For a box they start at its centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
    /// Cumulative luminance × solid angle over the pixels.
    cumulative: Cumulative,
    /// Pdf per solid angle of the map's directions within each pixel.
    pdfs: Vec<f32>,
    /// cosθ at the edges of the rows, from the top.
    cosines: Vec<f64>,
    /// The distance of the light.
    surroundings: Surroundings,
    /// Radiance from above the horizon, if it differs, and the up vector.
    above: Option<(Vec<Vec3>, Vec3)>,
    /// The sun beside the map.
    sun: Option<Sun>,
    /// The pixels that the sun shines through; `None` if all.
    openings: Option<Vec<bool>>,
}

impl Environment {
    /// A map of `width` × `height` radiances; row 0 is around +y. `None` if the number of pixels differs or is zero.
    pub fn new(width: usize, height: usize, pixels: Vec<Vec3>) -> Option<Self> {
        if width == 0 || height == 0 || pixels.len() != width * height {
            return None;
        }
        let cumulative = cumulative(width, height, pixels.iter().copied());
        Some(Self {
            width,
            height,
            pdfs: pdfs(width, height, &cumulative),
            cosines: (0..=height).map(|row| row_cosine(row, height)).collect(),
            cumulative,
            pixels,
            surroundings: Surroundings::Far,
            above: None,
            sun: None,
            openings: None,
        })
    }

    /// The map with a sun beyond it that shines through some or all of its pixels. `None` if the number of `openings` differs.
    pub fn with_sun(self, sun: Option<Sun>, openings: Option<Vec<bool>>) -> Option<Self> {
        let fit = (openings.as_ref()).is_none_or(|open| open.len() == self.pixels.len());
        fit.then_some(Self {
            sun,
            openings,
            ..self
        })
    }

    /// The map with other radiances for light from above the horizon. `None` if their number differs.
    pub fn with_above(self, above: Vec<Vec3>, up: Vec3) -> Option<Self> {
        if above.len() != self.pixels.len() {
            return None;
        }
        let mean = (self.pixels.iter().zip(&above)).map(|(below, above)| (*below + *above) * 0.5);
        let cumulative = cumulative(self.width, self.height, mean);
        Some(Self {
            pdfs: pdfs(self.width, self.height, &cumulative),
            cumulative,
            above: Some((above, up)),
            ..self
        })
    }

    /// The map with other surroundings.
    pub fn around(self, surroundings: Surroundings) -> Self {
        Self {
            surroundings,
            ..self
        }
    }

    /// The distance of the light.
    pub fn surroundings(&self) -> Surroundings {
        self.surroundings
    }

    /// Radiance along a ray that leaves the mesh.
    pub fn radiance(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        let pixel = self.pixel(origin, direction);
        let sun = self.sun.filter(|_| self.is_open(pixel));
        self.pixels_from(direction)[pixel] + sun.map_or(Vec3::ZERO, |sun| sun.radiance(direction))
    }

    /// The pixels for light from a direction: from above the horizon or from below it.
    pub fn pixels_from(&self, direction: Vec3) -> &[Vec3] {
        match &self.above {
            Some((above, up)) if direction.dot(*up) > 0.0 => above,
            _ => &self.pixels,
        }
    }

    /// Samples a direction at a point; returns it with its pdf per solid angle. `None` if the map is black.
    pub fn sample(&self, origin: Vec3, choice: f64, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let share = self.sun_share();
        if let Some(sun) = self.sun.filter(|_| choice < share) {
            let direction = sun::sample(sun.direction, u);
            return Some((direction, self.pdf(origin, direction)));
        }
        let total = self.cumulative.total();
        if total <= 0.0 {
            return None;
        }
        let target = (choice - share) / (1.0 - share) * total;
        let index = self.cumulative.index_at(target)?;
        let (row, column) = (index / self.width, index % self.width);
        // Sample uniformly by solid angle within the pixel: uniformly in cosθ and φ.
        let (top, bottom) = (self.cosines[row], self.cosines[row + 1]);
        let y = (top + (bottom - top) * f64::from(u[0])) as f32;
        let phi = 2.0 * PI * (column as f32 + u[1]) / self.width as f32;
        let r = (1.0 - y * y).max(0.0).sqrt();
        let map_direction = Vec3::new(r * phi.cos(), y, r * phi.sin());
        let direction = self.surroundings.from_map(origin, map_direction);
        Some((direction, self.mixed_pdf(origin, direction, index)))
    }

    /// Pdf per solid angle of [`Environment::sample`] at a point.
    pub fn pdf(&self, origin: Vec3, direction: Vec3) -> f32 {
        self.mixed_pdf(origin, direction, self.pixel(origin, direction))
    }

    /// Pdf of a direction whose pixel is known.
    fn mixed_pdf(&self, origin: Vec3, direction: Vec3, pixel: usize) -> f32 {
        let ratio = self.surroundings.density_ratio(origin, direction);
        let map = self.pixel_pdf(pixel) * ratio;
        let share = self.sun_share() as f32;
        self.sun
            .map_or(map, |sun| map + (sun.pdf(direction) - map) * share)
    }

    /// Radiance of each pixel from above the horizon, if it differs, and the up vector.
    pub fn above(&self) -> Option<(&[Vec3], Vec3)> {
        let above = self.above.as_ref();
        above.map(|(pixels, up)| (pixels.as_slice(), *up))
    }

    /// The sun beside the map.
    pub fn sun(&self) -> Option<Sun> {
        self.sun
    }

    /// Whether the sun shines through a pixel.
    pub fn is_open(&self, pixel: usize) -> bool {
        (self.openings.as_ref()).is_none_or(|open| open[pixel])
    }

    /// Fraction of the samples that are drawn from the sun: its share of the power.
    pub fn sun_share(&self) -> f64 {
        match self.sun_power() {
            0.0 => 0.0,
            sun => sun / self.power(),
        }
    }

    fn sun_power(&self) -> f64 {
        let irradiance = self.sun.map_or(0.0, |sun| luminance(sun.irradiance));
        f64::from(irradiance).max(0.0)
    }

    /// Width and height of the map.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Radiance of each pixel, row by row.
    pub fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    /// Cumulative luminance × solid angle over the pixels.
    pub fn cumulative(&self) -> &[f64] {
        self.cumulative.sums()
    }

    /// Total luminance × solid angle, with the sun's.
    pub fn power(&self) -> f64 {
        self.cumulative.total() + self.sun_power()
    }

    /// The pixel that light along a ray comes from.
    pub fn pixel(&self, origin: Vec3, direction: Vec3) -> usize {
        let map_direction = self.surroundings.map_direction(origin, direction);
        pixel_of(self.width, self.height, map_direction)
    }

    /// Pdf per solid angle of the map's directions within a pixel.
    pub fn pixel_pdf(&self, index: usize) -> f32 {
        self.pdfs[index]
    }
}

/// Cumulative luminance × solid angle over a map's pixels.
fn cumulative(width: usize, height: usize, pixels: impl Iterator<Item = Vec3>) -> Cumulative {
    Cumulative::new(pixels.enumerate().map(|(i, radiance)| {
        let weight = f64::from(luminance(radiance)) * row_solid_angle(i / width, width, height);
        if weight.is_finite() {
            weight.max(0.0)
        } else {
            0.0
        }
    }))
}

/// Pdf per solid angle within each pixel, of choices in proportion to luminance × solid angle; zero for a black map.
fn pdfs(width: usize, height: usize, cumulative: &Cumulative) -> Vec<f32> {
    let total = cumulative.total();
    let pdf = |index: usize| {
        let weight = cumulative.sums()[index] - cumulative.before(index);
        (weight / total / row_solid_angle(index / width, width, height)) as f32
    };
    let pixels = 0..width * height;
    pixels
        .map(|index| if total > 0.0 { pdf(index) } else { 0.0 })
        .collect()
}

/// The pixel index of a unit direction in a `width` × `height` map, row by row.
pub fn pixel_of(width: usize, height: usize, direction: Vec3) -> usize {
    let theta = direction.y.clamp(-1.0, 1.0).acos();
    let row = ((theta / PI * height as f32) as usize).min(height - 1);
    let angle = direction.z.atan2(direction.x);
    let phi = if angle < 0.0 { angle + 2.0 * PI } else { angle };
    let column = ((phi / (2.0 * PI) * width as f32) as usize).min(width - 1);
    row * width + column
}

/// The unit direction of a pixel's centre in a `width` × `height` map.
pub fn direction_of(width: usize, height: usize, pixel: usize) -> Vec3 {
    let theta = PI * ((pixel / width) as f32 + 0.5) / height as f32;
    let phi = 2.0 * PI * ((pixel % width) as f32 + 0.5) / width as f32;
    Vec3::new(
        theta.sin() * phi.cos(),
        theta.cos(),
        theta.sin() * phi.sin(),
    )
}

/// The unit directions of the pixels' centres in a `width` × `height` map, row by row.
pub fn directions([width, height]: [usize; 2]) -> impl Iterator<Item = Vec3> {
    (0..width * height).map(move |pixel| direction_of(width, height, pixel))
}

/// cosθ at the upper and lower edge of a row.
pub fn row_cosines(row: usize, height: usize) -> (f64, f64) {
    (row_cosine(row, height), row_cosine(row + 1, height))
}

/// cosθ at the upper edge of a row.
fn row_cosine(row: usize, height: usize) -> f64 {
    (std::f64::consts::PI * row as f64 / height as f64).cos()
}

/// Solid angle of one pixel of a row.
pub fn row_solid_angle(row: usize, width: usize, height: usize) -> f64 {
    let (top, bottom) = row_cosines(row, height);
    2.0 * std::f64::consts::PI * (top - bottom) / width as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    #[test]
    fn the_middle_of_each_pixel_falls_into_it() {
        for pixel in 0..128 {
            assert_eq!(pixel_of(16, 8, direction_of(16, 8, pixel)), pixel);
        }
    }

    /// The irradiance of a surface that faces up and sees a bright upper half, and of one that faces down.
    #[test]
    fn light_from_above_the_horizon_may_differ_from_that_from_below() {
        let dim = Environment::new(8, 4, vec![Vec3::splat(0.5); 32]).expect("sizes fit");
        let map = dim.with_above(vec![Vec3::splat(3.0); 32], Vec3::X);
        let map = map.expect("sizes fit");
        let mut stream = Stream::new(3, 0, 0, 0);
        let n = 40_000;
        let mut sums = [0.0f64; 2];
        for _ in 0..n {
            let drawn = map.sample(Vec3::ONE, stream.uniform_f64(), stream.uniform2());
            let (direction, pdf) = drawn.expect("not black");
            let side = usize::from(direction.x > 0.0);
            let radiance = map.radiance(Vec3::ONE, direction).x;
            assert_eq!(radiance, [0.5, 3.0][side]);
            sums[side] += f64::from(radiance * direction.x.abs() / pdf) / f64::from(n);
        }
        // π times the radiance, within 2 %: about five standard errors.
        for (sum, radiance) in sums.iter().zip([0.5, 3.0]) {
            let ratio = sum / (std::f64::consts::PI * radiance);
            assert!((ratio - 1.0).abs() < 0.02, "{sums:?}");
        }
        assert!(map.with_above(vec![Vec3::ONE; 3], Vec3::X).is_none());
    }

    /// Irradiance of a surface under a sun and a grey box, by samples of the mixture.
    #[test]
    fn a_sun_gives_its_irradiance_beside_the_map() {
        let sun = Sun {
            direction: Vec3::new(0.6, 0.8, 0.0),
            irradiance: Vec3::splat(5.0),
        };
        let around = Surroundings::around([Vec3::splat(-2.0), Vec3::splat(3.0)].into_iter());
        let map = Environment::new(8, 4, vec![Vec3::splat(0.5); 32]).expect("sizes fit");
        let map = map.around(around.expect("points"));
        let map = map.with_sun(Some(sun), None).expect("all pixels");
        let mut stream = Stream::new(4, 0, 0, 0);
        let (n, origin) = (40_000, Vec3::new(0.3, -0.2, 1.0));
        let (mut sum, mut in_sun) = (0.0f64, 0);
        for _ in 0..n {
            let drawn = map.sample(origin, stream.uniform_f64(), stream.uniform2());
            let (direction, pdf) = drawn.expect("not black");
            assert!((map.pdf(origin, direction) / pdf - 1.0).abs() < 1e-3);
            let radiance = map.radiance(origin, direction).x;
            in_sun += u32::from(radiance > 1.0);
            sum += f64::from(radiance * direction.y.max(0.0) / pdf) / f64::from(n);
        }
        // The sun's cosine is 0.8; the box gives π times its radiance. Within 3 %: five standard errors.
        let exact = 5.0 * 0.8 + std::f64::consts::PI * 0.5;
        assert!((sum / exact - 1.0).abs() < 0.03, "{sum} {exact}");
        let share = 5.0 / map.power();
        assert!((f64::from(in_sun) / f64::from(n) - share).abs() < 0.015);
        // The sun alone is drawn from as well.
        let black = Environment::new(2, 1, vec![Vec3::ZERO; 2]).expect("sizes fit");
        let alone = black.with_sun(Some(sun), None).expect("all pixels");
        let alone = alone.sample(origin, 0.99, [0.3, 0.7]);
        let (direction, pdf) = alone.expect("not black");
        let irradiance = sun.radiance(direction) / pdf;
        assert!((irradiance.x / 5.0 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_sun_shines_through_open_pixels_alone() {
        let sun = Sun {
            direction: Vec3::Y,
            irradiance: Vec3::ONE,
        };
        let around = Surroundings::around([Vec3::NEG_ONE, Vec3::ONE].into_iter()).expect("points");
        let map = Environment::new(2, 1, vec![Vec3::splat(0.5); 2]).expect("sizes fit");
        let map = map.around(around);
        // The top of the box left and right of its middle is in one pixel each.
        let [left, right] = [-0.5, 0.5].map(|z| Vec3::new(0.0, 0.0, z));
        let open = [left, right].map(|at| pixel_of(2, 1, around.map_direction(at, Vec3::Y)));
        assert_ne!(open[0], open[1]);
        let openings = (0..2).map(|pixel| pixel == open[1]).collect();
        let map = map.with_sun(Some(sun), Some(openings)).expect("two pixels");
        assert_eq!(map.radiance(left, Vec3::Y), Vec3::splat(0.5));
        assert!(map.radiance(right, Vec3::Y).x > 1e3);
        assert_eq!(map.with_sun(Some(sun), Some(vec![true])), None);
    }

    #[test]
    fn sampling_matches_its_density_and_a_constant_map_integrates_to_four_pi() {
        let mut stream = Stream::new(2, 0, 0, 0);
        let pixels: Vec<Vec3> = (0..32).map(|i| Vec3::splat((i % 5) as f32)).collect();
        let map = Environment::new(8, 4, pixels).expect("sizes fit");
        let n = 20_000;
        let (mut sum, mut missing) = (0.0f64, 0);
        for _ in 0..n {
            let (direction, pdf) = map
                .sample(Vec3::ONE, stream.uniform_f64(), stream.uniform2())
                .expect("not black");
            assert!((direction.length() - 1.0).abs() < 1e-5);
            missing += u32::from((map.pdf(Vec3::ONE, direction) - pdf).abs() > 1e-4 * pdf);
            sum += f64::from(luminance(map.radiance(Vec3::ONE, direction)) / pdf);
        }
        // Directions on a pixel's edge may round into its neighbour.
        assert!(missing < 5, "{missing}");
        assert!((sum / f64::from(n) / map.power() - 1.0).abs() < 1e-3);
        let white = Environment::new(6, 3, vec![Vec3::ONE; 18]).expect("sizes fit");
        assert!((white.power() - 4.0 * std::f64::consts::PI).abs() < 1e-6);
        assert!(Environment::new(2, 2, vec![Vec3::ONE; 3]).is_none());
        let black = Environment::new(1, 1, vec![Vec3::ZERO]).expect("sizes fit");
        assert!(black.sample(Vec3::ONE, 0.5, [0.5; 2]).is_none());
    }
}
