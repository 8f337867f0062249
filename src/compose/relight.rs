//! A photograph in other light: multiplied by the ratio of two renders of its view (Marschner and Greenberg 1997), which
//! keeps all that the estimate does not model.

use crate::compose::backdrop::Backdrop;
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use crate::transport::denoise::{denoise, guides};
use crate::transport::film::Film;
use crate::transport::lit::Lit;
use crate::transport::path::PathOptions;
use glam::Vec3;

/// Above this ratio light is added rather than multiplied, since dark pixels have no detail to be brightened.
const MOST: f32 = 4.0;
/// Samples a pixel between two questions whether to go on.
const PASS: u32 = 2;

/// The photograph's values, were its view lit by `after` instead of `before` (radiances, one a pixel).
///
/// A pixel whose radiance is the same keeps its value to the bit. A channel that is saturated was at least as bright as
/// `before` says, and what saturates stays saturated.
pub fn relit(backdrop: &Backdrop, before: &[Vec3], after: &[Vec3]) -> Picture {
    let photograph = &backdrop.photograph;
    let pixels = photograph.pixels.iter().zip(before).zip(after);
    Picture {
        pixels: pixels
            .map(|((photograph, before), after)| {
                let (before, after) = (*before * backdrop.exposure, *after * backdrop.exposure);
                let channel =
                    |c: usize| changed(photograph[c], before[c], after[c], backdrop.saturation);
                Vec3::new(channel(0), channel(1), channel(2))
            })
            .collect(),
        ..**photograph
    }
}

fn changed(photograph: f32, before: f32, after: f32, saturation: f32) -> f32 {
    if before == after {
        return photograph;
    }
    let seen = if photograph >= saturation {
        photograph.max(before)
    } else {
        photograph
    };
    let ratio = if before > 0.0 {
        (after / before).min(MOST)
    } else {
        1.0
    };
    (seen * ratio + (after - before * ratio).max(0.0)).clamp(0.0, saturation)
}

/// Renders a view in two lights from the same random numbers, pass by pass; `None` if `go_on`, which hears the share
/// that is done, said no. With `smooth` the noise is smoothed, the same way in both.
pub fn render_both(
    lights: [&Lit; 2],
    camera: &Camera,
    options: &PathOptions,
    (seed, frame): (u64, u64),
    (samples, smooth): (u32, bool),
    go_on: &dyn Fn(f32) -> bool,
) -> Option<[Vec<Vec3>; 2]> {
    // What is to be smoothed is rendered in two independent halves, which tell the noise.
    let parts = if smooth { 2 } else { 1 };
    let samples = samples.div_ceil(parts);
    let mut halves = Vec::new();
    for part in 0..parts {
        let mut films = [Film::new(camera), Film::new(camera)];
        while films[1].samples < samples {
            let done = part as f32 + films[1].samples as f32 / samples as f32;
            if !go_on(done / parts as f32) {
                return None;
            }
            let pass = PASS.min(samples - films[1].samples);
            for (film, lit) in films.iter_mut().zip(lights) {
                let seed = seed.wrapping_add(u64::from(part));
                film.add(lit, camera, options, seed, frame, pass);
            }
        }
        halves.push(films.map(|film| Picture {
            width: film.width,
            height: film.height,
            pixels: film.mean(),
        }));
    }
    let mut halves = halves.into_iter();
    let first = halves.next()?;
    let Some(second) = halves.next() else {
        return Some(first.map(|picture| picture.pixels));
    };
    let lit = |index: usize| {
        let seen = guides(lights[index], camera);
        denoise(&first[index], &second[index], &seen).pixels
    };
    Some([lit(0), lit(1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_multiplied_added_where_it_was_dark_and_left_where_nothing_changes() {
        let linear = f32::INFINITY;
        assert_eq!(changed(0.3, 0.2, 0.2, linear), 0.3);
        // Detail that the estimate misses keeps its contrast.
        assert!((changed(0.3, 0.2, 0.1, linear) - 0.15).abs() < 1e-7);
        assert!((changed(0.3, 0.2, 0.4, linear) - 0.6).abs() < 1e-7);
        assert_eq!(changed(0.0, 0.0, 0.7, linear), 0.7);
        assert_eq!(changed(0.5, 0.5, 0.0, linear), 0.0);
        // Beyond the greatest ratio the rest is added; a photograph that agrees shows `after` all the same.
        assert!((changed(0.01, 0.01, 1.0, linear) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_was_saturated_was_brighter_than_it_shows_and_nothing_exceeds_saturation() {
        assert_eq!(changed(1.0, 8.0, 2.0, 1.0), 1.0);
        assert!((changed(1.0, 8.0, 0.8, 1.0) - 0.8).abs() < 1e-6);
        assert_eq!(changed(0.9, 0.5, 5.0, 1.0), 1.0);
    }
}
