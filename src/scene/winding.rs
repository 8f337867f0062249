//! Corrects the winding of triangles where the photographs contradict it.
//!
//! A triangle emits on its front only, so winding matters for lamps. It is reversed in two cases:
//!
//! 1. Nearly all pixels see backs: the file has the opposite convention, and all seen objects are reversed.
//! 2. An object is seen from its back only, and is as bright there as the brightest surfaces seen from their front: it emits on its
//!    back.
//!
//! A dim back is no contradiction (a lamp that lights the ceiling is seen from below). Unseen objects are never reversed.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::scene::visibility::{IdBuffers, NOTHING};
use std::sync::Arc;

/// Fraction of an object's pixels that must see its back to count as seen from the back only.
const BACK_FRACTION: f64 = 0.99;
/// Minimum number of pixels of an object for a decision.
const MIN_PIXELS: u64 = 16;
/// Quantile of the luminances of all other objects that counts as the brightest surfaces.
const BRIGHT_QUANTILE: f64 = 0.95;

/// Reverses the winding of objects where the photographs contradict it; returns a sentence about each change.
///
/// `scene`, `ids` and `photographs` (one per camera, of its size) must be those of `capture`. Any change makes the scene invalid.
pub fn turn_over(
    capture: &mut Capture,
    scene: &Scene,
    ids: &IdBuffers,
    photographs: &[Arc<Photograph>],
) -> Vec<String> {
    let front: u64 = ids.front_pixels.iter().sum();
    let back: u64 = ids.back_pixels.iter().sum();
    if back >= MIN_PIXELS && back as f64 >= BACK_FRACTION * (front + back) as f64 {
        let seen: Vec<bool> = (0..scene.objects.len())
            .map(|object| ids.seen_pixels(object) > 0)
            .collect();
        reverse(capture, &seen);
        return vec![
            "the photographs see the mesh from the back of its triangles; all objects that are seen were turned over"
                .into(),
        ];
    }

    // Collect luminances of each object seen from its back only, and of all others together.
    let only_back: Vec<bool> = (0..scene.objects.len())
        .map(|object| {
            let seen = ids.seen_pixels(object);
            seen >= MIN_PIXELS && ids.back_pixels[object] as f64 >= BACK_FRACTION * seen as f64
        })
        .collect();
    if only_back.iter().all(|&b| !b) {
        return Vec::new();
    }
    let mut others = Vec::new();
    let mut own: Vec<Vec<f64>> = vec![Vec::new(); scene.objects.len()];
    for (photograph, triangles) in photographs.iter().zip(&ids.triangles) {
        for (index, (pixel, &triangle)) in photograph.pixels.iter().zip(triangles).enumerate() {
            if triangle == NOTHING || !photograph.is_usable(index) {
                continue;
            }
            let object = scene.object_of[triangle as usize] as usize;
            let values = if only_back[object] {
                &mut own[object]
            } else {
                &mut others
            };
            values.push(f64::from(luminance(*pixel)));
        }
    }
    let Some(bright) = quantile(&mut others, BRIGHT_QUANTILE) else {
        return Vec::new();
    };
    let emits: Vec<bool> = own
        .iter_mut()
        .map(|values| quantile(values, 0.5).is_some_and(|median| median > 0.0 && median >= bright))
        .collect();
    reverse(capture, &emits);
    scene
        .objects
        .iter()
        .zip(&emits)
        .filter(|(_, emits)| **emits)
        .map(|(object, _)| {
            format!(
                "object {:?} shines on the back of its triangles; it was turned over",
                object.name
            )
        })
        .collect()
}

/// Reverses the winding of the triangles of the chosen objects.
fn reverse(capture: &mut Capture, chosen: &[bool]) {
    let mesh = &mut capture.mesh;
    for (index, &object) in mesh.object_of.iter().enumerate() {
        if chosen[object as usize] {
            mesh.triangles[index].swap(1, 2);
            if let Some(uvs) = mesh.corner_uvs.get_mut(index) {
                uvs.swap(1, 2);
            }
        }
    }
}
