//! Prepares a capture for solving: builds the scene, corrects windings, masks contradicting depth, and collects warnings.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::working::Working;
use crate::error::{Error, Result};
use crate::say::listed;
use crate::scene::Scene;
use crate::scene::depth;
use crate::scene::visibility::seen_area_fraction;
use crate::scene::winding::turn_over;
use std::sync::Arc;

/// Points on the mesh that estimate the seen area, with a standard error of at most 0.4 %.
const AREA_SAMPLES: u32 = 1 << 14;

/// A capture ready to be solved.
#[derive(Debug)]
pub struct Prepared {
    /// The capture at the working resolution, with corrected windings.
    pub capture: Capture,
    /// Its scene; camera sizes equal the photographs'.
    pub scene: Scene,
    /// The photographs at the working resolution, one per camera.
    pub photographs: Vec<Arc<Photograph>>,
    /// Fraction of the mesh's area that the photographs see, 0 to 1.
    pub seen_area_fraction: f64,
    /// Warnings of the reader, the photographs and the scene, each a full sentence.
    pub warnings: Vec<String>,
}

/// Builds the scene and its id buffers, and corrects windings (see [`crate::scene::winding`]).
///
/// # Errors
/// The mesh has no triangle with an area, or no photograph sees the mesh.
pub fn prepare(capture: &Capture, working: &Working) -> Result<Prepared> {
    let mut capture = capture.at(working);
    let mut scene = Scene::new(&capture)?;
    if (0..scene.cameras.len()).all(|frame| scene.ids().pixels_on_mesh(frame) == 0) {
        return Err(Error::new(
            &capture.name,
            "no photograph sees the mesh",
            "check that transform_matrix is camera-to-world (x right, y up, looking down -z) in the mesh's coordinates",
        ));
    }
    let mut warnings = capture.warnings.clone();
    warnings.extend(working.warnings.iter().cloned());
    let turned = turn_over(&mut capture, &scene, scene.ids(), &working.photographs);
    if !turned.is_empty() {
        warnings.extend(turned);
        // The seen triangles stay the same; only their sides change.
        let mut ids = scene.ids().clone();
        scene = Scene::new(&capture)?;
        ids.count_sides(&scene);
        scene = scene.with_ids(ids);
    }
    warnings.extend(unseen(&scene));
    let (photographs, contradictions) = depth::compare(&capture, &scene, &working.photographs);
    warnings.extend(contradictions);
    Ok(Prepared {
        seen_area_fraction: seen_area_fraction(&scene, AREA_SAMPLES),
        photographs,
        capture,
        scene,
        warnings,
    })
}

impl Prepared {
    /// A summary, a line each: counts, size, and what the photographs see.
    pub fn summary(&self) -> Vec<String> {
        let scene = &self.scene;
        let pixels: usize = self.photographs.iter().map(|p| p.pixels.len()).sum();
        let seen_objects = (0..scene.objects.len())
            .filter(|&object| scene.ids().seen_pixels(object) > 0)
            .count();
        let (low, high) = self.capture.mesh.bounds();
        let size = high - low;
        vec![
            format!(
                "{} in {}",
                count(scene.triangles.len(), "triangle"),
                count(scene.objects.len(), "object")
            ),
            format!(
                "{}, {} at the working resolution",
                count(self.photographs.len(), "photograph"),
                count(pixels, "pixel")
            ),
            format!("{:.4} × {:.4} × {:.4} m", size.x, size.y, size.z),
            format!(
                "the photographs see {:.0} % of the mesh and {seen_objects} of its objects",
                self.seen_area_fraction * 100.0
            ),
        ]
    }
}

/// Warnings about objects that no photograph sees, and about photographs that do not see the mesh.
fn unseen(scene: &Scene) -> Vec<String> {
    let ids = scene.ids();
    let objects: Vec<&str> = (scene.objects.iter().enumerate())
        .filter(|(index, _)| ids.seen_pixels(*index) == 0)
        .map(|(_, object)| object.name.as_str())
        .collect();
    let photographs: Vec<String> = (0..scene.cameras.len())
        .filter(|&frame| ids.pixels_on_mesh(frame) == 0)
        .map(|frame| format!("{frame:03}"))
        .collect();
    let unseen = (!objects.is_empty()).then(|| {
        let (count, names) = (count(objects.len(), "object"), listed(&objects));
        format!("no photograph sees {count}: {names}")
    });
    let blind = (!photographs.is_empty()).then(|| {
        let (count, names) = (count(photographs.len(), "photograph"), listed(&photographs));
        format!("{count} see nothing of the mesh: {names}")
    });
    unseen.into_iter().chain(blind).collect()
}

/// "1 object", "1,234 objects".
fn count(n: usize, one: &str) -> String {
    let digits = n.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let grouped: Vec<&str> = groups.filter_map(|g| std::str::from_utf8(g).ok()).collect();
    let plural = if n == 1 { "" } else { "s" };
    format!("{} {one}{plural}", grouped.join(","))
}
