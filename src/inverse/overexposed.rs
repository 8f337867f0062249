//! Lamps that photographs show saturated: their other pixels are mixtures.
//!
//! Where most of what a photograph shows of an object is saturated, the rest is darker because the pixel, the lens or the mesh's
//! outline mixes the object with what is beside it. Fitted as if it were measured, it would hold a lamp's light at the
//! level of saturation, and make up for the rest by surfaces that are too white.

use crate::capture::photograph::Photograph;
use crate::inverse::solver::Problem;
use crate::inverse::survey::{Survey, SurveyedPixel};
use glam::{BVec3, Vec3};
use std::sync::Arc;

/// The problem with lower bounds for such pixels, channel by channel; `None` where there are none.
///
/// Also bounds are the pixels at the edges of such an object in photographs that do not show it saturated.
pub fn bounded(problem: &Problem, survey: &Survey) -> Option<Problem> {
    let (frames, objects) = (problem.photographs.len(), survey.seen.len());
    let counts = Counts::new(problem, survey);
    let overexposed = |frame: usize, object: usize| counts.mostly_saturated(frame, object);
    let ever: Vec<BVec3> = (0..objects)
        .map(|object| {
            (0..frames).fold(BVec3::FALSE, |ever, frame| {
                ever | overexposed(frame, object)
            })
        })
        .collect();
    if !ever.iter().any(|ever| ever.any()) {
        return None;
    }
    let mut limits: Vec<Vec<Vec3>> = vec![Vec::new(); frames];
    for pixel in &survey.pixels {
        let Some(&ever) = ever.get(pixel.object as usize).filter(|ever| ever.any()) else {
            continue;
        };
        let (frame, index) = (pixel.frame as usize, pixel.pixel as usize);
        let bound = match pixel.inside {
            true => overexposed(frame, pixel.object as usize),
            false => ever,
        };
        let photograph = &problem.photographs[frame];
        let limits = &mut limits[frame];
        if limits.is_empty() {
            limits.extend((0..photograph.pixels.len()).map(|i| photograph.limit(i)));
        }
        let shown = photograph.pixels[index].min(limits[index]);
        limits[index] = Vec3::select(bound, shown, limits[index]);
    }
    let photographs = problem.photographs.iter().zip(limits);
    Some(Problem {
        scene: problem.scene.clone(),
        photographs: photographs
            .map(|(photograph, limits)| match limits.is_empty() {
                true => photograph.clone(),
                false => Arc::new(Photograph {
                    limits,
                    ..(**photograph).clone()
                }),
            })
            .collect(),
    })
}

/// Pixels by photograph and object: all of them, and those that each channel is saturated in.
struct Counts {
    objects: usize,
    /// Pixels away from edges, and all pixels where there are no such.
    counts: Vec<[[u32; 4]; 2]>,
}

impl Counts {
    fn new(problem: &Problem, survey: &Survey) -> Self {
        let objects = survey.seen.len();
        let mut counts = vec![[[0; 4]; 2]; problem.photographs.len() * objects];
        let fitted = |pixel: &&SurveyedPixel| !pixel.held_out && (pixel.object as usize) < objects;
        for pixel in survey.pixels.iter().filter(fitted) {
            let photograph = &problem.photographs[pixel.frame as usize];
            let saturated = photograph.saturated(pixel.pixel as usize);
            let of = &mut counts[pixel.frame as usize * objects + pixel.object as usize];
            for kind in [pixel.pure.then_some(0), Some(1)].into_iter().flatten() {
                of[kind][0] += 1;
                for channel in 0..3 {
                    of[kind][1 + channel] += u32::from(saturated.test(channel));
                }
            }
        }
        Self { objects, counts }
    }

    /// In which channels most of an object's pixels in a photograph are saturated.
    fn mostly_saturated(&self, frame: usize, object: usize) -> BVec3 {
        let [pure, all] = self.counts[frame * self.objects + object];
        let [pixels, r, g, b] = if pure[0] > 0 { pure } else { all };
        BVec3::from([r, g, b].map(|saturated| 2 * saturated > pixels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::settings::Settings;
    use crate::room::Room;
    use crate::room::photographs::Rendering;

    #[test]
    fn the_edges_of_a_saturated_lamp_are_bounds_and_a_wall_stays_measured() {
        let room = Room::new();
        let rendering = Rendering {
            seed: 3,
            samples: 1,
            size: [64, 48],
        };
        let lit = room.lit(rendering.size).expect("a room");
        // White is what lamps and their edges show, grey all else; white saturates, in red and green alone.
        let photographs = crate::room::photographs::render(&room, &rendering).expect("photographs");
        let photographs: Vec<Photograph> = (photographs.into_iter())
            .map(|photograph| Photograph {
                saturation: Vec3::new(1.0, 1.0, 9.0),
                ..photograph
            })
            .collect();
        let problem = |photographs: &[Photograph]| Problem {
            scene: lit.scene.clone(),
            photographs: photographs.iter().cloned().map(Arc::new).collect(),
        };
        let unsaturated: Vec<Photograph> = (photographs.iter())
            .map(|photograph| Photograph {
                saturation: Vec3::INFINITY,
                ..photograph.clone()
            })
            .collect();
        let plain = problem(&unsaturated);
        let settings = Settings::default();
        let survey = Survey::new(&plain, &settings, usize::MAX);
        assert!(bounded(&plain, &survey).is_none());
        // Pixels of lamps are at 2 inside, 0.4 at the edge; of all else at 0.3.
        let emits = |object: u32| {
            let material = lit.materials.get(object as usize);
            material.is_some_and(|m| m.emission != Vec3::ZERO)
        };
        let mut painted = photographs;
        for pixel in &survey.pixels {
            let value = match (emits(pixel.object), pixel.pure) {
                (true, true) => 1.0,
                (true, false) => 0.4,
                _ => 0.3,
            };
            painted[pixel.frame as usize].pixels[pixel.pixel as usize] = Vec3::splat(value);
        }
        let given = problem(&painted);
        let bounded = bounded(&given, &survey).expect("lamps are saturated");
        let mut edges = 0;
        for pixel in &survey.pixels {
            let photograph = &bounded.photographs[pixel.frame as usize];
            let bound = photograph.saturated(pixel.pixel as usize);
            let wanted = BVec3::new(emits(pixel.object), emits(pixel.object), false);
            assert_eq!(bound, wanted, "{pixel:?}");
            edges += u32::from(wanted.any() && !pixel.pure);
        }
        assert!(edges > 30, "{edges}");
    }
}
