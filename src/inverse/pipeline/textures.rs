//! The stage of textures.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::sharpness::Sharpness;
use crate::inverse::estimate::Estimate;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;
use crate::inverse::texture::{Refined, Task, refine};
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

/// Greatest factor by which a texture is scaled.
const MAX_SCALE: f32 = 1.5;

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

impl Pipeline<'_, '_> {
    /// Subtracts the effect of the textures from the residuals, if it is traced.
    pub(super) fn leave_textures_out(&self, clusters: &mut [Linearised]) {
        let offsets = self.detail.iter().flat_map(|detail| &detail.offsets);
        for (cluster, &offset) in clusters.iter_mut().zip(offsets) {
            cluster.residuals = cluster.residuals.map(|r| r - offset);
        }
    }

    /// Tries a texture on every reflector without a known albedo.
    pub(super) fn detail(&mut self) -> Result<(), Termination> {
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
        let judged = Cell::new(RayCount::default());
        let judge = |estimate: &Estimate| {
            let (loss, cast) = losses.held_out(problem, estimate);
            let mut all = judged.get();
            all += cast;
            judged.set(all);
            loss
        };
        let (monitor, estimate, checkpoint) = (&mut self.monitor, &self.estimate, &self.checkpoint);
        let (refined, ended) = refine(
            &task,
            estimate,
            &objects,
            &judge,
            &mut |rays, rejected, fraction| {
                monitor.cast(RayCount { rays, rejected });
                monitor.progress.fraction = Some(fraction as f32);
                monitor.tick(estimate, &|_| checkpoint.clone())
            },
        );
        self.monitor.cast(judged.get());
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
}
