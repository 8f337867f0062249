//! Finds unusable photographs (black, white, duplicated, mispaired) and hot pixels, masks them, and warns.

use crate::calibrate::alignment::{Evidence, MispairedPhotograph};
use crate::capture::Capture;
use crate::capture::photograph::{Encoding, Photograph, PhotographSource};
use crate::capture::working::Working;
use crate::error::{Error, Result};
use crate::math::color::luminance;
use crate::math::stats::quantile;
use std::sync::Arc;

/// An integer-encoded photograph is black if its 99th percentile of luminance is ten stops below the median photograph's.
const BLACK: f64 = 1.0 / 1024.0;
/// A photograph is white if at least this fraction is saturated in every channel.
const WHITE: f64 = 0.99;
/// A pixel is hot if it is this many times as bright as its brightest neighbour and all of them see one object. Path tracing
/// noise with 64 samples per pixel reaches that only if one path carries 64,000 times the mean.
const HOT: f32 = 1000.0;
/// At least this many photographs must remain: two that contradict each other cannot be told apart.
const MIN_LEFT: usize = 3;

/// Masks black, white and duplicated photographs, and adds a warning for each.
///
/// # Errors
/// No photograph is left.
pub fn leave_out(capture: &Capture, working: &mut Working) -> Result<()> {
    let photographs = &working.photographs;
    let mut reasons: Vec<Option<String>> = vec![None; photographs.len()];
    let brightest: Vec<Option<f64>> = photographs.iter().map(|p| brightest(p)).collect();
    let mut known: Vec<f64> = brightest.iter().flatten().copied().collect();
    let median = quantile(&mut known, 0.5).unwrap_or(0.0);
    for (frame, photograph) in photographs.iter().enumerate() {
        reasons[frame] = blank(photograph, brightest[frame], median).map(str::to_owned);
    }
    for (frame, same) in same_pictures(photographs).into_iter().enumerate() {
        let Some(same) = same.filter(|_| reasons[frame].is_none()) else {
            continue;
        };
        if capture.frames[frame].pose != capture.frames[same].pose {
            reasons[frame] = Some(format!(
                "is the same picture as {}, which has another pose",
                name(capture, same)
            ));
        } else if same < frame {
            reasons[frame] = Some(format!("repeats {}", name(capture, same)));
        }
    }

    if reasons.iter().all(Option::is_some) {
        let first = reasons.into_iter().flatten().next().unwrap_or_default();
        let problem = format!("no photograph is usable; the first one {first}");
        return Err(Error::new(&capture.name, problem, "check the image files"));
    }
    for (frame, reason) in reasons.into_iter().enumerate() {
        if let Some(reason) = reason {
            take_out(capture, working, frame, &reason);
        }
    }
    Ok(())
}

/// Masks photographs that have a wrong pose, and adds a warning for each; warns only, if too few photographs would be left.
pub fn leave_out_mispaired(
    capture: &Capture,
    working: &mut Working,
    mispaired: &[MispairedPhotograph],
) {
    let is_used = |p: &Arc<Photograph>| (0..p.pixels.len()).any(|pixel| p.is_usable(pixel));
    let used = working.photographs.iter().filter(|p| is_used(p)).count();
    let left = used.saturating_sub(mispaired.len());
    for &MispairedPhotograph { frame, evidence } in mispaired {
        let reason = match evidence {
            Evidence::ShowsViewOf(other) => format!(
                "shows what the pose of {} sees, and not what its own does",
                name(capture, other)
            ),
            Evidence::SharesPoseWith(other) => format!(
                "has the pose of {}, but is another picture and does not fit the mesh from there",
                name(capture, other)
            ),
        };
        if left >= MIN_LEFT {
            take_out(capture, working, frame, &reason);
        } else {
            let name = name(capture, frame);
            let warning = format!("{name} {reason}; check its pose: too few others would be left");
            working.warnings.push(warning);
        }
    }
}

/// Masks a photograph and adds a warning with the reason.
fn take_out(capture: &Capture, working: &mut Working, frame: usize, reason: &str) {
    working.photographs[frame] = Arc::new(working.photographs[frame].masked());
    let name = name(capture, frame);
    let warning = format!("{name} {reason}; it is left out");
    working.warnings.push(warning);
}

/// A linear photograph with its hot pixels masked, and their number; `None` if there are none. Hot pixels are far brighter than
/// their eight neighbours and see the same object as these; `object_at` gives the object of a pixel.
pub fn without_hot_pixels(
    photograph: &Arc<Photograph>,
    object_at: impl Fn(usize) -> Option<u32>,
) -> Option<(Arc<Photograph>, usize)> {
    if photograph.encoding != Encoding::Linear {
        return None;
    }
    let [width, height] = [photograph.width, photograph.height].map(|side| side as usize);
    let value = |pixel: usize| photograph.pixels[pixel].max_element();
    let is_hot = |&pixel: &usize| {
        if value(pixel) <= 0.0 || !photograph.is_usable(pixel) {
            return false;
        }
        let mut around = [pixel - width, pixel, pixel + width]
            .into_iter()
            .flat_map(|row| [row - 1, row, row + 1])
            .filter(|&p| p != pixel);
        let max = around.clone().map(value).fold(0.0, f32::max);
        let object = object_at(pixel);
        value(pixel) > HOT * max && object.is_some() && around.all(|p| object_at(p) == object)
    };
    let rows = 1..height.saturating_sub(1);
    let inner = rows.flat_map(|y| (1..width.saturating_sub(1)).map(move |x| y * width + x));
    let hot: Vec<usize> = inner.filter(is_hot).collect();
    if hot.is_empty() {
        return None;
    }
    let mut usable = match photograph.usable.len() {
        0 => vec![true; photograph.pixels.len()],
        _ => photograph.usable.clone(),
    };
    for &pixel in &hot {
        usable[pixel] = false;
    }
    let without = Photograph {
        usable,
        ..(**photograph).clone()
    };
    Some((Arc::new(without), hot.len()))
}

/// The photograph's file, or its frame number.
pub fn name(capture: &Capture, frame: usize) -> String {
    match &capture.frames[frame].photograph {
        PhotographSource::File(path, _) => path.display().to_string(),
        PhotographSource::Memory(_) => format!("frame {frame:03}"),
    }
}

/// 99th percentile of the luminance of usable pixels; `None` if no pixel is usable.
fn brightest(photograph: &Photograph) -> Option<f64> {
    let mut levels: Vec<f64> = (0..photograph.pixels.len())
        .filter(|&pixel| photograph.is_usable(pixel))
        .map(|pixel| f64::from(luminance(photograph.pixels[pixel])))
        .collect();
    quantile(&mut levels, 0.99)
}

/// Why a photograph shows nothing; `None` if it shows something. `median` is that of [`brightest`] over all photographs.
fn blank(photograph: &Photograph, brightest: Option<f64>, median: f64) -> Option<&'static str> {
    let usable = || (0..photograph.pixels.len()).filter(|&pixel| photograph.is_usable(pixel));
    let Some(brightest) = brightest else {
        return Some("has no usable pixel");
    };
    let black = match photograph.encoding {
        Encoding::Linear => 0.0,
        Encoding::Srgb8 | Encoding::Srgb16 => median * BLACK,
    };
    if brightest <= black {
        return Some("is black");
    }
    let saturated = usable().filter(|&pixel| photograph.saturated(pixel).all());
    if saturated.count() as f64 >= WHITE * usable().count() as f64 {
        return Some("is white");
    }
    None
}

/// For each photograph, the first other one with identical pixels. Photographs of one single colour have none.
fn same_pictures(photographs: &[Arc<Photograph>]) -> Vec<Option<usize>> {
    let hashes: Vec<blake3::Hash> = photographs
        .iter()
        .map(|photograph| {
            let values = photograph.pixels.iter().flat_map(|pixel| pixel.to_array());
            let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
            blake3::hash(&bytes)
        })
        .collect();
    (0..hashes.len())
        .map(|frame| {
            let first = photographs[frame].pixels.first();
            let uniform = photographs[frame].pixels.iter().all(|p| Some(p) == first);
            (0..hashes.len()).find(|&k| k != frame && hashes[k] == hashes[frame] && !uniform)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn photograph(pixels: Vec<Vec3>, encoding: Encoding) -> Arc<Photograph> {
        Arc::new(Photograph::new([5; 2], pixels, encoding, Vec3::ONE))
    }

    fn ramp() -> Vec<Vec3> {
        (0..25)
            .map(|i| Vec3::splat(0.1 + i as f32 * 0.01))
            .collect()
    }

    #[test]
    fn black_and_white_photographs_show_nothing() {
        let why = |pixels: Vec<Vec3>| {
            let photograph = photograph(pixels, Encoding::Srgb8);
            blank(&photograph, brightest(&photograph), 0.5)
        };
        assert_eq!(why(ramp()), None);
        assert_eq!(why(vec![Vec3::splat(1e-4); 25]), Some("is black"));
        assert_eq!(why(vec![Vec3::splat(0.3); 25]), None);
        let mut nearly = vec![Vec3::ONE; 25];
        nearly[3] = Vec3::splat(0.99);
        assert_eq!(why(nearly), Some("is white"));
    }

    #[test]
    fn a_pixel_far_brighter_than_its_object_is_hot_and_a_small_lamp_is_none() {
        let mut pixels = ramp();
        pixels[12] = Vec3::splat(1e5);
        let photograph = photograph(pixels, Encoding::Linear);
        let (cooled, count) = without_hot_pixels(&photograph, |_| Some(3)).expect("one is hot");
        assert_eq!(count, 1);
        assert!(!cooled.is_usable(12) && cooled.is_usable(11));
        // The pixel is all that is seen of another object.
        let lamp = |pixel: usize| Some(u32::from(pixel == 12));
        assert!(without_hot_pixels(&photograph, lamp).is_none());
    }

    #[test]
    fn the_same_picture_is_found_wherever_it_is() {
        let other: Vec<Vec3> = ramp().into_iter().map(|p| p * 2.0).collect();
        let all = [ramp(), other, ramp()].map(|p| photograph(p, Encoding::Linear));
        assert_eq!(same_pictures(&all), [Some(2), None, Some(0)]);
    }
}
