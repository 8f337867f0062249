//! Relights a photograph by the ratio of two renders of its view (Marschner and Greenberg 1997), which keeps detail that the
//! estimate does not model.

use crate::compose::backdrop::Backdrop;
use crate::error::Result;
use crate::gpu::{Tracer, View};
use crate::math::picture::Picture;
use crate::transport::denoise::{Denoiser, Guide, guides};
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::Vec3;
use std::sync::Arc;

/// Largest ratio. Light beyond it is added, since dark pixels hold no detail to amplify.
const MAX_RATIO: f32 = 4.0;
/// Fewest rows between two calls of `go_on`.
const BAND: u32 = 16;
/// Long side and samples per pixel of the renders for a preview.
const COARSE_LONG_SIDE: u32 = 128;
const COARSE_SAMPLES: u32 = 4;

/// The photograph's values if its view were lit by `after` instead of `before` (radiances, one a pixel).
///
/// A pixel with equal radiances keeps its value to the bit. `before` is a lower bound of the light in saturated channels.
pub fn relit(backdrop: &Backdrop, before: &[Vec3], after: &[Vec3]) -> Picture {
    let photograph = &backdrop.photograph;
    let pixels = photograph.pixels.iter().zip(before).zip(after).enumerate();
    Picture {
        pixels: pixels
            .map(|(pixel, ((photograph, before), after))| {
                let exposure = backdrop.exposure_at(pixel);
                let (before, after) = (*before * exposure, *after * exposure);
                let light = backdrop.light(pixel);
                let saturated = photograph.cmpge(backdrop.saturation);
                let channel =
                    |c: usize| relit_channel(light[c], before[c], after[c], saturated.test(c));
                let relit = Vec3::new(channel(0), channel(1), channel(2));
                let value = backdrop.value(relit).clamp(Vec3::ZERO, backdrop.saturation);
                Vec3::select(before.cmpeq(after), *photograph, value)
            })
            .collect(),
        ..**photograph
    }
}

/// Exposed light of one channel, from two renders of it.
fn relit_channel(photograph: f32, before: f32, after: f32, saturated: bool) -> f32 {
    let light = if saturated {
        photograph.max(before)
    } else {
        photograph
    };
    let ratio = if before > 0.0 {
        (after / before).min(MAX_RATIO)
    } else {
        1.0
    };
    light * ratio + (after - before * ratio).max(0.0)
}

/// A photograph being relit, refined progressively by bands of rows.
#[derive(Debug)]
pub struct Relighting {
    backdrop: Backdrop,
    lights: [Arc<LitScene>; 2],
    options: PathOptions,
    seed: u64,
    /// Renders in both lights from the same random numbers. With denoising there are two independent pairs, to estimate
    /// the noise.
    pairs: Vec<[Film; 2]>,
    next_row: u32,
    denoiser: Option<Denoiser>,
    guides: Option<[Vec<Option<Guide>>; 2]>,
}

impl Relighting {
    /// Relights the photograph of `backdrop` from the first light to the second. With a denoiser both renders are denoised.
    pub fn new(
        backdrop: Backdrop,
        lights: [Arc<LitScene>; 2],
        options: PathOptions,
        seed: u64,
        denoiser: Option<Denoiser>,
    ) -> Self {
        let pair = || [0; 2].map(|_| Film::new(&backdrop.camera));
        Self {
            pairs: (0..1 + u8::from(denoiser.is_some()))
                .map(|_| pair())
                .collect(),
            backdrop,
            lights,
            options,
            seed,
            next_row: 0,
            denoiser,
            guides: None,
        }
    }

    /// Samples per pixel in each light.
    pub fn samples(&self) -> u32 {
        self.pairs.iter().map(|pair| pair[1].samples).sum()
    }

    /// Whether [`Relighting::photograph`] has samples to work from.
    pub fn is_begun(&self) -> bool {
        self.samples() >= self.pairs.len() as u32
    }

    /// Samples every pixel up to `samples` paths. Stops between two bands of rows once `go_on` returns false; the
    /// next call continues there. Returns whether all samples are done.
    pub fn refine_to(&mut self, samples: u32, go_on: impl Fn() -> bool) -> bool {
        let height = self.backdrop.camera.intrinsics.height;
        let band = BAND.max(2 * rayon::current_num_threads() as u32);
        while self.samples() < samples {
            if !go_on() {
                return false;
            }
            let rows = self.next_row..(self.next_row + band).min(height);
            // Continue with the first of the pairs with the fewest samples.
            let parts = 0..self.pairs.len();
            let part = parts.min_by_key(|&p| self.pairs[p][1].samples);
            let part = part.unwrap_or(0);
            let key = (self.seed.wrapping_add(part as u64), self.backdrop.frame);
            for (film, lit) in self.pairs[part].iter_mut().zip(&self.lights) {
                let camera = &self.backdrop.camera;
                film.add_rows(&**lit, camera, &self.options, key, rows.clone());
            }
            self.next_row = rows.end % height.max(1);
        }
        true
    }

    /// [`Relighting::refine_to`] on a graphics card that holds the scene in both lights; call it only between passes.
    /// After an error no pair is changed in part, and [`Relighting::refine_to`] continues.
    ///
    /// # Errors
    /// The card failed.
    pub fn refine_on(
        &mut self,
        tracers: &mut [Tracer; 2],
        samples: u32,
        go_on: impl Fn() -> bool,
    ) -> Result<bool> {
        let parts = self.pairs.len() as u32;
        for (part, pair) in (0..).zip(&mut self.pairs) {
            if !go_on() {
                return Ok(false);
            }
            // The first pair takes an odd sample.
            let wanted = (samples + parts - 1 - part) / parts;
            let missing = wanted.saturating_sub(pair[1].samples);
            let view = View {
                camera: &self.backdrop.camera,
                options: &self.options,
                seed: self.seed.wrapping_add(u64::from(part)),
                frame: self.backdrop.frame,
            };
            let mut refined = pair.clone();
            for (film, tracer) in refined.iter_mut().zip(tracers.iter_mut()) {
                tracer.add(film, &view, missing)?;
            }
            *pair = refined;
        }
        Ok(true)
    }

    /// The relit photograph from the samples so far; call it only between passes.
    pub fn photograph(&mut self) -> Picture {
        let [before, after] = self.renders();
        relit(&self.backdrop, &before.pixels, &after.pixels)
    }

    /// A preview from small renders.
    pub fn coarse(&self) -> Picture {
        let (width, height) = (
            self.backdrop.photograph.width,
            self.backdrop.photograph.height,
        );
        let small = Backdrop {
            camera: self.backdrop.camera.shrunk(COARSE_LONG_SIDE),
            ..self.backdrop.clone()
        };
        let mut rough = Self::new(
            small,
            self.lights.clone(),
            self.options,
            self.seed,
            self.denoiser,
        );
        rough.refine_to(COARSE_SAMPLES, || true);
        let [before, after] = rough.renders().map(|render| render.enlarged(width, height));
        relit(&self.backdrop, &before.pixels, &after.pixels)
    }

    /// Renders in both lights, denoised if there are two pairs.
    fn renders(&mut self) -> [Picture; 2] {
        let mean = |film: &Film| Picture {
            width: film.width,
            height: film.height,
            pixels: film.mean(),
        };
        let ([first, second], Some(denoiser)) = (&self.pairs[..], self.denoiser) else {
            return [0, 1].map(|light| mean(&self.pairs[0][light]));
        };
        let camera = &self.backdrop.camera;
        let seen = || self.lights.each_ref().map(|lit| guides(&**lit, camera));
        let guides = self.guides.get_or_insert_with(seen);
        [0, 1].map(|light| {
            denoiser.denoise(&mean(&first[light]), &mean(&second[light]), &guides[light])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::capture::camera::{Intrinsics, Pose};
    use crate::capture::exposure::Exposure;
    use crate::capture::response::Response;
    use crate::compose::psf_and_grain::PsfAndGrain;
    use crate::scene::camera::Camera;
    use glam::{DMat3, DVec3};

    /// One relit pixel of a photograph with a given saturation.
    fn pixel(photograph: f32, before: f32, after: f32, saturation: f32) -> f32 {
        by(Exposure::default(), photograph, before, after, saturation)
    }

    fn by(exposure: Exposure, photograph: f32, before: f32, after: f32, saturation: f32) -> f32 {
        let intrinsics = Intrinsics {
            width: 1,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 0.5,
            cy: 0.5,
            distortion: [0.0; 4],
        };
        let pose = Pose {
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        };
        let backdrop = Backdrop {
            frame: 0,
            camera: Camera::new(&intrinsics, &pose, DVec3::ZERO),
            photograph: Arc::new(Picture::from_fn(1, 1, |_, _| Vec3::splat(photograph))),
            exposure,
            saturation: Vec3::splat(saturation),
            finish: PsfAndGrain::default(),
            shown_at: 1.0,
        };
        let picture = relit(&backdrop, &[Vec3::splat(before)], &[Vec3::splat(after)]);
        picture.pixels[0].y
    }

    #[test]
    fn light_is_multiplied_added_where_it_was_dark_and_left_where_nothing_changes() {
        let linear = f32::INFINITY;
        assert_eq!(pixel(0.3, 0.2, 0.2, linear), 0.3);
        // Detail that the estimate does not model keeps its contrast.
        assert!((pixel(0.3, 0.2, 0.1, linear) - 0.15).abs() < 1e-7);
        assert!((pixel(0.3, 0.2, 0.4, linear) - 0.6).abs() < 1e-7);
        assert_eq!(pixel(0.0, 0.0, 0.7, linear), 0.7);
        assert_eq!(pixel(0.5, 0.5, 0.0, linear), 0.0);
        // Beyond the largest ratio light is added; a photograph that agrees with `before` still becomes `after`.
        assert!((pixel(0.01, 0.01, 1.0, linear) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_was_saturated_was_brighter_than_it_shows_and_nothing_exceeds_saturation() {
        assert_eq!(pixel(1.0, 8.0, 2.0, 1.0), 1.0);
        assert!((pixel(1.0, 8.0, 0.8, 1.0) - 0.8).abs() < 1e-6);
        assert_eq!(pixel(0.9, 0.5, 5.0, 1.0), 1.0);
    }

    /// Half of the light has the value that the camera would give it, not half of the value.
    #[test]
    fn light_is_changed_before_the_camera_bends_it() {
        let exposure = Exposure {
            response: Some(Response {
                terms: [0.3, 0.2, -0.3].map(Vec3::splat),
            }),
            ..Exposure::default()
        };
        let shown = |light: f32| exposure.value(Vec3::splat(light), Vec3::ONE).y;
        let relit = by(exposure, shown(0.4), 0.5, 0.25, 1.0);
        assert!((relit - shown(0.2)).abs() < 1e-5, "{relit}");
        assert!((relit / shown(0.4) - 0.5).abs() > 0.05);
        assert_eq!(by(exposure, shown(0.4), 0.5, 0.5, 1.0), shown(0.4));
    }
}
