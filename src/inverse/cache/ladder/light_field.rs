//! The first stage: each object fitted to the light that the photographs measured around it; light from outside.

use super::Ladder;
use crate::inverse::cache::PathCache;
use crate::inverse::cache::path_noise::share_paths;
use crate::inverse::cache::roles::Role;
use crate::inverse::cache::trust::Trust;
use crate::inverse::measured::MeasuredRadiance;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::parameters::Unknowns;
use crate::inverse::solver::Termination;
use crate::math::color::luminance;
use crate::transport::emitters::Emitters;

/// Share of paths that must leave the mesh before light from outside is tried.
const ESCAPING: f64 = 1e-3;
/// Share of the held-out loss that light from outside must take away.
const OUTSIDE_GAIN: f64 = 0.03;
/// Relative error of albedo that the light field's resolution is trusted to stay below, where edges blur: a
/// cautious assumption until full paths have replaced it.
const LIGHT_FIELD_BIAS: f32 = 0.01;

impl Ladder<'_, '_> {
    /// First stage: paths end where a photograph measured the radiance, so each object is nearly a linear fit of its
    /// own: what it sends against what it receives.
    pub(super) fn light_field(&mut self) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("gathering light from the photographs");
        let measured = MeasuredRadiance::new(self.problem, &self.survey);
        share_paths(
            &mut self.clusters,
            self.roles.len(),
            self.budget.light_field_paths,
        );

        // Light samples go where the photographs are bright: in proportion to area × radiance².
        let scene = &self.problem.scene;
        let bright: Vec<f64> = (scene.objects.iter().zip(&measured.object_means))
            .map(|(object, mean)| {
                mean.map_or(0.0, |m| object.area * f64::from(luminance(m)).powi(2))
            })
            .collect();
        let lights = Emitters::new(scene, &self.explore(&bright));
        let cache = self.trace(&lights, Some(&measured), 0, 0)?;

        // First as if no light came from outside, then, where rays leave the mesh, as if some did.
        self.monitor.phase("telling lamps from walls");
        self.tell_lamps(&cache, Role::Dark)?;
        self.monitor
            .progress
            .seconds_to_first_estimate
            .get_or_insert(self.monitor.seconds());
        self.finish_stage("light field", started, format!("each object fitted to the light that the photographs measured around it; {} give light", self.lamps()))?;
        let escaping = cache.share_ending_on(self.outside.first);
        if escaping > ESCAPING && self.monitor.settings.outside_light {
            self.light_from_outside(&cache, &lights, &measured, escaping)?;
        }
        for (error, albedo) in self.errors.albedo.iter_mut().zip(&self.unknowns.albedo) {
            *error = (*error * *error + *albedo * *albedo * (LIGHT_FIELD_BIAS * LIGHT_FIELD_BIAS))
                .powf(0.5);
        }
        self.describe();
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// Fits all seen objects as reflectors, then those that plainly give light as emitters; light from outside is
    /// fitted where `outside` is [`Role::Unseen`].
    fn tell_lamps(&mut self, cache: &PathCache, outside: Role) -> Result<(), Termination> {
        for (k, role) in self.roles.iter_mut().enumerate() {
            *role = match self.survey.seen.get(k) {
                Some(0) => Role::Unseen,
                Some(_) => Role::Reflector,
                None => outside,
            };
        }
        self.unknowns = Unknowns::new(self.roles.len());
        self.trust = Trust::even(self.roles.len());
        let fitted = self.fit(cache)?;
        self.take(fitted);
        self.settle_roles(cache)?;
        self.weigh(cache)?;
        self.test_dark(cache);
        Ok(())
    }

    /// Tries light from outside the mesh, and keeps it only if pixels held out of the fit get better.
    fn light_from_outside(
        &mut self,
        cache: &PathCache,
        lights: &Emitters,
        measured: &MeasuredRadiance,
        escaping: f64,
    ) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("trying light from outside");
        let before = (
            self.roles.clone(),
            self.unknowns.clone(),
            self.errors.clone(),
            self.trust.clone(),
        );
        let closed = self.measure();
        self.open = true;
        self.sky = MeasuredOutside::new(self.problem, &self.survey);
        self.expect_of_outside();
        match self.sky {
            Some(_) => {
                let cache = self.trace(lights, Some(measured), 0, 0)?;
                self.tell_lamps(&cache, Role::Unseen)?;
            }
            None => self.tell_lamps(cache, Role::Unseen)?,
        }
        let open = self.measure();
        // Held-out pixels decide; where there are none, those of the fit must do.
        let gain = match (
            closed.held_out.zip(open.held_out),
            closed.train.zip(open.train),
        ) {
            (Some((before, after)), _) | (None, Some((before, after))) => 1.0 - after / before,
            (None, None) => 0.0,
        };
        let kept = gain > OUTSIDE_GAIN;
        if !kept {
            (self.roles, self.unknowns, self.errors, self.trust) = before;
            (self.open, self.sky) = (false, None);
            self.describe();
        }
        let why = format!(
            "{:.1} % of the paths leave the mesh; light from there changes the held-out loss by {:.1} %{}",
            escaping * 100.0,
            -gain * 100.0,
            if kept {
                ""
            } else {
                ", so it is not called for"
            }
        );
        self.record("outside light", started, kept, why)
    }

    /// Objects that give light.
    fn lamps(&self) -> usize {
        self.roles.iter().filter(|r| r.emits()).count()
    }
}
