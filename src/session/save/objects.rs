//! What is written of each object, in `estimate.json` and in `report.json`.

use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::scene::Scene;
use crate::session::save::named::Named;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A linear colour; a channel that is no finite number is `null`.
pub type Rgb = [Option<f32>; 3];

/// One object of an estimate as files hold it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectRecord {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub albedo: Rgb,
    /// Its standard error; `null` where nothing is known.
    pub albedo_stderr: Rgb,
    /// Emitted radiance, W·sr⁻¹·m⁻².
    pub emission: Rgb,
    /// Its standard error; `null` where nothing is known.
    pub emission_stderr: Rgb,
    /// GGX roughness, where a lobe was kept.
    pub roughness: Option<f32>,
    /// Specular reflectance at normal incidence, where a lobe was kept.
    pub specular: Option<f32>,
    /// Pixels whose centre sees the object.
    pub seen_pixels: u64,
    /// Whether the photographs determine albedo and emission.
    pub identifiable: bool,
    /// Whether the photographs determine the albedo.
    pub albedo_identifiable: bool,
    /// Why not, in a sentence.
    pub note: String,
}

/// A colour for a file.
pub fn rgb(color: Vec3) -> Rgb {
    color.to_array().map(finite)
}

fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

fn color(rgb: Rgb, unknown: f32) -> Vec3 {
    Vec3::from_array(rgb.map(|v| v.unwrap_or(unknown)))
}

impl From<&ObjectEstimate> for ObjectRecord {
    fn from(object: &ObjectEstimate) -> Self {
        Self {
            albedo: rgb(object.albedo),
            albedo_stderr: rgb(object.albedo_stderr),
            emission: rgb(object.emission),
            emission_stderr: rgb(object.emission_stderr),
            roughness: object.roughness.and_then(finite),
            specular: object.specular.and_then(finite),
            seen_pixels: object.seen_pixels,
            identifiable: object.identifiable,
            albedo_identifiable: object.albedo_identifiable,
            note: object.note.clone(),
        }
    }
}

impl From<&ObjectRecord> for ObjectEstimate {
    fn from(record: &ObjectRecord) -> Self {
        Self {
            albedo: color(record.albedo, 0.0),
            albedo_stderr: color(record.albedo_stderr, f32::INFINITY),
            emission: color(record.emission, 0.0),
            emission_stderr: color(record.emission_stderr, f32::INFINITY),
            roughness: record.roughness,
            specular: record.specular,
            seen_pixels: record.seen_pixels,
            identifiable: record.identifiable,
            albedo_identifiable: record.albedo_identifiable,
            note: record.note.clone(),
        }
    }
}

/// All objects of an estimate by name, in the scene's order.
pub fn records(scene: &Scene, estimate: &Estimate) -> Named<ObjectRecord> {
    Named(
        scene
            .objects
            .iter()
            .zip(&estimate.objects)
            .map(|(object, estimate)| (object.name.clone(), estimate.into()))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_round_trips_and_what_is_no_number_is_null() {
        let object = ObjectEstimate {
            albedo: Vec3::new(0.1, 0.25, 1.0 / 3.0),
            albedo_stderr: Vec3::new(0.01, f32::INFINITY, f32::INFINITY),
            emission: Vec3::new(1e-30, 17.25, 1e30),
            roughness: Some(0.3),
            specular: Some(f32::NAN),
            seen_pixels: u64::MAX,
            note: "a \"note\"".into(),
            ..Default::default()
        };
        let text = serde_json::to_string(&ObjectRecord::from(&object)).expect("serialises");
        assert!(text.contains("\"specular\":null"), "{text}");
        assert!(text.contains("[0.01,null,null]"), "{text}");
        let record: ObjectRecord = serde_json::from_str(&text).expect("parses");
        let back = ObjectEstimate::from(&record);
        let expected = ObjectEstimate {
            specular: None,
            ..object
        };
        assert_eq!(back, expected);
    }
}
