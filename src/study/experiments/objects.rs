//! Single objects whose photographs are far more accurate than the required fit.

use crate::capture::photograph::Photograph;
use crate::error::{Error, Result};
use crate::room::Room;
use crate::room::cameras::View;
use crate::room::linear_photograph;
use crate::room::photographs::{Rendering, render};
use crate::room::shape::Modeller;
use crate::room::truth::seen_pixels;
use crate::scene::visibility::NOTHING;
use crate::study::experiments::box_room;
use crate::study::experiments::chair::chair;
use crate::study::experiments::closed_form;
use crate::study::experiments::twin::Studied;
use crate::study::subject::Subject;
use crate::transport::material::Material;
use glam::{DAffine3, DVec3, Vec3};
use std::cmp::Reverse;

/// An object to be photographed and fitted.
pub struct Posed {
    pub name: String,
    /// Its name in the scene.
    pub object: String,
    /// Sentence on the object and its photographs.
    pub how: String,
    /// The scene with its photographs.
    pub subject: Subject,
    /// Error in percent that the paper reports for a similar object.
    pub target: f64,
    /// Relative error of the object's mean radiance due to the photographs' noise.
    pub floor: f64,
}

/// A convex object of one colour under a black lamp, with photographs in closed form.
pub fn convex(quick: bool) -> Result<Posed> {
    let size = if quick { [48, 36] } else { [128, 96] };
    let room = gem();
    let photographs = closed_form::photographs(&room, size);
    Ok(Posed {
        name: "convex, under a lamp".to_owned(),
        object: "gem".to_owned(),
        how: format!(
            "A convex polyhedron of {} triangles below a square black lamp, nothing else, in {} photographs (the last one of the \
             lamp) of {} × {} pixels in closed form (Lambert's polygon irradiance, 25 points for each part of a pixel), \
             rounded to 32 bits. They show both whole, outlines included.",
            room.mesh.triangles.len() - 2,
            room.views.len(),
            size[0],
            size[1],
        ),
        subject: Subject::of_photographs(&room, photographs)?,
        target: 3.7e-4,
        // The rounding of one value bounds that of a mean.
        floor: f64::from(f32::EPSILON) * 0.5,
    })
}

/// The convex object and its lamp, each whole in the views.
fn gem() -> Room {
    let mut modeller = Modeller::default();
    modeller.object("gem");
    modeller.lathe(&[[0.2, 0.0], [0.5, 0.2], [0.15, 0.45]], 7);
    modeller.object("lamp");
    let corner = DVec3::new(-0.5, 1.6, -0.5);
    modeller.grid(corner, DVec3::X, DVec3::Z, 1, 1);
    let views = [
        [[1.1, 0.9, 0.9], [0.0, 0.22, 0.0]],
        [[-1.2, 0.7, 0.5], [0.0, 0.22, 0.0]],
        [[0.2, 1.0, -1.2], [0.0, 0.22, 0.0]],
        [[0.9, 0.2, -0.8], [0.0, 1.6, 0.0]],
    ];
    Room {
        name: "gem".to_owned(),
        mesh: modeller.mesh,
        materials: vec![
            Material::diffuse(Vec3::new(0.65, 0.45, 0.25), Vec3::ZERO),
            Material::diffuse(Vec3::ZERO, Vec3::new(12.0, 10.0, 8.0)),
        ],
        views: View::all(&views),
    }
}

/// A chair that shadows itself, in a room with interreflection, with path-traced photographs of all bounces.
pub fn shadowed(quick: bool) -> Result<Posed> {
    let (size, samples) = if quick {
        ([32, 24], 32)
    } else {
        ([96, 72], 128)
    };
    let object = "chair";
    let mut room = box_room::furnished("chair in a room", 0.5, 0.25, object, |m| {
        let turn = DAffine3::from_rotation_y(0.5);
        let place = DAffine3::from_translation(DVec3::new(-0.3, 0.0, -0.25)) * turn;
        m.placed(place, chair);
    });
    // Close-up views of the chair, besides those of the room.
    for eye in [[0.5, 0.8, 0.5], [-0.8, 1.0, 0.5], [0.5, 0.5, -0.7]] {
        let target = DVec3::new(-0.3, 0.45, -0.25);
        room.views.push(View::towards(eye.into(), target));
    }
    let rendering = Rendering::new(box_room::PHOTOGRAPH_SEED, samples, size);
    let (subject, floor) = photographed(&room, &rendering, object)?;
    Ok(Posed {
        name: "self-shadowing, in a room".to_owned(),
        object: object.to_owned(),
        how: format!(
            "A chair in a box room of mean albedo 0.5, all of whose seven reflectors and whose lamp are unknown too, in {} \
             photographs of {} × {} pixels with {} paths each and all bounces, from random numbers that the solver does not \
             use, kept in 32 bits.",
            room.views.len(),
            size[0],
            size[1],
            2 * samples,
        ),
        subject,
        target: 0.14,
        floor,
    })
}

/// The most visible object of a capture's twin that is no lamp; fails if all are. All other objects are unknown too.
pub fn of_twin(twin: &Studied) -> Result<Posed> {
    let room = &twin.room;
    let seen = seen_pixels(&room.lit(twin.rendering.size)?);
    let reflectors =
        (0..seen.len()).filter(|&i| seen[i] > 0 && room.materials[i].emission == Vec3::ZERO);
    let object = reflectors.max_by_key(|&i| (seen[i], Reverse(i)));
    let object = object
        .map(|i| room.mesh.objects[i].clone())
        .ok_or_else(|| {
            Error::new(
                &room.name,
                "every visible object is a lamp",
                "run the study on rooms of its own",
            )
        })?;
    let (subject, floor) = photographed(room, &twin.rendering, &object)?;
    Ok(Posed {
        name: format!("{object}, in the {}", room.name),
        how: format!(
            "{}, twice with other random numbers; of its {} objects, all of them unknown, the errors of {object} are told.",
            twin.words,
            seen.len(),
        ),
        object,
        subject,
        target: 0.14,
        floor,
    })
}

/// Photographs a room in two independent halves: their mean, and the relative error of an object's mean radiance by their noise.
fn photographed(room: &Room, rendering: &Rendering, object: &str) -> Result<(Subject, f64)> {
    let half = |seed| render(room, &Rendering { seed, ..*rendering });
    let halves = [half(rendering.seed)?, half(rendering.seed + 1)?];
    let mean = |(a, b): (&Photograph, &Photograph)| {
        let pixels = a.pixels.iter().zip(&b.pixels);
        let means = pixels.map(|(&a, &b)| (a + b) * 0.5).collect();
        linear_photograph(rendering.size, means)
    };
    let photographs: Vec<Photograph> = halves[0].iter().zip(&halves[1]).map(mean).collect();
    let subject = Subject::of_photographs(room, photographs)?;
    let floor = noise_of(&subject, object, &halves);
    Ok((subject, floor))
}

/// Relative standard error of an object's mean radiance over all channels, from two independent halves of the photographs.
fn noise_of(subject: &Subject, object: &str, halves: &[Vec<Photograph>; 2]) -> f64 {
    let scene = &subject.problem.scene;
    let triangles = &scene.ids().triangles;
    let (mut squares, mut count) = (0.0, 0.0);
    for (frame, (a, b)) in halves[0].iter().zip(&halves[1]).enumerate() {
        for (pixel, (&a, &b)) in a.pixels.iter().zip(&b.pixels).enumerate() {
            let triangle = triangles[frame][pixel];
            if triangle == NOTHING {
                continue;
            }
            let seen = scene.object_of[triangle as usize] as usize;
            let level = (a + b).as_dvec3();
            if scene.objects[seen].name == object && level.min_element() > 0.0 {
                let relative = (a - b).as_dvec3() / level;
                squares += relative.length_squared() / 3.0;
                count += 1.0;
            }
        }
    }
    f64::sqrt(squares) / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::settings::{LightSampling, Preset, Settings};
    use crate::study::experiments::course::{cache_settings, solved};
    use crate::study::experiments::study::Bench;
    use std::time::Duration;

    /// From so near that no outline of the object is seen, and with light sampling alone, paths have next to no noise.
    #[test]
    fn a_convex_object_comes_out_as_exactly_as_its_closed_form_allows() {
        let mut room = gem();
        room.views = View::all(&[
            [[0.02, 0.57, 0.03], [0.0, 0.3, 0.0]],
            [[0.06, 0.57, 0.05], [0.05, 0.3, 0.02]],
            [[-0.05, 0.57, -0.04], [-0.05, 0.3, -0.02]],
            [[0.0, 1.2, 0.03], [0.0, 1.6, 0.0]],
        ]);
        let photographs = closed_form::photographs(&room, [48, 36]);
        let subject = Subject::of_photographs(&room, photographs).expect("a room");
        let bench = Bench {
            quick: true,
            time: Duration::MAX,
            seeds: 2,
            subject: None,
            say: &|_| {},
            show: &|_| {},
            stopped: &|| false,
        };
        for seed in bench.seeds() {
            let settings = Settings {
                preset: Preset::Balanced,
                light_sampling: LightSampling::Emitter,
                ..cache_settings(seed, true)
            };
            let solution = solved(&bench, &subject, &settings).expect("solved");
            let truth = subject.truth().expect("known");
            let errors = truth.errors(&subject.problem.scene, &solution.estimate);
            let gem = (errors.per_object.iter()).find(|(name, _)| name == "gem");
            let error = gem.and_then(|(_, errors)| errors.albedo_rel);
            assert!(error.is_some_and(|error| error < 1e-5), "{error:?}");
        }
    }

    #[test]
    fn the_closed_form_is_what_paths_render_on_the_mean() {
        // Also from farther away, where pixels see outlines.
        let mut room = gem();
        let eye = DVec3::new(1.1, 0.9, 0.9);
        room.views
            .push(View::towards(eye, DVec3::new(0.0, 0.7, 0.0)));
        let size = [32, 24];
        let exact = closed_form::photographs(&room, size);
        let rendering = Rendering::new(3, 1024, size);
        let rendered = render(&room, &rendering).expect("rendered");
        for (frame, (exact, rendered)) in exact.iter().zip(&rendered).enumerate() {
            let mut sums = [0.0; 2];
            for (a, b) in exact.pixels.iter().zip(&rendered.pixels) {
                // Five standard deviations where a pixel sees the edge of the lamp, whose radiance is 12.
                let spread = (12.0 * a.max_element() / rendering.samples as f32).sqrt();
                let off = (*a - *b).abs().max_element();
                assert!(off < 0.05 + 5.0 * spread, "{frame}: {a} {b}");
                sums[0] += f64::from(a.x);
                sums[1] += f64::from(b.x);
            }
            // Without outlines there is little noise.
            let alike = (sums[1] - sums[0]).abs() <= 2e-3 * sums[0];
            assert!(alike || frame == room.views.len() - 1, "{frame}: {sums:?}");
        }
    }
}
