//! The result of a solve: emission, materials, outside light and exposures, with standard errors.

use crate::capture::exposure::{Exposure, Vignetting};
use crate::capture::response::Response;
use crate::math::nullable;
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::transport::environment::Environment;
use crate::transport::lit::LitScene;
use crate::transport::material::{Albedo, Lobe, Material, TexelColors};
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Least number of pixels of an object whose albedo counts in an error over objects.
pub const ENOUGH_PIXELS: u64 = 50;
/// Errors are relative to an albedo of at least this.
const MIN_ALBEDO: f32 = 1e-3;

/// The estimate of a scene.
#[derive(Debug, Clone, Default)]
pub struct Estimate {
    /// One entry per object, in the scene's order.
    pub objects: Vec<ObjectEstimate>,
    /// Textures; `None` if none was kept.
    pub texels: Option<Arc<TexelEstimate>>,
    /// Light from outside the mesh; `None` if it was not kept.
    pub outside: Option<Outside>,
    /// Linear exposure and white balance of each frame, with a median of 1 in each channel; `None` if they do not differ.
    pub exposures: Option<Vec<Vec3>>,
    /// Vignetting of all frames, if it was found.
    pub vignetting: Option<Vignetting>,
    /// Response of the camera, if it was found to differ from the files' own curve.
    pub response: Option<Response>,
    /// Standard error, relative, of the factor that all albedos share because the light is known no better. It is part of every
    /// albedo's standard error; ratios of albedos are free of it. Zero if lamps and mesh leave no such factor open.
    pub common_error: f32,
}

/// The estimate of one object; also its entry in `estimate.json` and `report.json`, where non-finite numbers are `null`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectEstimate {
    /// Diffuse reflectance, linear RGB in [0, 1].
    #[serde(deserialize_with = "nullable::or_zero")]
    pub albedo: Vec3,
    /// Standard error of `albedo`.
    #[serde(deserialize_with = "nullable::or_infinity")]
    pub albedo_stderr: Vec3,
    /// Emitted radiance, W·sr⁻¹·m⁻².
    #[serde(deserialize_with = "nullable::or_zero")]
    pub emission: Vec3,
    /// Standard error of `emission`.
    #[serde(deserialize_with = "nullable::or_infinity")]
    pub emission_stderr: Vec3,
    /// GGX roughness α; `None` without a lobe.
    pub roughness: Option<f32>,
    /// Specular reflectance at normal incidence; `None` without a lobe.
    pub specular: Option<f32>,
    /// Number of pixels of all photographs whose centre sees the object.
    pub seen_pixels: u64,
    /// Whether the photographs determine albedo and emission.
    pub identifiable: bool,
    /// Whether the photographs determine the albedo.
    pub albedo_identifiable: bool,
    /// A remark, such as why something is not determined; may be empty.
    pub note: String,
}

impl Default for ObjectEstimate {
    fn default() -> Self {
        Self {
            albedo: Vec3::ZERO,
            albedo_stderr: Vec3::ZERO,
            emission: Vec3::ZERO,
            emission_stderr: Vec3::ZERO,
            roughness: None,
            specular: None,
            seen_pixels: 0,
            identifiable: true,
            albedo_identifiable: true,
            note: String::new(),
        }
    }
}

impl ObjectEstimate {
    /// GGX roughness α and specular reflectance at normal incidence; `None` without a lobe.
    pub fn lobe(&self) -> Option<(f32, f32)> {
        self.roughness.zip(self.specular)
    }

    /// The first field with a physically impossible value.
    pub fn impossible(&self) -> Option<&'static str> {
        let reflects =
            |fraction: Vec3| fraction.cmpge(Vec3::ZERO).all() && fraction.cmple(Vec3::ONE).all();
        let fraction = |value: Option<f32>| reflects(Vec3::splat(value.unwrap_or(0.0)));
        let emits = self.emission.is_finite() && self.emission.min_element() >= 0.0;
        let is_rough = fraction(self.roughness) && self.roughness != Some(0.0);
        let fields = [
            ("albedo", reflects(self.albedo)),
            ("emission", emits),
            ("roughness", is_rough),
            ("specular", fraction(self.specular)),
        ];
        let impossible = fields.into_iter().find(|(_, possible)| !possible);
        impossible.map(|(name, _)| name)
    }
}

/// Albedo texels with their standard errors.
#[derive(Debug, Clone)]
pub struct TexelEstimate {
    /// Albedo of each texel; used for the objects in `textured`.
    pub colors: Arc<TexelColors>,
    /// Standard error of each texel's albedo.
    pub stderr: Vec<Vec3>,
    /// Number of pixels that see each texel; zero for interpolated texels.
    pub seen: Vec<u32>,
    /// For each object, whether its albedo is read from the texels.
    pub textured: Vec<bool>,
}

impl TexelEstimate {
    /// The texels of each textured object times a factor per channel, at most one. `object_of` is the object of each triangle.
    pub fn scaled(&self, factor: impl Fn(usize) -> Vec3, object_of: &[u32]) -> Self {
        let layout = &self.colors.layout;
        let mut scaled = self.clone();
        let mut colors = self.colors.colors.clone();
        for (triangle, &object) in object_of.iter().enumerate() {
            if self.textured.get(object as usize) == Some(&true) {
                let factor = factor(object as usize);
                let texels = layout.first[triangle] as usize..layout.first[triangle + 1] as usize;
                for color in &mut colors[texels.clone()] {
                    *color = (*color * factor).min(Vec3::ONE);
                }
                scaled.stderr[texels].iter_mut().for_each(|e| *e *= factor);
            }
        }
        scaled.colors = Arc::new(TexelColors {
            layout: layout.clone(),
            colors,
        });
        scaled
    }
}

/// Light arriving from outside the mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outside {
    /// Columns of the equirectangular map of directions towards the light, for a box from its centre. Row 0 is straight up (+y).
    pub width: u32,
    /// Rows of the map.
    pub height: u32,
    /// Incoming radiance, row by row.
    pub pixels: Vec<Vec3>,
    /// For a box, radiance that comes from above the horizon, if it differs: each point of a window shows the sky from below and
    /// the ground from above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<Vec<Vec3>>,
    /// Distance of the light: infinite, or a box.
    pub surroundings: Surroundings,
    /// The sun beside the map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<Sun>,
    /// The pixels of the box that the sun shines through: those that photographs show bright. `None` if all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub openings: Option<Vec<bool>>,
}

impl Outside {
    /// The radiance of each pixel; the mean where light from above and from below the horizon differs.
    pub fn means(&self) -> impl Iterator<Item = Vec3> {
        (self.pixels.iter().enumerate()).map(|(pixel, &below)| {
            let above = self.above.as_ref().and_then(|above| above.get(pixel));
            above.map_or(below, |&above| (below + above) * 0.5)
        })
    }
}

/// Norm over RGB of an albedo's error, relative to the norm of the albedo.
pub fn relative_to_albedo(error: Vec3, albedo: Vec3) -> f64 {
    f64::from(error.length() / albedo.length().max(MIN_ALBEDO))
}

impl Estimate {
    /// The reported error: the median relative standard error of albedo, over objects whose albedo is determined and that at least
    /// [`ENOUGH_PIXELS`] pixels see; `None` if there are none. It is without [`Self::common_error`], which no number of paths
    /// lowers.
    pub fn relative_error(&self) -> Option<f64> {
        let common = f64::from(self.common_error);
        let mut relative: Vec<f64> = (self.objects.iter())
            .filter(|object| object.albedo_identifiable && object.seen_pixels >= ENOUGH_PIXELS)
            .map(|object| relative_to_albedo(object.albedo_stderr, object.albedo))
            .map(|error| (error * error - common * common).max(0.0).sqrt())
            .collect();
        quantile(&mut relative, 0.5)
    }

    /// The estimated map from radiance to a frame's values: exposure, white balance, vignetting and response.
    pub fn exposure(&self, frame: usize) -> Exposure {
        let factor = self.exposures.as_ref().and_then(|e| e.get(frame));
        Exposure {
            factor: factor.copied().unwrap_or(Vec3::ONE),
            vignetting: self.vignetting,
            response: self.response,
        }
    }

    /// The scene with the light and the materials of this estimate.
    pub fn lit(&self, scene: &Arc<Scene>) -> LitScene {
        let mut materials = self.materials();
        materials.resize(
            scene.objects.len(),
            Material::diffuse(Vec3::ZERO, Vec3::ZERO),
        );
        let outside = self.outside.as_ref().and_then(|outside| {
            let (width, height) = (outside.width as usize, outside.height as usize);
            let map = Environment::new(width, height, outside.pixels.clone())?;
            let map = map.around(outside.surroundings);
            let map = map.with_sun(outside.sun, outside.openings.clone())?;
            match outside.above.clone() {
                Some(above) => map.with_above(above, scene.up),
                None => Some(map),
            }
        });
        LitScene::new(scene.clone(), materials, outside.map(Arc::new))
    }

    /// The material of each object, for rendering.
    pub fn materials(&self) -> Vec<Material> {
        self.objects
            .iter()
            .enumerate()
            .map(|(index, object)| {
                let albedo = match &self.texels {
                    Some(texels) if texels.textured.get(index) == Some(&true) => {
                        Albedo::Texels(texels.colors.clone())
                    }
                    _ => Albedo::Constant(object.albedo),
                };
                let lobe = object.lobe();
                Material {
                    albedo,
                    emission: object.emission,
                    lobe: lobe.map(|(roughness, specular)| Lobe::grey(roughness, specular)),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_round_trips_and_what_is_no_number_is_null() {
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
        let text = serde_json::to_string(&object).expect("serialises");
        assert!(text.contains("\"specular\":null"), "{text}");
        assert!(text.contains("[0.01,null,null]"), "{text}");
        let back: ObjectEstimate = serde_json::from_str(&text).expect("parses");
        let expected = ObjectEstimate {
            specular: None,
            ..object
        };
        assert_eq!(back, expected);
    }
}
