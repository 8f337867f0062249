//! Samples the incident radiance at observed surface points, stored by direction, so that any lobe can be evaluated without
//! further rays.

use crate::inverse::lobe::observations::SpotObservation;
use crate::math::frame::Frame;
use crate::math::rng::Stream;
use crate::math::warp;
use crate::scene::camera::Camera;
use crate::transport::arrival::{Arrival, RayCount, arrivals};
use crate::transport::bsdf::coupling;
use crate::transport::lit::LitScene;
use crate::transport::microfacet::Microfacet;
use crate::transport::path::PathOptions;
use glam::{DVec3, Vec2};

/// First of the sample keys of these paths, disjoint from those of other stages.
const KEY: u64 = 9 << 59;

/// Settings of the sampling of incident radiance.
#[derive(Debug, Clone, Copy)]
pub struct Gathering<'a> {
    /// The scene with its present estimate.
    pub lit: &'a LitScene,
    pub object: u32,
    /// Points per observation in each of two sets.
    pub points: u32,
    /// GGX roughnesses whose lobes directions are sampled from, in addition to cosine sampling.
    pub roughnesses: &'a [f64],
    pub options: PathOptions,
    pub seed: u64,
    /// Different passes are independent.
    pub pass: u64,
}

/// Incident radiance at random points of an observation, from one set of paths.
#[derive(Debug, Clone, Default)]
pub struct Gathered {
    /// Outgoing direction in the local frame, and an incident sample.
    arrivals: Vec<(glam::Vec3, Arrival)>,
    points: u32,
}

/// Radiance of an observation per unit of each component of a material, per channel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Components {
    /// A diffuse surface of unit albedo.
    pub diffuse: DVec3,
    /// The base below a lobe, of unit albedo, without the factor (1 − specular).
    pub base: DVec3,
    /// The lobe without its Fresnel term.
    pub lobe: DVec3,
    /// The lobe times Schlick's (1 − cos)⁵.
    pub grazing: DVec3,
}

impl Components {
    /// What `f` makes of each component.
    pub fn map(self, f: impl Fn(DVec3) -> DVec3) -> Self {
        self.zip(self, |own, _| f(own))
    }

    /// What `f` makes of each component of both.
    pub fn zip(self, other: Self, f: impl Fn(DVec3, DVec3) -> DVec3) -> Self {
        Self {
            diffuse: f(self.diffuse, other.diffuse),
            base: f(self.base, other.base),
            lobe: f(self.lobe, other.lobe),
            grazing: f(self.grazing, other.grazing),
        }
    }
}

impl Gathering<'_> {
    /// Samples the incident radiance of one observation, in two independent sets.
    pub fn observation(
        &self,
        camera: &Camera,
        observation: &SpotObservation,
    ) -> ([Gathered; 2], RayCount) {
        let mut cast = RayCount::default();
        let sets = [0, 1].map(|set| {
            let mut gathered = Gathered::default();
            for point in 0..self.points {
                cast += self.point(camera, observation, set, point, &mut gathered);
            }
            gathered
        });
        (sets, cast)
    }

    fn point(
        &self,
        camera: &Camera,
        observation: &SpotObservation,
        set: u64,
        point: u32,
        gathered: &mut Gathered,
    ) -> RayCount {
        // Points are stratified over the pixels.
        let index = KEY + (self.pass << 40) + 2 * u64::from(point) + set;
        let first = u64::from(observation.pixels[0]);
        let mut stream = Stream::new(self.seed, u64::from(observation.frame), first, index);
        let count = observation.pixels.len() as u32;
        let mut index_in_pixels = point;
        if self.points < count {
            let within = stream.below(1 + (count / self.points) as usize) as u32;
            index_in_pixels = point * count / self.points + within;
        }
        let pixel = observation.pixels[(index_in_pixels % count) as usize];
        let corner = camera.corner(pixel as usize);
        let ray = camera.ray(corner + Vec2::from_array(stream.uniform2()));
        let mut cast = RayCount {
            rays: 1,
            rejected: 0,
        };
        let scene = &self.lit.scene;
        let Some(hit) = scene.intersect(&ray) else {
            return cast;
        };
        if scene.object_of[hit.triangle as usize] != self.object {
            return cast;
        }

        // Incident light on the side that the camera sees.
        let surface = self.lit.surface(&hit);
        let to_camera = -ray.direction.normalize_or_zero();
        let is_back = surface.normal.dot(to_camera) < 0.0;
        let frame = Frame::around(surface.normal * if is_back { -1.0 } else { 1.0 });
        let wo = frame.to_local(to_camera);
        if wo.z <= 0.0 {
            return cast;
        }
        let mut found = Vec::new();
        cast += arrivals(
            self.lit,
            &surface,
            &frame,
            wo,
            self.roughnesses,
            &mut stream,
            &self.options,
            &mut found,
        );
        gathered.points += 1;
        gathered.arrivals.extend(found.into_iter().map(|a| (wo, a)));
        cast
    }
}

impl Gathered {
    /// The observation's components for a lobe of GGX roughness α; zero if no point hit the object.
    pub fn components(&self, alpha: f64) -> Components {
        let mut sum = Components::default();
        for (wo, arrival) in &self.arrivals {
            let light = arrival.light.as_dvec3();
            let lobe = Microfacet::new(alpha, *wo, arrival.wi);
            let value = lobe.eval();
            sum.diffuse += light * f64::from(warp::cosine_hemisphere_pdf(arrival.wi.z));
            sum.base += light * coupling(*wo, arrival.wi);
            sum.lobe += light * value;
            sum.grazing += light * (value * lobe.schlick);
        }
        let fraction = 1.0 / f64::from(self.points.max(1));
        sum.map(|component| component * fraction)
    }

    /// Whether no point hit the object.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    pub fn joined([mut a, b]: [Self; 2]) -> Self {
        a.arrivals.extend(b.arrivals);
        a.points += b.points;
        a
    }
}
