//! A denoiser guided by feature buffers, for pictures that people look at, never for fits.
//!
//! Radiance is demodulated by albedo and smoothed by an edge-avoiding à-trous wavelet filter (Dammertz et al. 2010), whose weights
//! fall off across normals, planes, objects, and luminance differences beyond the noise (Schied et al. 2017). The noise is
//! estimated from two independent pictures of the view; each is smoothed by weights from the other (Rousselle, Knaus and Zwicker
//! 2012).

use crate::math::color::luminance;
use crate::math::picture::Picture;
use crate::say;
pub use crate::transport::guide::{Guide, guides, guides_at_centers, guides_where};
use crate::transport::oidn;
use glam::Vec3;
use rayon::prelude::*;

/// Filter passes of 5 × 5 taps; the spacing doubles each pass, up to a radius of 32 pixels.
const PASSES: u32 = 5;
/// Cubic B-spline weights.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Differences between luminances of 3 × 3 pixels are measured in this many standard deviations of a pixel's noise.
const LUMINANCE_SIGMAS: f32 = 0.7;
/// Power of the cosine between normals in the weights.
const NORMAL_POWER: i32 = 64;
/// Distance from a pixel's tangent plane, as a fraction of depth, at which weights fall to 1/e.
const PLANE_DISTANCE: f32 = 0.01;
/// Radius in pixels over which the noise variance is averaged first.
const NOISE_RADIUS: isize = 3;
/// Radius in pixels over which normals are averaged first, and the power of the cosine between them in the weights: a scanned
/// wall's triangles differ by ten degrees and more, and the weights of the filter would find nothing like a pixel.
const NORMAL_RADIUS: isize = 3;
const STEADY_POWER: i32 = 16;
/// Where a smaller fraction of a pixel's neighbours has its normal, the surface is rough and all of them are averaged. At a corner
/// of three planes each has a third.
const ROUGH: f32 = 0.25;

/// The denoiser of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denoiser {
    /// The built-in filter, [`denoise`].
    Builtin,
    /// Open Image Denoise, or the built-in filter if it fails.
    Oidn,
}

impl Denoiser {
    /// Open Image Denoise if it is installed, else the built-in filter.
    pub fn best() -> Self {
        match oidn::found() {
            Some(_) => Self::Oidn,
            None => Self::Builtin,
        }
    }

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Builtin => "builtin",
            Self::Oidn => "oidn",
        }
    }

    /// Denoises the mean of two independent pictures of one view; `guides` has one entry per pixel.
    pub fn denoise(self, a: &Picture, b: &Picture, guides: &[Option<Guide>]) -> Picture {
        let oidn = match self {
            Self::Builtin => None,
            Self::Oidn => oidn::found(),
        };
        let Some(oidn) = oidn else {
            return denoise(a, b, guides);
        };
        oidn.denoise(&mean(a, b), guides).unwrap_or_else(|error| {
            say::warning(format_args!("Open Image Denoise: {error}"));
            denoise(a, b, guides)
        })
    }
}

/// The mean of two pictures of one view.
fn mean(a: &Picture, b: &Picture) -> Picture {
    let halves = a.pixels.iter().zip(&b.pixels);
    Picture {
        pixels: halves.map(|(a, b)| (*a + *b) * 0.5).collect(),
        ..*a
    }
}

/// Denoises the mean of two independent pictures of one view; `guides` has one entry per pixel, `None` for the background.
/// Emitters, background and non-finite pixels are not changed.
pub fn denoise(a: &Picture, b: &Picture, guides: &[Option<Guide>]) -> Picture {
    let width = a.width as usize;
    let unfiltered = mean(a, b);
    let mean = &unfiltered.pixels;
    if guides.len() != mean.len() || b.pixels.len() != mean.len() {
        return unfiltered;
    }

    // Demodulate, and estimate the variance of luminance from the two pictures, averaged over similar pixels.
    let light = |pixel: usize, value: Vec3| match &guides[pixel] {
        Some(guide) => guide.demodulated(value),
        None => value,
    };
    let mut smooth: Vec<[Vec3; 2]> = (0..mean.len())
        .map(|i| [light(i, a.pixels[i]), light(i, b.pixels[i])])
        .collect();
    let around = Around {
        width,
        height: a.height as usize,
    };
    let guides = &steadied(guides, around);
    let variance: Vec<f32> = (smooth.iter())
        .map(|&[a, b]| {
            let half = luminance(a - b);
            let square = 0.5 * half * half;
            if square.is_finite() { square } else { 0.0 }
        })
        .collect();
    let mut noise: Vec<f32> = (0..mean.len())
        .into_par_iter()
        .map(|pixel| {
            let taps = around.square(pixel, NOISE_RADIUS, 1);
            let (sum, weights) = taps.fold((0.0, 0.0), |(sum, weights), (q, _)| {
                let weight = similarity(guides[pixel].as_ref(), guides[q].as_ref());
                (sum + weight * variance[q], weights + weight)
            });
            let alone = beyond_neighbours(&smooth, guides, around, pixel);
            (sum / f32::max(weights, f32::MIN_POSITIVE)).max(alone * alone)
        })
        .collect();

    // Each picture is smoothed by weights from the other one: if a weight knew the value that it weighs, rare bright samples would
    // stand alone, and their light would be missing around them.
    let finite = |[a, b]: [Vec3; 2]| a.is_finite() && b.is_finite();
    for pass in 0..PASSES {
        let step = 1 << pass;
        let levels = levels(&smooth, guides, around);
        let filtered: Vec<([Vec3; 2], f32)> = (0..mean.len())
            .into_par_iter()
            .map(|pixel| {
                let here = (smooth[pixel], noise[pixel]);
                let guide = guides[pixel].as_ref();
                let Some(guide) = guide.filter(|g| g.emission == Vec3::ZERO && finite(here.0))
                else {
                    return here;
                };
                let [level_a, level_b] = levels[pixel];
                let allowed = LUMINANCE_SIGMAS * here.1.sqrt() + f32::MIN_POSITIVE;
                let (mut sums, mut sum_variance, mut weights) = ([Vec3::ZERO; 2], 0.0, [0.0; 2]);
                for (q, [dx, dy]) in around.square(pixel, 2, step) {
                    let spline = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                    let like = similarity(Some(guide), guides[q].as_ref());
                    if like == 0.0 || !finite(smooth[q]) {
                        continue;
                    }
                    let ([a, b], [a_there, b_there]) = (smooth[q], levels[q]);
                    let weight = |off: f32| spline * like * (-(off.abs() / allowed)).exp();
                    let [by_b, by_a] = [weight(b_there - level_b), weight(a_there - level_a)];
                    sums = [sums[0] + a * by_b, sums[1] + b * by_a];
                    weights = [weights[0] + by_b, weights[1] + by_a];
                    sum_variance += noise[q] * by_a * by_b;
                }
                let smoothed = [sums[0] / weights[0], sums[1] / weights[1]];
                (smoothed, sum_variance / (weights[0] * weights[1]))
            })
            .collect();
        (smooth, noise) = filtered.into_iter().unzip();
    }

    let pixels = (0..mean.len()).map(|pixel| match (&guides[pixel], smooth[pixel]) {
        (Some(guide), [a, b]) if finite([a, b]) => guide.modulated((a + b) * 0.5),
        _ => mean[pixel],
    });
    Picture {
        pixels: pixels.collect(),
        ..*a
    }
}

/// Luminance of both pictures averaged over 3 × 3 pixels of the same object. Weights from single pixels would keep a rare sample
/// that both pictures happen to have at one pixel.
fn levels(light: &[[Vec3; 2]], guides: &[Option<Guide>], around: Around) -> Vec<[f32; 2]> {
    let level = |pixel: usize| {
        let (mut sums, mut weights) = ([0.0; 2], 0.0);
        for (q, [dx, dy]) in around.square(pixel, 1, 1) {
            let [a, b] = light[q].map(luminance);
            if same_object(guides, pixel, q) && (a + b).is_finite() {
                let weight = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                sums = [sums[0] + weight * a, sums[1] + weight * b];
                weights += weight;
            }
        }
        sums.map(|sum| sum / f32::max(weights, f32::MIN_POSITIVE))
    };
    (0..light.len()).into_par_iter().map(level).collect()
}

/// How far the luminance of a pixel lies outside of the range of its neighbours on the same object; 0 if less than that range.
fn beyond_neighbours(
    light: &[[Vec3; 2]],
    guides: &[Option<Guide>],
    around: Around,
    pixel: usize,
) -> f32 {
    let level = |q: usize| 0.5 * luminance(light[q][0] + light[q][1]);
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (q, _) in around.square(pixel, 1, 1) {
        if q != pixel && same_object(guides, pixel, q) {
            (low, high) = (low.min(level(q)), high.max(level(q)));
        }
    }
    let beyond = (level(pixel) - high).max(low - level(pixel));
    if beyond > high - low { beyond } else { 0.0 }
}

/// Whether two pixels see the same object, or are one.
fn same_object(guides: &[Option<Guide>], a: usize, b: usize) -> bool {
    let object = |pixel: usize| guides[pixel].map(|guide| guide.object);
    a == b || object(a).is_some_and(|here| object(b) == Some(here))
}

/// The guides with normals averaged over their neighbourhoods; edges stay, since normals across them hardly count. On a [`ROUGH`]
/// surface all count alike.
fn steadied(guides: &[Option<Guide>], around: Around) -> Vec<Option<Guide>> {
    let steady = |pixel: usize| {
        let guide = guides[pixel]?;
        let (mut like, mut likeness) = (Vec3::ZERO, 0.0);
        let (mut all, mut count) = (Vec3::ZERO, 0.0);
        for (q, _) in around.square(pixel, NORMAL_RADIUS, 1) {
            let Some(there) = guides[q].filter(|g| g.object == guide.object) else {
                continue;
            };
            let weight = (guide.normal.dot(there.normal).max(0.0)).powi(STEADY_POWER);
            (like, likeness) = (like + there.normal * weight, likeness + weight);
            (all, count) = (all + there.normal, count + 1.0);
        }
        let sum = if likeness < ROUGH * count { all } else { like };
        let normal = sum.try_normalize().unwrap_or(guide.normal);
        Some(Guide { normal, ..guide })
    };
    (0..guides.len()).into_par_iter().map(steady).collect()
}

/// Weight for two pixels seeing the same surface, 0 to 1.
pub(super) fn similarity(a: Option<&Guide>, b: Option<&Guide>) -> f32 {
    match (a, b) {
        (Some(a), Some(b)) if a.object == b.object => {
            let turned = a.normal.dot(b.normal).max(0.0).powi(NORMAL_POWER);
            let off = (b.point - a.point).dot(a.normal).abs();
            turned * (-off / (PLANE_DISTANCE * a.depth + f32::MIN_POSITIVE)).exp()
        }
        _ => 0.0,
    }
}

/// Neighbourhoods of pixels in a picture.
#[derive(Clone, Copy)]
struct Around {
    width: usize,
    height: usize,
}

impl Around {
    /// The pixels of a square of `reach` taps to each side, `step` pixels apart, clipped to the picture, with their tap offsets.
    fn square(
        self,
        pixel: usize,
        reach: isize,
        step: isize,
    ) -> impl Iterator<Item = (usize, [isize; 2])> {
        let (x, y) = ((pixel % self.width) as isize, (pixel / self.width) as isize);
        (-reach..=reach)
            .flat_map(move |dy| (-reach..=reach).map(move |dx| [dx, dy]))
            .filter_map(move |[dx, dy]| {
                let at = |from: isize, by: isize, size: usize| {
                    usize::try_from(from + by * step).ok().filter(|&v| v < size)
                };
                let (x, y) = (at(x, dx, self.width)?, at(y, dy, self.height)?);
                Some((y * self.width + x, [dx, dy]))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    const SIDE: u32 = 48;

    /// A floor in two colours under light that falls to the right, with a wall of another object on the upper half.
    fn scene() -> (Vec<Option<Guide>>, Picture) {
        let guide = |x: u32, y: u32| {
            let wall = y < SIDE / 2;
            Guide {
                point: Vec3::new(
                    x as f32,
                    if wall { SIDE as f32 - y as f32 } else { 0.0 },
                    10.0,
                ),
                normal: if wall { Vec3::Z } else { Vec3::Y },
                depth: 50.0,
                albedo: Vec3::splat(if x % 6 < 3 { 0.2 } else { 0.8 }),
                emission: Vec3::ZERO,
                object: u32::from(wall),
            }
        };
        let light = |x: u32, y: u32| match y < SIDE / 2 {
            true => 3.0,
            false => 1.0 - 0.8 * x as f32 / SIDE as f32,
        };
        let guides = (0..SIDE * SIDE).map(|i| Some(guide(i % SIDE, i / SIDE)));
        let picture = Picture::from_fn(SIDE, SIDE, |x, y| guide(x, y).albedo * light(x, y));
        (guides.collect(), picture)
    }

    fn noisy(truth: &Picture, seed: u64, size: f32) -> Picture {
        let mut pixel = 0;
        Picture::from_fn(truth.width, truth.height, |x, y| {
            let mut stream = Stream::new(seed, 0, pixel, 0);
            pixel += 1;
            let value = truth.pixels[(y * truth.width + x) as usize];
            value * (1.0 + size * (2.0 * stream.uniform2()[0] - 1.0))
        })
    }

    fn error(a: &Picture, b: &Picture) -> f32 {
        let pairs = a.pixels.iter().zip(&b.pixels);
        let squares = pairs.map(|(a, b)| (*a - *b).length_squared());
        (squares.sum::<f32>() / a.pixels.len() as f32).sqrt()
    }

    #[test]
    fn noise_goes_while_colours_edges_and_slopes_of_light_stay() {
        let (guides, truth) = scene();
        let (a, b) = (noisy(&truth, 1, 0.8), noisy(&truth, 2, 0.8));
        let smooth = denoise(&a, &b, &guides);
        let (before, after) = (error(&mean(&a, &b), &truth), error(&smooth, &truth));
        assert!(after < 0.25 * before, "{before} {after}");
        // What has no noise stays as it is, to rounding.
        let clean = denoise(&truth, &truth, &guides);
        assert!(error(&clean, &truth) < 1e-5, "{}", error(&clean, &truth));
    }

    /// Normals as a scan has them: turned at random by 15 degrees, and where it is ragged by 45.
    #[test]
    fn noise_goes_where_the_triangles_of_a_surface_are_not_level() {
        for turned in [0.18, 0.6] {
            let (mut guides, truth) = scene();
            for (i, guide) in guides.iter_mut().flatten().enumerate() {
                let mut stream = Stream::new(3, 0, i as u64, 0);
                let by = Vec3::new(stream.normal(), stream.normal(), stream.normal()) * turned;
                guide.normal = (guide.normal + by).normalize();
            }
            let (a, b) = (noisy(&truth, 1, 0.8), noisy(&truth, 2, 0.8));
            let smooth = denoise(&a, &b, &guides);
            let (before, after) = (error(&a, &truth), error(&smooth, &truth));
            println!("turned by {turned}: {before} {after}");
            assert!(after < 0.2 * before, "turned by {turned}: {before} {after}");
        }
    }

    /// One bright sample in one of the pictures: a hundred times the light around it.
    #[test]
    fn a_rare_bright_sample_is_spread_and_keeps_its_light() {
        let (guides, truth) = scene();
        let (mut a, b) = (noisy(&truth, 1, 0.8), noisy(&truth, 2, 0.8));
        let plain = denoise(&a, &b, &guides);
        let bright = (36 * SIDE + 24) as usize;
        let added = truth.pixels[bright] * 100.0;
        a.pixels[bright] += added;
        let smooth = denoise(&a, &b, &guides);
        let highest = smooth.pixels[bright].x / truth.pixels[bright].x;
        assert!(highest < 2.0, "{highest}");
        // Light, not radiance: that of a dark colour counts as that of a light one.
        let light = |picture: &Picture| -> f32 {
            let pixels = picture.pixels.iter().zip(&guides);
            pixels
                .filter_map(|(p, g)| g.map(|g| p.x / g.albedo.x))
                .sum()
        };
        let albedo = guides[bright].map_or(1.0, |g| g.albedo.x);
        let kept = (light(&smooth) - light(&plain)) / (0.5 * added.x / albedo);
        assert!((kept - 1.0).abs() < 0.3, "{kept}");
    }

    /// The same rare bright sample in both pictures, which their difference does not tell from light.
    #[test]
    fn a_bright_pixel_that_both_pictures_share_is_spread() {
        let (guides, truth) = scene();
        let (mut a, mut b) = (noisy(&truth, 1, 0.1), noisy(&truth, 2, 0.1));
        let bright = (36 * SIDE + 24) as usize;
        for picture in [&mut a, &mut b] {
            picture.pixels[bright] += truth.pixels[bright] * 10.0;
        }
        let smooth = denoise(&a, &b, &guides);
        let highest = smooth.pixels[bright].x / truth.pixels[bright].x;
        assert!(highest < 2.0, "{highest}");
    }

    #[test]
    fn lamps_keep_their_light_and_what_nothing_is_known_of_stays() {
        let (mut guides, truth) = scene();
        let lamp = Vec3::new(9.0, 8.0, 7.0);
        let (mut a, mut b) = (noisy(&truth, 1, 0.5), noisy(&truth, 2, 0.5));
        guides[5] = None;
        a.pixels[7] = Vec3::splat(f32::NAN);
        if let Some(guide) = &mut guides[40] {
            (guide.emission, guide.albedo, guide.object) = (lamp, Vec3::ZERO, 77);
        }
        (a.pixels[40], b.pixels[40]) = (lamp, lamp);
        let smooth = denoise(&a, &b, &guides);
        assert_eq!(smooth.pixels[5], (a.pixels[5] + b.pixels[5]) * 0.5);
        assert!(smooth.pixels[7].is_nan());
        assert!((smooth.pixels[40] - lamp).length() < 1e-5);
        let spoilt = smooth.pixels.iter().filter(|p| !p.is_finite()).count();
        assert_eq!(spoilt, 1);
    }
}
