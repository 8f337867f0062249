//! The photograph that objects are put into, and how light becomes its values.

use crate::capture::exposure::Exposure;
use crate::capture::photograph::Photograph;
use crate::compose::psf_and_grain::PsfAndGrain;
use crate::error::{Error, Result};
use crate::export::picture::shown_at;
use crate::math::color::luminance;
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// A photograph with its camera.
#[derive(Debug, Clone)]
pub struct Backdrop {
    /// Index of the frame; keys the random numbers.
    pub frame: u64,
    /// Where the photograph was taken from; its size is the photograph's.
    pub camera: Camera,
    /// The photograph's values, linear.
    pub photograph: Arc<Picture>,
    /// From the estimate's radiance to light on the sensor and to the photograph's values.
    pub exposure: Exposure,
    /// The value at which each channel of the photograph saturates; infinite for linear files.
    pub saturation: Vec3,
    /// How soft and how grainy what is put into it becomes: not at all, or as it is itself.
    pub finish: PsfAndGrain,
    /// The exposure at which it is shown as 8-bit sRGB: its own, or the 99th percentile of the photograph as taken at 1.
    pub shown_at: f32,
}

/// A pixel with and without what is put there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mixed {
    /// The fraction of it that is covered.
    pub alpha: f32,
    /// Radiance with it.
    pub over: Vec3,
    /// Radiance without it.
    pub under: Vec3,
    /// Whether anything changes.
    pub changed: bool,
}

impl Backdrop {
    /// The backdrop of a frame, what is put into it exact; `exposure` is the estimate's for it.
    ///
    /// # Errors
    /// Camera and photograph differ in size.
    pub fn new(
        frame: usize,
        camera: &Camera,
        photograph: &Photograph,
        exposure: Exposure,
    ) -> Result<Self> {
        let picture = photograph.picture();
        let size = (camera.intrinsics.width, camera.intrinsics.height);
        if !picture.is_whole() || size != (picture.width, picture.height) {
            return Err(Error::new(
                format!("frame {frame}"),
                format!(
                    "the photograph is {} × {}, its camera {} × {}",
                    picture.width, picture.height, size.0, size.1
                ),
                "give both one size",
            ));
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

    /// The factor from radiance to light on the sensor at a pixel.
    pub fn exposure_at(&self, pixel: usize) -> Vec3 {
        let size = [self.photograph.width, self.photograph.height];
        self.exposure.at(&self.camera.intrinsics, size, pixel)
    }

    /// The light on the sensor that the photograph shows at a pixel.
    pub fn light(&self, pixel: usize) -> Vec3 {
        self.exposure
            .light(self.photograph.pixels[pixel], self.saturation)
    }

    /// What light on the sensor shows as.
    pub fn value(&self, light: Vec3) -> Vec3 {
        self.exposure.value(light, self.saturation)
    }

    /// The photograph with surfaces over a fraction of its pixels, by the radiance with and without them; as soft and as grainy as it
    /// is itself. Pixels that nothing changes, and none around them either as far as a soft edge reaches, are the photograph's to
    /// the bit.
    pub fn composite(&self, layers: &[Mixed]) -> Picture {
        let size = [self.photograph.width, self.photograph.height].map(|side| side as usize);
        if self.finish.is_none() {
            return self.each(|pixel| match layers[pixel] {
                Mixed { changed: false, .. } => self.photograph.pixels[pixel],
                Mixed {
                    alpha, over, under, ..
                } => self.blend(pixel, alpha, over, under),
            });
        }

        // What covers, what it covers, and what changes beside it, each as soft as the photograph.
        let alphas: Vec<f32> = layers.iter().map(|layer| layer.alpha).collect();
        let alphas = self.finish.softened(&alphas, size);
        let soft = |value: &(dyn Fn(usize, &Mixed) -> Vec3 + Sync)| {
            let values: Vec<Vec3> = (layers.par_iter().enumerate())
                .map(|(pixel, layer)| value(pixel, layer))
                .collect();
            self.finish.softened(&values, size)
        };
        let covers = soft(&|pixel, layer| layer.over * layer.alpha * self.exposure_at(pixel));
        let changes = soft(&|pixel, layer| match layer.changed {
            true => (layer.over - layer.under) * (1.0 - layer.alpha) * self.exposure_at(pixel),
            false => Vec3::ZERO,
        });
        self.each(|pixel| {
            let (alpha, cover, change) = (alphas[pixel], covers[pixel], changes[pixel]);
            if alpha == 0.0 && change == Vec3::ZERO {
                return self.photograph.pixels[pixel];
            }
            let behind = self.behind(pixel, layers[pixel].under * self.exposure_at(pixel));
            let exact = self.value(cover + behind * (1.0 - alpha) + change);
            let place = [self.frame, pixel as u64];
            let grain = self.finish.grain(place, luminance(exact), alpha);
            (exact + grain).clamp(Vec3::ZERO, self.saturation)
        })
    }

    /// A picture of the photograph's size.
    fn each(&self, color: impl Fn(usize) -> Vec3 + Sync + Send) -> Picture {
        let pixels = 0..self.photograph.pixels.len();
        Picture {
            pixels: pixels.into_par_iter().map(color).collect(),
            ..*self.photograph
        }
    }

    /// The light that the photograph shows at a pixel; a channel that is saturated was at least as bright as the estimate says.
    fn behind(&self, pixel: usize, under: Vec3) -> Vec3 {
        let saturated = self.photograph.pixels[pixel].cmpge(self.saturation);
        let light = self.light(pixel);
        Vec3::select(saturated, light.max(under), light)
    }

    /// The pixel with a surface over `alpha` of it: α · over + (1 − α) · (photograph + over − under), in light on the sensor, where
    /// `over` and `under` are radiances with and without.
    ///
    /// A channel that is saturated in the photograph was at least as bright as the estimate says, and a saturating
    /// photograph's composite saturates with it.
    pub fn blend(&self, pixel: usize, alpha: f32, over: Vec3, under: Vec3) -> Vec3 {
        let exposure = self.exposure_at(pixel);
        let (over, under) = (over * exposure, under * exposure);
        let behind = self.behind(pixel, under);
        // A shadow that the estimate takes for deeper than the photograph is bright leaves nothing.
        let beside = (behind + over - under).max(Vec3::ZERO);
        let light = over * alpha + beside * (1.0 - alpha);
        if !self.saturation.is_finite() {
            return light;
        }
        self.value(light).clamp(Vec3::ZERO, self.saturation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::camera::{Intrinsics, Pose};
    use glam::{DMat3, DVec3, Vec2};

    const SIDE: u32 = 40;
    const LEVEL: f32 = 0.3;
    const OBJECT: f32 = 0.7;

    /// A square object, with a shadow right of it, before a grey photograph with some finish.
    fn composite(finish: PsfAndGrain) -> Vec<f32> {
        let backdrop = backdrop(finish, Vec3::ONE);
        let layers: Vec<Mixed> = (0..SIDE * SIDE)
            .map(|pixel| {
                let (x, y) = (pixel % SIDE, pixel / SIDE);
                let inside = (12..22).contains(&x) && (12..22).contains(&y);
                let shadow = (22..26).contains(&x) && (12..22).contains(&y);
                let over = if inside { OBJECT } else { 0.1 };
                Mixed {
                    alpha: f32::from(u8::from(inside)),
                    over: Vec3::splat(over),
                    under: Vec3::splat(LEVEL),
                    changed: inside || shadow,
                }
            })
            .collect();
        let composite = backdrop.composite(&layers);
        composite.pixels.iter().map(|p| p.x).collect()
    }

    /// A grey photograph that saturates at a value.
    fn backdrop(finish: PsfAndGrain, saturation: Vec3) -> Backdrop {
        let intrinsics = Intrinsics {
            width: SIDE,
            height: SIDE,
            fx: 40.0,
            fy: 40.0,
            cx: 20.0,
            cy: 20.0,
            distortion: [0.0; 4],
        };
        let pose = Pose {
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        };
        let photograph = Picture::from_fn(SIDE, SIDE, |_, _| Vec3::splat(LEVEL));
        Backdrop {
            frame: 4,
            camera: Camera::new(&intrinsics, &pose, DVec3::ZERO),
            photograph: Arc::new(photograph),
            exposure: Exposure::default(),
            saturation,
            finish,
            shown_at: 1.0,
        }
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
        // Half of the step falls on either side, nothing is lost, and the middle is as it was.
        let sum = at(&soft, 11, 17) + at(&soft, 12, 17);
        assert!((sum - (LEVEL + OBJECT)).abs() < 1e-4, "{sum}");
        assert!(at(&soft, 11, 17) > LEVEL + 0.05);
        let total = |pixels: &[f32]| pixels.iter().map(|&p| f64::from(p)).sum::<f64>();
        assert!((total(&soft) / total(&exact) - 1.0).abs() < 1e-5);
        assert!((at(&soft, 16, 17) - OBJECT).abs() < 1e-3);
        assert_eq!(at(&soft, 5, 17), LEVEL);
    }

    #[test]
    fn a_shadow_is_never_darker_than_black() {
        let shadow = backdrop(PsfAndGrain::default(), Vec3::INFINITY);
        let [over, under] = [0.0, LEVEL * 2.0].map(Vec3::splat);
        assert_eq!(shadow.blend(0, 0.0, over, under), Vec3::ZERO);
        assert_eq!(shadow.blend(0, 0.0, under, under), Vec3::splat(LEVEL));
    }

    #[test]
    fn objects_take_grain_and_the_photograph_and_its_shadows_keep_their_own() {
        let grainy = composite(PsfAndGrain {
            blur: Vec2::ZERO,
            grain: vec![(0.5, Vec3::splat(0.02))],
        });
        let inside: Vec<f64> = (12..22)
            .flat_map(|y| (12..22).map(move |x| (x, y)))
            .map(|(x, y)| f64::from(at(&grainy, x, y) - OBJECT))
            .collect();
        let variance = inside.iter().map(|v| v * v).sum::<f64>() / inside.len() as f64;
        assert!((variance.sqrt() / 0.02 - 1.0).abs() < 0.2, "{variance}");
        assert_eq!(at(&grainy, 5, 17), LEVEL);
        assert!((at(&grainy, 23, 17) - 0.1).abs() < 1e-6);
        assert_eq!(
            grainy,
            composite(PsfAndGrain {
                blur: Vec2::ZERO,
                grain: vec![(0.5, Vec3::splat(0.02))],
            })
        );
    }
}
