//! What the path tracer asks of the world around it.

use crate::scene::geometry::Ray;
use crate::transport::environment::Environment;
use crate::transport::material::Lobe;
use glam::Vec3;

/// A surface point met by a ray, with everything that scattering there needs.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// Position.
    pub point: Vec3,
    /// The triangle's corners, for offsetting the next ray.
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
    /// Object index (inserted objects follow the scene's).
    pub object: u32,
    /// Triangle index within its mesh.
    pub triangle: u32,
    /// Distance along the ray, in units of its direction.
    pub t: f32,
}

/// A point drawn on an emitter.
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
    /// Density per square metre, the choice of emitter included.
    pub pdf: f32,
    /// Object index.
    pub object: u32,
}

/// Sine of the angle that a bent shading normal keeps above the view's horizon.
pub const NORMAL_MARGIN: f32 = 0.01;

/// The shading normal, bent just far enough that `wo` sees its front where it sees the geometric normal's.
pub fn towards_viewer(shading: Vec3, geometric: Vec3, wo: Vec3) -> Vec3 {
    let side = if geometric.dot(wo) < 0.0 { -wo } else { wo };
    let cos = shading.dot(side);
    if cos >= NORMAL_MARGIN {
        return shading;
    }
    (shading + side * (NORMAL_MARGIN - cos)).normalize_or(geometric)
}

/// Geometry, materials and emitters: all that the path tracer needs to know.
pub trait World: Sync {
    /// The nearest surface along a ray.
    fn intersect(&self, ray: &Ray) -> Option<SurfacePoint>;

    /// Whether anything lies on the ray between its ends.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Draws a point on an emitter, from one uniform number for the choice and two for the point.
    /// `None` where nothing emits.
    fn sample_emitter(&self, choice: f64, u: [f32; 2]) -> Option<EmitterSample>;

    /// Density per square metre with which [`World::sample_emitter`] draws a point of this surface.
    fn emitter_pdf(&self, surface: &SurfacePoint) -> f32;

    /// Whether [`World::sample_emitter`] can draw anything.
    fn has_emitters(&self) -> bool;

    /// Light from outside the mesh, met by rays that escape.
    fn environment(&self) -> Option<&Environment>;
}
