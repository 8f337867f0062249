//! Tracing the paths of a cache.

use crate::calibrate::gbuffer::SurfacePoint;
use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::estimate::TexelEstimate;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::clusters::Cluster;
use crate::inverse::paths::lamp_patches::LampPatches;
use crate::inverse::paths::scatter::{Scattered, Scattering};
use crate::inverse::paths::{CachedCluster, NO_PATCH, NO_TEXEL, PathCache, SPECULAR, Vertex};
use crate::inverse::settings::LightSampling;
use crate::math::frame::Frame;
use crate::math::sequence::{SequencePoint, Uniforms};
use crate::math::warp;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Hit, Ray, offset_origin};
use crate::transport::arrival::Cast;
use crate::transport::emitters::Emitters;
use crate::transport::environment::{direction_of, pixel_of};
use crate::transport::material::Lobe;
use crate::transport::path::power_heuristic;
use crate::transport::surroundings::Surroundings;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Bounces before Russian roulette may end a path.
const RR_DEPTH: u32 = 2;
/// Paths are never ended with a higher chance than this at one vertex.
const RR_MIN_SURVIVAL: f32 = 0.1;
/// Paths are never continued with a higher chance than this. Their variance is finite while the square of the albedo is
/// below it.
const RR_MAX_SURVIVAL: f32 = 0.999;

/// At most so many vertices has a path in the mean where no surface is believed to reflect more than `albedo`.
pub fn longest_mean_path(albedo: f32) -> f32 {
    // The camera's vertex, one outside, and a geometric number of bounces once the roulette may end it.
    let survival = albedo.clamp(RR_MIN_SURVIVAL, RR_MAX_SURVIVAL);
    2.0 + RR_DEPTH as f32 + 1.0 / (1.0 - survival)
}

/// Everything that a path needs and that stays the same while a cache is traced.
pub struct Tracer<'a> {
    /// Geometry.
    pub scene: &'a Scene,
    /// Where light samples go.
    pub lights: &'a Emitters,
    /// Radiance known from photographs, where paths may end; `None` traces them to the lamps.
    pub measured: Option<&'a MeasuredRadiance>,
    /// The surface that each triangle belongs to: triangles of one surface share their unknowns.
    pub surface_of: &'a [u32],
    /// For each surface, the largest channel of its albedo as believed now; only steers where paths end.
    pub believed_albedo: &'a [f32],
    /// Textures whose texels are noted at the vertices.
    pub texels: Option<&'a TexelEstimate>,
    /// For each object its rough specular lobe, where it has one; empty where none has. What has a lobe gives no light.
    pub lobes: &'a [Option<Lobe>],
    /// Patches of lamps, at which paths end unless the camera sees them: what they reflect is known. `None` follows all
    /// paths on.
    pub patches: Option<&'a LampPatches>,
    /// Light from outside where photographs measured it; draws light samples too.
    pub sky: Option<&'a MeasuredOutside>,
    /// Surfaces that stand for light from elsewhere outside, by direction; `None` lets escaping rays find nothing.
    pub outside: Option<OutsideGrid>,
    /// How light is found at a vertex.
    pub sampling: LightSampling,
    /// Longest path in bounces.
    pub max_bounces: u32,
    /// Key of the random streams.
    pub seed: u64,
    /// Caches of other stages are independent.
    pub stage: u64,
    /// Rounds of one stage continue each other's sequences of numbers, so that together they are more even than apart.
    pub round: u32,
}

/// Directions out of the mesh, cut into the pixels of a map; each is a surface with an emission. One more stands for what
/// directions in which all photographs are saturated exceed their bounds by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutsideGrid {
    /// Index of the first pixel's surface.
    pub first: u32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// How far away the light comes from.
    pub surroundings: Surroundings,
}

impl OutsideGrid {
    /// Surfaces in all.
    pub fn surfaces(&self) -> usize {
        self.width * self.height + 1
    }

    /// The surface that stands for light above the bounds.
    pub fn excess(&self) -> u32 {
        self.first + (self.width * self.height) as u32
    }

    /// The unit direction in the middle of a surface.
    pub fn direction(&self, surface: u32) -> Vec3 {
        direction_of(self.width, self.height, (surface - self.first) as usize)
    }

    /// The surface of a unit direction of the map.
    pub fn surface(&self, map_direction: Vec3) -> u32 {
        self.first + pixel_of(self.width, self.height, map_direction) as u32
    }

    /// The vertex at which a path ends that leaves along a ray.
    fn vertex(&self, ray: &Ray, weight: f32) -> Vertex {
        let map_direction = self.surroundings.map_direction(ray.origin, ray.direction);
        Vertex {
            emission_weight: weight,
            ..Vertex::on(self.surface(map_direction))
        }
    }
}

impl Tracer<'_> {
    /// Traces the paths of every cluster, two independent sets of them.
    pub fn trace(&self, clusters: &[Cluster], widths: &[u32]) -> PathCache {
        let traced: Vec<(CachedCluster, Cast)> = clusters
            .par_iter()
            .map(|cluster| self.cluster(cluster, widths[cluster.frame as usize]))
            .collect();
        let mut cache = PathCache::default();
        for (cluster, cast) in traced {
            cache.clusters.push(cluster);
            cache.cast += cast;
        }
        cache
    }

    fn cluster(&self, cluster: &Cluster, width: u32) -> (CachedCluster, Cast) {
        let (mut vertices, mut ends) = (Vec::new(), Vec::new());
        let mut cast = Cast::default();
        let (paths, count) = (u64::from(cluster.paths), cluster.pixels.len() as u64);
        let first = cluster.pixels.first().copied().map_or(0, u64::from);
        for (place, &pixel) in cluster.pixels.iter().enumerate() {
            let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
            for path in 0..2 * paths {
                // The paths of a set, over all its pixels and rounds, share one sequence.
                let set = path / paths;
                let index = (u64::from(self.round) * count + place as u64) * paths + path % paths;
                let key = [u64::from(cluster.frame), first, 2 * self.stage + set];
                let mut numbers = SequencePoint::new(self.seed, key, index);
                let camera = &self.scene.cameras[cluster.frame as usize];
                let traced = self.pixel_path(camera, corner, &mut numbers, &mut vertices);
                cast.rays += traced.0;
                cast.rejected += u64::from(!traced.1);
                ends.push(vertices.len() as u32);
            }
        }
        // Memory is counted by what is used.
        vertices.shrink_to_fit();
        (
            CachedCluster {
                cluster: cluster.clone(),
                vertices,
                ends,
            },
            cast,
        )
    }

    /// Appends the vertices of one path through a pixel whose upper left corner is given; returns the number of rays,
    /// and whether all weights are finite (else nothing was appended).
    pub fn pixel_path(
        &self,
        camera: &Camera,
        corner: Vec2,
        numbers: &mut impl Uniforms,
        vertices: &mut Vec<Vertex>,
    ) -> (u64, bool) {
        let start = vertices.len();
        let [dx, dy, ..] = numbers.four();
        let rays = self.path(&camera.ray(corner + Vec2::new(dx, dy)), numbers, vertices);
        let finite = vertices[start..].iter().all(|v| {
            v.lamp_weight.is_finite() && v.emission_weight.is_finite() && v.known.is_finite()
        });
        if !finite {
            vertices.truncate(start);
        }
        (rays, finite)
    }

    /// Appends the vertices of one path; returns the number of rays.
    fn path(
        &self,
        camera_ray: &Ray,
        numbers: &mut impl Uniforms,
        vertices: &mut Vec<Vertex>,
    ) -> u64 {
        let mut rays = 1;
        let Some(mut hit) = self.scene.intersect(camera_ray) else {
            vertices.extend(self.outside.map(|grid| grid.vertex(camera_ray, 1.0)));
            return rays;
        };
        let mut wo = -camera_ray.direction;
        // Weight of everything from here on: the inverse of the chances of having come so far.
        let mut scale = 1.0f32;
        let mut emission_weight = 1.0;
        let mut believed = 1.0f32;
        let mut bounce = 0;
        loop {
            // Describe the vertex.
            let surface = self.surface(&hit, wo);
            let albedo = self.believed_albedo[surface.id as usize];
            let lobed = self.lobe(surface.seen.object).map(|lobe| {
                let [choice, ..] = numbers.four();
                Scattering::new(lobe, surface.seen.normal, wo, albedo, choice)
            });
            let mut vertex = Vertex::on(match &lobed {
                Some(scattering) if scattering.specular => SPECULAR,
                _ => surface.id,
            });
            vertex.texel = self.texel(&hit);
            if surface.front && lobed.is_none() {
                vertex.emission_weight = emission_weight * scale;
            }
            if surface.front && bounce > 0 {
                vertex.patch = self.patch(hit.triangle);
            }
            if bounce >= self.max_bounces || vertex.patch != NO_PATCH {
                vertices.push(vertex);
                return rays;
            }

            // Sample light directly.
            let [choice, u, v, pick] = numbers.four();
            if self.sampling != LightSampling::Bsdf {
                let choice = numbers.refine(choice);
                rays += if pick < self.sky_fraction() {
                    self.sky_sample(&surface, &lobed, scale, choice, [u, v], &mut vertex)
                } else {
                    self.light_sample(&surface, &lobed, scale, choice, [u, v], &mut vertex)
                };
            }

            // Decide whether to go on, by what is believed of the albedo and never by the unknowns themselves.
            let [u, v, end, _] = numbers.four();
            let left = (lobed.as_ref()).map_or(albedo, |scattering| scattering.believed(albedo));
            let believed_here = believed * left;
            let mut survival = 1.0;
            if bounce >= RR_DEPTH {
                survival = believed_here.clamp(RR_MIN_SURVIVAL, RR_MAX_SURVIVAL);
                if end >= survival {
                    vertices.push(vertex);
                    return rays;
                }
                believed = believed_here / survival;
            } else {
                believed = believed_here;
            }
            scale /= survival;

            // Scatter with density cosθ/π, so that the weight is the albedo alone; under a lobe by the part taken.
            let Some(scattered) = surface.scatter(&lobed, [u, v]) else {
                vertices.push(vertex);
                return rays;
            };
            let (wi, bsdf_pdf) = (scattered.wi, scattered.pdf);
            scale *= scattered.weight;
            let origin = surface.leave(wi);
            rays += 1;
            let ray = Ray::new(origin, wi);
            let next = self.scene.intersect(&ray);
            let Some(next) = next else {
                if let Some((sky, radiance)) = self.sky.and_then(|s| Some((s, s.at(origin, wi)?))) {
                    let sky_pdf = sky.map().pdf(origin, wi) * self.sky_fraction();
                    let weight = self.met_weight(bsdf_pdf, sky_pdf);
                    vertex.known += radiance * (weight * scale);
                    vertices.push(vertex);
                    let excess = self.outside.filter(|_| sky.is_bound(origin, wi));
                    vertices.extend(excess.map(|grid| Vertex {
                        emission_weight: weight * scale,
                        ..Vertex::on(grid.excess())
                    }));
                } else {
                    vertices.push(vertex);
                    // Where nothing is known no light samples go, so what is met has the whole weight.
                    vertices.extend(self.outside.map(|grid| grid.vertex(&ray, scale)));
                }
                return rays;
            };

            // Weigh what is found against light sampling.
            let met = self.surface(&next, -wi);
            let light_pdf = if met.front {
                let cosine = met.seen.normal.dot(-wi);
                self.light_pdf(met.seen.object) * next.t * next.t / cosine.max(f32::MIN_POSITIVE)
            } else {
                0.0
            };
            emission_weight = self.met_weight(bsdf_pdf, light_pdf);

            // End at a surface whose radiance a photograph measured.
            if let Some(radiance) = self.measured.and_then(|m| m.at(&met.seen)) {
                vertex.known += radiance * (emission_weight * scale);
                vertices.push(vertex);
                return rays;
            }
            vertices.push(vertex);
            hit = next;
            wo = -wi;
            bounce += 1;
        }
    }

    /// Adds a light sample to a vertex; returns the number of rays.
    fn light_sample(
        &self,
        surface: &Surface,
        lobed: &Option<Scattering>,
        scale: f32,
        choice: f64,
        u: [f32; 2],
        vertex: &mut Vertex,
    ) -> u64 {
        let Some((object, sample)) = self.lights.sample(self.scene, choice, u) else {
            return 0;
        };
        let light_normal = self.scene.normals[sample.triangle as usize];
        let to_light = sample.point - surface.seen.point;
        let distance2 = to_light.length_squared();
        let wi = to_light.normalize_or_zero();
        let (cos_surface, cos_light) = (surface.seen.normal.dot(wi), -light_normal.dot(wi));
        if cos_surface <= 0.0 || cos_light <= 0.0 {
            return 0;
        }
        let from = surface.leave(wi);
        let to = offset_origin(
            sample.point,
            light_normal,
            &self.scene.corners(sample.triangle),
            -wi,
        );
        if self.scene.occluded(&Ray::between(from, to)) {
            return 1;
        }
        let light_pdf = self.light_pdf(object) * distance2 / cos_light;
        let weight = self.drawn_weight(light_pdf, surface.value(lobed, wi)) * scale;
        let seen = SurfacePoint {
            point: sample.point,
            normal: light_normal,
            object,
        };
        match self.measured.and_then(|m| m.at(&seen)) {
            Some(radiance) => vertex.known += radiance * weight,
            None => {
                vertex.lamp = self.surface_of[sample.triangle as usize];
                vertex.lamp_weight = weight;
                vertex.patch = self.patch(sample.triangle);
            }
        }
        1
    }

    /// Adds a light sample of the measured light from outside to a vertex; returns the number of rays.
    fn sky_sample(
        &self,
        surface: &Surface,
        lobed: &Option<Scattering>,
        scale: f32,
        choice: f64,
        u: [f32; 2],
        vertex: &mut Vertex,
    ) -> u64 {
        let point = surface.seen.point;
        let Some((sky, (wi, pdf))) =
            (self.sky).and_then(|s| Some((s, s.map().sample(point, choice, u)?)))
        else {
            return 0;
        };
        let cosine = surface.seen.normal.dot(wi);
        if cosine <= 0.0 {
            return 0;
        }
        let from = surface.leave(wi);
        if self.scene.occluded(&Ray::new(from, wi)) {
            return 1;
        }
        let weight = self.drawn_weight(pdf * self.sky_fraction(), surface.value(lobed, wi)) * scale;
        vertex.known += sky.map().radiance(point, wi) * weight;
        if let Some(grid) = self.outside.filter(|_| sky.is_bound(point, wi)) {
            (vertex.lamp, vertex.lamp_weight) = (grid.excess(), weight);
        }
        1
    }

    /// Fraction of the light samples that go outside.
    fn sky_fraction(&self) -> f32 {
        match (self.sky.is_some(), self.lights.is_dark()) {
            (false, _) => 0.0,
            (true, true) => 1.0,
            (true, false) => 0.5,
        }
    }

    /// Density per square metre with which light samples land on an object of the mesh.
    fn light_pdf(&self, object: u32) -> f32 {
        self.lights.pdf(object) * (1.0 - self.sky_fraction())
    }

    /// Weight of a light sample: `value` (the BSDF over its albedo, times the cosine) over its density, shared with
    /// BSDF sampling; both densities per solid angle.
    fn drawn_weight(&self, light_pdf: f32, (value, bsdf_pdf): (f32, f32)) -> f32 {
        let fraction = match self.sampling {
            LightSampling::Mis => power_heuristic(light_pdf, bsdf_pdf),
            LightSampling::Emitter | LightSampling::Bsdf => 1.0,
        };
        value / light_pdf * fraction
    }

    /// Weight of light met by BSDF sampling against light sampling, given both densities per solid angle.
    fn met_weight(&self, bsdf_pdf: f32, light_pdf: f32) -> f32 {
        match self.sampling {
            LightSampling::Mis => power_heuristic(bsdf_pdf, light_pdf),
            LightSampling::Bsdf => 1.0,
            // What light sampling cannot draw is left to BSDF sampling.
            LightSampling::Emitter => f32::from(light_pdf <= 0.0),
        }
    }

    fn texel(&self, hit: &Hit) -> u32 {
        let object = self.scene.object_of[hit.triangle as usize] as usize;
        let textures = self
            .texels
            .filter(|t| t.textured.get(object) == Some(&true));
        textures.map_or(NO_TEXEL, |t| t.colors.layout.texel(hit))
    }

    fn patch(&self, triangle: u32) -> u32 {
        self.patches.map_or(NO_PATCH, |p| p.of(triangle))
    }

    fn lobe(&self, object: u32) -> Option<Lobe> {
        self.lobes.get(object as usize).copied().flatten()
    }

    fn surface(&self, hit: &Hit, wo: Vec3) -> Surface {
        let normal = self.scene.normals[hit.triangle as usize];
        let front = normal.dot(wo) > 0.0;
        Surface {
            seen: SurfacePoint {
                point: self.scene.point(hit),
                normal: if front { normal } else { -normal },
                object: self.scene.object_of[hit.triangle as usize],
            },
            corners: self.scene.corners(hit.triangle),
            id: self.surface_of[hit.triangle as usize],
            front,
        }
    }
}

/// A surface point as a path sees it.
struct Surface {
    seen: SurfacePoint,
    corners: [Vec3; 3],
    /// Index of its unknowns.
    id: u32,
    front: bool,
}

impl Surface {
    /// Where a ray begins that leaves it in a direction.
    fn leave(&self, wi: Vec3) -> Vec3 {
        offset_origin(self.seen.point, self.seen.normal, &self.corners, wi)
    }
    /// The BSDF over its albedo, times the cosine, and the density with which it is sampled, for a unit direction above
    /// the horizon: both cosθ/π, or those of the part that is taken under a lobe.
    fn value(&self, lobed: &Option<Scattering>, wi: Vec3) -> (f32, f32) {
        match lobed {
            Some(scattering) => scattering.value(wi),
            None => {
                let cosine_pdf = self.seen.normal.dot(wi) * FRAC_1_PI;
                (cosine_pdf, cosine_pdf)
            }
        }
    }

    /// Draws a direction; `None` where a lobe reflects it below the horizon.
    fn scatter(&self, lobed: &Option<Scattering>, u: [f32; 2]) -> Option<Scattered> {
        if let Some(scattering) = lobed {
            return scattering.sample(u);
        }
        let local = warp::cosine_hemisphere(u);
        Some(Scattered {
            wi: Frame::around(self.seen.normal).to_world(local),
            weight: 1.0,
            pdf: warp::cosine_hemisphere_pdf(local.z),
        })
    }
}
