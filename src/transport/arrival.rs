//! Samples of incident light at a surface point, stored by direction, so that any BSDF can be integrated over them without rays.

use crate::math::frame::Frame;
use crate::math::rng::Stream;
use crate::math::warp;
use crate::scene::geometry::{Ray, offset_origin};
use crate::transport::microfacet::{Microfacet, reflect_on_visible_normal};
use crate::transport::path::{PathOptions, PathState, draw_light, follow, power_heuristic};
use crate::transport::world::{SurfacePoint, World};
use glam::Vec3;
use std::iter::Sum;
use std::ops::AddAssign;

/// Incident light from one sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Unit direction in the local frame, above the horizon.
    pub wi: Vec3,
    /// MIS-weighted radiance over pdf (per solid angle): Σ f(wi) cosθ · `light` over the arrivals of one call is an unbiased
    /// estimate of the radiance scattered by f.
    pub light: Vec3,
}

/// Counts of traced rays.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RayCount {
    /// Rays cast.
    pub rays: u64,
    /// Samples dropped because they were not finite.
    pub rejected: u64,
}

impl AddAssign for RayCount {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.rejected += other.rejected;
    }
}

impl Sum for RayCount {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, more| {
            sum += more;
            sum
        })
    }
}

/// Appends samples of incident light at a surface: one direction with pdf cosθ/π, one reflected on a visible normal of each given
/// GGX roughness for the local direction `wo`, and one light sample. The directional techniques are combined by the balance
/// heuristic, and together with the light sample by the power heuristic.
#[expect(clippy::too_many_arguments, reason = "the state of one path vertex")]
pub fn arrivals(
    world: &impl World,
    surface: &SurfacePoint,
    frame: &Frame,
    wo: Vec3,
    roughnesses: &[f64],
    stream: &mut Stream,
    options: &PathOptions,
    found: &mut Vec<Arrival>,
) -> RayCount {
    let density = |wi: Vec3| {
        let lobes = (roughnesses.iter()).map(|&alpha| Microfacet::new(alpha, wo, wi).pdf());
        warp::cosine_hemisphere_pdf(wi.z) + lobes.sum::<f64>() as f32
    };
    let mut cast = RayCount::default();
    let mut push = |wi: Vec3, light: Vec3| {
        if !light.is_finite() {
            return 1;
        }
        if light != Vec3::ZERO {
            found.push(Arrival { wi, light });
        }
        0
    };

    // Light sample.
    if let (_, Some(light)) = draw_light(world, surface, stream) {
        let wi = frame.to_local(light.wi);
        if wi.z > 0.0 {
            cast.rays += 1;
            if !world.occluded(&light.ray) {
                let weight = power_heuristic(light.pdf, density(wi));
                cast.rejected += push(wi, light.radiance * (weight / light.pdf));
            }
        }
    }

    // Directional techniques.
    let normal = frame.n;
    for technique in 0..=roughnesses.len() {
        let u = stream.uniform2();
        let wi = match technique.checked_sub(1) {
            None => warp::cosine_hemisphere(u),
            Some(lobe) => reflect_on_visible_normal(roughnesses[lobe], wo, u),
        };
        let pdf = density(wi);
        if wi.z <= 0.0 || !(pdf > 0.0 && pdf.is_finite()) {
            continue;
        }
        let direction = frame.to_world(wi);
        let origin = offset_origin(surface.point, normal, &surface.corners, direction);
        let state = PathState {
            ray: Ray::new(origin, direction),
            throughput: Vec3::ONE,
            bsdf_pdf: Some(pdf),
            bounce: 1,
        };
        let sample = follow(world, state, stream, options, &mut |_, _| {});
        cast.rays += u64::from(sample.rays);
        cast.rejected += u64::from(sample.rejected) + push(wi, sample.radiance / pdf);
    }
    cast
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Capture;
    use crate::capture::mesh::Mesh;
    use crate::math::stats::Moments;
    use crate::scene::Scene;
    use crate::transport::bsdf::Bsdf;
    use crate::transport::environment::Environment;
    use crate::transport::lit::LitScene;
    use crate::transport::material::{Lobe, Material};
    use glam::DVec3;
    use std::sync::Arc;

    /// A triangle around the origin, and light from outside.
    fn under(sky: Arc<Environment>) -> LitScene {
        let capture = Capture {
            name: String::new(),
            folder: None,
            mesh: Mesh {
                positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
                triangles: vec![[0, 1, 2]],
                object_of: vec![0],
                objects: vec!["floor".to_owned()],
                ..Mesh::default()
            },
            segmentation: None,
            frames: Vec::new(),
            up: DVec3::Z,
            warnings: Vec::new(),
        };
        let scene = Arc::new(Scene::new(&capture).expect("a triangle"));
        let black = Material::diffuse(Vec3::ZERO, Vec3::ZERO);
        LitScene::new(scene, vec![black], Some(sky))
    }

    /// Means of two unbiased estimates differ by less than four and a half standard errors; 12 tests.
    #[test]
    fn any_scattering_is_integrated_over_the_same_arrivals_without_bias() {
        let pixels = (0..32 * 16).map(|i| Vec3::splat(if i % 32 < 3 { 9.0 } else { 0.4 }));
        let sky = Arc::new(Environment::new(32, 16, pixels.collect()).expect("light"));
        let world = under(sky.clone());
        // Above the triangle, so that no ray meets it.
        let surface = SurfacePoint {
            point: Vec3::Z,
            corners: [Vec3::ZERO, Vec3::X, Vec3::Y],
            normal: Vec3::Z,
            shading_normal: Vec3::Z,
            ..SurfacePoint::default()
        };
        let frame = Frame::around(Vec3::Z);
        let wo = Vec3::new(0.6, 0.2, 0.5).normalize();
        let materials = [0.08, 0.2, 0.5, 1.0].map(|roughness| Bsdf {
            albedo: Vec3::splat(0.3),
            lobe: Some(Lobe::grey(roughness, 0.4)),
        });
        let diffuse = Bsdf {
            albedo: Vec3::ONE,
            lobe: None,
        };
        for bsdf in materials.into_iter().chain([diffuse]) {
            let (mut found, mut wanted) = (Moments::default(), Moments::default());
            for sample in 0..60_000 {
                let mut stream = Stream::new(3, 0, 0, sample);
                let mut kept = Vec::new();
                let options = PathOptions::default();
                arrivals(
                    &world,
                    &surface,
                    &frame,
                    wo,
                    &[0.1, 0.4],
                    &mut stream,
                    &options,
                    &mut kept,
                );
                let scattered = |a: &Arrival| f64::from((bsdf.eval(wo, a.wi) * a.light).x);
                found.push(kept.iter().map(scattered).sum());
                let drawn = bsdf.sample(wo, stream.uniform(), stream.uniform2());
                wanted.push(drawn.map_or(0.0, |s| {
                    f64::from((s.weight * sky.radiance(Vec3::ZERO, frame.to_world(s.wi))).x)
                }));
            }
            let error = found.standard_error().hypot(wanted.standard_error());
            let off = (found.mean - wanted.mean) / error;
            assert!(off.abs() < 4.5, "{bsdf:?}: {off}");
        }
    }
}
