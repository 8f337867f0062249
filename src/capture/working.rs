//! The working resolution: photographs downsampled to a pixel budget, with matching cameras.

use crate::capture::camera::Intrinsics;
use crate::capture::photograph::{Photograph, PhotographSource};
use crate::capture::{Capture, Frame};
use crate::error::{Error, Result};
use crate::math::picture::around;
use glam::{BVec3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Most pixels used in a solve; larger photographs are reduced together.
pub const WORKING_PIXELS: u64 = 4_000_000;

/// Radius in pixels around a saturated pixel within which blur, resampling and compression mix in clipped light.
pub const CLIPPED_RADIUS: usize = 2;

/// All photographs of a capture in memory at the working resolution.
#[derive(Debug, Clone)]
pub struct Working {
    /// One per frame: linear radiance, each pixel the mean of `factor`² pixels of the file.
    pub photographs: Vec<Arc<Photograph>>,
    /// The frames' intrinsics at this resolution.
    pub intrinsics: Vec<Intrinsics>,
    /// The downsampling factor: width and height of the block of pixels that becomes one.
    pub factor: u32,
    /// Warnings, each a full sentence naming the file.
    pub warnings: Vec<String>,
}

/// Loads all photographs, downsampled by the smallest whole factor at which their pixels sum to at most `max_pixels`. Pixels
/// next to saturated ones are marked as lower bounds.
///
/// Frames are read in parallel; at most one full-size photograph per thread is in memory.
///
/// # Errors
/// A photograph cannot be read or has another size than its camera, or there is no light in any of them.
pub fn load_working(capture: &Capture, max_pixels: u64) -> Result<Working> {
    let factor = reduction(&capture.frames, max_pixels);
    let loaded: Vec<Result<(Arc<Photograph>, usize)>> = capture
        .frames
        .par_iter()
        .map(|frame| {
            let (photograph, invalid) =
                (frame.photograph).load(&frame.intrinsics, frame.exposure)?;
            let reduced = match factor {
                1 => photograph,
                _ => Arc::new(reduce(&photograph, factor)),
            };
            Ok((bound_near_clipped(reduced), invalid))
        })
        .collect();

    let mut photographs = Vec::with_capacity(loaded.len());
    let mut warnings = Vec::new();
    for (index, (loaded, frame)) in loaded.into_iter().zip(&capture.frames).enumerate() {
        let (photograph, invalid) = loaded?;
        if invalid > 0 {
            let place = match &frame.photograph {
                PhotographSource::File(path, _) => path.display().to_string(),
                PhotographSource::Memory(_) => format!("frame {index}"),
            };
            warnings.push(format!(
                "{place}: {invalid} pixels are negative or not finite and are left out"
            ));
        }
        photographs.push(photograph);
    }
    if !photographs.iter().any(|photograph| holds_light(photograph)) {
        return Err(Error::new(
            &capture.name,
            "no photograph holds light: all pixels are black, masked or not finite",
            "check how the photographs were exported",
        ));
    }
    Ok(Working {
        photographs,
        intrinsics: capture
            .frames
            .iter()
            .map(|frame| frame.intrinsics.reduced(factor))
            .collect(),
        factor,
        warnings,
    })
}

impl Capture {
    /// The capture at the working resolution: with the cameras and photographs of `working`.
    pub fn at(&self, working: &Working) -> Self {
        let mut capture = self.clone();
        let reduced = working.intrinsics.iter().zip(&working.photographs);
        for (frame, (&intrinsics, photograph)) in capture.frames.iter_mut().zip(reduced) {
            frame.intrinsics = intrinsics;
            frame.photograph = PhotographSource::Memory(photograph.clone());
        }
        capture
    }
}

impl Intrinsics {
    /// The lens of the photograph downsampled in blocks of `factor`² pixels from the top-left corner; a remainder is cropped.
    pub fn reduced(&self, factor: u32) -> Self {
        let scale = f64::from(factor);
        Self {
            width: self.width / factor,
            height: self.height / factor,
            fx: self.fx / scale,
            fy: self.fy / scale,
            cx: self.cx / scale,
            cy: self.cy / scale,
            ..*self
        }
    }
}

/// Whether any usable pixel is brighter than zero.
fn holds_light(photograph: &Photograph) -> bool {
    let is_lit =
        |(index, value): (usize, &Vec3)| value.max_element() > 0.0 && photograph.is_usable(index);
    photograph.pixels.iter().enumerate().any(is_lit)
}

/// The smallest factor that meets the pixel budget; no photograph shrinks below one pixel.
fn reduction(frames: &[Frame], max_pixels: u64) -> u32 {
    let lenses = || frames.iter().map(|frame| &frame.intrinsics);
    let shortest = lenses().map(|k| k.width.min(k.height)).min();
    let largest = shortest.unwrap_or(1).max(1);
    let pixels = |factor: u32| -> u64 {
        let pixels = |k: &Intrinsics| u64::from(k.width / factor) * u64::from(k.height / factor);
        lenses().map(pixels).sum()
    };
    let fits = |factor: &u32| pixels(*factor) <= max_pixels;
    (1..largest).find(fits).unwrap_or(largest)
}

/// Downsamples by block means. A block with an unusable pixel is unusable; a block with a saturated pixel is a lower bound.
pub fn reduce(photograph: &Photograph, factor: u32) -> Photograph {
    let (width, height) = (photograph.width / factor, photograph.height / factor);
    let count = f64::from(factor) * f64::from(factor);
    let limit = photograph.saturation;
    let (encoding, pixels) = (photograph.encoding, Vec::new());
    let mut reduced = Photograph::new([width, height], pixels, encoding, limit);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let mut sum = DVec3::ZERO;
        let mut saturated = BVec3::FALSE;
        let mut usable = true;
        for j in y * factor..(y + 1) * factor {
            for i in x * factor..(x + 1) * factor {
                let index = j as usize * photograph.width as usize + i as usize;
                sum += photograph.pixels[index].as_dvec3();
                saturated |= photograph.saturated(index);
                usable &= photograph.is_usable(index);
            }
        }
        let mean = (sum / count).as_vec3();
        reduced.pixels.push(mean);
        reduced.usable.push(usable);
        let own_limit = Vec3::select(saturated, mean.min(limit), limit);
        reduced.limits.push(own_limit);
    }
    if reduced.usable.iter().all(|&good| good) {
        reduced.usable.clear();
    }
    if reduced.limits.iter().all(|&own| own == limit) {
        reduced.limits.clear();
    }
    reduced
}

/// Marks the pixels within [`CLIPPED_RADIUS`] of a saturated one as lower bounds: they lack part of their light.
fn bound_near_clipped(photograph: Arc<Photograph>) -> Arc<Photograph> {
    let size = [photograph.width, photograph.height].map(|side| side as usize);
    let clipped: Vec<bool> = (0..photograph.pixels.len())
        .map(|pixel| photograph.is_saturated(pixel))
        .collect();
    if !clipped.contains(&true) {
        return photograph;
    }
    let limits = (0..clipped.len())
        .map(|pixel| {
            let is_near_clipped = around(size, pixel, CLIPPED_RADIUS).any(|near| clipped[near]);
            match is_near_clipped {
                true => photograph.limit(pixel).min(photograph.pixels[pixel]),
                false => photograph.limit(pixel),
            }
        })
        .collect();
    let mut bounded = Arc::unwrap_or_clone(photograph);
    bounded.limits = limits;
    Arc::new(bounded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::photograph::Encoding;
    use glam::DVec2;

    fn photograph(width: u32, height: u32) -> Photograph {
        let pixels = (0..width * height).map(|i| Vec3::splat(i as f32)).collect();
        Photograph::new([width, height], pixels, Encoding::Linear, Vec3::INFINITY)
    }

    #[test]
    fn blocks_become_their_means_and_the_remainder_is_cut_off() {
        let reduced = reduce(&photograph(5, 4), 2);
        assert_eq!((reduced.width, reduced.height), (2, 2));
        let values: Vec<f32> = reduced.pixels.iter().map(|p| p.x).collect();
        assert_eq!(values, [3.0, 5.0, 13.0, 15.0]);
    }

    #[test]
    fn unusable_blocks_are_unusable_and_partly_saturated_ones_lower_bounds() {
        let mut p = photograph(4, 4);
        p.usable = vec![true; 16];
        p.usable[0] = false;
        p.saturation = Vec3::splat(7.0);
        p.pixels
            .iter_mut()
            .for_each(|v| *v = v.min(Vec3::splat(7.0)));
        let reduced = reduce(&p, 2);
        assert_eq!(reduced.usable, [false, true, true, true]);
        // Of the second block, 2, 3, 6 and 7, one pixel is saturated, of the others all.
        assert_eq!(reduced.pixels[1], Vec3::splat(4.5));
        assert_eq!(reduced.pixels[3], Vec3::splat(7.0));
        let saturated = [1, 2, 3].map(|pixel| reduced.is_saturated(pixel));
        assert_eq!(saturated, [true, true, true]);
        // With none saturated there is one limit for all.
        let linear = reduce(&photograph(4, 4), 2);
        assert!(linear.limits.is_empty() && !linear.is_saturated(3));
    }

    #[test]
    fn what_lies_beside_a_saturated_pixel_is_a_lower_bound() {
        let mut clipped = photograph(8, 5);
        clipped.saturation = Vec3::splat(100.0);
        clipped.pixels[2 * 8 + 3].y = 100.0;
        let bounded = bound_near_clipped(Arc::new(clipped));
        for pixel in 0..40 {
            let (x, y) = (pixel as i32 % 8, pixel as i32 / 8);
            let beside = (x - 3).abs() <= 2 && (y - 2).abs() <= 2;
            assert_eq!(bounded.saturated(pixel).all(), beside, "{pixel}");
            assert_eq!(bounded.is_saturated(pixel), beside, "{pixel}");
        }
        // Nothing saturates: nothing changes.
        let linear = bound_near_clipped(Arc::new(photograph(6, 5)));
        assert!(linear.limits.is_empty());
    }

    #[test]
    fn a_point_lands_on_the_same_spot_of_the_reduced_photograph() {
        let lens = Intrinsics {
            distortion: [0.1, -0.02, 1e-3, 2e-3],
            ..Intrinsics::plain([641, 480], [500.0, 510.0], [321.3, 240.1])
        };
        let reduced = lens.reduced(4);
        assert_eq!((reduced.width, reduced.height), (160, 120));
        let project = |k: &Intrinsics| k.pixel(k.distort(DVec2::new(0.2, -0.3)).unwrap());
        assert!((project(&lens) / 4.0 - project(&reduced)).length() < 1e-12);
    }
}
