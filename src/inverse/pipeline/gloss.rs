//! Rough specular lobes, tried on objects that look different from different sides.

use crate::inverse::known::Pinned;
use crate::inverse::lobe::{LobeFit, Lobes, Task};
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::inverse::solver::{Stage, Termination};
use crate::transport::arrival::Cast;
use glam::Vec3;

/// Fraction of a round's paths that a trial of a lobe takes; finding one anew, whose roughness is about known, takes all of them.
const PATHS_FRACTION: u64 = 4;
/// More objects than this fraction what so many take.
const FULL_FRACTIONS: u64 = 4;

impl<'a> Pipeline<'a, '_> {
    /// Tries a lobe on each object that calls for one; where any is kept, what gives light is judged anew.
    pub(super) fn gloss(&mut self) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("looking for gloss");
        let objects: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects() || self.roles[k] == Role::Emitter)
            .filter(|&k| self.monitor.known.of(k) == Pinned::default())
            .collect();
        let mut lobes = Lobes::new(self.lobe_task(1), &self.gbuffer);
        let estimate = self.estimate.clone();
        let evidence = lobes.evidence(&estimate, &objects, &mut |cast| self.cast(cast))?;
        let called: Vec<usize> = (objects.iter().zip(&evidence))
            .filter(|(_, e)| Lobes::is_promising(**e))
            .map(|(&k, _)| k)
            .collect();
        if called.is_empty() {
            let most = evidence.iter().flatten().fold(0.0f64, |a, b| a.max(*b));
            self.monitor.stage(Stage {
                name: "lobes".to_owned(),
                seconds: self.monitor.seconds() - started,
                iterations: self.monitor.progress.iterations,
                train_loss: None,
                held_out_loss: None,
                kept: false,
                why: format!(
                    "none of {} objects looks glossy: photographs of the same spots differ as a lobe would make them by {most:.1} \
                     standard errors at most",
                    objects.len()
                ),
            });
            return Ok(());
        }

        // Try those that call for one.
        lobes.task = self.lobe_task(called.len());
        let lit = estimate.lit(&self.problem.scene);
        let (mut kept, mut refused) = (Vec::new(), Vec::new());
        for &k in &called {
            self.monitor.phase("trying a rough lobe");
            let emits = self.roles[k].emits();
            let found = lobes.find(&lit, k, emits, None, &mut |cast| self.cast(cast))?;
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
            why.push(format!("untouched pixels do not ask for: {refused}"));
        }
        why.push(format!(
            "{} of {} objects look different from different sides",
            called.len(),
            objects.len()
        ));
        let why = why.join("; ");
        self.record("lobes", started, !kept.is_empty(), why)?;

        // What was taken for light may have been gloss.
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

    /// Finds the lobes that were kept anew for the `turn`th time, in the light as it is known now. Where there is a texture it
    /// stays, and the lobe that it was found under.
    pub(super) fn settle_lobes(&mut self, turn: u64) -> Result<(), Termination> {
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
        let mut task = self.lobe_task(glossy.len());
        task.paths *= PATHS_FRACTION;
        let lobes = Lobes::new(task, &self.gbuffer);
        let lit = self.estimate.lit(&self.problem.scene);
        let mut names = Vec::new();
        for k in glossy {
            let known = self.lobes[k].map(|lobe| (lobe, turn));
            let found = lobes.find(&lit, k, false, known, &mut |cast| self.cast(cast))?;
            if let Some(found) = found {
                self.take_lobe(k, &found);
                names.push(self.words(k, &found, false));
            }
        }
        self.describe();
        self.record("lobes refined", started, true, names.join("; "))?;
        Ok(())
    }

    /// The task of finding the lobes of so many objects.
    fn lobe_task(&self, objects: usize) -> Task<'a> {
        let fraction = FULL_FRACTIONS.max(objects as u64);
        Task {
            problem: self.problem,
            seed: self.monitor.settings.seed,
            paths: self.budget.round_paths / PATHS_FRACTION * FULL_FRACTIONS / fraction,
            max_bounces: self.max_bounces,
        }
    }

    /// Takes over a lobe and the base under it; what the light field said of the object as a diffuse one counts no more.
    fn take_lobe(&mut self, k: usize, found: &LobeFit) {
        self.lobes[k] = Some(found.lobe());
        self.unknowns.albedo[k] = found.albedo.as_vec3();
        self.errors.albedo[k] = found.albedo_error().min(Vec3::splat(0.5));
        self.prior.forget_albedo(k);
    }

    fn cast(&mut self, cast: Cast) -> Result<(), Termination> {
        self.monitor.cast(cast);
        self.monitor
            .tick(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// An object's lobe in words.
    fn words(&self, k: usize, found: &LobeFit, gains: bool) -> String {
        let [.., specular, roughness] = found.errors;
        let mut words = format!(
            "{}: roughness {:.3} ± {roughness:.3}, specular {:.3} ± {specular:.3}",
            self.problem.scene.objects[k].name, found.roughness, found.specular
        );
        if gains {
            let sure = |gain: &crate::inverse::lobe::Gain| gain.mean / gain.noise;
            words.push_str(&format!(
                " (untouched pixels better by {:.0} standard errors, differences by view by {:.0})",
                sure(&found.gain),
                sure(&found.by_view)
            ));
        }
        words
    }
}
