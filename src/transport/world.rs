//! The interface between the path tracer and a scene.

use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use crate::transport::material::Lobe;
use glam::Vec3;

/// A surface point with all data for scattering.
#[derive(Debug, Clone, Copy, Default)]
pub struct SurfacePoint {
    /// Position.
    pub point: Vec3,
    /// The triangle's corners, for ray offsets.
    pub corners: [Vec3; 3],
    /// Unit geometric normal of the front side.
    pub normal: Vec3,
    /// Unit shading normal on the front side (equal to `normal` on scans).
    pub shading_normal: Vec3,
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Radiance emitted from the front side.
    pub emission: Vec3,
    /// Rough specular lobe.
    pub lobe: Option<Lobe>,
    /// Object index (inserted objects come after the scene's).
    pub object: u32,
    /// Triangle index within its mesh.
    pub triangle: u32,
    /// Distance along the ray, in units of its direction.
    pub t: f32,
}

/// A point sampled on an emitter.
#[derive(Debug, Clone, Copy)]
pub struct EmitterSample {
    /// Position.
    pub point: Vec3,
    /// The triangle's corners.
    pub corners: [Vec3; 3],
    /// Unit normal of the emitting side.
    pub normal: Vec3,
    /// Emitted radiance.
    pub radiance: Vec3,
    /// Pdf per square metre, including the choice of emitter.
    pub pdf: f32,
    /// Object index.
    pub object: u32,
}

/// Minimum cosine between a corrected shading normal and the viewing direction.
pub const NORMAL_MARGIN: f32 = 0.01;

/// The shading normal, bent minimally so that it faces `wo` on the side on which the geometric normal does.
pub fn towards_viewer(shading: Vec3, geometric: Vec3, wo: Vec3) -> Vec3 {
    let side = if geometric.dot(wo) < 0.0 { -wo } else { wo };
    let cos = shading.dot(side);
    if cos >= NORMAL_MARGIN {
        return shading;
    }
    (shading + side * (NORMAL_MARGIN - cos)).normalize_or(geometric)
}

/// What the rays of the path tracer meet, and what lights it.
pub trait World: Sync {
    /// The scene whose lamps and environment are all the light.
    fn lit(&self) -> &LitScene;

    /// The nearest surface along a ray.
    fn intersect(&self, ray: &Ray) -> Option<SurfacePoint>;

    /// Whether anything blocks the ray between its ends.
    fn occluded(&self, ray: &Ray) -> bool;
}
