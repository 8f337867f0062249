//! Materials as object files describe them, converted to those of light transport.

use crate::math::picture::Picture;
use crate::transport::material::{Albedo, DIELECTRIC, Lobe, Material, Texture};
use glam::{DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Metallic-roughness material.
#[derive(Debug, Clone)]
pub struct ObjectSurface {
    /// Linear base colour; multiplies the texture if there is one.
    pub base_color: Vec3,
    /// Linear image of the base colour.
    pub texture: Option<Arc<Picture>>,
    /// 0 for a dielectric, 1 for a metal; in between, a blend.
    pub metallic: f32,
    /// GGX roughness α; `None` for a purely diffuse surface.
    pub alpha: Option<f32>,
    /// Specular reflectance of the dielectric part at normal incidence.
    pub dielectric: f32,
}

/// One material for a whole object, in place of those of its file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MaterialOverride {
    /// Linear base colour, 0 to 1.
    pub base_color: Vec3,
    /// 0 for a dielectric, 1 for a metal; in between, a blend.
    pub metallic: f32,
    /// GGX roughness α, 0 to 1; `None` for a purely diffuse surface.
    pub roughness: Option<f32>,
}

impl Default for MaterialOverride {
    /// A grey diffuse surface.
    fn default() -> Self {
        Self {
            base_color: Vec3::splat(0.5),
            metallic: 0.0,
            roughness: None,
        }
    }
}

impl MaterialOverride {
    /// Roughness of a surface that is made glossy: semi-gloss paint.
    pub const GLOSS: f32 = 0.3;

    /// The override that is most like a material: one colour, and a metal where nothing is reflected diffusely.
    pub fn like(material: &Material) -> Self {
        let diffuse = match &material.albedo {
            Albedo::Constant(albedo) => *albedo,
            Albedo::Texels(texels) => mean(&texels.colors),
            Albedo::Image(texture, factor) => mean(&texture.pixels) * *factor,
        };
        let metal = material.lobe.filter(|_| diffuse.max_element() <= 0.0);
        Self {
            base_color: metal.map_or(diffuse, |lobe| lobe.specular),
            metallic: if metal.is_some() { 1.0 } else { 0.0 },
            roughness: material.lobe.map(|lobe| lobe.roughness),
        }
    }

    /// The surface.
    pub fn surface(&self) -> ObjectSurface {
        ObjectSurface {
            metallic: self.metallic,
            alpha: self.roughness,
            dielectric: DIELECTRIC,
            ..ObjectSurface::diffuse(self.base_color)
        }
    }
}

/// Mean of linear colours.
pub fn mean(colors: &[Vec3]) -> Vec3 {
    let sum: DVec3 = colors.iter().map(|c| c.as_dvec3()).sum();
    (sum / colors.len().max(1) as f64).as_vec3()
}

impl ObjectSurface {
    /// A diffuse surface.
    pub fn diffuse(base_color: Vec3) -> Self {
        Self {
            base_color,
            texture: None,
            metallic: 0.0,
            alpha: None,
            dielectric: 0.0,
        }
    }

    /// The surface with every value clamped to its physical range; `None` where one is not finite.
    pub fn checked(self) -> Option<Self> {
        let finite = self.base_color.is_finite()
            && self.metallic.is_finite()
            && self.dielectric.is_finite()
            && self.alpha.is_none_or(f32::is_finite);
        finite.then(|| Self {
            base_color: self.base_color.clamp(Vec3::ZERO, Vec3::ONE),
            metallic: self.metallic.clamp(0.0, 1.0),
            dielectric: self.dielectric.clamp(0.0, 1.0),
            alpha: self.alpha.map(|alpha| alpha.clamp(0.0, 1.0)),
            ..self
        })
    }

    /// The material. `corner_uvs` are the texture coordinates of a texture.
    ///
    /// A metal has no diffuse reflectance; its specular one is its base colour, or its texture's mean, as an object has one lobe.
    pub fn material(&self, corner_uvs: Option<&Arc<Vec<[Vec2; 3]>>>) -> Material {
        let diffuse = self.base_color * (1.0 - self.metallic);
        let (albedo, mean) = match (&self.texture, corner_uvs) {
            (Some(image), Some(corner_uvs)) => {
                let texture = Texture {
                    width: image.width,
                    height: image.height,
                    pixels: image.pixels.clone(),
                    corner_uvs: corner_uvs.clone(),
                };
                let mean = mean(&image.pixels) * self.base_color;
                (Albedo::Image(Arc::new(texture), diffuse), mean)
            }
            _ => (Albedo::Constant(diffuse), self.base_color),
        };
        let specular = Vec3::splat(self.dielectric).lerp(mean, self.metallic);
        let shines = specular.max_element() > 0.0;
        let lobe = self.alpha.filter(|_| shines).map(|roughness| Lobe {
            roughness,
            specular,
        });
        Material {
            albedo,
            emission: Vec3::ZERO,
            lobe,
        }
    }
}
