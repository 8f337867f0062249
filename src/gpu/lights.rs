//! Emitters and environment as tables of cumulative probabilities in integers, which the shader compares exactly.

use crate::gpu::layout::{Dispatch, NONE};
use crate::transport::environment::{Environment, row_cosines};
use crate::transport::lit::LitScene;
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;

/// Bits of the random number that selects an object or an environment pixel.
const CHOICE_BITS: i32 = 53;
/// Bits of the random number that selects a triangle.
const TRIANGLE_BITS: i32 = 48;

/// Objects with positive probability, then their triangles: (low word, high word, first entry or slot, number of entries); and the
/// number of objects. `slot_of` is the slot of each triangle ([`NONE`] for triangles that cannot be hit).
pub(super) fn emitters(lit: &LitScene, slot_of: &[u32]) -> (Vec<[u32; 4]>, u32) {
    let probability = |object: usize| lit.emitters.probability(object);
    let drawn: Vec<usize> = (0..lit.scene.objects.len())
        .filter(|&object| probability(object) > 0.0 && lit.emitters.pdf(object as u32) > 0.0)
        .collect();
    let probabilities: Vec<f64> = drawn.iter().map(|&object| probability(object)).collect();
    let chosen = thresholds(&probabilities, CHOICE_BITS);
    let mut entries = vec![[0; 4]; drawn.len()];
    for (index, (&object, threshold)) in drawn.iter().zip(chosen).enumerate() {
        let first = entries.len() as u32;
        let all = lit.scene.objects[object].triangles.iter().copied();
        let triangles: Vec<u32> = all.filter(|&t| slot_of[t as usize] != NONE).collect();
        let area = |&t: &u32| f64::from(lit.scene.areas[t as usize]);
        let areas: Vec<f64> = triangles.iter().map(area).collect();
        let drawn = thresholds(&areas, TRIANGLE_BITS);
        for (threshold, &t) in drawn.into_iter().zip(&triangles) {
            entries.push(entry(threshold, slot_of[t as usize], 0));
        }
        entries[index] = entry(threshold, first, triangles.len() as u32);
    }
    (entries, drawn.len() as u32)
}

/// The words of the environment, as `environment.wgsl` describes them, and its part of the dispatch parameters.
pub(super) fn environment(map: &Environment) -> (Vec<[u32; 4]>, Dispatch) {
    let [width, height] = map.size();
    let share = map.sun_share();
    let mut words: Vec<[u32; 4]> = (map.pixels().iter().enumerate())
        .map(|(pixel, radiance)| bits(*radiance, map.pixel_pdf(pixel)))
        .collect();
    let before = std::iter::once(0.0).chain(map.cumulative().iter().copied());
    let weights = (map.cumulative().iter().zip(before)).map(|(sum, before)| sum - before);
    // The sun comes first.
    let total = map.cumulative().last().copied().unwrap_or(0.0);
    let sun = if share < 1.0 {
        share / (1.0 - share) * total
    } else {
        1.0
    };
    let weights: Vec<f64> = std::iter::once(sun).chain(weights).collect();
    let drawn = thresholds(&weights, CHOICE_BITS);
    let pixels = drawn[1..].iter().enumerate();
    words.extend(pixels.map(|(pixel, &threshold)| entry(threshold, map.is_open(pixel).into(), 0)));
    words.extend((0..height).map(|row| {
        let (top, bottom) = row_cosines(row, height);
        [(top as f32).to_bits(), (bottom as f32).to_bits(), 0, 0]
    }));
    let above = map.above();
    words.extend((above.iter()).flat_map(|(pixels, _)| pixels.iter().map(|r| bits(*r, 0.0))));
    let mut description = Dispatch {
        lights: [0, 0, width as u32, height as u32],
        ..Dispatch::default()
    };
    if let Surroundings::Box { min, max } = map.surroundings() {
        description.box_low = min.extend(1.0).to_array();
        description.box_high = max.extend(0.0).to_array();
    }
    if let Some((_, up)) = above {
        description.above = up.extend(1.0).to_array();
    }
    if let Some(sun) = map.sun().filter(|_| share > 0.0) {
        description.sun = sun.direction.extend(share as f32).to_array();
        let light = sun.irradiance / Sun::SOLID_ANGLE;
        description.sun_light = light.extend(1.0 / Sun::SOLID_ANGLE).to_array();
        description.sun_choice = entry(drawn[0], 0, 0);
    }
    (words, description)
}

fn bits(v: Vec3, w: f32) -> [u32; 4] {
    v.extend(w).to_array().map(f32::to_bits)
}

/// Cumulative probabilities of weights in units of 2^-bits; the last is 1 if any weight is positive.
fn thresholds(weights: &[f64], bits: i32) -> Vec<u64> {
    let total: f64 = weights.iter().sum();
    let scale = 2f64.powi(bits);
    let mut sum = 0.0;
    let mut threshold = |weight: &f64| {
        sum += weight;
        (sum / total * scale).ceil() as u64
    };
    weights.iter().map(&mut threshold).collect()
}

fn entry(threshold: u64, third: u32, fourth: u32) -> [u32; 4] {
    [threshold as u32, (threshold >> 32) as u32, third, fourth]
}
