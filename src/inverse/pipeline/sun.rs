//! Search for the sun: the direction from which one far, small source explains how bright the surfaces are that it reaches.
//!
//! Each pixel of a fine map of the sky above the horizon is a candidate. For each, shadow rays tell which clusters of pixels it
//! reaches; its irradiance, that of the sky and the albedo of each object are then fitted together.

use crate::inverse::fit::prior::{ALBEDO_MEAN, UNSEEN_DEVIATION};
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::clusters::Cluster;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::inverse::settings::LightSampling;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::{luminance, luminance_f64};
use crate::scene::Scene;
use crate::scene::geometry::{Ray, offset_origin};
use crate::transport::environment::directions;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use rayon::prelude::*;

/// Columns of the maps of candidates, from coarse to fine; twice the rows. A finest pixel has 1.4 degrees.
const COLUMNS: [usize; 3] = [64, 128, 256];
/// Clusters that each map is tested with, at most.
const CLUSTERS: [usize; 3] = [512, 2048, 2048];
/// Candidates of one map that are refined by the next.
const REFINED: usize = 8;
/// Assumed relative error of a cluster's radiance, by texture, noise of paths and the light field's blur.
const CLUSTER_ERROR: f64 = 0.2;
/// Irradiances that are tried, over π times the mean photographed radiance: powers of two from 1/8 to 1024. Sunlight is up to a
/// thousand times as bright as a room.
const IRRADIANCES: std::ops::RangeInclusive<i32> = -3..=10;
/// Radiances of the sky that are tried besides black, over the mean photographed radiance: powers of four from 1/4 to 256.
const SKIES: std::ops::RangeInclusive<i32> = -1..=4;
/// Least fall of χ² of a sun: five standard errors, and 2 ln of the number of candidates that it is the best of.
const MIN_FALL: f64 = 25.0 + 20.0;

/// Columns of the maps in which the direction of a fitted sun is refined, and how far from it candidates are, in their pixels. A
/// finest pixel has 0.18 degrees, a third of the sun's disc.
const FINE_COLUMNS: [usize; 3] = [512, 1024, 2048];
const FINE_REACH: f32 = 5.0;
/// Clusters that a fitted sun is refined with, at most, and pixels of each: shadow edges cross clusters.
const FINE_CLUSTERS: usize = 2048;
const FINE_PIXELS: usize = 8;
/// Irradiances that are tried with each direction, over that of the fitted sun: powers of the eighth root of two.
const FINE_IRRADIANCES: std::ops::RangeInclusive<i32> = -4..=4;

/// One cluster of pixels, reduced to what the search needs.
struct Patch {
    object: usize,
    /// Surface points of some of its pixels.
    spots: Vec<Spot>,
    /// Photographed luminance, and whether it is a lower bound.
    measured: f64,
    censored: bool,
    /// Luminance that it would have at an albedo of one in the light of the room, and in that of a uniform sky of radiance one.
    room: f64,
    sky: f64,
}

impl Patch {
    /// The patch of a cluster with spots in `pixels` of its pixels; `None` if nothing of the mesh is seen there.
    fn new(
        scene: &Scene,
        cluster: &Cluster,
        pixels: usize,
        [dark, bright]: [&Linearised; 2],
    ) -> Option<Self> {
        let camera = &scene.cameras[cluster.frame as usize];
        let all = &cluster.pixels;
        let pixels = pixels.min(all.len());
        let spots: Vec<Spot> = (0..pixels)
            .map(|i| all[(2 * i + 1) * all.len() / (2 * pixels)])
            .filter_map(|pixel| Spot::new(scene, &camera.ray(camera.corner(pixel as usize) + 0.5)))
            .collect();
        let measured = f64::from(luminance(cluster.measured));
        (measured > 0.0 && !spots.is_empty()).then_some(Self {
            object: cluster.object as usize,
            spots,
            measured,
            censored: dark.censored.any(),
            room: luminance_f64(dark.own).max(0.0),
            sky: luminance_f64(bright.own - dark.own).max(0.0),
        })
    }

    /// Mean over the spots of the cosine of the incidence of a sun's light.
    fn cosine(&self, scene: &Scene, sky: Option<&MeasuredOutside>, towards: Vec3) -> f64 {
        let cosines = self.spots.iter().map(|s| s.cosine(scene, sky, towards));
        cosines.sum::<f64>() / self.spots.len() as f64
    }

    /// Squared residual of a predicted luminance, over its variance.
    fn misfit(&self, predicted: f64, dark: f64) -> f64 {
        let residual = self.measured - predicted;
        match self.censored && residual < 0.0 {
            true => 0.0,
            false => residual * residual / self.variance(dark),
        }
    }

    fn variance(&self, dark: f64) -> f64 {
        CLUSTER_ERROR * CLUSTER_ERROR * (self.measured * self.measured + dark * dark)
    }
}

/// A surface point that a pixel sees.
struct Spot {
    point: Vec3,
    normal: Vec3,
    corners: [Vec3; 3],
}

impl Spot {
    fn new(scene: &Scene, ray: &Ray) -> Option<Self> {
        let hit = scene.intersect(ray)?;
        let normal = scene.normals[hit.triangle as usize];
        Some(Self {
            point: scene.point(&hit),
            normal: normal * -normal.dot(ray.direction).signum(),
            corners: scene.corners(hit.triangle),
        })
    }

    /// Cosine of the incidence of a sun's light; zero in shadow.
    fn cosine(&self, scene: &Scene, sky: Option<&MeasuredOutside>, towards: Vec3) -> f64 {
        let cosine = self.normal.dot(towards);
        let origin = offset_origin(self.point, self.normal, &self.corners, towards);
        let is_open = || sky.is_none_or(|sky| sky.is_open(origin, towards));
        match cosine > 0.0 && is_open() && !scene.occluded(&Ray::new(origin, towards)) {
            true => f64::from(cosine),
            false => 0.0,
        }
    }
}

struct Search<'a> {
    scene: &'a Scene,
    sky: Option<&'a MeasuredOutside>,
    /// Sorted by object.
    patches: Vec<Patch>,
    /// Mean photographed luminance.
    level: f64,
}

impl Search<'_> {
    /// Every `step`-th patch, with the cosine of a sun's light in a direction.
    fn with_cosines(&self, towards: Vec3, step: usize) -> Vec<(&Patch, f64)> {
        (self.patches.iter().step_by(step))
            .map(|patch| (patch, patch.cosine(self.scene, self.sky, towards)))
            .collect()
    }

    /// Least χ² over the tried irradiances of a sun in a direction, over every `step`-th patch; and without a sun.
    fn misfits(&self, towards: Vec3, step: usize) -> (f64, f64) {
        let patches = self.with_cosines(towards, step);
        let brightest = |sun: f64| {
            let skies = SKIES.map(|power| self.level * 4f64.powi(power));
            (std::iter::once(0.0).chain(skies))
                .map(|sky| self.misfit(&patches, sky, sun))
                .fold(f64::INFINITY, f64::min)
        };
        let without = brightest(0.0);
        if patches.iter().all(|(_, cosine)| *cosine == 0.0) {
            return (without, without);
        }
        let suns = IRRADIANCES.map(|power| self.level * 2f64.powi(power));
        (suns.map(brightest).fold(f64::INFINITY, f64::min), without)
    }

    /// Least χ² of a sun in a direction with about an irradiance over π.
    fn misfit_near(&self, towards: Vec3, irradiance: f64) -> f64 {
        let step = self.patches.len().div_ceil(FINE_CLUSTERS).max(1);
        let patches = self.with_cosines(towards, step);
        FINE_IRRADIANCES
            .map(|step| self.misfit(&patches, 0.0, irradiance * 2f64.powf(f64::from(step) / 8.0)))
            .fold(f64::INFINITY, f64::min)
    }

    /// χ² with a sky of a radiance and a sun of an irradiance over π, where each object has the albedo that fits best.
    fn misfit(&self, patches: &[(&Patch, f64)], sky: f64, sun: f64) -> f64 {
        let precision = f64::from(UNSEEN_DEVIATION).powi(-2);
        let mean = f64::from(ALBEDO_MEAN);
        let light = |(patch, cosine): &(&Patch, f64)| patch.room + sky * patch.sky + sun * cosine;
        (patches.chunk_by(|a, b| a.0.object == b.0.object))
            .map(|object| {
                let (mut top, mut bottom) = (precision * mean, precision);
                for seen in object {
                    let weight = light(seen) / seen.0.variance(self.level);
                    top += weight * seen.0.measured;
                    bottom += weight * light(seen);
                }
                let albedo = (top / bottom).clamp(0.0, 1.0);
                let fit = object
                    .iter()
                    .map(|seen| seen.0.misfit(albedo * light(seen), self.level));
                fit.sum::<f64>() + precision * (albedo - mean).powi(2)
            })
            .sum()
    }

    /// The best direction that may hold a sun, with the fall of χ².
    fn best(&self, up: Vec3, may_hold: impl Fn(Vec3) -> bool + Sync) -> Option<(Vec3, f64)> {
        let mut candidates: Vec<Vec3> = directions([COLUMNS[0], COLUMNS[0] / 2]).collect();
        let mut ranked = Vec::new();
        for (level, columns) in COLUMNS.into_iter().enumerate() {
            let step = self.patches.len().div_ceil(CLUSTERS[level]).max(1);
            ranked = (candidates.par_iter())
                .filter(|d| d.dot(up) > 0.0 && may_hold(**d))
                .map(|&d| {
                    let (with, without) = self.misfits(d, step);
                    (d, without - with)
                })
                .collect();
            ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
            ranked.truncate(REFINED);
            let Some(finer) = COLUMNS.get(level + 1) else {
                break;
            };
            // Of the next map those pixels that lie in the kept ones or touch them.
            let reach = (std::f32::consts::TAU / columns as f32).cos();
            candidates = directions([*finer, *finer / 2])
                .filter(|d| ranked.iter().any(|(kept, _)| kept.dot(*d) >= reach))
                .collect();
        }
        ranked.first().copied()
    }
}

impl Pipeline<'_, '_> {
    /// The direction towards a sun that explains the photographs better than the present fit of the light field, if there is one.
    pub(super) fn find_sun(&self, cache: &PathCache) -> Option<Vec3> {
        // Without light samples, paths would hardly ever meet the sun.
        if self.monitor.settings.light_sampling == LightSampling::Bsdf {
            return None;
        }
        if let Some(sun) = self.sky.as_ref().and_then(|sky| sky.seen_sun()) {
            return Some(sun);
        }
        let objects = self.problem.scene.objects.len();
        // All objects are reflectors of one albedo, under a black sky and under a white one.
        let residuals = [0.0, 1.0].map(|sky| {
            let mut assumed: Unknowns = self.unknowns.clone();
            for k in (0..objects).filter(|&k| self.gbuffer.seen[k] > 0) {
                assumed.albedo[k] = Vec3::splat(ALBEDO_MEAN);
                assumed.emission[k] = Vec3::ZERO;
            }
            assumed.emission[objects..].fill(Vec3::splat(sky));
            cache.residuals(&assumed)
        });
        let search = self.search(cache, 1, residuals.each_ref());
        // A photograph that looks into a direction far away would show a sun there.
        let far = (self.sky.as_ref()).filter(|_| self.outside.surroundings == Surroundings::Far);
        let may_hold = |d: Vec3| far.is_none_or(|sky| sky.may_hold_sun(d));
        let (direction, fall) = search.best(self.problem.scene.up, may_hold)?;
        (fall >= MIN_FALL).then_some(direction)
    }

    /// The direction near the present sun that explains the photographs best, with the rest of the light as fitted.
    pub(super) fn refine_sun(&self, cache: &PathCache) -> Option<Vec3> {
        let sun = self.outside.sun?;
        let surface = self.outside.sun_surface() as usize;
        let irradiance = luminance_f64(self.unknowns.emission[surface].as_dvec3());
        let mut without = self.unknowns.clone();
        without.emission[surface] = Vec3::ZERO;
        let search = self.search(cache, FINE_PIXELS, [&cache.residuals(&without); 2]);
        let mut best = sun;
        for columns in FINE_COLUMNS {
            let reach = (FINE_REACH * std::f32::consts::TAU / columns as f32).cos();
            let candidates: Vec<Vec3> = (directions([columns, columns / 2]))
                .filter(|d| d.dot(best) >= reach && d.dot(self.problem.scene.up) > 0.0)
                .collect();
            let ranked = (candidates.into_par_iter().chain([best]))
                .map(|d| (d, search.misfit_near(d, irradiance)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            best = ranked?.0;
        }
        Some(best)
    }

    /// The clusters of seen reflectors, lit as in two assumed states. What they get more in the second one is a sky's light.
    fn search(
        &self,
        cache: &PathCache,
        pixels: usize,
        residuals: [&Vec<Linearised>; 2],
    ) -> Search<'_> {
        let scene = &*self.problem.scene;
        let mut patches: Vec<Patch> = (cache.clusters.iter().enumerate())
            .filter_map(|(i, cached)| {
                let cluster = &cached.cluster;
                let reflects = self.roles[cluster.object as usize] == Role::Reflector;
                let radiances = residuals.map(|of_state| &of_state[i]);
                reflects.then(|| Patch::new(scene, cluster, pixels, radiances))?
            })
            .collect();
        patches.sort_by_key(|patch| patch.object);
        let sum: f64 = patches.iter().map(|patch| patch.measured).sum();
        Search {
            level: sum / patches.len().max(1) as f64,
            scene,
            sky: self.sky.as_ref(),
            patches,
        }
    }
}
