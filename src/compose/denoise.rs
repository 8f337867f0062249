//! A composite with its noise smoothed: the objects' own light, and what they change around them, each by itself.

use crate::compose::backdrop::Mixed;
use crate::compose::insert::{Insertion, Layers};
use crate::compose::world::FurnishedScene;
use crate::math::picture::Picture;
use crate::transport::denoise::{Guide, denoise, guides};
use glam::Vec3;

/// The composite and its layers, from two independent insertions of the same objects into the same photograph.
///
/// Pixels that no object changes in either, nor around them, stay the photograph's to the bit.
pub fn denoised(halves: [&Insertion; 2]) -> (Picture, Layers) {
    let [a, b] = halves.map(Insertion::layers);
    let (backdrop, lit) = (halves[0].backdrop(), halves[0].lit());
    let world = FurnishedScene::new(lit, halves[0].objects());
    let halved = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a + b) * 0.5).collect();
    let alpha: Vec<f32> = halved(&a.alpha, &b.alpha);
    // At their outlines objects and what is behind them are mixed: those pixels stay as they are.
    let mut seen = guides(&world, &backdrop.camera);
    for (guide, alpha) in seen.iter_mut().zip(&alpha) {
        if *alpha > 0.0 && *alpha < 1.0 {
            *guide = None;
        }
    }
    // A difference holds no light of lamps, which is the same with and without.
    let dark: Vec<Option<Guide>> = (seen.iter())
        .map(|guide| {
            guide.map(|guide| Guide {
                emission: Vec3::ZERO,
                ..guide
            })
        })
        .collect();
    let with = denoise(&a.with, &b.with, &seen);
    let delta = denoise(&a.delta, &b.delta, &dark);
    let each = |value: &dyn Fn(usize) -> Vec3| Picture {
        pixels: (0..alpha.len()).map(value).collect(),
        ..*backdrop.photograph
    };
    let without = each(&|pixel| with.pixels[pixel] - delta.pixels[pixel]);
    let mixed: Vec<Mixed> = (alpha.iter().enumerate())
        .map(|(pixel, &alpha)| Mixed {
            alpha,
            over: with.pixels[pixel],
            under: without.pixels[pixel],
            changed: alpha != 0.0 || delta.pixels[pixel] != Vec3::ZERO,
        })
        .collect();
    let composite = backdrop.composite(&mixed);
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
