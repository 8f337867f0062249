//! The photograph that objects are inserted into, and the conversion between radiance and its values.

use crate::capture::exposure::Exposure;
use crate::capture::photograph::{BELOW_SATURATION, Photograph};
use crate::capture::working::CLIPPED_RADIUS;
use crate::compose::psf_and_grain::PsfAndGrain;
use crate::error::{Error, Result};
use crate::export::picture::shown_at;
use crate::math::color::luminance;
use crate::math::picture::{Picture, around};
use crate::scene::camera::Camera;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Largest ratio by which a photograph is multiplied.
const MAX_RATIO: Vec3 = Vec3::splat(4.0);

/// Part of the saturation value up to which a channel surely shows all of its light. Between it and [`BELOW_SATURATION`] lie eight codes
/// of 8-bit sRGB, so that noise and compression of a code or two change little.
const MAX_UNCLIPPED: f32 = 0.9;

/// A photograph with its camera.
#[derive(Debug, Clone)]
pub struct Backdrop {
    /// Index of the frame; keys the random numbers.
    pub frame: u64,
    /// Where the photograph was taken from; its size is the photograph's.
    pub camera: Camera,
    /// The photograph's linear values.
    pub photograph: Arc<Picture>,
    /// Maps the estimate's radiance to exposed light, and exposed light to the photograph's values.
    pub exposure: Exposure,
    /// The value at which each channel of the photograph saturates; infinite for linear files.
    pub saturation: Vec3,
    /// Blur and grain given to what is inserted; by default none.
    pub finish: PsfAndGrain,
    /// Exposure for display as 8-bit sRGB: the photograph's own, or the one that maps the 99th percentile of its values to 1.
    pub shown_at: f32,
}

/// A rendered pixel with and without the inserted objects.
#[derive(Debug, Clone, Copy, Default)]
pub struct LayeredPixel {
    /// Fraction of the pixel that the objects cover, 0 to 1.
    pub alpha: f32,
    /// Radiance with the objects.
    pub with: Vec3,
    /// The same of the part of the pixel that they do not cover.
    pub uncovered: Vec3,
    /// Radiance without them.
    pub without: Vec3,
    /// Whether the objects change the pixel.
    pub changed: bool,
}

impl Backdrop {
    /// The backdrop of a frame, without blur or grain; `exposure` is the estimate's for the frame.
    ///
    /// # Errors
    /// The camera and the photograph differ in size.
    pub fn new(
        frame: usize,
        camera: &Camera,
        photograph: &Photograph,
        exposure: Exposure,
    ) -> Result<Self> {
        let picture = photograph.picture();
        let size = (camera.intrinsics.width, camera.intrinsics.height);
        if !picture.is_whole() || size != (picture.width, picture.height) {
            let problem = format!(
                "the photograph is {} × {}, its camera {} × {}",
                picture.width, picture.height, size.0, size.1
            );
            let place = format!("frame {frame}");
            return Err(Error::new(place, problem, "give both one size"));
        }
        Ok(Self {
            finish: PsfAndGrain::default(),
            frame: frame as u64,
            camera: camera.clone(),
            shown_at: shown_at(photograph.saturation, &picture.pixels),
            photograph: Arc::new(picture),
            exposure,
            saturation: photograph.saturation,
        })
    }

    /// Exposure factor from radiance to exposed light at a pixel.
    pub fn exposure_at(&self, pixel: usize) -> Vec3 {
        let size = [self.photograph.width, self.photograph.height];
        self.exposure.at(&self.camera.intrinsics, size, pixel)
    }

    /// Exposed light that the photograph shows at a pixel.
    pub fn light(&self, pixel: usize) -> Vec3 {
        self.exposure
            .light(self.photograph.pixels[pixel], self.saturation)
    }

    /// The photograph's value of exposed light.
    pub fn value(&self, light: Vec3) -> Vec3 {
        self.exposure.value(light, self.saturation)
    }

    /// Composites objects into the photograph, with its blur and grain. A pixel that nothing changes, not even within
    /// the reach of the blur, keeps its value to the bit.
    pub fn composite(&self, layers: &[LayeredPixel]) -> Picture {
        let size = [self.photograph.width, self.photograph.height].map(|side| side as usize);
        if self.finish.is_none() {
            return self.each(|pixel| match layers[pixel] {
                LayeredPixel { changed: false, .. } => self.photograph.pixels[pixel],
                layer => self.blend(pixel, &layer),
            });
        }

        // The objects' light, its coverage, and the change of the light around them, each blurred like the photograph.
        let alphas: Vec<f32> = layers.iter().map(|layer| layer.alpha).collect();
        let alphas = self.finish.softened(&alphas, size);
        let soft = |value: &(dyn Fn(usize, &LayeredPixel) -> Vec3 + Sync)| {
            let layers = layers.par_iter().enumerate();
            let values: Vec<Vec3> = layers.map(|(i, layer)| value(i, layer)).collect();
            self.finish.softened(&values, size)
        };
        let covers = soft(&|pixel, layer| layer.with * layer.alpha * self.exposure_at(pixel));
        let changes = soft(&|pixel, layer| match layer.changed {
            true => self.change(pixel, layer) * (1.0 - layer.alpha),
            false => Vec3::ZERO,
        });
        self.each(|pixel| {
            let (alpha, cover, change) = (alphas[pixel], covers[pixel], changes[pixel]);
            if alpha == 0.0 && change == Vec3::ZERO {
                return self.photograph.pixels[pixel];
            }
            let behind = self.background_light(pixel, layers[pixel].without);
            let lit = cover + behind * (1.0 - alpha) + change;
            let exact = self.value(self.limited(pixel, lit, cover, change));
            let place = [self.frame, pixel as u64];
            let grain = self.finish.grain(place, luminance(exact), alpha);
            (exact + grain).clamp(Vec3::ZERO, self.saturation)
        })
    }

    /// A picture of the photograph's size, pixel by pixel.
    fn each(&self, color: impl Fn(usize) -> Vec3 + Sync + Send) -> Picture {
        let pixels = 0..self.photograph.pixels.len();
        Picture {
            pixels: pixels.into_par_iter().map(color).collect(),
            ..*self.photograph
        }
    }

    /// The photograph's exposed light at a pixel. Where it is clipped, it is at least that of radiance `before`.
    fn background_light(&self, pixel: usize, before: Vec3) -> Vec3 {
        let light = self.light(pixel);
        let bound = light.max(before * self.exposure_at(pixel));
        light + (bound - light) * self.clipped(pixel)
    }

    /// How surely each channel of a pixel is clipped, 0 to 1: the mean over the pixels around it that may be. Compression leaves some
    /// pixels of a clipped surface a little darker than others; a limit between them would give its shadows spots.
    fn clipped(&self, pixel: usize) -> Vec3 {
        let limits = [MAX_UNCLIPPED, BELOW_SATURATION].map(|part| self.saturation * part);
        let above = self.photograph.pixels[pixel].cmpgt(limits[0]);
        if !above.any() {
            return Vec3::ZERO;
        }
        let size = [self.photograph.width, self.photograph.height].map(|side| side as usize);
        let (mut sum, mut count) = (Vec3::ZERO, Vec3::ZERO);
        for near in around(size, pixel, CLIPPED_RADIUS) {
            let part = (self.photograph.pixels[near] - limits[0]) / (limits[1] - limits[0]);
            sum += part.clamp(Vec3::ZERO, Vec3::ONE);
            count += Vec3::select(part.cmpgt(Vec3::ZERO), Vec3::ONE, Vec3::ZERO);
        }
        Vec3::select(above, sum / count.max(Vec3::ONE), Vec3::ZERO)
    }

    /// The photograph's exposed light at a pixel if its radiance changed from `before` to `after` in the estimate. No clipped pixel
    /// becomes brighter where light is lost.
    pub fn changed_light(&self, pixel: usize, before: Vec3, after: Vec3) -> Vec3 {
        let behind = self.background_light(pixel, before);
        let shown = self.light(pixel);
        let [behind, changed] =
            [behind, shown].map(|light| self.changed(pixel, light, before, after));
        behind.min(changed.max(shown))
    }

    /// Exposed light at a pixel if its radiance changed from `before` to `after` in the estimate: multiplied by their ratio, so that
    /// the photograph's own albedo and detail count (Marschner and Greenberg 1997). Beyond [`MAX_RATIO`] light is added, since dark
    /// pixels hold no detail to amplify.
    fn changed(&self, pixel: usize, light: Vec3, before: Vec3, after: Vec3) -> Vec3 {
        let lit = before.cmpgt(Vec3::ZERO);
        let ratio = Vec3::select(lit, (after / before).min(MAX_RATIO), Vec3::ONE);
        let added = (after - before * ratio).max(Vec3::ZERO) * self.exposure_at(pixel);
        light * ratio + added
    }

    /// Exposed light of a pixel behind what covers it, and beside: α · with + (1 − α) · beside is the composite. With `with` as the mean
    /// of object and uncovered part, that is α · object + (1 − α) · the changed light of the photograph.
    fn behind_and_beside(&self, pixel: usize, layer: &LayeredPixel) -> [Vec3; 2] {
        let behind = self.background_light(pixel, layer.without);
        let outline = (layer.with - layer.uncovered) * self.exposure_at(pixel);
        let changed = self.changed(pixel, behind, layer.without, layer.uncovered);
        [behind, outline + changed]
    }

    /// The change of a pixel's light beside what covers it.
    fn change(&self, pixel: usize, layer: &LayeredPixel) -> Vec3 {
        let [behind, beside] = self.behind_and_beside(pixel, layer);
        beside - behind
    }

    /// Exposed light `lit` of a pixel, no brighter than the photograph with what covers the pixel and what the change adds.
    fn limited(&self, pixel: usize, lit: Vec3, cover: Vec3, change: Vec3) -> Vec3 {
        lit.min(self.light(pixel) + cover + change.max(Vec3::ZERO))
    }

    /// What the objects add to a pixel's light beside what they cover and take from it, as radiance of the estimate: α · with +
    /// (1 − α) · (photograph + delta) is the composite.
    pub fn delta(&self, pixel: usize, layer: &LayeredPixel) -> Vec3 {
        let exposure = self.exposure_at(pixel);
        let exposed = exposure.cmpgt(Vec3::ZERO);
        Vec3::select(exposed, self.change(pixel, layer) / exposure, Vec3::ZERO)
    }

    /// Composites one pixel. It saturates like the photograph.
    fn blend(&self, pixel: usize, layer: &LayeredPixel) -> Vec3 {
        let free = 1.0 - layer.alpha;
        let cover = layer.with * layer.alpha * self.exposure_at(pixel);
        let [behind, beside] = self.behind_and_beside(pixel, layer);
        let light = (cover + beside * free).max(Vec3::ZERO);
        if !self.saturation.is_finite() {
            return light;
        }
        let light = self.limited(pixel, light, cover, (beside - behind) * free);
        self.value(light).clamp(Vec3::ZERO, self.saturation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::camera::{Intrinsics, Pose};
    use crate::capture::photograph::Encoding;
    use glam::{DVec3, Vec2};

    const SIDE: u32 = 40;
    const LEVEL: f32 = 0.3;
    const OBJECT: f32 = 0.7;

    /// A square object with a shadow to its right, in front of a grey photograph with given blur and grain.
    fn composite(finish: PsfAndGrain) -> Vec<f32> {
        let mut backdrop = backdrop(Vec3::ONE);
        backdrop.finish = finish;
        let layers: Vec<LayeredPixel> = (0..SIDE * SIDE)
            .map(|pixel| {
                let (x, y) = (pixel % SIDE, pixel / SIDE);
                let inside = (12..22).contains(&x) && (12..22).contains(&y);
                let shadow = (22..26).contains(&x) && (12..22).contains(&y);
                let with = if inside { OBJECT } else { 0.1 };
                LayeredPixel {
                    alpha: f32::from(u8::from(inside)),
                    with: Vec3::splat(with),
                    uncovered: Vec3::splat(if shadow { 0.1 } else { LEVEL }),
                    without: Vec3::splat(LEVEL),
                    changed: inside || shadow,
                }
            })
            .collect();
        let composite = backdrop.composite(&layers);
        composite.pixels.iter().map(|p| p.x).collect()
    }

    /// A grey photograph with a given saturation.
    fn backdrop(saturation: Vec3) -> Backdrop {
        let intrinsics = Intrinsics::plain([SIDE; 2], [40.0; 2], [20.0; 2]);
        let camera = Camera::new(&intrinsics, &Pose::default(), DVec3::ZERO);
        let pixels = vec![Vec3::splat(LEVEL); (SIDE * SIDE) as usize];
        let grey = Photograph::new([SIDE; 2], pixels, Encoding::Linear, saturation);
        Backdrop::new(4, &camera, &grey, Exposure::default()).expect("one size")
    }

    fn at(pixels: &[f32], x: u32, y: u32) -> f32 {
        pixels[(y * SIDE + x) as usize]
    }

    #[test]
    fn objects_and_their_shadows_become_soft_and_what_is_far_stays_to_the_bit() {
        let exact = composite(PsfAndGrain::default());
        assert_eq!([at(&exact, 11, 17), at(&exact, 12, 17)], [LEVEL, OBJECT]);
        assert!((at(&exact, 23, 17) - 0.1).abs() < 1e-6);
        let soft = composite(PsfAndGrain {
            blur: Vec2::new(1.2, 0.8),
            grain: Vec::new(),
        });
        // Half of the step lies on either side, the sum is conserved, and the middle is unchanged.
        let sum = at(&soft, 11, 17) + at(&soft, 12, 17);
        assert!((sum - (LEVEL + OBJECT)).abs() < 1e-4, "{sum}");
        assert!(at(&soft, 11, 17) > LEVEL + 0.05);
        let total = |pixels: &[f32]| pixels.iter().map(|&p| f64::from(p)).sum::<f64>();
        assert!((total(&soft) / total(&exact) - 1.0).abs() < 1e-5);
        assert!((at(&soft, 16, 17) - OBJECT).abs() < 1e-3);
        assert_eq!(at(&soft, 5, 17), LEVEL);
    }

    #[test]
    fn a_shadow_takes_its_share_of_the_light_that_the_photograph_shows() {
        let linear = backdrop(Vec3::INFINITY);
        let shown = |without: f32, uncovered: f32| {
            let [without, uncovered] = [without, uncovered].map(Vec3::splat);
            let layer = LayeredPixel {
                with: uncovered,
                uncovered,
                without,
                changed: true,
                ..LayeredPixel::default()
            };
            let after = linear.blend(0, &layer).x;
            assert!((linear.delta(0, &layer).x - (after - LEVEL)).abs() < 1e-6);
            after
        };
        assert_eq!(shown(0.1, 0.1), LEVEL);
        assert_eq!(shown(2.0 * LEVEL, 0.0), 0.0);
        // Half of the light, whatever albedo the estimate gave the surface.
        assert!([0.1, 1.0].map(|e| shown(e, 0.5 * e)) == [0.5 * LEVEL; 2]);
        // Light on black, and a mirror image in a surface estimated dark, are added beyond four times the photograph.
        assert!((shown(0.0, 0.2) - (LEVEL + 0.2)).abs() < 1e-6);
        assert!((shown(0.01, 0.21) - (4.0 * LEVEL + 0.17)).abs() < 1e-6);
    }

    #[test]
    fn a_clipped_surface_takes_an_even_shadow_though_compression_moves_its_values() {
        let mut clipped = backdrop(Vec3::ONE);
        let values = [1.0, 0.99, 0.95, 1.0, 0.98, 1.0, 0.96];
        let pixels = (0..SIDE * SIDE).map(|pixel| Vec3::splat(values[pixel as usize % 7]));
        clipped.photograph = Arc::new(Picture {
            pixels: pixels.collect(),
            ..*clipped.photograph
        });
        let layers = |uncovered: f32| {
            let layer = LayeredPixel {
                with: Vec3::splat(uncovered),
                uncovered: Vec3::splat(uncovered),
                without: Vec3::splat(1.5),
                changed: true,
                ..LayeredPixel::default()
            };
            vec![layer; (SIDE * SIDE) as usize]
        };
        for finish in [Vec2::ZERO, Vec2::splat(0.7)] {
            clipped.finish.blur = finish;
            // Half of one and a half, of which the photograph shows one.
            for shadow in clipped.composite(&layers(0.75)).pixels {
                assert!((shadow.x - 0.75).abs() < 0.05, "{shadow}");
            }
            // What is left still saturates: nothing is brighter than it was.
            let slight = clipped.composite(&layers(1.4));
            assert!(
                (slight.pixels.iter().zip(&clipped.photograph.pixels)).all(|(a, b)| a.x <= b.x)
            );
            assert_eq!(slight.pixels[0].x, 1.0);
        }
        let relit = clipped.changed_light(2, Vec3::splat(1.5), Vec3::splat(1.4));
        assert!((relit.x - 0.95).abs() < 1e-6, "{relit}");
    }

    #[test]
    fn objects_take_grain_and_the_photograph_and_its_shadows_keep_their_own() {
        let finish = PsfAndGrain {
            blur: Vec2::ZERO,
            grain: vec![(0.5, Vec3::splat(0.02))],
        };
        let grainy = composite(finish.clone());
        let inside = (12..22).flat_map(|y| (12..22).map(move |x| (x, y)));
        let off = |(x, y)| f64::from(at(&grainy, x, y) - OBJECT);
        let inside: Vec<f64> = inside.map(off).collect();
        let variance = inside.iter().map(|v| v * v).sum::<f64>() / inside.len() as f64;
        assert!((variance.sqrt() / 0.02 - 1.0).abs() < 0.2, "{variance}");
        assert_eq!(at(&grainy, 5, 17), LEVEL);
        assert!((at(&grainy, 23, 17) - 0.1).abs() < 1e-6);
        assert_eq!(grainy, composite(finish));
    }
}
