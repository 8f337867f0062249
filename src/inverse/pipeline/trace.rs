//! Traces the paths of the pipeline in slices, with reports in between, and within the memory limit.

use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::fit::path_noise::distribute_paths;
use crate::inverse::fit::prior::ALBEDO_MEAN;
use crate::inverse::paths::clusters::{Cluster, cluster};
use crate::inverse::paths::memory::PILOT_CLUSTERS;
use crate::inverse::paths::trace::{Tracer, max_mean_path_length};
use crate::inverse::paths::{PathCache, memory};
use crate::inverse::pipeline::{Pipeline, Result};
use crate::transport::emitters::Emitters;
use std::time::{Duration, Instant};

const SLICE: Duration = Duration::from_millis(25);
/// Memory limit of stored paths over that of one slice.
const SLICE_FRACTION: u64 = 8;

fn paths(clusters: &[Cluster]) -> u64 {
    (clusters.iter())
        .map(|c| 2 * u64::from(c.paths) * c.pixels.len() as u64)
        .sum()
}

impl Pipeline<'_, '_> {
    pub(super) fn distribute(&mut self, paths: u64) {
        distribute_paths(&mut self.clusters, self.roles.len(), paths);
    }

    /// Traces and stores about `paths` paths of the clusters, fewer if memory does not suffice. Also returns a remark on that, or
    /// an empty string.
    pub(super) fn stored(
        &mut self,
        lights: &Emitters,
        measured: Option<&MeasuredRadiance>,
        stage: u64,
        paths: u64,
    ) -> Result<(PathCache, String)> {
        let allowed = memory::allowed(self.monitor.settings.memory);
        let mut fits = paths;
        let expected = self.expected_albedo();
        if !memory::suffices(
            allowed,
            paths,
            max_mean_path_length(self.max_albedo(&expected)),
        ) {
            // A pilot measures the mean length of these paths.
            self.distribute(0);
            let step = self.clusters.len().div_ceil(PILOT_CLUSTERS).max(1);
            let pilot: Vec<_> = self.clusters.iter().step_by(step).cloned().collect();
            let pilot = self
                .tracer(lights, measured, &expected, stage, 0)
                .trace(&pilot);
            self.monitor.cast(pilot.cast);
            fits = paths.min(memory::paths_that_fit(allowed, &pilot));
        }
        let pixels: usize = self.clusters.iter().map(|c| c.pixels.len()).sum();
        if fits < 2 * pixels as u64 {
            // There is not room for a path per pixel in each set, so pixels are reduced.
            let pixels = (fits / 2).min(self.budget.pixels as u64);
            self.clusters = cluster(self.problem, &self.gbuffer, pixels as usize);
        }
        self.distribute(fits);
        let clusters = self.traced(lights, measured, stage, 0, |slice| slice.clusters)?;
        let limit = match fits < paths {
            true => {
                let pixels: usize = self.clusters.iter().map(|c| c.pixels.len()).sum();
                format!("; memory allows {fits} paths of {pixels} pixels in place of {paths}")
            }
            false => String::new(),
        };
        Ok((PathCache::from(clusters), limit))
    }

    /// Traces the clusters' paths in slices, with reports in between, and joins what `of_slice` makes of each; no path is stored.
    pub(super) fn traced<T>(
        &mut self,
        lights: &Emitters,
        measured: Option<&MeasuredRadiance>,
        stage: u64,
        round: u32,
        of_slice: impl Fn(PathCache) -> Vec<T>,
    ) -> Result<Vec<T>> {
        let expected = self.expected_albedo();
        let allowed = memory::allowed(self.monitor.settings.memory) / SLICE_FRACTION;
        let vertices = max_mean_path_length(self.max_albedo(&expected));
        let mut all = Vec::with_capacity(self.clusters.len());
        let mut next = 0;
        let mut slice = 16;
        while next < self.clusters.len() {
            let mut end = (next + slice).min(self.clusters.len());
            while end > next + 1
                && !memory::suffices(allowed, paths(&self.clusters[next..end]), vertices)
            {
                end = next + (end - next) / 2;
            }
            let started = Instant::now();
            let traced = self
                .tracer(lights, measured, &expected, stage, round)
                .trace(&self.clusters[next..end]);
            self.monitor.cast(traced.cast);
            all.extend(of_slice(traced));
            let elapsed = started.elapsed();
            self.monitor
                .tick(&self.estimate, &|_| self.checkpoint.clone())?;
            slice = if elapsed > SLICE {
                (slice / 2).max(4)
            } else {
                slice + slice / 2
            };
            next = end;
        }
        Ok(all)
    }

    /// For each surface, the largest channel of its present albedo, and the prior's mean for emitters, whose albedo is unknown.
    fn expected_albedo(&self) -> Vec<f32> {
        let albedo = self.unknowns.albedo.iter().zip(&self.roles);
        albedo
            .map(|(albedo, role)| match role.is_lamp() {
                true => ALBEDO_MEAN,
                false => albedo.max_element(),
            })
            .collect()
    }

    /// The largest expected albedo; 1 if there are lobes, which may reflect all light at grazing angles.
    fn max_albedo(&self, expected: &[f32]) -> f32 {
        match self.lobes.iter().any(Option::is_some) {
            true => 1.0,
            false => expected.iter().copied().fold(0.0, f32::max),
        }
    }

    fn tracer<'t>(
        &'t self,
        lights: &'t Emitters,
        measured: Option<&'t MeasuredRadiance>,
        expected_albedo: &'t [f32],
        stage: u64,
        round: u32,
    ) -> Tracer<'t> {
        let texels = self.estimate.texels.as_ref();
        Tracer {
            scene: &self.problem.scene,
            lights,
            measured,
            surface_of: &self.problem.scene.object_of,
            expected_albedo,
            texels: texels.map(|t| (&t.colors.layout, Some(&*t.textured))),
            lobes: &self.lobes,
            patches: Some(&self.patches),
            sky: self.sky.as_ref(),
            outside: Some(self.outside),
            sampling: self.monitor.settings.light_sampling,
            max_bounces: self.monitor.settings.max_bounces(),
            seed: self.monitor.settings.seed,
            stage,
            round,
        }
    }
}
