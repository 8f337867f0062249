//! The first stage: each object fitted to its measured irradiance; and the trial of outside light.

use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::fit::equations::NormalEquations;
use crate::inverse::fit::errors::StandardErrors;
use crate::inverse::fit::gauss_newton::{MIN_DAMPING, propose};
use crate::inverse::fit::prior::{ExpectedAlbedo, Prior};
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::loss::Losses;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::clusters::mean_radiance;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::transport::emitters::Emitters;
use crate::transport::surroundings::Surroundings;
use glam::{DVec3, Vec3};

/// Least fraction of paths that leave the mesh for which outside light is tried.
const ESCAPING: f64 = 1e-3;
/// Least relative decrease of the held-out loss by outside light.
const OUTSIDE_GAIN: f64 = 0.03;
/// Assumed relative error of albedo by the light field's limited resolution at edges, until full paths replace it.
const LIGHT_FIELD_BIAS: f32 = 0.01;
/// Least standard deviation of the prior of an albedo.
const MIN_DEVIATION: f32 = 1e-3;

/// The result of a trial of outside light.
#[derive(Clone)]
struct Found {
    roles: Vec<Role>,
    unknowns: Unknowns,
    errors: StandardErrors,
    robust: RobustWeights,
    prior: Prior,
    surroundings: Surroundings,
    open: bool,
    sky: Option<MeasuredOutside>,
}

/// Full paths that were fitted to compare two kinds of light from outside.
pub(super) struct Compared {
    /// Roles and unknowns before the fit.
    roles: Vec<Role>,
    unknowns: Unknowns,
    /// The free parameters of the fit.
    free: Vec<usize>,
    /// The result of the fit.
    fitted: Found,
    /// The paths, and a remark on their number.
    stored: (PathCache, String),
}

/// Relative decrease of the loss: on held-out pixels, or in the fit if none is held out.
fn fall(before: Losses, after: Losses) -> f64 {
    match (
        before.held_out.zip(after.held_out),
        before.train.zip(after.train),
    ) {
        (Some((before, after)), _) | (None, Some((before, after))) => 1.0 - after / before,
        (None, None) => 0.0,
    }
}

impl Pipeline<'_, '_> {
    /// Sets the prior of unmeasured outside directions from the measured ones.
    pub(super) fn expect_of_outside(&mut self) {
        if let Some(sky) = &self.sky {
            let grid = self.outside;
            let band = std::f64::consts::PI / grid.height as f64;
            let expected = |surface| match surface == grid.excess() {
                true => Vec3::ZERO,
                false => sky.expected(grid.direction(surface), band),
            };
            self.prior = self.prior.clone().with_sky(expected);
        }
    }

    /// First stage: paths end at measured radiance, so that each object's albedo is nearly an independent linear fit of its radiance
    /// to its irradiance.
    pub(super) fn light_field(&mut self) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("gathering light from the photographs");
        let measured = MeasuredRadiance::new(self.problem, &self.gbuffer);

        // Light samples are drawn in proportion to area × squared photographed radiance.
        let scene = &self.problem.scene;
        let bright: Vec<f64> = (scene.objects.iter().zip(&measured.object_means))
            .map(|(object, mean)| {
                mean.map_or(0.0, |m| object.area * f64::from(luminance(m)).powi(2))
            })
            .collect();
        let lights = Emitters::new(scene, &self.explore(bright));
        let paths = self.budget.light_field_paths;
        let (cache, limit) = self.stored(&lights, Some(&measured), 0, paths)?;

        // First without outside light, then, if rays leave the mesh, with it.
        self.monitor.phase("telling lamps from walls");
        self.tell_lamps(&cache, Role::Dark)?;
        self.monitor
            .progress
            .seconds_to_first_estimate
            .get_or_insert(self.monitor.seconds());
        let why = format!(
            "each object fitted to the light that the photographs measured around it; {} give light{limit}",
            self.lamps()
        );
        let closed = self.record("light field", started, true, why)?;
        let escaping = cache.fraction_ending_on(self.outside.first);
        if escaping > ESCAPING && self.monitor.settings.outside_light {
            self.light_from_outside(&cache, &lights, &measured, escaping, closed)?;
        }
        self.expect_of_albedo();
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// With outside light, sets the prior of albedos from the light field, which measures all irradiance. Full paths have only a
    /// coarse map of the outside light, and albedos would drift to compensate its errors.
    fn expect_of_albedo(&mut self) {
        if !self.open {
            return;
        }
        let mut expected = ExpectedAlbedo::unknown(self.roles.len(), &self.gbuffer.seen);
        for (k, role) in self.roles.iter().enumerate() {
            if *role == Role::Reflector {
                let deviation = &mut expected.deviation[k];
                *deviation = self.errors.albedo[k].clamp(Vec3::splat(MIN_DEVIATION), *deviation);
                expected.mean[k] = self.unknowns.albedo[k];
            }
        }
        self.prior = (self.prior.clone()).with_albedo(expected);
    }

    /// Fits all seen objects as reflectors, then settles which are emitters. Outside light is fitted if `outside` is
    /// [`Role::Unseen`].
    fn tell_lamps(&mut self, cache: &PathCache, outside: Role) -> Result<(), Termination> {
        self.unknowns = Unknowns::new(self.roles.len());
        self.robust = RobustWeights::even(self.roles.len());
        // Seen lamps first: while they are fitted as white walls, unseen objects would be given light to explain them.
        for out_of_sight in [Role::Dark, Role::Unseen] {
            for (k, role) in self.roles.iter_mut().enumerate() {
                match self.gbuffer.seen.get(k) {
                    Some(0) => *role = out_of_sight,
                    Some(_) if out_of_sight == Role::Dark => *role = Role::Reflector,
                    Some(_) => {}
                    None => *role = outside,
                }
            }
            self.hold();
            let fitted = self.fit(cache)?;
            self.settle_roles(cache, fitted)?;
        }
        self.weigh(cache)?;
        for (error, albedo) in self.errors.albedo.iter_mut().zip(&self.unknowns.albedo) {
            *error = (*error * *error + *albedo * *albedo * (LIGHT_FIELD_BIAS * LIGHT_FIELD_BIAS))
                .powf(0.5);
        }
        self.test_dark(cache);
        Ok(())
    }

    /// Tries light from infinity, and for a scan also from a box around the mesh. Keeps the better one if it predicts held-out pixels
    /// better than the model without it.
    ///
    /// A scan gets light from outside without that test: what was not scanned reflects light, if nothing else, and the light field
    /// without it makes walls lighter, or gives them light of their own, until nothing is left to improve.
    fn light_from_outside(
        &mut self,
        cache: &PathCache,
        lights: &Emitters,
        measured: &MeasuredRadiance,
        escaping: f64,
        closed: Losses,
    ) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("trying light from outside");
        let leave = format!("{:.1} % of the paths leave the mesh", escaping * 100.0);
        let scanned = self.problem.scene.scanned;
        // A linear step estimates the gain at a small fraction of the cost of a trial.
        let gain = (!scanned).then(|| self.outside_gain(cache));
        if let Some(gain) = gain.filter(|&gain| gain < OUTSIDE_GAIN) {
            let why = format!(
                "{leave}; light from there would change the squared error by {:.1} %, so it is not called for",
                -gain * 100.0,
            );
            self.record("outside light", started, false, why)?;
            return Ok(());
        }
        let without = self.found();
        let scene = &self.problem.scene;
        let cameras = scene.cameras.iter().map(|camera| camera.center);
        let places = scene.positions.iter().copied().chain(cameras);
        // A mesh that is not a scan is assumed to lack windows only.
        let around = scanned.then(|| Surroundings::around(places)).flatten();
        let mut gained: Vec<(Losses, Found)> = Vec::new();
        for surroundings in [Some(Surroundings::Far), around].into_iter().flatten() {
            let losses = self.fit_open(surroundings, cache, lights, measured)?;
            if scanned || fall(closed, losses) > OUTSIDE_GAIN {
                gained.push((losses, self.found()));
            }
            self.go_back_to(without.clone());
        }
        let best = self.best_trial(gained)?;
        let gain = best
            .as_ref()
            .map_or(0.0, |(losses, _)| fall(closed, *losses));
        self.go_back_to(best.map_or(without, |(_, found)| found));
        self.describe();
        let comes = match (self.open, self.outside.surroundings) {
            (false, _) => "is not called for".to_owned(),
            (true, from) => format!(
                "changes the held-out loss by {:.1} % and comes from {}",
                -gain * 100.0,
                match from {
                    Surroundings::Far => "far away",
                    Surroundings::Box { .. } => "a box around the mesh",
                }
            ),
        };
        let why = format!("{leave}; light from there {comes}");
        self.record("outside light", started, self.open, why)?;
        Ok(())
    }

    /// Fits everything with outside light; returns the losses.
    fn fit_open(
        &mut self,
        surroundings: Surroundings,
        cache: &PathCache,
        lights: &Emitters,
        measured: &MeasuredRadiance,
    ) -> Result<Losses, Termination> {
        self.open = true;
        self.outside.surroundings = surroundings;
        self.sky = MeasuredOutside::new(self.problem, &self.gbuffer, surroundings);
        self.expect_of_outside();
        let paths = self.budget.light_field_paths;
        let as_stored = self.sky.is_none() && surroundings == Surroundings::Far;
        let towards_it = match as_stored {
            true => None,
            false => Some(self.stored(lights, Some(measured), 0, paths)?.0),
        };
        let cache = towards_it.as_ref().unwrap_or(cache);
        self.tell_lamps(cache, Role::Unseen)?;
        self.expect_colors_of_outside();
        self.weigh(cache)?;
        Ok(self.measure())
    }

    /// The best result, with its losses. If there are two to choose from, their losses are those after a fit of full paths, if there
    /// are any: the light field is blurred. The paths of the best are kept, since the next stage begins with the same.
    fn best_trial(
        &mut self,
        gained: Vec<(Losses, Found)>,
    ) -> Result<Option<(Losses, Found)>, Termination> {
        if gained.len() < 2 || self.budget.round_paths == 0 {
            let best =
                (gained.into_iter()).reduce(|best, other| match fall(best.0, other.0) > 0.0 {
                    true => other,
                    false => best,
                });
            return Ok(best);
        }
        let mut best: Option<(Losses, Found)> = None;
        for (_, found) in gained {
            self.go_back_to(found.clone());
            self.expect_of_albedo();
            let free = self.free();
            let stored = self.fit_full_paths()?;
            let losses = self.measure();
            if (best.as_ref()).is_none_or(|(least, _)| fall(*least, losses) > 0.0) {
                self.compared = Some(Compared {
                    roles: found.roles.clone(),
                    unknowns: found.unknowns.clone(),
                    free,
                    fitted: self.found(),
                    stored,
                });
                best = Some((losses, found));
            }
        }
        Ok(best)
    }

    /// The paths of the best trial of light from outside, and their fit, if roles and unknowns are still those that they were traced
    /// with: a second trace would give the same bits.
    pub(super) fn compared(&mut self) -> Result<Option<(PathCache, String)>, Termination> {
        let taken = self.compared.take();
        let compared = taken.filter(|c| {
            c.roles == self.roles
                && c.unknowns == self.unknowns
                && c.stored.0.clusters.len() == self.clusters.len()
        });
        let Some(compared) = compared else {
            return Ok(None);
        };
        // The albedos of unseen surfaces are free from the second stage on.
        if compared.free == self.free() {
            self.go_back_to(compared.fitted);
            self.describe();
        } else {
            self.fit_stored(&compared.stored.0)?;
        }
        Ok(Some(compared.stored))
    }

    /// The present result of a trial.
    fn found(&self) -> Found {
        Found {
            roles: self.roles.clone(),
            unknowns: self.unknowns.clone(),
            errors: self.errors.clone(),
            robust: self.robust.clone(),
            prior: self.prior.clone(),
            surroundings: self.outside.surroundings,
            open: self.open,
            sky: self.sky.clone(),
        }
    }

    /// Restores the result of a trial.
    fn go_back_to(&mut self, found: Found) {
        self.roles = found.roles;
        self.unknowns = found.unknowns;
        self.errors = found.errors;
        self.robust = found.robust;
        self.prior = found.prior;
        self.outside.surroundings = found.surroundings;
        self.open = found.open;
        self.sky = found.sky;
    }

    /// Sets the prior of outside light to its expected colours at the fitted brightness.
    fn expect_colors_of_outside(&mut self) {
        let photographed = mean_radiance(&self.clusters);
        let bound = self.sky.as_ref().map(|sky| sky.mean_bound());
        let excess = self.outside.excess();
        let color = |surface: u32, expected: Vec3| match bound {
            Some(bound) if surface == excess => bound,
            Some(_) => expected,
            None => photographed,
        };
        let found = |k: usize| (self.unknowns.emission[k], self.errors.emission[k]);
        self.prior = self.prior.clone().with_outside_found(found, color);
    }

    /// Relative decrease of the clusters' squared residuals by one linear step with light from all outside directions free. It is
    /// measured across the two sets of paths, so that fitting path noise gains nothing.
    fn outside_gain(&self, cache: &PathCache) -> f64 {
        let surfaces = self.roles.len();
        let mut free = self.free();
        free.extend(surfaces + self.outside.first as usize..2 * surfaces);
        let linearised = cache.linearise(&self.unknowns, &roles::places(&free, surfaces), &[]);
        let even = RobustWeights::even(surfaces);
        let equations = NormalEquations::new(&linearised, free.len(), &even, &self.prior);
        let (after, _) = propose(&equations, &free, &self.unknowns, MIN_DAMPING);
        let steps: Vec<DVec3> = (free.iter())
            .map(|&i| (after.value(i) - self.unknowns.value(i)).as_dvec3())
            .collect();
        let (mut fall, mut all) = (0.0, 0.0);
        for mut cluster in linearised {
            let square = |c: &Linearised| {
                let [a, b] = c.residuals;
                (c.weight_now() * a * b).element_sum()
            };
            let residual = cluster.residual();
            all += (cluster.weight_now() * residual * residual).element_sum();
            fall += square(&cluster);
            cluster.step(&steps);
            fall -= square(&cluster);
        }
        if all > 0.0 { fall / all } else { 0.0 }
    }

    /// Number of objects that emit light.
    fn lamps(&self) -> usize {
        self.roles.iter().filter(|r| r.emits()).count()
    }
}
