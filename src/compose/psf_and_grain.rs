//! Blur and grain of a photograph, to be given to inserted objects.
//!
//! The blur is estimated from how much a known blur reduces the slope of strong edges (Zhuo and Sim 2011, "Defocus map
//! estimation from a single image"), separately along rows and columns because of motion blur. The grain is estimated from
//! second differences (Immerkær 1996, "Fast noise variance estimation") where the photograph is smooth, by level of brightness.

use crate::capture::photograph::{Encoding, Photograph};
use crate::math::blur::{Blend, blurred};
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::stats::quantile;
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Standard deviation in pixels of the known blur.
const KNOWN_BLUR: f32 = 1.0;
/// Smallest slope of an edge, as a fraction of the local level.
const EDGE: f32 = 0.25;
/// Largest slope along an edge, as a fraction of the slope across it.
const ACROSS: f32 = 0.25;
/// Smallest slope of an edge, in standard deviations of the grain.
const ABOVE_GRAIN: f32 = 6.0;
/// Fewest edges for an estimate of the blur.
const MIN_EDGES: usize = 50;
/// Variance in pixels² of a pixel's box filter.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// Bisection steps of the blur estimate.
const HALVINGS: u32 = 40;
/// A pixel is used only if all pixels within this distance are valid, as far as slopes and blurs reach.
const MASK_MARGIN: usize = 4;
/// Range of the blur in pixels: below, photographs count as sharp; above, the blur is not the camera's.
const BLUR_RANGE: [f32; 2] = [0.3, 4.0];
/// Levels of brightness, with equally many pixels each.
const STEPS: usize = 8;
/// Fewest pixels of a level.
const MIN_PIXELS: usize = 100;
/// Fraction of a level's pixels, those with the smallest slopes, that count as smooth.
const SMOOTH: f64 = 0.3;
/// Median absolute value of the standard normal distribution.
const NORMAL_MEDIAN: f32 = 0.674_49;
/// Root of the sum of the squared weights of the second difference.
const SECOND_DIFFERENCE: f32 = 6.0;
/// Key of the grain's random numbers; differs from those of paths.
const GRAIN_KEY: u64 = 0x6772_6169;

/// Point-spread function and grain of a photograph.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PsfAndGrain {
    /// Standard deviations in pixels of the Gaussian that blurs a sharp render like the photograph, along rows and
    /// columns; 0 where the photograph is sharp.
    pub blur: Vec2,
    /// Standard deviation of the grain in each channel by luminance, ascending.
    pub grain: Vec<(f32, Vec3)>,
}

impl PsfAndGrain {
    /// Estimates blur and grain of an 8- or 16-bit photograph. Linear files have none, since most are rendered.
    pub fn of(photograph: &Photograph) -> Self {
        if photograph.encoding == Encoding::Linear {
            return Self::default();
        }
        let shape = [photograph.width, photograph.height].map(|side| side as usize);
        let valid: Vec<bool> = (photograph.pixels.iter().enumerate())
            .map(|(index, pixel)| {
                let usable = photograph.is_usable(index);
                usable && pixel.is_finite() && !photograph.is_saturated(index)
            })
            .collect();
        let valid = eroded(&valid, shape[0]);
        let levels: Vec<f32> = photograph.pixels.iter().map(|&p| luminance(p)).collect();
        let mut found = Self {
            blur: Vec2::ZERO,
            grain: grain(&photograph.pixels, &levels, &valid, shape),
        };
        let grain = |level: f32| luminance(found.grain_at(level));
        let blur = [false, true].map(|down| softness(&levels, &valid, &grain, shape, down));
        found.blur = Vec2::from(blur);
        found
    }

    /// Standard deviation of the grain at a luminance, interpolated.
    fn grain_at(&self, level: f32) -> Vec3 {
        let above = self.grain.partition_point(|(step, _)| *step <= level);
        let (below, above) = self.grain.split_at(above);
        match (below.last(), above.first()) {
            (None, None) => Vec3::ZERO,
            // Constant below the darkest and above the brightest level.
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (Some((low, a)), Some((high, b))) => a.lerp(*b, (level - low) / (high - low)),
        }
    }

    /// Whether there is neither blur nor grain.
    pub fn is_none(&self) -> bool {
        self.blur == Vec2::ZERO && self.grain.is_empty()
    }

    /// Blurs a picture, or a scalar field, like the photograph.
    pub fn softened<T: Blend>(&self, values: &[T], [width, height]: [usize; 2]) -> Vec<T> {
        let rows = blurred(values, [width, height], self.blur.x, false);
        blurred(&rows, [width, height], self.blur.y, true)
    }

    /// Grain for a pixel that something new of luminance `level` covers by `alpha`; the rest of the pixel has its own grain.
    pub fn grain(&self, [frame, pixel]: [u64; 2], level: f32, alpha: f32) -> Vec3 {
        let deviation = self.grain_at(level);
        if alpha <= 0.0 || deviation == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let mut stream = Stream::new(GRAIN_KEY, frame, pixel, 0);
        let mut normal = || {
            let [a, b] = stream.uniform2();
            (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
        };
        deviation * alpha * Vec3::new(normal(), normal(), normal())
    }
}

/// Erodes the mask of valid pixels by [`MASK_MARGIN`] pixels in both directions.
fn eroded(valid: &[bool], width: usize) -> Vec<bool> {
    let height = valid.len() / width.max(1);
    let along = |valid: &[bool], down: bool| -> Vec<bool> {
        let is_inside = |index: usize| {
            let (x, y) = (index % width, index / width);
            let (at, side) = if down { (y, height) } else { (x, width) };
            let near = at.saturating_sub(MASK_MARGIN)..(at + MASK_MARGIN + 1).min(side);
            let place = |i: usize| if down { i * width + x } else { y * width + i };
            near.map(place).all(|i| valid[i])
        };
        (0..valid.len()).map(is_inside).collect()
    };
    along(&along(valid, false), true)
}

/// Standard deviation in pixels of the blur along rows (or columns if `down`), beyond the box filter of pixels; 0 if unknown.
fn softness(
    levels: &[f32],
    valid: &[bool],
    grain: &dyn Fn(f32) -> f32,
    [width, height]: [usize; 2],
    down: bool,
) -> f32 {
    if width < 5 || height < 5 {
        return 0.0;
    }
    let (along, other) = if down { (width, 1) } else { (1, width) };
    // Average three pixels along the edge to reduce grain.
    let mean = |at: usize| {
        let next = (at + other).min(levels.len() - 1);
        let near = [at.saturating_sub(other), at, next];
        near.iter().map(|&i| levels[i]).sum::<f32>() / near.len() as f32
    };
    let smooth: Vec<f32> = (0..levels.len()).map(mean).collect();
    let reblurred = blurred(&smooth, [width, height], KNOWN_BLUR, down);
    let slope = |at: usize, step: usize| smooth[at + step] - smooth[at - step];
    let mut ratios: Vec<f64> = (2..height - 2)
        .flat_map(|y| (2..width - 2).map(move |x| y * width + x))
        .filter(|&at| {
            let here = slope(at, along).abs();
            let level = smooth[at + along].max(smooth[at - along]);
            valid[at]
                && here > (EDGE * level).max(ABOVE_GRAIN * grain(level))
                && slope(at, other).abs() < ACROSS * here
                && here >= slope(at - along, along).abs()
                && here > slope(at + along, along).abs()
        })
        .filter_map(|at| {
            let after = (reblurred[at + along] - reblurred[at - along]).abs();
            (after > 0.0).then(|| f64::from(slope(at, along).abs() / after))
        })
        .collect();
    if ratios.len() < MIN_EDGES {
        return 0.0;
    }
    let ratio = quantile(&mut ratios, 0.5).unwrap_or(f64::INFINITY);
    let found = softness_of(ratio) as f32;
    let [min, max] = BLUR_RANGE;
    if found < min { 0.0 } else { found.min(max) }
}

/// Standard deviation in pixels of a step edge's blur, beyond the box filter. `ratio`: slope before over after the known blur.
fn softness_of(ratio: f64) -> f64 {
    // Difference between the pixels after and before a step of height 1.
    let slope = |variance: f64| libm::erf((2.0 * (variance + PIXEL_VARIANCE)).sqrt().recip());
    let known_variance = f64::from(KNOWN_BLUR * KNOWN_BLUR);
    let (mut low, mut high) = (0.0, f64::from(BLUR_RANGE[1] * BLUR_RANGE[1]));
    for _ in 0..HALVINGS {
        let middle: f64 = 0.5 * (low + high);
        // The more an edge is blurred already, the less the known blur reduces its slope.
        match slope(middle) / slope(middle + known_variance) > ratio {
            true => low = middle,
            false => high = middle,
        }
    }
    low.sqrt()
}

/// Standard deviation of the grain by luminance, where the photograph is smooth.
fn grain(
    pixels: &[Vec3],
    levels: &[f32],
    valid: &[bool],
    [width, height]: [usize; 2],
) -> Vec<(f32, Vec3)> {
    if width < 7 || height < 7 {
        return Vec::new();
    }
    // Slopes between distant 3 × 3 means contain little grain, so selecting by them does not bias its estimate.
    let mean = |at: usize| -> f32 {
        let rows = [at - width, at, at + width];
        let near = rows.iter().flat_map(|&row| &levels[row - 1..=row + 1]);
        near.sum::<f32>() / 9.0
    };
    let mut seen: Vec<(f32, f32, usize)> = (3..height - 3)
        .flat_map(|y| (3..width - 3).map(move |x| y * width + x))
        .filter(|&at| valid[at])
        .map(|at| {
            let across = mean(at + 2) - mean(at - 2);
            let down = mean(at + 2 * width) - mean(at - 2 * width);
            (mean(at), across.hypot(down), at)
        })
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = seen.len().div_ceil(STEPS);
    if size < MIN_PIXELS {
        return Vec::new();
    }
    let second = |at: usize| -> Vec3 {
        let row = |i: usize| pixels[i - 1] - pixels[i] * 2.0 + pixels[i + 1];
        row(at - width) - row(at) * 2.0 + row(at + width)
    };
    let step = |part: &mut [(f32, f32, usize)]| {
        part.sort_by(|a, b| a.1.total_cmp(&b.1));
        let smooth = &part[..((part.len() as f64 * SMOOTH) as usize).max(1)];
        let deviation = [0, 1, 2].map(|channel| {
            let size = |&(_, _, at): &(f32, f32, usize)| f64::from(second(at)[channel].abs());
            let mut sizes: Vec<f64> = smooth.iter().map(size).collect();
            let median = quantile(&mut sizes, 0.5).unwrap_or(0.0) as f32;
            median / (NORMAL_MEDIAN * SECOND_DIFFERENCE)
        });
        let level = smooth.iter().map(|s| s.0).sum::<f32>() / smooth.len() as f32;
        (level, Vec3::from(deviation))
    };
    let mut steps: Vec<(f32, Vec3)> = seen.chunks_mut(size).map(step).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    steps.dedup_by(|next, kept| next.0 <= kept.0);
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [240, 180];

    /// Bricks of random colours, antialiased, then blurred, with grain proportional to the level.
    fn bricks(blur: Vec2, grain: f32) -> Photograph {
        let [width, height] = SIZE;
        let mut stream = Stream::new(7, 0, 0, 0);
        let colors: Vec<f32> = (0..400).map(|_| 0.1 + 0.8 * stream.uniform()).collect();
        // Joints at all positions within a pixel.
        let cell = |at: f32| ((at / 11.3).floor() as usize).min(19);
        let exact: Vec<Vec3> = (0..width * height)
            .map(|index| {
                let (x, y) = ((index % width) as f32, (index / width) as f32);
                let points = (0..16).map(|i| {
                    let (dx, dy) = ((i % 4) as f32, (i / 4) as f32);
                    let at = [x + (dx + 0.5) / 4.0, y + (dy + 0.5) / 4.0];
                    colors[cell(at[1]) * 20 + cell(at[0])]
                });
                Vec3::new(1.0, 0.8, 0.5) * (points.sum::<f32>() / 16.0)
            })
            .collect();
        let finish = PsfAndGrain {
            blur,
            grain: vec![(0.0, Vec3::ZERO), (1.0, Vec3::splat(grain))],
        };
        let soft = finish.softened(&exact, SIZE);
        let noisy = |(index, &pixel): (usize, &Vec3)| {
            pixel + finish.grain([3, index as u64], luminance(pixel), 1.0)
        };
        let pixels = soft.iter().enumerate().map(noisy).collect();
        let size = SIZE.map(|side| side as u32);
        Photograph::new(size, pixels, Encoding::Srgb8, Vec3::INFINITY)
    }

    #[test]
    fn softness_and_grain_are_what_the_picture_was_given() {
        for (blur, grain) in [([0.0, 0.0], 0.02), ([1.0, 1.0], 0.02), ([2.0, 0.6], 0.04)] {
            let blur = Vec2::from(blur);
            let found = PsfAndGrain::of(&bricks(blur, grain));
            let off = (found.blur - blur).abs().max_element();
            let allowed = 0.15 + 0.15 * blur.max_element();
            assert!(off <= allowed, "{blur}: {}", found.blur);
            for level in [0.3, 0.6] {
                let ratio = found.grain_at(level) / (grain * level);
                let off = (ratio - 1.0).abs().max_element();
                assert!(off < 0.25, "{blur} {level}: {ratio}");
            }
        }
    }

    #[test]
    fn exact_pictures_get_nothing_and_small_ones_are_not_asked() {
        let exact = PsfAndGrain::of(&bricks(Vec2::ZERO, 0.0));
        assert_eq!(exact.blur, Vec2::ZERO);
        assert_eq!(exact.grain([0, 0], 0.5, 1.0), Vec3::ZERO);
        for side in [1, 2, 5, 8] {
            let pixels = (0..side * side).map(|i| Vec3::splat((i % side * (i / side)) as f32));
            let pixels = pixels.collect();
            let small = Photograph::new([side; 2], pixels, Encoding::Srgb8, Vec3::ONE);
            assert!(PsfAndGrain::of(&small).is_none(), "{side}");
        }
        let pixels = vec![Vec3::ZERO; 50 * 40];
        let black = Photograph::new([50, 40], pixels, Encoding::Srgb8, Vec3::ONE);
        let found = PsfAndGrain::of(&black);
        assert_eq!(found.blur, Vec2::ZERO);
        assert_eq!(found.grain([0, 0], 0.0, 1.0), Vec3::ZERO);
    }

    #[test]
    fn what_is_masked_says_nothing() {
        let mut picture = bricks(Vec2::splat(1.0), 0.02);
        let whole = PsfAndGrain::of(&picture);
        // Stripes without noise or blur.
        let pixels = 0..picture.pixels.len();
        let usable: Vec<bool> = pixels.map(|index| index % SIZE[0] % 60 >= 8).collect();
        for (pixel, usable) in picture.pixels.iter_mut().zip(&usable) {
            *pixel *= f32::from(u8::from(*usable));
        }
        picture.usable = usable;
        let found = PsfAndGrain::of(&picture);
        let off = (found.blur - whole.blur).abs().max_element();
        assert!(off < 0.15, "{found:?}");
        for level in [0.15, 0.5] {
            let ratio = found.grain_at(level) / whole.grain_at(level);
            assert!((ratio - 1.0).abs().max_element() < 0.2, "{level}: {ratio}");
        }
    }
}
