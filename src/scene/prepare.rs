//! From a capture to a scene that can be solved, with a checked summary of what there is and what is odd.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::working::Working;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::scene::depth;
use crate::scene::visibility::seen_area_fraction;
use crate::scene::winding::turn_over;
use std::sync::Arc;

/// Points on the mesh for which it is asked whether a photograph sees them: a standard error of at most 0.4 %.
const AREA_SAMPLES: u32 = 1 << 14;
/// Lists of names end here, with the number of the rest.
const LISTED: usize = 5;

/// A capture ready to be solved.
#[derive(Debug)]
pub struct Prepared {
    /// The capture at the working resolution, with windings put right.
    pub capture: Capture,
    /// Its scene; camera sizes equal those of the photographs.
    pub scene: Scene,
    /// The photographs at the working resolution, one a camera.
    pub photographs: Vec<Arc<Photograph>>,
    /// Fraction of the mesh's area that the photographs see, 0 to 1.
    pub seen_area_fraction: f64,
    /// Warnings of the reader, the photographs and the scene, each a full sentence.
    pub warnings: Vec<String>,
}

/// Builds the scene, finds what the photographs see, and puts windings right (see [`crate::scene::winding`]).
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
        // Only the sides have changed.
        let mut ids = scene.ids().clone();
        scene = Scene::new(&capture)?;
        ids.count_sides(&scene);
        scene = scene.with_ids(ids);
    }
    warnings.extend(oddities(&scene));
    let compared = depth::compare(&capture, &scene, &working.photographs);
    warnings.extend(compared.warnings);
    Ok(Prepared {
        seen_area_fraction: seen_area_fraction(&scene, AREA_SAMPLES),
        photographs: compared.photographs,
        capture,
        scene,
        warnings,
    })
}

impl Prepared {
    /// What a person wants to know before solving, a line each: counts, size, what the photographs see.
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

/// Objects that no photograph sees, and photographs that do not see the mesh.
fn oddities(scene: &Scene) -> Vec<String> {
    let ids = scene.ids();
    let mut warnings = Vec::new();
    let unseen: Vec<&str> = (0..scene.objects.len())
        .filter(|&object| ids.seen_pixels(object) == 0)
        .map(|object| scene.objects[object].name.as_str())
        .collect();
    if !unseen.is_empty() {
        warnings.push(format!(
            "no photograph sees {}: {}",
            count(unseen.len(), "object"),
            list(&unseen)
        ));
    }
    let blind: Vec<String> = (0..scene.cameras.len())
        .filter(|&frame| ids.pixels_on_mesh(frame) == 0)
        .map(|frame| format!("{frame:03}"))
        .collect();
    if !blind.is_empty() {
        let names: Vec<&str> = blind.iter().map(String::as_str).collect();
        warnings.push(format!(
            "{} see nothing of the mesh: {}",
            count(blind.len(), "photograph"),
            list(&names)
        ));
    }
    warnings
}

/// "1 object", "1,234 objects".
fn count(n: usize, one: &str) -> String {
    let digits = n.to_string();
    let grouped: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .filter_map(|group| std::str::from_utf8(group).ok())
        .collect();
    let plural = if n == 1 { "" } else { "s" };
    format!("{} {one}{plural}", grouped.join(","))
}

/// The first few names and the number of the rest.
fn list(names: &[&str]) -> String {
    let first = names[..names.len().min(LISTED)].join(", ");
    match names.len().saturating_sub(LISTED) {
        0 => first,
        rest => format!("{first} and {rest} more"),
    }
}
