//! Which side of a surface is its front, where the photographs plainly contradict the file.
//!
//! A triangle emits on its front only, so winding matters for lamps alone. It is kept unless the photographs show that
//! it cannot be right:
//!
//! 1. nearly every pixel sees a back: the file winds the other way round, and every object that is seen is turned over;
//! 2. an object is seen from its back only, and is there as bright as the brightest surfaces that are seen from their
//!    front: it shines on the side on which it could not.
//!
//! A dim back is no contradiction (a lamp that lights the ceiling is seen from below), and objects that no photograph
//! sees are never turned over.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::scene::visibility::{IdBuffers, NOTHING};
use std::sync::Arc;

/// Fraction of an object's pixels that must see its back.
const ONLY_BACK: f64 = 0.99;
/// Fewer pixels say nothing about an object.
const ENOUGH_PIXELS: u64 = 16;
/// "The brightest surfaces": this quantile of the pixels that see other objects from the front.
const BRIGHT: f64 = 0.95;

/// Turns over the objects of `capture` whose winding the photographs contradict; says which, a sentence each.
///
/// `scene`, `ids` and `photographs` (one a camera, of its size) must be those of `capture`. If anything is returned the
/// scene must be built again.
pub fn turn_over(
    capture: &mut Capture,
    scene: &Scene,
    ids: &IdBuffers,
    photographs: &[Arc<Photograph>],
) -> Vec<String> {
    let front: u64 = ids.front_pixels.iter().sum();
    let back: u64 = ids.back_pixels.iter().sum();
    if back >= ENOUGH_PIXELS && back as f64 >= ONLY_BACK * (front + back) as f64 {
        let seen: Vec<bool> = (0..scene.objects.len())
            .map(|object| ids.seen_pixels(object) > 0)
            .collect();
        turn(capture, &seen);
        return vec![
            "the photographs see the mesh from the back of its triangles; all objects that are seen were turned over"
                .into(),
        ];
    }

    // Luminances of each object that is seen from its back only, and of everything else.
    let only_back: Vec<bool> = (0..scene.objects.len())
        .map(|object| {
            let seen = ids.seen_pixels(object);
            seen >= ENOUGH_PIXELS && ids.back_pixels[object] as f64 >= ONLY_BACK * seen as f64
        })
        .collect();
    if only_back.iter().all(|&b| !b) {
        return Vec::new();
    }
    let mut others = Vec::new();
    let mut own: Vec<Vec<f64>> = vec![Vec::new(); scene.objects.len()];
    for (photograph, triangles) in photographs.iter().zip(&ids.triangles) {
        for (index, (pixel, &triangle)) in photograph.pixels.iter().zip(triangles).enumerate() {
            if triangle == NOTHING || !photograph.usable.get(index).copied().unwrap_or(true) {
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
    let Some(bright) = quantile(&mut others, BRIGHT) else {
        return Vec::new();
    };
    let shines: Vec<bool> = own
        .iter_mut()
        .map(|values| quantile(values, 0.5).is_some_and(|median| median > 0.0 && median >= bright))
        .collect();
    turn(capture, &shines);
    scene
        .objects
        .iter()
        .zip(&shines)
        .filter(|(_, shines)| **shines)
        .map(|(object, _)| {
            format!(
                "object {:?} shines on the back of its triangles; it was turned over",
                object.name
            )
        })
        .collect()
}

/// Reverses the winding of the triangles of the chosen objects.
fn turn(capture: &mut Capture, chosen: &[bool]) {
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
