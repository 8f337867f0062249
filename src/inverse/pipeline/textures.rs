//! The stage of textures, and the fit of all albedos and lamps with their effect.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::sharpness::Sharpness;
use crate::inverse::estimate::Estimate;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::refine::Rounds;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::inverse::texture::{Refined, Task, refine};
use crate::math::stats::Moments;
use crate::transport::arrival::RayCount;
use glam::{DVec3, Vec3};
use std::cell::Cell;

/// Textures, and their effect on the fit of mean albedos.
#[derive(Debug, Clone)]
pub(super) struct Detail {
    pub refined: Refined,
    /// The albedo of each object that they were fitted with.
    pub albedo: Vec<Vec3>,
    /// Change of the radiance of each cluster by the textures; empty until it is traced.
    pub offsets: Vec<DVec3>,
}

const MAX_SCALE: f32 = 1.5;
/// Increase of the held-out loss, in standard errors, above which the refit is undone.
const SIGNIFICANT: f64 = 2.0;

impl Detail {
    /// The textures scaled by the change of their objects' albedos since they were fitted.
    pub fn scaled_to(&self, albedo: &[Vec3], object_of: &[u32]) -> Refined {
        let factors: Vec<Vec3> = (albedo.iter().zip(&self.albedo))
            .map(|(new, old)| {
                let known = old.cmpgt(Vec3::ZERO);
                let ratio = *new / Vec3::select(known, *old, Vec3::ONE);
                let scale = ratio.clamp(Vec3::splat(1.0 / MAX_SCALE), Vec3::splat(MAX_SCALE));
                Vec3::select(known, scale, Vec3::ONE)
            })
            .collect();
        let mut scaled = self.refined.clone();
        scaled.scale(|k| factors[k], object_of);
        scaled
    }
}

/// Mean increase of the loss of held-out pixels, in standard errors; zero if there are none.
pub(super) fn increase(before: &[f64], after: &[f64]) -> f64 {
    let increase: Moments = before.iter().zip(after).map(|(b, a)| a - b).collect();
    let errors = increase.mean / increase.standard_error();
    if errors.is_nan() { 0.0 } else { errors }
}

impl Pipeline<'_, '_> {
    /// Subtracts the effect of the textures from the residuals, if it is traced.
    pub(super) fn leave_textures_out(&self, clusters: &mut [Linearised]) {
        let offsets = self.detail.iter().flat_map(|detail| &detail.offsets);
        for (cluster, &offset) in clusters.iter_mut().zip(offsets) {
            cluster.residuals = cluster.residuals.map(|r| r - offset);
        }
    }

    /// Tries a texture on every reflector without a known albedo.
    pub(super) fn detail(&mut self) -> Result {
        let started = self.monitor.seconds();
        self.monitor.phase("looking for textures");
        let objects: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| {
                self.roles[k] == Role::Reflector && self.monitor.known.object(k).albedo.is_none()
            })
            .collect();
        let unfitted = self.gbuffer.unfitted(self.problem.photographs.len());
        let settings = self.monitor.settings.clone();
        let sharpness = Sharpness::new(self.problem, HoldOut::from(&settings), &unfitted);
        let warnings = &mut self.monitor.progress.warnings;
        warnings.extend(
            sharpness
                .remark()
                .filter(|remark| !warnings.contains(remark)),
        );
        let task = Task {
            problem: self.problem,
            gbuffer: &self.gbuffer,
            sharpness: &sharpness,
            settings: &settings,
            paths: self.budget.round_paths,
            max_bounces: self.max_bounces,
        };
        let (losses, problem) = (&self.losses, self.problem);
        let rays = Cell::new(RayCount::default());
        let loss = |estimate: &Estimate| {
            let (loss, cast) = losses.held_out(problem, estimate);
            let mut all = rays.get();
            all += cast;
            rays.set(all);
            loss
        };
        let (monitor, estimate, checkpoint) = (&mut self.monitor, &self.estimate, &self.checkpoint);
        let (refined, ended) = refine(&task, estimate, &objects, &loss, &mut |step, fraction| {
            monitor.cast(step.cast);
            if let Some(residual) = step.residual {
                monitor.texture(residual);
            }
            monitor.progress.fraction = Some(fraction as f32);
            monitor.tick(estimate, &|_| checkpoint.clone())
        });
        self.monitor.cast(rays.get());
        let mut why = refined.summary(|k| self.problem.scene.objects[k].name.clone());
        if ended.is_err() {
            why.push_str("; the stage ended early");
        }
        let kept = refined.texels.is_some();
        self.detail = Some(Detail {
            refined,
            albedo: self.unknowns.albedo.clone(),
            offsets: Vec::new(),
        });
        self.describe();
        // The stage is recorded even if it ended early.
        let recorded = self.record("textures", started, kept, why);
        ended.and(recorded)
    }

    /// Fits the sum of all rounds, if some are new, to the photographs minus the change by the textures, which is traced once.
    /// Textures are scaled with the mean albedo of their objects.
    ///
    /// Without this, the light from a textured object, and mixed pixels at its edges, would be those of its mean colour.
    pub(super) fn refit(&mut self, rounds: &mut Rounds) -> Result {
        let detail = self.detail.clone();
        let texels = detail.as_ref().and_then(|d| d.refined.texels.clone());
        let has_new = std::mem::take(&mut rounds.has_new);
        let (Some(detail), Some(texels), true) = (detail, texels, has_new) else {
            return Ok(());
        };
        let started = self.monitor.seconds();
        self.monitor.phase("fitting again with textures");
        let before = (
            self.unknowns.clone(),
            self.errors.clone(),
            self.held_out_each(),
        );
        let lights = self.lights();
        self.distribute(self.budget.round_paths);
        // The change by textures is relative to the mean albedos that they were fitted with.
        let mut flat = self.unknowns.clone();
        for (k, albedo) in detail.albedo.iter().enumerate() {
            if texels.textured.get(k) == Some(&true) {
                flat.albedo[k] = *albedo;
            }
        }
        let colors = &texels.colors.colors;
        let offsets = self.traced(&lights, None, 4, 0, |slice| {
            slice.texture_offsets(&flat, colors)
        })?;
        self.detail = Some(Detail {
            offsets,
            ..detail.clone()
        });
        let mut clusters = rounds.mean(&self.roles);
        self.leave_textures_out(&mut clusters);
        self.descend(clusters, &rounds.about);
        self.describe();

        let after = self.held_out_each();
        let increase = increase(&before.2, &after);
        let kept = increase <= SIGNIFICANT;
        if !kept {
            (self.unknowns, self.errors, self.detail) = (before.0.clone(), before.1, Some(detail));
            self.describe();
        }
        let change = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects())
            .map(|k| {
                (self.unknowns.albedo[k] - before.0.albedo[k])
                    .abs()
                    .max_element()
            })
            .fold(0.0, f32::max);
        let why = match kept {
            true => {
                format!(
                    "with the light that textures reflect, albedos change by {change:.3} at most"
                )
            }
            false => format!(
                "held-out pixels get worse by {increase:.1} standard errors, so the refit is undone"
            ),
        };
        self.record("refit", started, kept, why)
    }

    pub(super) fn held_out_each(&mut self) -> Vec<f64> {
        let (each, cast) = self.losses.held_out_each(self.problem, &self.estimate);
        self.monitor.cast(cast);
        each
    }
}
