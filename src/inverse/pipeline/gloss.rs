//! The stage of rough specular lobes: screening, trials, and refits.

use crate::inverse::known::Pinned;
use crate::inverse::lobe::{Gain, LobeFit, Lobes};
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::transport::arrival::RayCount;
use glam::Vec3;

/// Paths of a round over the paths of a trial; a refit of a known lobe takes all paths of a round.
const TRIAL_DIVISOR: u64 = 4;
/// Number of objects above which they share the paths of this many.
const MAX_FULL_TRIALS: u64 = 4;

impl<'a> Pipeline<'a, '_> {
    /// Tries a lobe on each promising object. If any is kept, glowing objects become reflectors and full paths are fitted again.
    pub(super) fn gloss(&mut self) -> Result {
        let started = self.monitor.seconds();
        self.monitor.phase("looking for gloss");
        let objects: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects() || self.roles[k] == Role::Emitter)
            .filter(|&k| self.monitor.known.object(k) == Pinned::default())
            .collect();
        let mut lobes = self.lobes_of(1);
        let estimate = self.estimate.clone();
        let evidence = lobes.evidence(&estimate, &objects, &mut |cast| self.cast(cast))?;
        let promising: Vec<usize> = (objects.iter().zip(&evidence))
            .filter(|(_, e)| Lobes::is_promising(**e))
            .map(|(&k, _)| k)
            .collect();
        if promising.is_empty() {
            let max = evidence.iter().flatten().fold(0.0f64, |a, b| a.max(*b));
            let why = format!(
                "none of {} objects looks glossy: differences between photographs of the same spots give at most {max:.1} \
                 standard errors of evidence for a lobe",
                objects.len()
            );
            self.record_unmeasured("lobes", started, false, why);
            return Ok(());
        }

        lobes.paths = self.lobe_paths(promising.len());
        let lit = estimate.lit(&self.problem.scene);
        let (mut kept, mut refused) = (Vec::new(), Vec::new());
        for &k in &promising {
            self.monitor.phase("trying a rough lobe");
            let emits = self.roles[k].emits();
            let found = lobes.try_lobe(&lit, k, emits, &mut |cast| self.cast(cast))?;
            match found {
                Some(found) if found.is_significant() => kept.push((k, found)),
                Some(found) => refused.push(self.words(k, &found, true)),
                None => refused.push(self.problem.scene.objects[k].name.clone()),
            }
        }
        for (k, found) in &kept {
            self.roles[*k] = Role::Reflector;
            self.unknowns.emission[*k] = Vec3::ZERO;
            self.errors.emission[*k] = Vec3::ZERO;
            self.take_lobe(*k, found);
        }
        self.describe();
        let mut why: Vec<String> = (kept.iter())
            .map(|(k, found)| self.words(*k, found, true))
            .collect();
        if !refused.is_empty() {
            let refused = refused.join("; ");
            why.push(format!(
                "not significant on pixels outside the fit: {refused}"
            ));
        }
        why.push(format!(
            "{} of {} objects look different in different views",
            promising.len(),
            objects.len()
        ));
        let why = why.join("; ");
        self.record("lobes", started, !kept.is_empty(), why)?;

        // Emission of glowing objects may have been gloss.
        let glowing: Vec<usize> = (0..self.roles.len())
            .filter(|&k| self.roles[k] == Role::Glowing && !self.emission_is_known(k))
            .collect();
        if !kept.is_empty() && !glowing.is_empty() {
            for k in glowing {
                self.roles[k] = Role::Reflector;
                self.unknowns.emission[k] = Vec3::ZERO;
            }
            self.full_paths()?;
        }
        Ok(())
    }

    /// Refits the kept lobes with the present light, for the `refit`th time. Lobes of textured objects stay as they are.
    pub(super) fn settle_lobes(&mut self, refit: u64) -> Result {
        let texels = self.estimate.texels.clone();
        let textured =
            |k: usize| (texels.as_ref()).is_some_and(|t| t.textured.get(k) == Some(&true));
        let glossy: Vec<usize> = (0..self.lobes.len())
            .filter(|&k| self.lobes[k].is_some() && !textured(k))
            .collect();
        if glossy.is_empty() {
            return Ok(());
        }
        let started = self.monitor.seconds();
        self.monitor.phase("refining lobes");
        let mut lobes = self.lobes_of(glossy.len());
        lobes.paths *= TRIAL_DIVISOR;
        let lit = self.estimate.lit(&self.problem.scene);
        let mut names = Vec::new();
        for k in glossy {
            let known = self.lobes[k].map(|lobe| (lobe, refit));
            let found = lobes.find(&lit, k, false, known, &mut |cast| self.cast(cast))?;
            if let Some(found) = found {
                self.take_lobe(k, &found);
                names.push(self.words(k, &found, false));
            }
        }
        self.describe();
        self.record("lobes refined", started, true, names.join("; "))
    }

    /// Paths of a trial, if the lobes of `objects` objects are fitted.
    fn lobe_paths(&self, objects: usize) -> u64 {
        let divisor = MAX_FULL_TRIALS.max(objects as u64);
        self.budget.round_paths / TRIAL_DIVISOR * MAX_FULL_TRIALS / divisor
    }

    fn lobes_of(&self, objects: usize) -> Lobes<'a> {
        let (seed, paths) = (self.monitor.settings.seed, self.lobe_paths(objects));
        Lobes::new(self.problem, &self.gbuffer, seed, paths, self.max_bounces)
    }

    /// Sets an object's lobe and base, and resets the prior of its albedo, which assumed a diffuse surface.
    fn take_lobe(&mut self, k: usize, found: &LobeFit) {
        self.lobes[k] = Some(found.lobe());
        self.unknowns.albedo[k] = found.albedo.as_vec3();
        self.errors.albedo[k] = found.albedo_error().min(Vec3::splat(0.5));
        self.prior.forget_albedo(k);
    }

    fn cast(&mut self, cast: RayCount) -> Result {
        self.monitor.cast(cast);
        self.monitor
            .tick(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// An object's lobe in words; with its gains if `gains`.
    fn words(&self, k: usize, found: &LobeFit, gains: bool) -> String {
        let [.., specular, roughness] = found.errors;
        let mut words = format!(
            "{}: roughness {:.3} ± {roughness:.3}, specular {:.3} ± {specular:.3}",
            self.problem.scene.objects[k].name, found.roughness, found.specular
        );
        if gains {
            let significance = |gain: &Gain| gain.mean / gain.noise;
            words.push_str(&format!(
                " (pixels outside the fit better by {:.0} standard errors, differences between views by {:.0})",
                significance(&found.gain),
                significance(&found.by_view)
            ));
        }
        words
    }
}
