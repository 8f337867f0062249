//! Materials of surfaces.

use crate::scene::geometry::Hit;
use crate::scene::texels::TexelLayout;
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Specular reflectance of a dielectric at normal incidence (index of refraction 1.5), as glTF fixes it.
pub const DIELECTRIC: f32 = 0.04;

/// Diffuse reflectance over an object.
#[derive(Debug, Clone)]
pub enum Albedo {
    /// One colour.
    Constant(Vec3),
    /// One colour per texel of the scene's triangles.
    Texels(Arc<TexelColors>),
    /// An image over texture coordinates, times a constant.
    Image(Arc<Texture>, Vec3),
}

impl Albedo {
    /// Whether two albedos are plainly the same: one colour, or the same texels or image in memory.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => a == b,
            (Self::Texels(a), Self::Texels(b)) => Arc::ptr_eq(a, b),
            (Self::Image(a, by_a), Self::Image(b, by_b)) => Arc::ptr_eq(a, b) && by_a == by_b,
            _ => false,
        }
    }
}

/// Colours on a [`TexelLayout`].
#[derive(Debug, Clone)]
pub struct TexelColors {
    /// The texels.
    pub layout: TexelLayout,
    /// The colour of each texel.
    pub colors: Vec<Vec3>,
}

/// A tiled image of linear colours, with texture coordinates per triangle.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear colours, row by row; v = 0 is the bottom row's lower edge.
    pub pixels: Vec<Vec3>,
    /// Texture coordinates of the corners of each triangle.
    pub corner_uvs: Arc<Vec<[Vec2; 3]>>,
}

impl Texture {
    /// Bilinear lookup at a hit.
    pub fn at(&self, hit: &Hit) -> Vec3 {
        let Some(&[a, b, c]) = self.corner_uvs.get(hit.triangle as usize) else {
            return Vec3::ZERO;
        };
        let uv = a * (1.0 - hit.b1 - hit.b2) + b * hit.b1 + c * hit.b2;
        let x = uv.x * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let pixel = |dx: i64, dy: i64| {
            let i = (x.floor() as i64 + dx).rem_euclid(i64::from(self.width));
            let j = (y.floor() as i64 + dy).rem_euclid(i64::from(self.height));
            self.pixels[(j * i64::from(self.width) + i) as usize]
        };
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let top = pixel(0, 0).lerp(pixel(1, 0), fx);
        let bottom = pixel(0, 1).lerp(pixel(1, 1), fx);
        top.lerp(bottom, fy)
    }
}

/// A GGX microfacet lobe over the diffuse base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lobe {
    /// GGX roughness α in (0, 1] (α = 1 is widest).
    pub roughness: f32,
    /// Specular reflectance at normal incidence.
    pub specular: Vec3,
}

impl Lobe {
    /// A lobe of grey reflectance.
    pub fn grey(roughness: f32, specular: f32) -> Self {
        Self {
            roughness,
            specular: Vec3::splat(specular),
        }
    }
}

/// An object's scattering and emission.
#[derive(Debug, Clone)]
pub struct Material {
    /// Diffuse reflectance, in [0, 1] per channel.
    pub albedo: Albedo,
    /// Radiance emitted by the front side, W·sr⁻¹·m⁻².
    pub emission: Vec3,
    /// Rough specular lobe, if any.
    pub lobe: Option<Lobe>,
}

impl Material {
    /// A diffuse material.
    pub fn diffuse(albedo: Vec3, emission: Vec3) -> Self {
        Self {
            albedo: Albedo::Constant(albedo),
            emission,
            lobe: None,
        }
    }

    /// Diffuse reflectance at a hit.
    #[inline]
    pub fn albedo_at(&self, hit: &Hit) -> Vec3 {
        match &self.albedo {
            Albedo::Constant(color) => *color,
            Albedo::Texels(texels) => texels.colors[texels.layout.texel(hit) as usize],
            Albedo::Image(texture, tint) => texture.at(hit) * *tint,
        }
    }
}
