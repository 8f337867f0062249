//! Relights a photograph by the ratio of two renders (Marschner and Greenberg 1997), which keeps detail beyond the estimate.

use crate::compose::backdrop::Backdrop;
use crate::compose::matte::Matte;
use crate::error::Result;
use crate::gpu::{Tracer, View};
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use crate::transport::denoise::{Denoiser, Guide, guides, guides_at_centers};
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use crate::transport::upsample::upsample;
use glam::Vec3;
use std::sync::{Arc, OnceLock};

/// Fewest rows between two calls of `go_on`.
const BAND: u32 = 16;

/// What the pixels see in both lights; their albedos may differ.
type Guides = [Vec<Option<Guide>>; 2];

/// The photograph's values if its view were lit by `after` instead of `before` (radiances, one a pixel).
///
/// A pixel with equal radiances keeps its value to the bit. `before` is a lower bound of the light in saturated channels.
fn relit(backdrop: &Backdrop, before: &[Vec3], after: &[Vec3]) -> Picture {
    let photograph = &backdrop.photograph;
    let pixels = photograph.pixels.iter().zip(before).zip(after).enumerate();
    Picture {
        pixels: pixels
            .map(|(pixel, ((photograph, &before), &after))| {
                let light = backdrop.changed_light(pixel, before, after);
                let value = backdrop.value(light).clamp(Vec3::ZERO, backdrop.saturation);
                Vec3::select(before.cmpeq(after), *photograph, value)
            })
            .collect(),
        ..**photograph
    }
}

/// A photograph being relit, refined progressively by bands of rows.
#[derive(Debug)]
pub struct Relighting {
    backdrop: Backdrop,
    /// The renders' camera: that of the photograph, or a smaller one of the same view.
    camera: Camera,
    lights: [Arc<LitScene>; 2],
    options: PathOptions,
    seed: u64,
    /// Renders in both lights from the same random numbers. With denoising there are two independent pairs, to estimate
    /// the noise.
    pairs: Vec<[Film; 2]>,
    next_row: u32,
    denoiser: Option<Denoiser>,
    guides: OnceLock<Guides>,
    /// What the photograph's pixels see, if that was asked for.
    guides_at_centers: Arc<OnceLock<Guides>>,
    /// The edges of recoloured surfaces of a scan.
    matte: Arc<OnceLock<Option<Matte>>>,
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
        Self {
            pairs: pairs(&backdrop.camera, denoiser),
            camera: backdrop.camera.clone(),
            backdrop,
            lights,
            options,
            seed,
            next_row: 0,
            denoiser,
            guides: OnceLock::new(),
            guides_at_centers: Arc::default(),
            matte: Arc::default(),
        }
    }

    /// The same relighting from smaller renders without samples yet; the photograph keeps its size.
    pub fn smaller(&self, long_side: u32) -> Self {
        let camera = self.backdrop.camera.shrunk(long_side);
        Self {
            pairs: pairs(&camera, self.denoiser),
            camera,
            backdrop: self.backdrop.clone(),
            lights: self.lights.clone(),
            next_row: 0,
            guides: OnceLock::new(),
            guides_at_centers: self.guides_at_centers.clone(),
            matte: self.matte.clone(),
            ..*self
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

    /// Whether no pass is half done.
    pub fn is_between_passes(&self) -> bool {
        self.next_row == 0
    }

    /// Samples every pixel up to `samples` paths. Stops between two bands of rows once `go_on` returns false; the
    /// next call continues there. Returns whether all samples are done.
    pub fn refine_to(&mut self, samples: u32, go_on: impl Fn() -> bool) -> bool {
        let height = self.camera.intrinsics.height;
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
                let camera = &self.camera;
                film.add_rows(&**lit, camera, &self.options, key, rows.clone(), 1);
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
            // The first pair takes an odd sample.
            let wanted = (samples + parts - 1 - part) / parts;
            let missing = wanted.saturating_sub(pair[1].samples);
            if missing == 0 {
                continue;
            }
            if !go_on() {
                return Ok(false);
            }
            let view = View {
                camera: &self.camera,
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
    pub fn photograph(&self) -> Picture {
        let [before, mut after] = self.renders();
        if let Some(matte) = self.matte() {
            after.pixels = matte.applied(&before.pixels, &after.pixels);
        }
        relit(&self.backdrop, &before.pixels, &after.pixels)
    }

    /// The matte of recoloured surfaces, if the mesh is a scan's; other meshes have edges where the photograph has them.
    fn matte(&self) -> Option<&Matte> {
        let [before, after] = &self.lights;
        let mut materials = before.materials.iter().zip(&after.materials);
        if !before.scene.scanned || materials.all(|(a, b)| a.albedo.is_same(&b.albedo)) {
            return None;
        }
        let matte = || {
            let Backdrop {
                photograph,
                shown_at,
                ..
            } = &self.backdrop;
            let shown: Vec<Vec3> = photograph.pixels.iter().map(|&p| p * *shown_at).collect();
            let shape = [photograph.width, photograph.height].map(|side| side as usize);
            let [before, after] = self.guides_at_centers();
            Matte::new(&shown, shape, before, after)
        };
        self.matte.get_or_init(matte).as_ref()
    }

    /// What the photograph's pixels see at their centres.
    fn guides_at_centers(&self) -> &Guides {
        self.guides_at_centers.get_or_init(|| {
            let lights = self.lights.each_ref();
            lights.map(|lit| guides_at_centers(&**lit, &self.backdrop.camera))
        })
    }

    /// Renders in both lights at the photograph's size, denoised if there are two pairs.
    fn renders(&self) -> [Picture; 2] {
        let size = |camera: &Camera| [camera.intrinsics.width, camera.intrinsics.height];
        let whole = &self.backdrop.camera;
        let is_small = size(&self.camera) != size(whole);
        if !is_small && self.denoiser.is_none() {
            return self.pairs[0].each_ref().map(Film::picture);
        }
        let lights = self.lights.each_ref();
        let seen = || lights.map(|lit| guides(&**lit, &self.camera));
        let guides = self.guides.get_or_init(seen);
        let render = |light: usize| match (&self.pairs[..], self.denoiser) {
            ([first, second], Some(denoiser)) => denoiser.denoise(
                &first[light].picture(),
                &second[light].picture(),
                &guides[light],
            ),
            (pairs, _) => pairs[0][light].picture(),
        };
        let renders = [0, 1].map(render);
        if !is_small {
            return renders;
        }
        let at_centers = self.guides_at_centers();
        [0, 1].map(|i| upsample(&renders[i], &guides[i], size(whole), &at_centers[i]))
    }
}

/// Empty renders: one pair, or two with denoising.
fn pairs(camera: &Camera, denoiser: Option<Denoiser>) -> Vec<[Film; 2]> {
    let pair = |_| [(); 2].map(|()| Film::new(camera));
    (0..1 + u8::from(denoiser.is_some())).map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::capture::camera::{Intrinsics, Pose};
    use crate::capture::exposure::Exposure;
    use crate::capture::photograph::{Encoding, Photograph};
    use crate::capture::response::Response;
    use crate::scene::camera::Camera;
    use glam::DVec3;

    /// One relit pixel of a photograph with a given saturation.
    fn pixel(photograph: f32, before: f32, after: f32, saturation: f32) -> f32 {
        by(Exposure::default(), photograph, before, after, saturation)
    }

    fn by(exposure: Exposure, photograph: f32, before: f32, after: f32, saturation: f32) -> f32 {
        let intrinsics = Intrinsics::plain([1; 2], [1.0; 2], [0.5; 2]);
        let camera = Camera::new(&intrinsics, &Pose::default(), DVec3::ZERO);
        let [pixel, saturation] = [photograph, saturation].map(Vec3::splat);
        let taken = Photograph::new([1; 2], vec![pixel], Encoding::Linear, saturation);
        let backdrop = Backdrop::new(0, &camera, &taken, exposure).expect("one size");
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
