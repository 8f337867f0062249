//! The third stage: rounds of independent paths, summed until the reported errors are small or no longer due to path noise.

use crate::inverse::emitters::lamp_albedo;
use crate::inverse::estimate::{ENOUGH_PIXELS, relative_to_albedo};
use crate::inverse::fit::accumulate::Accumulated;
use crate::inverse::fit::errors::{StandardErrors, leave_one_out, standard_errors};
use crate::inverse::fit::linear::{Descended, descend};
use crate::inverse::fit::path_noise;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::paths::lamp_patches::LampPatches;
use crate::inverse::pipeline::budget::{ACCURATE, Aim};
use crate::inverse::pipeline::textures::increase;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::{self, Role};
use crate::inverse::solver::Termination;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::quantile;
use crate::transport::emitters::Emitters;
use crate::transport::path::PathOptions;
use glam::Vec3;

/// Squared step, as a fraction of the standard error, above which paths are linearised again.
const NONLINEAR: f32 = 0.3;
/// Relative standard error below which an emission counts as well determined.
const WELL_KNOWN: f32 = 0.3;
/// Number of rounds that show how noisy their own sum is. After fewer, it must be smaller in proportion.
const TELLING_ROUNDS: u32 = 4;
/// Increase of the held-out loss, in standard errors, above which a warning is given: a chance of 3·10⁻⁵.
const WORSE: f64 = 4.0;
/// Paths of a round over the paths that predict the levels of clusters.
const PREDICTING: u64 = 4;
/// Least number of such paths per cluster, unless a whole round has fewer: with a dozen paths a pixel next to a lamp may seem
/// dark, and would then outweigh all others.
const MIN_PREDICTING: u64 = 256;
/// Paths of a round over the paths that light the patches of lamps.
const LIGHTING_LAMPS: u64 = 32;
/// Median error of albedo at which the light suffices for textures, since a single pixel determines a texel to some per cent. Small
/// objects that are less accurate are not waited for.
const ENOUGH_FOR_TEXTURES: f64 = 5e-3;

pub(super) struct Rounds {
    lights: Emitters,
    /// Rows of the free parameters.
    places: Vec<usize>,
    /// The unknowns that the sums are linearised about.
    pub about: Unknowns,
    sums: Accumulated,
    next: u32,
    /// Whether rounds were added since the last refit.
    pub has_new: bool,
}

impl Rounds {
    /// The mean over the rounds of each cluster.
    pub fn mean(&self, roles: &[Role]) -> Vec<Linearised> {
        let mut clusters = self.sums.mean();
        lamp_albedo::hold_exitance(&mut clusters, roles, &self.places);
        clusters
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Leg {
    /// Until the light is accurate enough for textures.
    UntilTextures,
    UntilDone,
}

impl Pipeline<'_, '_> {
    /// Third stage: sums rounds of independent paths until the reported errors reach the target. Textures are fitted as soon as
    /// errors are small enough for them, or after the budget's number of rounds.
    pub(super) fn refine(&mut self) -> Result<Termination> {
        let before = self.held_out_each();
        let mut rounds = self.begin_rounds()?;
        let textures = self.monitor.settings.textures;
        if textures && self.aim().1.median < ENOUGH_FOR_TEXTURES {
            self.add_rounds(&mut rounds, Leg::UntilTextures)?;
            self.warn_if_worse(&before);
            self.detail()?;
            self.refit(&mut rounds)?;
        }
        let ended = self.add_rounds(&mut rounds, Leg::UntilDone)?;
        if self.detail.is_none() {
            self.warn_if_worse(&before);
            if textures {
                self.detail()?;
            }
        }
        if textures {
            self.refit(&mut rounds)?;
        }
        Ok(ended)
    }

    /// Warns if held-out pixels became clearly worse: the fit then explains its pixels by light or colours that are not there.
    fn warn_if_worse(&mut self, before: &[f64]) {
        let after = self.held_out_each();
        let increase = increase(before, &after);
        if increase > WORSE {
            let warning = format!(
                "pixels left out of the fit became worse by {increase:.0} standard errors while it was refined: light, mesh or poses may be \
                 other than assumed"
            );
            self.monitor.progress.warnings.push(warning);
        }
    }

    /// Sets the weights and paths of clusters, and starts empty sums.
    fn begin_rounds(&mut self) -> Result<Rounds> {
        self.monitor.phase("refining");
        let lights = self.lights();
        self.patches = LampPatches::new(&self.problem.scene, &self.roles);
        self.weigh_by_prediction(&lights)?;
        self.distribute(self.budget.round_paths);
        // Including the albedos of lamps.
        let free = roles::free(&self.roles, |k| self.has_free_albedo(k));
        Ok(Rounds {
            lights,
            places: roles::places(&free, self.roles.len()),
            about: self.unknowns.clone(),
            sums: Accumulated::default(),
            next: 0,
            has_new: false,
        })
    }

    /// Adds rounds until the reported errors reach the target, or up to the greatest number of rounds.
    fn add_rounds(&mut self, rounds: &mut Rounds, leg: Leg) -> Result<Termination> {
        if rounds.next > 0 && rounds.next >= self.aim_of(leg).0 {
            return Ok(Termination::Steps);
        }
        let started = self.monitor.seconds();
        self.monitor.phase("refining");
        let mut outcome = Termination::Steps;
        loop {
            // The target may change while a solve runs.
            let (most, aim) = self.aim_of(leg);
            if rounds.next >= most {
                break;
            }
            let round = rounds.next;
            rounds.next += 1;
            // The reflected light of lamps is traced again each round instead of linearised.
            self.light_patches(round);
            let reflected = self.patches.reflected.clone();
            let (about, places) = (&rounds.about, &rounds.places);
            let linearised = self.traced(&rounds.lights, None, 2, round, |slice| {
                slice.linearise(about, places, &reflected)
            })?;
            rounds.sums.add(linearised);
            let mut clusters = rounds.mean(&self.roles);
            self.leave_textures_out(&mut clusters);
            let found = self.descend(clusters, &rounds.about);
            self.robust = found.robust;
            self.path_noise = path_noise::fractions(&found.clusters, self.roles.len());
            // The effect of textures is relative to the present linearisation, which then must stay.
            let may_restart = self.detail.is_none() && round < most.min(self.budget.rounds) / 4;
            let objects = self.problem.scene.objects.len();
            let far =
                may_restart && is_nonlinear(&rounds.about, &self.unknowns, &self.errors, objects);
            self.describe();
            self.monitor
                .report(&self.estimate, &|_| self.checkpoint.clone())?;
            if far {
                rounds.about = self.unknowns.clone();
                rounds.sums = Accumulated::default();
                continue;
            }
            let done = self.reported().done(aim, rounds.sums.rounds());
            let fraction = done.max(f64::from(rounds.next) / f64::from(most));
            self.monitor.progress.fraction = Some(fraction.min(1.0) as f32);
            if done >= 1.0 {
                outcome = Termination::Converged;
                break;
            }
        }
        rounds.has_new = true;
        let reported = self.reported();
        let [median, tail] = reported.all.map(|e| e * 100.0);
        let [median_of_paths, tail_of_paths] = reported.of_paths.map(|e| e * 100.0);
        let why = format!(
            "{} rounds of independent paths: relative standard error of albedo {median:.2} % (median), {tail:.2} % (95 of 100 \
             objects); of that from the paths {median_of_paths:.2} % and {tail_of_paths:.2} %, the rest from the photographs \
             and the model",
            rounds.sums.rounds(),
        );
        self.record("refine", started, true, why)?;
        Ok(outcome)
    }

    /// Fits all free parameters, including the albedos of lamps, to clusters linearised about `about`, and sets unknowns, standard
    /// errors and model error.
    pub(super) fn descend(&mut self, clusters: Vec<Linearised>, about: &Unknowns) -> Descended {
        let free = roles::free(&self.roles, |k| self.has_free_albedo(k));
        let prior = lamp_albedo::without_lamps(&self.prior, &self.roles);
        let found = descend(clusters, about, &self.unknowns, &free, &prior);
        let (equations, terms) = (&found.equations, &found.terms);
        let scores = leave_one_out(equations, terms, &found.clusters, &found.robust);
        let errors = standard_errors(equations, terms, &scores, &free, self.roles.len());
        self.unknowns.clone_from(&found.unknowns);
        self.tell_model_error(&found.clusters);
        lamp_albedo::leave_out(&mut self.unknowns, &self.roles);
        self.monitor.progress.iterations += 1;
        self.merge_errors(errors);
        self.monitor.fitted(
            found.equations.relative_residual(),
            free.len(),
            &self.estimate,
        );
        self.hold();
        found
    }

    /// Greatest number of rounds up to the end of a leg, and its target errors.
    fn aim_of(&self, leg: Leg) -> (u32, Aim) {
        let (most, aim) = self.aim();
        match leg {
            Leg::UntilTextures => {
                let aim = Aim {
                    median: ENOUGH_FOR_TEXTURES,
                    tail: f64::INFINITY,
                    ..aim
                };
                (self.budget.texture_rounds.min(most), aim)
            }
            Leg::UntilDone => (most, aim),
        }
    }

    /// Greatest number of rounds and the target errors of the preset; a smaller median in the settings has no limit of rounds.
    fn aim(&self) -> (u32, Aim) {
        let asked = self.monitor.settings.target_error * 0.01;
        let aim = self.budget.aim;
        if asked <= 0.0 || asked >= aim.median {
            return (self.budget.rounds, aim);
        }
        let accurate = Aim {
            median: asked,
            path_noise: ACCURATE,
            ..aim
        };
        (u32::MAX, accurate)
    }

    /// Traces the reflected light of lamp patches with the present estimate.
    fn light_patches(&mut self, round: u32) {
        let options = PathOptions {
            max_bounces: self.max_bounces,
            ..PathOptions::default()
        };
        let cast = self.patches.light(
            &self.estimate.lit(&self.problem.scene),
            self.budget.round_paths / LIGHTING_LAMPS,
            &options,
            [self.monitor.settings.seed, u64::from(round)],
        );
        self.monitor.cast(cast);
    }

    /// Weights the clusters by levels predicted from a few paths, which are independent of those of the rounds. Each albedo is
    /// raised by its standard error: objects wrongly estimated as black would otherwise get too much weight.
    fn weigh_by_prediction(&mut self, lights: &Emitters) -> Result {
        self.distribute(self.budget.round_paths / PREDICTING);
        let least =
            (self.budget.round_paths / self.clusters.len().max(1) as u64).min(MIN_PREDICTING);
        for cluster in &mut self.clusters {
            let a_pixel = least.div_ceil(2 * cluster.pixels.len() as u64);
            cluster.paths = cluster.paths.max(a_pixel as u32);
        }
        let mut unknowns = self.unknowns.clone();
        for (k, albedo) in unknowns.albedo.iter_mut().enumerate() {
            if self.roles[k].reflects() {
                *albedo = (*albedo + self.errors.albedo[k]).min(Vec3::ONE);
            }
        }
        let levels = self.traced(lights, None, 3, 0, |slice| slice.levels(&unknowns))?;
        for (cluster, level) in self.clusters.iter_mut().zip(levels) {
            cluster.level = Some(level);
        }
        Ok(())
    }

    /// The relative standard errors of albedo, with the model error, over reflectors that at least [`ENOUGH_PIXELS`] pixels see.
    fn reported(&self) -> Reported {
        let counted: Vec<usize> = (0..self.roles.len())
            .filter(|&k| self.roles[k].reflects())
            .filter(|&k| {
                self.gbuffer
                    .seen
                    .get(k)
                    .is_some_and(|&n| n >= ENOUGH_PIXELS)
            })
            .collect();
        let quantiles = |error: &dyn Fn(usize) -> f64| {
            let mut errors: Vec<f64> = counted.iter().map(|&k| error(k)).collect();
            [0.5, 0.95].map(|q| quantile(&mut errors, q).unwrap_or(0.0))
        };
        let fitted = |k: usize| relative_to_albedo(self.errors.albedo[k], self.unknowns.albedo[k]);
        // What all objects share of the model error leaves their ratios, which more paths improve, and does not count.
        let model = self.model_variance.sqrt();
        Reported {
            all: quantiles(&|k| fitted(k).hypot(model)),
            of_paths: quantiles(&|k| fitted(k) * self.path_noise[k].sqrt()),
        }
    }
}

/// Relative standard errors of albedo: median and 95th percentile over objects.
struct Reported {
    all: [f64; 2],
    /// The part due to path noise.
    of_paths: [f64; 2],
}

impl Reported {
    /// The rounds that were added, as a fraction of those after which more would gain little: the error is then at its target, or
    /// the part due to path noise is negligible. Variances fall in proportion to the number of rounds.
    fn done(&self, aim: Aim, rounds: u32) -> f64 {
        let targets = [aim.median, aim.tail];
        let told = f64::from(rounds.min(TELLING_ROUNDS)) / f64::from(TELLING_ROUNDS);
        let error = |i: usize| targets[i] / self.all[i];
        let noise = |i: usize| self.all[i] * aim.path_noise * told / self.of_paths[i];
        let each = [0, 1].map(|i| error(i).max(noise(i)).powi(2));
        each[0].min(each[1])
    }
}

/// Whether a step's second-order term, about its square, is not small compared with the standard errors. Albedos count absolutely,
/// emissions of objects relatively. Badly determined lamps do not count: radiance is linear in them, and albedos depend little on
/// them. Nor do the many directions of outside light: paths swap light between neighbours, and albedos move with their sum alone.
fn is_nonlinear(from: &Unknowns, to: &Unknowns, errors: &StandardErrors, objects: usize) -> bool {
    let exceeds = |step: Vec3, size: Vec3, error: Vec3| {
        let known = error.cmpgt(Vec3::ZERO) & error.cmplt(Vec3::INFINITY);
        (known & (step * step).cmpgt(size * error * NONLINEAR)).any()
    };
    let albedo = (from.albedo.iter().zip(&to.albedo).zip(&errors.albedo))
        .any(|((a, b), error)| exceeds(*b - *a, Vec3::ONE, *error));
    let emission = (from.emission.iter().zip(&to.emission).zip(&errors.emission))
        .take(objects)
        .any(|((a, b), error)| {
            let size = a.max(*b);
            let known = error.cmple(size * WELL_KNOWN);
            exceeds(*b - *a, size, Vec3::select(known, *error, Vec3::INFINITY))
        });
    albedo || emission
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_are_done_at_the_target_or_once_their_noise_is_negligible() {
        let aim = Aim {
            median: 0.01,
            tail: 0.05,
            path_noise: 0.5,
        };
        let done = |all: [f64; 2], of_paths: [f64; 2]| Reported { all, of_paths }.done(aim, 4);
        // Both quantiles count, and each by what ends it first.
        assert!((done([0.02, 0.04], [0.02, 0.04]) - 0.25).abs() < 1e-12);
        assert!((done([0.02, 0.04], [0.02, 0.01]) - 0.25).abs() < 1e-12);
        assert!(done([0.02, 0.04], [0.005, 0.04]) > 1.0);
        assert!((done([0.02, 0.2], [0.005, 0.2]) - 0.25).abs() < 1e-12);
        // Nothing that is counted is nothing to improve.
        assert!(done([0.0; 2], [0.0; 2]) >= 1.0);
    }

    #[test]
    fn a_step_is_nonlinear_by_its_square_against_its_own_error() {
        let unknowns = |albedo, emission| Unknowns::grey([albedo, 0.5], [0.0, emission]);
        let mut errors = StandardErrors {
            albedo: vec![Vec3::splat(0.06), Vec3::splat(0.5)],
            emission: vec![Vec3::INFINITY, Vec3::splat(0.01)],
        };
        let from = unknowns(0.5, 10.0);
        // Uncertain parameters may move far, certain ones may not.
        assert!(!is_nonlinear(&from, &unknowns(0.6, 10.0), &errors, 2));
        errors.albedo[0] = Vec3::splat(0.003);
        assert!(is_nonlinear(&from, &unknowns(0.6, 10.0), &errors, 2));
        assert!(!is_nonlinear(&from, &unknowns(0.51, 10.0), &errors, 2));
        // Emissions count relatively.
        assert!(!is_nonlinear(&from, &unknowns(0.5, 10.1), &errors, 2));
        assert!(is_nonlinear(&from, &unknowns(0.5, 10.3), &errors, 2));
        // An uncertain lamp may vanish.
        errors.emission[1] = Vec3::splat(4.0);
        assert!(!is_nonlinear(&from, &unknowns(0.5, 0.0), &errors, 2));
        // Nor does light from outside count.
        errors.emission[1] = Vec3::splat(0.01);
        assert!(!is_nonlinear(&from, &unknowns(0.5, 10.3), &errors, 1));
    }
}
