//! Photographs that cannot be of the room, and pixels that cannot be of a photograph: found, left out and named.

use crate::calibrate::alignment::{Astray, Why};
use crate::capture::Capture;
use crate::capture::photograph::{Encoding, Photograph, PhotographSource};
use crate::capture::working::Working;
use crate::error::{Error, Result};
use crate::math::color::luminance;
use crate::math::stats::quantile;
use std::sync::Arc;

/// An 8-bit photograph is black whose brightest hundredth is so much darker than that of the median one: ten stops, which is
/// more than eight bits hold.
const BLACK: f64 = 1.0 / 1024.0;
/// A photograph is white of which at least this part is saturated in every channel.
const WHITE: f64 = 0.99;
/// A pixel is hot that is so many times as bright as the brightest around it, inside one object that surrounds it. Path
/// tracing noise of 64 samples a pixel reaches that where one path carries 64,000 times the mean.
const HOT: f32 = 1000.0;
/// At least this many photographs are left: of two that contradict each other, neither is outvoted.
const MIN_LEFT: usize = 3;

/// Marks what cannot be as unusable, and says so among the warnings.
///
/// # Errors
/// No photograph is left.
pub fn leave_out(capture: &Capture, working: &mut Working) -> Result<()> {
    let photographs = &working.photographs;
    let mut reasons: Vec<Option<String>> = vec![None; photographs.len()];
    let brightest: Vec<Option<f64>> = photographs.iter().map(|p| brightest(p)).collect();
    let usual = quantile(
        &mut brightest.iter().flatten().copied().collect::<Vec<f64>>(),
        0.5,
    )
    .unwrap_or(0.0);
    for (frame, photograph) in photographs.iter().enumerate() {
        reasons[frame] = nothing_shown(photograph, brightest[frame], usual).map(str::to_owned);
    }
    for (frame, same) in same_pictures(photographs).into_iter().enumerate() {
        let Some(same) = same.filter(|_| reasons[frame].is_none()) else {
            continue;
        };
        let one_pose = capture.frames[frame].pose == capture.frames[same].pose;
        if !one_pose {
            reasons[frame] = Some(format!(
                "is the same picture as {}, which has another pose",
                name(capture, same)
            ));
        } else if same < frame {
            reasons[frame] = Some(format!("repeats {}", name(capture, same)));
        }
    }

    if reasons.iter().all(Option::is_some) {
        let first = reasons.iter().flatten().next().cloned();
        return Err(Error::new(
            &capture.name,
            format!(
                "no photograph is of use; the first {}",
                first.unwrap_or_default()
            ),
            "check that the images are the ones that were taken",
        ));
    }
    for (frame, reason) in reasons.into_iter().enumerate() {
        if let Some(reason) = reason {
            take_out(capture, working, frame, &reason);
        }
    }
    Ok(())
}

/// Marks photographs that show something else than their poses see as unusable, and says so among the warnings. Where too few
/// would be left, they stay, and only that is said.
pub fn leave_out_astray(capture: &Capture, working: &mut Working, astray: &[Astray]) {
    let is_used = |p: &Arc<Photograph>| (0..p.pixels.len()).any(|pixel| p.is_usable(pixel));
    let used = working.photographs.iter().filter(|p| is_used(p)).count();
    let left = used.saturating_sub(astray.len());
    for &Astray { frame, why } in astray {
        let reason = match why {
            Why::Shows(other) => format!(
                "shows what the pose of {} sees, and not what its own does",
                name(capture, other)
            ),
            Why::Fractions(other) => format!(
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

/// Marks a photograph as unusable and says why.
fn take_out(capture: &Capture, working: &mut Working, frame: usize, reason: &str) {
    let photograph = &mut working.photographs[frame];
    let usable = vec![false; photograph.pixels.len()];
    *photograph = Arc::new(Photograph {
        usable,
        ..(**photograph).clone()
    });
    let name = name(capture, frame);
    let warning = format!("{name} {reason}; it is left out");
    working.warnings.push(warning);
}

/// Marks pixels as unusable that are far brighter than all around them and lie inside one object, as `object_at` tells
/// for each pixel; and how many there were.
pub fn without_hot_pixels(
    photograph: &Arc<Photograph>,
    object_at: impl Fn(usize) -> Option<u32>,
) -> Option<(Arc<Photograph>, usize)> {
    if photograph.encoding != Encoding::Linear {
        return None;
    }
    let width = photograph.width as usize;
    let height = photograph.height as usize;
    let mut hot = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let pixel = y * width + x;
            let value = photograph.pixels[pixel].max_element();
            if value <= 0.0 || !photograph.is_usable(pixel) {
                continue;
            }
            let around = [pixel - width, pixel, pixel + width]
                .into_iter()
                .flat_map(|row| [row - 1, row, row + 1])
                .filter(|&p| p != pixel);
            let most = around
                .clone()
                .map(|p| photograph.pixels[p].max_element())
                .fold(0.0, f32::max);
            let object = object_at(pixel);
            if value > HOT * most
                && object.is_some()
                && around.clone().all(|p| object_at(p) == object)
            {
                hot.push(pixel);
            }
        }
    }
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

/// The photograph's file, or its number.
pub fn name(capture: &Capture, frame: usize) -> String {
    match &capture.frames[frame].photograph {
        PhotographSource::File(path, _) => path.display().to_string(),
        PhotographSource::Memory(_) => format!("frame {frame:03}"),
    }
}

/// The luminance that a hundredth of the usable pixels exceed; `None` where none is usable.
fn brightest(photograph: &Photograph) -> Option<f64> {
    let mut levels: Vec<f64> = (0..photograph.pixels.len())
        .filter(|&pixel| photograph.is_usable(pixel))
        .map(|pixel| f64::from(luminance(photograph.pixels[pixel])))
        .collect();
    quantile(&mut levels, 0.99)
}

/// Why a photograph shows nothing, if it does.
fn nothing_shown(
    photograph: &Photograph,
    brightest: Option<f64>,
    usual: f64,
) -> Option<&'static str> {
    let usable = || (0..photograph.pixels.len()).filter(|&pixel| photograph.is_usable(pixel));
    let Some(brightest) = brightest else {
        return Some("has no usable pixel");
    };
    let black = match photograph.encoding {
        Encoding::Linear => 0.0,
        Encoding::Srgb8 | Encoding::Srgb16 => usual * BLACK,
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

/// For each photograph another one with the same pixels, the first of them, or the second for the first. Photographs of one colour
/// are no pictures that could be told apart.
fn same_pictures(photographs: &[Arc<Photograph>]) -> Vec<Option<usize>> {
    let hashes: Vec<blake3::Hash> = photographs
        .iter()
        .map(|photograph| {
            let mut hasher = blake3::Hasher::new();
            for pixel in &photograph.pixels {
                for value in pixel.to_array() {
                    hasher.update(&value.to_le_bytes());
                }
            }
            hasher.finalize()
        })
        .collect();
    (0..hashes.len())
        .map(|frame| {
            let first = photographs[frame].pixels.first();
            let plain = photographs[frame].pixels.iter().all(|p| Some(p) == first);
            (0..hashes.len()).find(|&k| k != frame && hashes[k] == hashes[frame] && !plain)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn photograph(pixels: Vec<Vec3>, encoding: Encoding) -> Arc<Photograph> {
        Arc::new(Photograph {
            width: 5,
            height: 5,
            pixels,
            usable: Vec::new(),
            encoding,
            saturation: Vec3::ONE,
            limits: Vec::new(),
        })
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
            nothing_shown(&photograph, brightest(&photograph), 0.5)
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
