//! The twin of a capture: a room with its mesh and cameras, and with the colours and lamps that a solve found. Its
//! truth is known, so that studies can measure errors.

use crate::capture::camera::Pose;
use crate::capture::mesh::Mesh;
use crate::error::{Error, Result};
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::room::Room;
use crate::room::cameras::View;
use crate::room::photographs::Rendering;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::study::experiments::box_room;
use crate::study::experiments::course::{cache_settings, solved};
use crate::study::experiments::study::Bench;
use crate::study::subject::Subject;
use crate::transport::material::Material;
use glam::Vec3;

/// Largest albedo, as in the studies' own rooms; whiter ones would need very long paths.
const MAX_ALBEDO: f32 = 0.98;
/// Range of the samples per pixel of its photographs.
const SAMPLES: [u64; 2] = [16, 128];

/// The room that a study uses, and the settings of its photographs.
#[derive(Debug, Clone)]
pub struct Studied {
    pub room: Room,
    pub rendering: Rendering,
    /// Description, as the beginning of a sentence.
    pub words: String,
}

/// The room of a study: the twin of its capture, or the standard box room, photographed by `rendering`. Fails as [`twin`] does.
pub fn studied(bench: &Bench, rendering: Rendering) -> Result<Studied> {
    Ok(twin(bench)?.unwrap_or_else(|| Studied {
        room: box_room::standard(),
        rendering,
        words: format!("A box room of mean albedo {}", box_room::ALBEDO),
    }))
}

/// The twin of a study's capture, with photographs as small as those of the box room; `None` if the study uses its own rooms.
///
/// # Errors
/// The capture cannot be solved, it has no lamp, or the study is stopped.
pub fn twin(bench: &Bench) -> Result<Option<Studied>> {
    let [width, _] = box_room::rendering(bench.quick).size;
    let paths = if bench.quick { 1_000_000 } else { 8_000_000 };
    twin_of_size(bench, width, paths)
}

/// The same with photographs of `long_side` pixels along their longer side. Each pixel gets between 16 and 128 of `paths` paths.
pub fn twin_of_size(bench: &Bench, long_side: u32, paths: u64) -> Result<Option<Studied>> {
    let Some(subject) = bench.subject else {
        return Ok(None);
    };
    bench.begin(&format!("solving {} for its twin", subject.name))?;
    let settings = Settings {
        exposures: true,
        ..cache_settings(1, bench.quick)
    };
    let estimate = solved(bench, subject, &settings)?.estimate;
    let room = room_of(subject, &estimate)?;
    let rendering = rendering(&subject.problem.scene.cameras, long_side, paths);
    let [width, height] = rendering.size;
    Ok(Some(Studied {
        words: format!(
            "The {}: its mesh, its views through ideal lenses of the first one's shape, and the colours and lamps that the transport cache found in \
             it (one an object, none above {MAX_ALBEDO}, light from outside left away), photographed with all bounces in {} photographs of {width} × \
             {height} pixels with {} paths each, so that the truth is known",
            room.name,
            room.views.len(),
            rendering.samples,
        ),
        room,
        rendering,
    }))
}

/// The room that an estimate describes.
fn room_of(subject: &Subject, estimate: &Estimate) -> Result<Room> {
    let scene = &*subject.problem.scene;
    let materials: Vec<Material> = (estimate.objects.iter())
        .map(|object| {
            let albedo = object.albedo.clamp(Vec3::ZERO, Vec3::splat(MAX_ALBEDO));
            Material::diffuse(albedo, object.emission)
        })
        .collect();
    if materials.iter().all(|m| m.emission == Vec3::ZERO) {
        return Err(Error::new(
            &subject.name,
            "no lamp was found on its mesh, so that its twin would be dark",
            "run the study on rooms of its own",
        ));
    }
    Ok(Room {
        name: format!("twin of {}", subject.name),
        mesh: mesh(scene),
        materials,
        views: scene.cameras.iter().map(|c| view(scene, c)).collect(),
    })
}

/// The scene's triangles in the capture's coordinates.
fn mesh(scene: &Scene) -> Mesh {
    let placed = |p: &Vec3| p.as_dvec3() + scene.origin;
    Mesh {
        positions: scene.positions.iter().map(placed).collect(),
        triangles: scene.triangles.clone(),
        object_of: scene.object_of.clone(),
        objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
        ..Mesh::default()
    }
}

/// A camera's view through a lens without distortion.
fn view(scene: &Scene, camera: &Camera) -> View {
    let lens = &camera.intrinsics;
    View {
        pose: Pose {
            rotation: camera.rotation.as_dmat3(),
            center: camera.center.as_dvec3() + scene.origin,
        },
        half_field: 0.5 * f64::from(lens.width) / lens.fx,
    }
}

/// Settings of photographs with the aspect ratio of the first camera.
fn rendering(cameras: &[Camera], long_side: u32, paths: u64) -> Rendering {
    let size = (cameras.first()).map_or([1; 2], |camera| {
        let small = camera.shrunk(long_side).intrinsics;
        [small.width, small.height]
    });
    let pixels = cameras.len() as u64 * u64::from(size[0]) * u64::from(size[1]);
    let [min, max] = SAMPLES;
    let samples = (paths / pixels.max(1)).clamp(min, max) as u32;
    Rendering::new(box_room::PHOTOGRAPH_SEED, samples, size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::Hit;
    use crate::study::trade::Metric;
    use std::time::Duration;

    fn bench(subject: &Subject) -> Bench<'_> {
        Bench {
            quick: true,
            time: Duration::from_secs(1),
            seeds: 1,
            subject: Some(subject),
            say: &|_| {},
            show: &|_| {},
            stopped: &|| false,
        }
    }

    #[test]
    fn a_twin_has_the_captures_views_and_nearly_its_photographs_and_its_truth_is_its_own() {
        let mut subject = box_room::photographed(true).expect("a room");
        subject.metric = Metric::HeldOut;
        let twin = twin(&bench(&subject));
        let twin = twin.expect("solved").expect("on a capture");
        let original = box_room::standard();
        for (view, other) in twin.room.views.iter().zip(&original.views) {
            assert!(view.pose.center.distance(other.pose.center) < 1e-5);
            assert!((view.half_field - other.half_field).abs() < 1e-12);
        }
        assert_eq!(twin.room.mesh.triangles, original.mesh.triangles);
        let truth = box_room::truth(&original);
        for (material, wanted) in twin.room.materials.iter().zip(&truth.albedo) {
            let found = material.albedo_at(&Hit::default());
            assert!((found - *wanted).abs().max_element() < 0.1 || material.emission != Vec3::ZERO);
        }
        let photographed = Subject::of_room(&twin.room, &twin.rendering).expect("a room");
        assert!(photographed.truth().is_some());
        let mean = |subject: &Subject| {
            let pixels = subject.problem.photographs.iter().flat_map(|p| &p.pixels);
            pixels
                .map(|pixel| f64::from(pixel.element_sum()))
                .sum::<f64>()
        };
        let ratio = mean(&photographed) / mean(&subject);
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }

    #[test]
    fn a_dark_capture_has_no_twin() {
        let mut room = box_room::standard();
        (room.materials.iter_mut()).for_each(|material| material.emission = Vec3::ZERO);
        let subject = Subject::of_room(&room, &box_room::rendering(true)).expect("a room");
        let refused = twin(&bench(&subject)).expect_err("no lamp");
        assert!(refused.to_string().contains("no lamp"), "{refused}");
    }
}
