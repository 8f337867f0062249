//! Denoises a composite: the objects' own light and the change of the light around them are denoised separately.

use crate::compose::backdrop::LayeredPixel;
use crate::compose::insert::{Insertion, Layers};
use crate::compose::world::FurnishedScene;
use crate::math::picture::Picture;
use crate::transport::denoise::{Denoiser, Guide, denoise, guides, guides_where};
use glam::Vec3;

/// The denoised composite and its layers, from two independent renderings of the same insertion.
///
/// Pixels that no object changes in either, nor within the reach of the filter, keep the photograph's value to the bit.
pub fn denoised(halves: [&Insertion; 2], denoiser: Denoiser) -> (Picture, Layers) {
    let [a, b] = halves.map(Insertion::layers);
    let (backdrop, lit) = (halves[0].backdrop(), halves[0].lit());
    let camera = &backdrop.camera;
    let average = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a + b) * 0.5).collect();
    let alpha: Vec<f32> = average(&a.alpha, &b.alpha);

    // Radiance of the objects, up to their outlines.
    let world = FurnishedScene::new(lit, halves[0].objects());
    let objects = guides_where(&world, camera, |pixel, ray| {
        alpha[pixel] > 0.0 && world.sees_object(ray)
    });
    let [mut object_a, mut object_b] = halves.map(Insertion::object_radiance);
    for pixel in 0..alpha.len() {
        // Where only one half has hit the object, its value is used for both.
        match (a.alpha[pixel] > 0.0, b.alpha[pixel] > 0.0) {
            (true, false) => object_b.pixels[pixel] = object_a.pixels[pixel],
            (false, true) => object_a.pixels[pixel] = object_b.pixels[pixel],
            _ => {}
        }
    }
    let object = denoiser.denoise(&object_a, &object_b, &objects);

    // The background and its change. Emission cancels in a difference, so its guides have none. A difference has both signs,
    // which only the built-in filter supports.
    let behind = guides(&**lit, camera);
    let dark: Vec<Option<Guide>> = (behind.iter())
        .map(|guide| {
            guide.map(|guide| Guide {
                emission: Vec3::ZERO,
                ..guide
            })
        })
        .collect();
    let [change_a, change_b] = halves.map(Insertion::uncovered_change);
    let change = denoise(&change_a, &change_b, &dark);
    let without = denoiser.denoise(&a.without, &b.without, &behind);
    let picture = |value: &dyn Fn(usize) -> Vec3| Picture {
        pixels: (0..alpha.len()).map(value).collect(),
        ..*backdrop.photograph
    };
    let uncovered = picture(&|pixel| without.pixels[pixel] + change.pixels[pixel]);
    let with = picture(&|pixel| uncovered.pixels[pixel].lerp(object.pixels[pixel], alpha[pixel]));
    let mixed: Vec<LayeredPixel> = (alpha.iter().enumerate())
        .map(|(pixel, &alpha)| LayeredPixel {
            alpha,
            with: with.pixels[pixel],
            uncovered: uncovered.pixels[pixel],
            without: without.pixels[pixel],
            changed: alpha != 0.0 || change.pixels[pixel] != Vec3::ZERO,
        })
        .collect();
    let composite = backdrop.composite(&mixed);
    let delta = picture(&|pixel| backdrop.delta(pixel, &mixed[pixel]));
    let layers = Layers {
        shadow: Layers::shadow_of(&with, &without, &alpha),
        with,
        without,
        delta,
        alpha,
        depth: a.depth,
        object: a.object,
    };
    (composite, layers)
}
