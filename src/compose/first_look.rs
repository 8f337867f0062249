//! The first look at inserted objects: exact outlines, and light from a small render that is denoised and enlarged.

use crate::compose::backdrop::LayeredPixel;
use crate::compose::denoise::{DenoisedLight, layered, unlit};
use crate::compose::insert::Insertion;
use crate::compose::world::FurnishedScene;
use crate::math::picture::Picture;
use crate::transport::denoise::{Denoiser, Guide, guides_at_centers};
use crate::transport::upsample::upsample;
use glam::Vec3;

/// Long side of the small render in pixels.
const LONG_SIDE: u32 = 200;
/// Samples per pixel of each of its two halves.
const SAMPLES: u32 = 1;

/// The pixels of `insertion`, whose own samples are not used. Pixels that no object changes near by are exactly unchanged.
pub fn first_look(insertion: &Insertion) -> Vec<LayeredPixel> {
    let seeds = [insertion.seed, insertion.seed.wrapping_add(1)];
    let halves = seeds.map(|seed| {
        let mut half = insertion.smaller(LONG_SIDE, seed);
        half.pass(SAMPLES);
        half
    });
    let mut small = DenoisedLight::new(halves.each_ref(), Denoiser::Builtin);
    lend_to_what_was_missed(&mut small.object, &small.object_guides);

    let (lit, camera) = (&insertion.lit, &insertion.backdrop().camera);
    let size = [camera.intrinsics.width, camera.intrinsics.height];
    let seen = guides_at_centers(&FurnishedScene::new(lit, &insertion.objects), camera);
    let object = upsample(&small.object, &small.object_guides, size, &seen);
    let without = upsample(&small.without, &small.without_guides, size, &seen);
    let dark = unlit(&small.without_guides);
    let change = upsample(&small.change, &dark, size, &unlit(&seen));

    let first_object = lit.scene.objects.len();
    let alpha = |guide: &Option<Guide>| {
        let covered = guide.is_some_and(|g| g.object as usize >= first_object);
        f32::from(u8::from(covered))
    };
    let alpha: Vec<f32> = seen.iter().map(alpha).collect();
    layered(&alpha, &object, &without, &change)
}

/// Gives the mean light of the objects to the pixels that see none: thin parts that the render missed take it from there.
fn lend_to_what_was_missed(object: &mut Picture, guides: &[Option<Guide>]) {
    let (mut light, mut count) = (Vec3::ZERO, 0.0);
    for (radiance, guide) in object.pixels.iter().zip(guides) {
        if let Some(guide) = guide.filter(|_| radiance.is_finite()) {
            light += guide.demodulated(*radiance);
            count += 1.0;
        }
    }
    let missed = object.pixels.iter_mut().zip(guides);
    for (radiance, _) in missed.filter(|(_, guide)| guide.is_none()) {
        *radiance = light / f32::max(count, 1.0);
    }
}
