//! The truth of unnamed mesh segments, from the true values of the pixels that see them.

use crate::capture::truth::{ObjectTruth, Truth};
use crate::room::generated::Generated;
use crate::scene::Scene;
use glam::{DVec3, Vec3};

/// A segment is a lamp if at least this fraction of its pixels sees one.
const LAMP: f64 = 0.5;
/// A segment is no lamp if at most this fraction of its pixels sees one. In between it has no truth.
const NO_LAMP: f64 = 0.1;

/// Sums over the pixels that see a segment.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    surfaces: f64,
    albedo: DVec3,
    lamps: f64,
    emission: DVec3,
}

/// The truth of each segment of a mesh without objects, over the pixels of all photographs whose centres see it: mean
/// true albedo of the pixels that see no lamp, or mean true emission if it is a lamp.
pub fn truth(room: &Generated, scene: &Scene) -> Truth {
    let mut sums = vec![Sum::default(); scene.objects.len()];
    for (frame, triangles) in scene.ids().triangles.iter().enumerate() {
        let albedo = room.albedo(frame);
        let truly_seen = &room.lit.scene.ids().triangles[frame];
        let pixels = albedo.pixels.iter().zip(truly_seen);
        for (&triangle, (albedo, &truly)) in triangles.iter().zip(pixels) {
            let Some(&segment) = scene.object_of.get(triangle as usize) else {
                continue;
            };
            let object = room.lit.scene.object_of.get(truly as usize);
            let emission = object.map_or(Vec3::ZERO, |&o| room.lit.materials[o as usize].emission);
            let sum = &mut sums[segment as usize];
            if emission == Vec3::ZERO {
                sum.surfaces += 1.0;
                sum.albedo += albedo.as_dvec3();
            } else {
                sum.lamps += 1.0;
                sum.emission += emission.as_dvec3();
            }
        }
    }
    let objects = scene.objects.iter().zip(&sums);
    let known = objects.filter_map(|(object, sum)| Some((object.name.clone(), sum.truth()?)));
    Truth {
        objects: known.collect(),
    }
}

impl Sum {
    fn truth(&self) -> Option<ObjectTruth> {
        let pixels = self.surfaces + self.lamps;
        if pixels > 0.0 && self.lamps >= LAMP * pixels {
            return Some(ObjectTruth {
                emission: self.emission / self.lamps,
                ..ObjectTruth::default()
            });
        }
        (pixels > 0.0 && self.lamps <= NO_LAMP * pixels).then(|| ObjectTruth {
            albedo: Some(self.albedo / self.surfaces),
            ..ObjectTruth::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_what_most_of_its_pixels_see() {
        let sum = |surfaces: f64, lamps: f64| Sum {
            surfaces,
            albedo: DVec3::splat(0.5 * surfaces),
            lamps,
            emission: DVec3::splat(7.0 * lamps),
        };
        let wall = sum(95.0, 5.0).truth().expect("known");
        assert_eq!(wall.albedo, Some(DVec3::splat(0.5)));
        assert!(!wall.is_emitter());
        let lamp = sum(40.0, 60.0).truth().expect("known");
        assert_eq!((lamp.albedo, lamp.emission), (None, DVec3::splat(7.0)));
        assert_eq!(sum(80.0, 20.0).truth(), None);
        assert_eq!(sum(0.0, 0.0).truth(), None);
    }
}
