//! The unidirectional path tracer with next-event estimation and multiple importance sampling.

use crate::math::frame::Frame;
use crate::math::rng::Stream;
use crate::scene::geometry::{Ray, offset_origin};
use crate::transport::bsdf::Bsdf;
use crate::transport::world::{SurfacePoint, World};
use glam::Vec3;

/// Maximum survival probability of Russian roulette. With all albedos ρ, variance is finite only for a probability above ρ², since
/// weights grow by ρ / probability per bounce.
pub const RR_MAX_SURVIVAL: f32 = 0.9999;

/// How paths are traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathOptions {
    /// Maximum number of bounces (one bounce is direct light; 0 is emission alone).
    pub max_bounces: u32,
    /// Number of bounces before Russian roulette starts.
    pub rr_depth: u32,
    /// Whether emitters are sampled (next-event estimation).
    pub sample_emitters: bool,
    /// Whether emission hit by BSDF sampling counts.
    pub sample_bsdf: bool,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self {
            max_bounces: u32::MAX,
            rr_depth: 4,
            sample_emitters: true,
            sample_bsdf: true,
        }
    }
}

/// The source of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// An emitting object.
    Object(u32),
    /// The environment.
    Outside,
}

/// The result of one path.
#[derive(Debug, Clone, Copy, Default)]
pub struct PathSample {
    /// Radiance estimate.
    pub radiance: Vec3,
    /// Rays cast, shadow rays included.
    pub rays: u32,
    /// Whether the sample was dropped because it was not finite; its radiance is then zero.
    pub rejected: bool,
}

/// MIS weight of a sample with pdf `a` against a technique with pdf `b`: power heuristic, β = 2 (Veach 1997).
#[inline]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

/// Radiance along a camera ray, estimated by one path.
pub fn radiance(
    world: &impl World,
    camera_ray: &Ray,
    stream: &mut Stream,
    options: &PathOptions,
) -> PathSample {
    let state = PathState::from_camera(camera_ray);
    follow(world, state, stream, options, &mut |_, _| {})
}

/// [`radiance`] split by origin: fills `parts` with the contributions of the path's vertices, whose sum is the sample's radiance up
/// to rounding; leaves it empty for rejected samples.
pub fn radiance_by_origin(
    world: &impl World,
    camera_ray: &Ray,
    stream: &mut Stream,
    options: &PathOptions,
    parts: &mut Vec<(Origin, Vec3)>,
) -> PathSample {
    parts.clear();
    let mut keep = |origin, light| {
        if light != Vec3::ZERO {
            parts.push((origin, light));
        }
    };
    let state = PathState::from_camera(camera_ray);
    let sample = follow(world, state, stream, options, &mut keep);
    if sample.rejected {
        parts.clear();
    }
    sample
}

/// Radiance of a white diffuse surface at a point on the side of `normal` (irradiance / π), by one path; its material is ignored.
pub fn white_radiance(
    world: &impl World,
    surface: &SurfacePoint,
    normal: Vec3,
    stream: &mut Stream,
    options: &PathOptions,
) -> PathSample {
    let frame = Frame::around(normal);
    let white = Bsdf {
        albedo: Vec3::ONE,
        lobe: None,
    };
    let mut rays = 0;
    let mut direct = Vec3::ZERO;
    if options.max_bounces == 0 {
        return PathSample::default();
    }
    if options.sample_emitters {
        let up = Vec3::Z;
        (_, direct) = direct_light(
            world, surface, &frame, up, &white, stream, options, &mut rays,
        );
    }
    let Some(next) = white.sample(Vec3::Z, stream.uniform(), stream.uniform2()) else {
        return PathSample {
            radiance: direct,
            rays,
            rejected: false,
        };
    };
    let wi = frame.to_world(next.wi);
    let origin = offset_origin(surface.point, normal, &surface.corners, wi);
    let state = PathState {
        ray: Ray::new(origin, wi),
        throughput: next.weight,
        bsdf_pdf: Some(next.pdf),
        bounce: 1,
    };
    let mut sample = follow(world, state, stream, options, &mut |_, _| {});
    sample.radiance += direct;
    sample.rays += rays;
    if !sample.radiance.is_finite() {
        sample.radiance = Vec3::ZERO;
        sample.rejected = true;
    }
    sample
}

/// The state of a path before its next ray.
pub(super) struct PathState {
    pub ray: Ray,
    pub throughput: Vec3,
    /// Pdf per solid angle of the last BSDF sample; `None` for the camera ray, which has no competing light sample.
    pub bsdf_pdf: Option<f32>,
    pub bounce: u32,
}

impl PathState {
    fn from_camera(ray: &Ray) -> Self {
        Self {
            ray: *ray,
            throughput: Vec3::ONE,
            bsdf_pdf: None,
            bounce: 0,
        }
    }
}

/// Traces a path from `state` to its end; calls `found` with each contribution to the radiance and its origin.
pub(super) fn follow(
    world: &impl World,
    state: PathState,
    stream: &mut Stream,
    options: &PathOptions,
    found: &mut impl FnMut(Origin, Vec3),
) -> PathSample {
    let mut sample = PathSample::default();
    let PathState {
        mut ray,
        mut throughput,
        mut bsdf_pdf,
        mut bounce,
    } = state;
    let mut total = Vec3::ZERO;
    let mut add = |origin, light| {
        total += light;
        found(origin, light);
    };

    loop {
        sample.rays += 1;
        let Some(surface) = world.intersect(&ray) else {
            if let Some(environment) = &world.lit().outside {
                let direction = ray.direction.normalize_or_zero();
                let weight = bsdf_pdf.map_or(1.0, |pdf| {
                    let map_pdf = environment.pdf(ray.origin, direction);
                    let light_pdf = map_pdf * (1.0 - world.lit().emitter_fraction());
                    emission_weight(pdf, light_pdf, options)
                });
                let light = throughput * environment.radiance(ray.origin, direction) * weight;
                add(Origin::Outside, light);
            }
            break;
        };

        let wo = -ray.direction.normalize_or_zero();
        let cos_emitter = surface.normal.dot(wo);
        if cos_emitter > 0.0 && surface.emission != Vec3::ZERO {
            let weight = bsdf_pdf.map_or(1.0, |pdf| {
                let distance2 = (ray.direction * surface.t).length_squared();
                let lit = world.lit();
                let area_pdf = lit.emitter_fraction() * lit.emitters.pdf(surface.object);
                emission_weight(pdf, area_pdf * distance2 / cos_emitter, options)
            });
            let light = throughput * surface.emission * weight;
            add(Origin::Object(surface.object), light);
        }
        if bounce >= options.max_bounces {
            break;
        }

        // Next-event estimation.
        let side = if cos_emitter < 0.0 { -1.0 } else { 1.0 };
        let frame = Frame::around(surface.shading_normal * side);
        let local_wo = frame.to_local(wo);
        let bsdf = Bsdf {
            albedo: surface.albedo,
            lobe: surface.lobe,
        };
        if options.sample_emitters {
            let (origin, light) = direct_light(
                world,
                &surface,
                &frame,
                local_wo,
                &bsdf,
                stream,
                options,
                &mut sample.rays,
            );
            add(origin, throughput * light);
        }

        // Continue the path by sampling the BSDF.
        let Some(next) = bsdf.sample(local_wo, stream.uniform(), stream.uniform2()) else {
            break;
        };
        throughput *= next.weight;
        let wi = frame.to_world(next.wi);
        let origin = offset_origin(surface.point, surface.normal, &surface.corners, wi);
        ray = Ray::new(origin, wi);
        bsdf_pdf = Some(next.pdf);
        bounce += 1;

        // Russian roulette.
        if bounce > options.rr_depth {
            let survival = throughput.max_element().min(RR_MAX_SURVIVAL);
            if survival <= 0.0 || stream.uniform() >= survival {
                break;
            }
            throughput /= survival;
        } else if throughput.max_element() <= 0.0 {
            break;
        }
    }

    if total.is_finite() {
        sample.radiance = total;
    } else {
        sample.rejected = true;
    }
    sample
}

/// Direct light scattered towards `local_wo`, estimated by one light sample, and its origin.
#[expect(clippy::too_many_arguments, reason = "the state of one path vertex")]
fn direct_light(
    world: &impl World,
    surface: &SurfacePoint,
    frame: &Frame,
    local_wo: Vec3,
    bsdf: &Bsdf,
    stream: &mut Stream,
    options: &PathOptions,
    rays: &mut u32,
) -> (Origin, Vec3) {
    let (origin, Some(light)) = draw_light(world, surface, stream) else {
        return (Origin::Outside, Vec3::ZERO);
    };
    let local_wi = frame.to_local(light.wi);
    let scattered = bsdf.eval(local_wo, local_wi);
    if scattered == Vec3::ZERO {
        return (origin, Vec3::ZERO);
    }
    *rays += 1;
    if world.occluded(&light.ray) {
        return (origin, Vec3::ZERO);
    }
    let weight = match options.sample_bsdf {
        true => power_heuristic(light.pdf, bsdf.pdf(local_wo, local_wi)),
        false => 1.0,
    };
    (origin, scattered * light.radiance / light.pdf * weight)
}

/// A sampled direction towards a light.
pub(super) struct LightSample {
    /// Unit direction.
    pub wi: Vec3,
    /// Unoccluded radiance.
    pub radiance: Vec3,
    /// Pdf per solid angle.
    pub pdf: f32,
    /// Shadow ray.
    pub ray: Ray,
}

/// Samples a point on an emitter's front or a direction of the environment, for a surface point.
pub(super) fn draw_light(
    world: &impl World,
    surface: &SurfacePoint,
    stream: &mut Stream,
) -> (Origin, Option<LightSample>) {
    let (pick, choice, u) = (stream.uniform(), stream.uniform_f64(), stream.uniform2());
    let lit = world.lit();
    let fraction = lit.emitter_fraction();
    let origin_towards = |wi| offset_origin(surface.point, surface.normal, &surface.corners, wi);
    if pick >= fraction {
        let drawn = lit.outside.as_ref().and_then(|environment| {
            let (wi, pdf) = environment.sample(surface.point, choice, u)?;
            Some(LightSample {
                wi,
                radiance: environment.radiance(surface.point, wi),
                pdf: pdf * (1.0 - fraction),
                ray: Ray::new(origin_towards(wi), wi),
            })
        });
        return (Origin::Outside, drawn);
    }
    let Some(light) = lit.sample_emitter(choice, u) else {
        return (Origin::Outside, None);
    };
    let origin = Origin::Object(light.object);
    let to_light = light.point - surface.point;
    let distance2 = to_light.length_squared();
    let wi = to_light.normalize_or_zero();
    let cos_emitter = -light.normal.dot(wi);
    if cos_emitter <= 0.0 || distance2 <= 0.0 {
        return (origin, None);
    }
    let to = offset_origin(light.point, light.normal, &light.corners, -wi);
    let drawn = LightSample {
        wi,
        radiance: light.radiance,
        pdf: fraction * light.pdf * distance2 / cos_emitter,
        ray: Ray::between(origin_towards(wi), to),
    };
    (origin, Some(drawn))
}

/// MIS weight of emission hit by BSDF sampling.
fn emission_weight(bsdf_pdf: f32, light_pdf: f32, options: &PathOptions) -> f32 {
    match (options.sample_bsdf, options.sample_emitters) {
        (true, true) => power_heuristic(bsdf_pdf, light_pdf),
        // Emission that light sampling cannot reach is left to BSDF sampling.
        (false, true) => f32::from(light_pdf <= 0.0),
        _ => 1.0,
    }
}
