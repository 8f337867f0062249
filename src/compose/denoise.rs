//! Denoises a composite: the objects' own light and the change of the light around them are denoised separately.

use crate::compose::backdrop::LayeredPixel;
use crate::compose::insert::{Insertion, Layers};
use crate::compose::world::FurnishedScene;
use crate::math::picture::Picture;
use crate::transport::denoise::{Denoiser, Guide, denoise, guides, guides_where};
use glam::Vec3;

/// The denoised light of an insertion, with what its pixels see.
pub(super) struct DenoisedLight {
    /// Fraction of each pixel that the objects cover.
    pub alpha: Vec<f32>,
    /// Radiance of the objects, up to their outlines.
    pub object: Picture,
    pub object_guides: Vec<Option<Guide>>,
    /// Radiance without the objects.
    pub without: Picture,
    pub without_guides: Vec<Option<Guide>>,
    /// What they change where they do not cover a pixel.
    pub change: Picture,
}

impl DenoisedLight {
    /// From two independent renderings of the same insertion.
    pub fn new(halves: [&Insertion; 2], denoiser: Denoiser) -> Self {
        let [a, b] = halves.map(Insertion::alpha);
        let alpha: Vec<f32> = a.iter().zip(&b).map(|(a, b)| (a + b) * 0.5).collect();
        let (lit, camera) = (&halves[0].lit, &halves[0].backdrop().camera);

        let world = FurnishedScene::new(lit, &halves[0].objects);
        let object_guides = guides_where(&world, camera, |pixel, ray| {
            alpha[pixel] > 0.0 && world.sees_object(ray)
        });
        let [mut object_a, mut object_b] = halves.map(Insertion::object_radiance);
        for pixel in 0..alpha.len() {
            // Where only one half has hit the object, its value is used for both.
            match (a[pixel] > 0.0, b[pixel] > 0.0) {
                (true, false) => object_b.pixels[pixel] = object_a.pixels[pixel],
                (false, true) => object_a.pixels[pixel] = object_b.pixels[pixel],
                _ => {}
            }
        }

        // Emission cancels in a difference. A difference has both signs, which only the built-in filter supports.
        let without_guides = guides(&**lit, camera);
        let [change_a, change_b] = halves.map(Insertion::uncovered_change);
        let [without_a, without_b] = halves.map(Insertion::without);
        Self {
            object: denoiser.denoise(&object_a, &object_b, &object_guides),
            without: denoiser.denoise(&without_a, &without_b, &without_guides),
            change: denoise(&change_a, &change_b, &unlit(&without_guides)),
            object_guides,
            without_guides,
            alpha,
        }
    }
}

/// Pixels of which objects cover a fraction `alpha`, from the objects' radiance, that without them, and their change beside them.
pub(super) fn layered(
    alpha: &[f32],
    object: &Picture,
    without: &Picture,
    change: &Picture,
) -> Vec<LayeredPixel> {
    let layered = |(pixel, &alpha): (usize, &f32)| {
        let (without, change) = (without.pixels[pixel], change.pixels[pixel]);
        let uncovered = without + change;
        LayeredPixel {
            alpha,
            with: uncovered.lerp(object.pixels[pixel], alpha),
            uncovered,
            without,
            changed: alpha != 0.0 || change != Vec3::ZERO,
        }
    };
    alpha.iter().enumerate().map(layered).collect()
}

/// The same features of surfaces that emit nothing.
pub(super) fn unlit(guides: &[Option<Guide>]) -> Vec<Option<Guide>> {
    let unlit = |guide: &Guide| Guide {
        emission: Vec3::ZERO,
        ..*guide
    };
    guides.iter().map(|g| g.as_ref().map(unlit)).collect()
}

/// The denoised composite, from two independent renderings of the same insertion.
///
/// Pixels that no object changes in either, nor within the reach of the filter, keep the photograph's value to the bit.
pub fn denoised_composite(halves: [&Insertion; 2], denoiser: Denoiser) -> Picture {
    composited(halves, denoiser).0
}

/// [`denoised_composite`] and its layers.
pub fn denoised(halves: [&Insertion; 2], denoiser: Denoiser) -> (Picture, Layers) {
    let (composite, layered) = composited(halves, denoiser);
    (composite, halves[0].layers_of(&layered))
}

fn composited(halves: [&Insertion; 2], denoiser: Denoiser) -> (Picture, Vec<LayeredPixel>) {
    let light = DenoisedLight::new(halves, denoiser);
    let layered = layered(&light.alpha, &light.object, &light.without, &light.change);
    (halves[0].backdrop().composite(&layered), layered)
}
