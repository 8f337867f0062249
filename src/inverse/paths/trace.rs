//! Traces the paths of a transport cache.

use crate::calibrate::gbuffer::SurfacePoint;
use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::clusters::Cluster;
use crate::inverse::paths::lamp_patches::LampPatches;
use crate::inverse::paths::outside_grid::OutsideGrid;
use crate::inverse::paths::scatter::{Scattered, Scattering};
use crate::inverse::paths::{CachedCluster, NO_PATCH, NO_TEXEL, PathCache, SPECULAR, Vertex};
use crate::inverse::settings::LightSampling;
use crate::math::frame::Frame;
use crate::math::sequence::{SequencePoint, Uniforms};
use crate::math::warp;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Hit, Ray, offset_origin};
use crate::scene::texels::TexelLayout;
use crate::transport::arrival::RayCount;
use crate::transport::emitters::Emitters;
use crate::transport::material::Lobe;
use crate::transport::path::power_heuristic;
use crate::transport::sun;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};

/// Bounces before Russian roulette may end a path.
const RR_DEPTH: u32 = 2;
const RR_MIN_SURVIVAL: f32 = 0.1;
/// Greatest survival probability of Russian roulette. The variance is finite while the squared albedo is below it.
const RR_MAX_SURVIVAL: f32 = 0.999;

/// Upper bound of the mean number of vertices per path if no surface's expected albedo exceeds `albedo`.
pub fn max_mean_path_length(albedo: f32) -> f32 {
    // The first vertex, one outside, and a geometric number of bounces under Russian roulette.
    let survival = albedo.clamp(RR_MIN_SURVIVAL, RR_MAX_SURVIVAL);
    2.0 + RR_DEPTH as f32 + 1.0 / (1.0 - survival)
}

/// The inputs that are constant while a cache is traced.
pub struct Tracer<'a> {
    /// Geometry.
    pub scene: &'a Scene,
    /// Emitters that light samples (NEE) are drawn from.
    pub lights: &'a Emitters,
    /// Radiance measured by photographs, at which paths end; `None` traces all paths to emitters.
    pub measured: Option<&'a MeasuredRadiance>,
    /// The surface of each triangle: triangles of one surface share their unknowns.
    pub surface_of: &'a [u32],
    /// For each surface, the largest channel of its present albedo estimate; used for sampling decisions only.
    pub expected_albedo: &'a [f32],
    /// Textures whose texel indices are stored at the vertices, and whether each object has one; `None` if all have.
    pub texels: Option<(&'a TexelLayout, Option<&'a [bool]>)>,
    /// The rough specular lobe of each object that has one; empty without lobes. Objects with a lobe emit no light.
    pub lobes: &'a [Option<Lobe>],
    /// Patches of lamps with known reflected light. Paths end at them except at the first vertex; `None` continues all paths.
    pub patches: Option<&'a LampPatches>,
    /// Outside light in directions that photographs measured; light samples are drawn from it too.
    pub sky: Option<&'a MeasuredOutside>,
    /// Surfaces that stand for unmeasured outside light, by direction, and for the sun; `None` makes it zero.
    pub outside: Option<OutsideGrid>,
    /// Sampling strategy for direct light.
    pub sampling: LightSampling,
    /// Greatest number of bounces.
    pub max_bounces: u32,
    /// Seed of the random streams.
    pub seed: u64,
    /// Caches of different stages are independent.
    pub stage: u64,
    /// Rounds of one stage continue the same low-discrepancy sequences.
    pub round: u32,
}

impl Tracer<'_> {
    /// Traces two independent sets of paths for every cluster.
    pub fn trace(&self, clusters: &[Cluster]) -> PathCache {
        let (clusters, casts): (Vec<CachedCluster>, Vec<RayCount>) = clusters
            .par_iter()
            .map(|cluster| self.cluster(cluster))
            .unzip();
        let cast = casts.into_iter().sum();
        PathCache { clusters, cast }
    }

    fn cluster(&self, cluster: &Cluster) -> (CachedCluster, RayCount) {
        let camera = &self.scene.cameras[cluster.frame as usize];
        let (mut vertices, mut ends) = (Vec::new(), Vec::new());
        let mut cast = RayCount::default();
        let (paths, count) = (u64::from(cluster.paths), cluster.pixels.len() as u64);
        let first = cluster.pixels.first().copied().map_or(0, u64::from);
        for (position, &pixel) in cluster.pixels.iter().enumerate() {
            let corner = camera.corner(pixel as usize);
            for path in 0..2 * paths {
                // All paths of a set, over its pixels and rounds, share one low-discrepancy sequence.
                let set = path / paths;
                let index =
                    (u64::from(self.round) * count + position as u64) * paths + path % paths;
                let key = [u64::from(cluster.frame), first, 2 * self.stage + set];
                let mut numbers = SequencePoint::new(self.seed, key, index);
                cast += self.pixel_path(camera, corner, &mut numbers, &mut vertices);
                ends.push(vertices.len() as u32);
            }
        }
        // `PathCache::bytes` counts lengths, not capacities.
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

    /// Appends the vertices of one path through the pixel at `corner`, unless a weight is not finite: then it counts as rejected.
    pub fn pixel_path(
        &self,
        camera: &Camera,
        corner: Vec2,
        numbers: &mut impl Uniforms,
        vertices: &mut Vec<Vertex>,
    ) -> RayCount {
        let start = vertices.len();
        let [dx, dy, ..] = numbers.four();
        let rays = self.path(&camera.ray(corner + Vec2::new(dx, dy)), numbers, vertices);
        let finite = vertices[start..].iter().all(|v| {
            v.lamp_weight.is_finite() && v.emission_weight.is_finite() && v.known.is_finite()
        });
        if !finite {
            vertices.truncate(start);
        }
        RayCount {
            rays,
            rejected: u64::from(!finite),
        }
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
            vertices.extend(self.unmeasured(camera_ray, 1.0));
            return rays;
        };
        let mut wo = -camera_ray.direction;
        // Product of the known weights so far: lobes and survival probabilities.
        let mut scale = 1.0f32;
        // MIS weight of emission at the present vertex.
        let mut emission_weight = 1.0;
        // Expected throughput, with the estimated albedos.
        let mut expected = 1.0f32;
        let mut bounce = 0;
        loop {
            let mut surface = self.surface(&hit, wo);
            let albedo = self.expected_albedo[surface.id as usize];
            surface.scale = scale;
            let lobe = self.lobes.get(surface.point.object as usize);
            surface.scattering = lobe.copied().flatten().map(|lobe| {
                let [choice, ..] = numbers.four();
                Scattering::new(lobe, surface.point.normal, wo, albedo, choice)
            });
            let mut vertex = Vertex::on(match &surface.scattering {
                Some(scattering) if scattering.specular => SPECULAR,
                _ => surface.id,
            });
            vertex.texel = self.texel(&hit);
            if surface.front && surface.scattering.is_none() {
                vertex.emission_weight = emission_weight * scale;
            }
            if surface.front && bounce > 0 {
                vertex.patch = self.patch(hit.triangle);
            }
            if bounce >= self.max_bounces || vertex.patch != NO_PATCH {
                vertices.push(vertex);
                return rays;
            }

            // Next-event estimation.
            let [choice, u, v, pick] = numbers.four();
            if self.sampling != LightSampling::Bsdf {
                let choice = numbers.refine(choice);
                let [sky, sun] = [self.sky_fraction(), self.sun_fraction()];
                rays += if pick < sky {
                    self.sky_sample(&surface, choice, [u, v], &mut vertex)
                } else if pick < sky + sun {
                    self.sun_sample(&surface, [u, v], &mut vertex)
                } else {
                    self.light_sample(&surface, choice, [u, v], &mut vertex)
                };
            }

            // Russian roulette by the expected albedo, which is constant while the unknowns are fitted.
            let [u, v, end, _] = numbers.four();
            let throughput =
                (surface.scattering.as_ref()).map_or(albedo, |s| s.expected_throughput(albedo));
            expected *= throughput;
            if bounce >= RR_DEPTH {
                let survival = expected.clamp(RR_MIN_SURVIVAL, RR_MAX_SURVIVAL);
                if end >= survival {
                    vertices.push(vertex);
                    return rays;
                }
                expected /= survival;
                scale /= survival;
            }

            // Scatter with pdf cosθ/π, so that the weight is the albedo alone, or from the chosen component of a lobed surface.
            let Some(scattered) = surface.scatter([u, v]) else {
                vertices.push(vertex);
                return rays;
            };
            let (wi, bsdf_pdf) = (scattered.wi, scattered.pdf);
            scale *= scattered.weight;
            let origin = surface.leave(wi);
            rays += 1;
            let ray = Ray::new(origin, wi);
            let Some(next) = self.scene.intersect(&ray) else {
                if let Some((sky, radiance)) = self.sky.and_then(|s| Some((s, s.at(origin, wi)?))) {
                    let sky_pdf = sky.map().pdf(origin, wi) * self.sky_fraction();
                    let weight = self.hit_weight(bsdf_pdf, sky_pdf);
                    vertex.known += radiance * (weight * scale);
                    vertices.push(vertex);
                    let excess = self.outside.filter(|_| sky.is_bound(origin, wi));
                    vertices.extend(excess.map(|grid| Vertex {
                        emission_weight: weight * scale,
                        ..Vertex::on(grid.excess(wi))
                    }));
                } else {
                    vertices.push(vertex);
                    // No light samples are drawn from unmeasured outside light, so a hit has the whole MIS weight.
                    vertices.extend(self.unmeasured(&ray, scale));
                }
                return rays;
            };

            // MIS weight of the hit's emission against light sampling.
            let next_surface = self.surface(&next, -wi);
            let light_pdf = if next_surface.front {
                let cosine = next_surface.point.normal.dot(-wi);
                self.light_pdf(next_surface.point.object) * next.t * next.t
                    / cosine.max(f32::MIN_POSITIVE)
            } else {
                0.0
            };
            emission_weight = self.hit_weight(bsdf_pdf, light_pdf);

            // End at a surface with measured radiance.
            if let Some(radiance) = self.measured.and_then(|m| m.at(&next_surface.point)) {
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

    /// The last vertex of a path that leaves the mesh where outside light is not measured.
    fn unmeasured(&self, ray: &Ray, scale: f32) -> Option<Vertex> {
        let shape = (self.sky).map_or(1.0, |sky| sky.shape(ray.origin, ray.direction));
        self.outside.map(|grid| grid.vertex(ray, scale * shape))
    }

    /// Adds a light sample on an emitter to a vertex; returns the number of rays.
    fn light_sample(
        &self,
        surface: &Surface,
        choice: f64,
        u: [f32; 2],
        vertex: &mut Vertex,
    ) -> u64 {
        let Some((object, sample)) = self.lights.sample(self.scene, choice, u) else {
            return 0;
        };
        let light_normal = self.scene.normals[sample.triangle as usize];
        let to_light = sample.point - surface.point.point;
        let distance2 = to_light.length_squared();
        let wi = to_light.normalize_or_zero();
        let (cos_surface, cos_light) = (surface.point.normal.dot(wi), -light_normal.dot(wi));
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
        let weight = self.sample_weight(light_pdf, surface.value(wi)) * surface.scale;
        let light_point = SurfacePoint {
            point: sample.point,
            normal: light_normal,
            object,
        };
        match self.measured.and_then(|m| m.at(&light_point)) {
            Some(radiance) => vertex.known += radiance * weight,
            None => {
                vertex.lamp = self.surface_of[sample.triangle as usize];
                vertex.lamp_weight = weight;
                vertex.patch = self.patch(sample.triangle);
            }
        }
        1
    }

    /// Adds a light sample of the measured outside light to a vertex; returns the number of rays.
    fn sky_sample(&self, surface: &Surface, choice: f64, u: [f32; 2], vertex: &mut Vertex) -> u64 {
        let point = surface.point.point;
        let Some((sky, (wi, pdf))) =
            (self.sky).and_then(|s| Some((s, s.map().sample(point, choice, u)?)))
        else {
            return 0;
        };
        let (leaves, rays) = self.leaves_mesh(surface, wi);
        if !leaves {
            return rays;
        }
        let sky_pdf = pdf * self.sky_fraction();
        let weight = self.sample_weight(sky_pdf, surface.value(wi)) * surface.scale;
        vertex.known += sky.map().radiance(point, wi) * weight;
        if let Some(grid) = self.outside.filter(|_| sky.is_bound(point, wi)) {
            (vertex.lamp, vertex.lamp_weight) = (grid.excess(wi), weight);
        }
        rays
    }

    /// Adds light of the sun to a vertex; returns the number of rays. No other sample reaches the sun, so its weight is one.
    fn sun_sample(&self, surface: &Surface, u: [f32; 2], vertex: &mut Vertex) -> u64 {
        let Some((grid, towards)) = self.outside.and_then(|grid| Some((grid, grid.sun?))) else {
            return 0;
        };
        let wi = sun::sample(towards, u);
        if (self.sky).is_some_and(|sky| !sky.is_open(surface.leave(wi), wi)) {
            return 0;
        }
        let (leaves, rays) = self.leaves_mesh(surface, wi);
        if leaves {
            let (value, _) = surface.value(wi);
            vertex.lamp = grid.sun_surface();
            vertex.lamp_weight = PI * value / self.sun_fraction() * surface.scale;
        }
        rays
    }

    /// Whether a ray in a direction leaves the mesh, and the number of rays that it took to tell.
    fn leaves_mesh(&self, surface: &Surface, wi: Vec3) -> (bool, u64) {
        if surface.point.normal.dot(wi) <= 0.0 {
            return (false, 0);
        }
        let ray = Ray::new(surface.leave(wi), wi);
        (!self.scene.occluded(&ray), 1)
    }

    /// Fraction of the light samples that are drawn from the measured outside light.
    fn sky_fraction(&self) -> f32 {
        self.fraction(self.sky.is_some())
    }

    /// Fraction of the light samples that are drawn from the sun.
    fn sun_fraction(&self) -> f32 {
        self.fraction(self.outside.is_some_and(|grid| grid.sun.is_some()))
    }

    /// Light samples are divided evenly among emitters of the mesh, measured outside light and the sun, as far as they exist.
    fn fraction(&self, exists: bool) -> f32 {
        let sun = self.outside.is_some_and(|grid| grid.sun.is_some());
        let all = [!self.lights.is_dark(), self.sky.is_some(), sun];
        let count = all.into_iter().filter(|&exists| exists).count();
        f32::from(exists) / count.max(1) as f32
    }

    /// Pdf of light samples on an object of the mesh, with respect to area in m².
    fn light_pdf(&self, object: u32) -> f32 {
        self.lights.pdf(object) * (1.0 - self.sky_fraction() - self.sun_fraction())
    }

    /// Weight of a light sample: `value` (f cosθ / albedo) over its pdf, times its MIS weight; pdfs with respect to solid angle.
    fn sample_weight(&self, light_pdf: f32, (value, bsdf_pdf): (f32, f32)) -> f32 {
        let fraction = match self.sampling {
            LightSampling::Mis => power_heuristic(light_pdf, bsdf_pdf),
            LightSampling::Emitter | LightSampling::Bsdf => 1.0,
        };
        value / light_pdf * fraction
    }

    /// MIS weight of light hit by BSDF sampling; pdfs with respect to solid angle.
    fn hit_weight(&self, bsdf_pdf: f32, light_pdf: f32) -> f32 {
        match self.sampling {
            LightSampling::Mis => power_heuristic(bsdf_pdf, light_pdf),
            LightSampling::Bsdf => 1.0,
            // Light that light sampling cannot draw is left to BSDF sampling.
            LightSampling::Emitter => f32::from(light_pdf <= 0.0),
        }
    }

    fn texel(&self, hit: &Hit) -> u32 {
        let object = self.scene.object_of[hit.triangle as usize] as usize;
        let has_one = |textured: &[bool]| textured.get(object) == Some(&true);
        let textures = self
            .texels
            .filter(|(_, textured)| textured.is_none_or(has_one));
        textures.map_or(NO_TEXEL, |(layout, _)| layout.texel(hit))
    }

    fn patch(&self, triangle: u32) -> u32 {
        self.patches.map_or(NO_PATCH, |p| p.patch(triangle))
    }

    fn surface(&self, hit: &Hit, wo: Vec3) -> Surface {
        let normal = self.scene.normals[hit.triangle as usize];
        let front = normal.dot(wo) > 0.0;
        Surface {
            point: SurfacePoint {
                point: self.scene.point(hit),
                normal: if front { normal } else { -normal },
                object: self.scene.object_of[hit.triangle as usize],
            },
            corners: self.scene.corners(hit.triangle),
            id: self.surface_of[hit.triangle as usize],
            front,
            scattering: None,
            scale: 1.0,
        }
    }
}

struct Surface {
    /// With the normal of the side that the path arrives at.
    point: SurfacePoint,
    corners: [Vec3; 3],
    id: u32,
    front: bool,
    /// What the path chose of a surface with a lobe.
    scattering: Option<Scattering>,
    /// Product of the path's known weights up to here.
    scale: f32,
}

impl Surface {
    /// Origin of a ray that leaves the surface in a direction.
    fn leave(&self, wi: Vec3) -> Vec3 {
        offset_origin(self.point.point, self.point.normal, &self.corners, wi)
    }

    /// For a unit direction above the horizon: f cosθ / albedo and the pdf of sampling it, cosθ/π or those of the lobe's component.
    fn value(&self, wi: Vec3) -> (f32, f32) {
        match &self.scattering {
            Some(scattering) => scattering.value(wi),
            None => {
                let cosine_pdf = self.point.normal.dot(wi) * FRAC_1_PI;
                (cosine_pdf, cosine_pdf)
            }
        }
    }

    /// Samples a direction; `None` if a lobe reflects below the horizon.
    fn scatter(&self, u: [f32; 2]) -> Option<Scattered> {
        if let Some(scattering) = &self.scattering {
            return scattering.sample(u);
        }
        let local = warp::cosine_hemisphere(u);
        Some(Scattered {
            wi: Frame::around(self.point.normal).to_world(local),
            weight: 1.0,
            pdf: warp::cosine_hemisphere_pdf(local.z),
        })
    }
}
