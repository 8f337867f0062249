//! Rounds of independent paths, added up until the reported errors are small enough or no longer the paths'.

use crate::inverse::emitters::lamp_albedo;
use crate::inverse::estimate::{ENOUGH_PIXELS, relative_to_albedo};
use crate::inverse::fit::accumulate::Accumulated;
use crate::inverse::fit::errors::{StandardErrors, jackknifed, standard_errors};
use crate::inverse::fit::linear::{Descended, descend};
use crate::inverse::fit::path_noise;
use crate::inverse::fit::path_noise::distribute_paths;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::paths::lamp_patches::LampPatches;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::quantile;
use crate::transport::emitters::Emitters;
use crate::transport::path::PathOptions;
use glam::Vec3;

/// A step asks for linearising anew where its square is more than this fraction of a standard error.
const NONLINEAR: f32 = 0.3;
/// Emissions whose standard error is below this fraction of them are well known.
const WELL_KNOWN: f32 = 0.3;
/// What the paths add to an error is negligible below this fraction of it: without them it would be 6 % less.
const NEGLIGIBLE: f64 = 1.0 / 3.0;
/// Levels that clusters are weighed by take this part of the paths of a round.
const PREDICTING: u64 = 4;
/// So many go to each cluster besides, or its part of those of a whole round: by a dozen paths a pixel beside a lamp may seem
/// dark, and would then weigh more than all others.
const MIN_PREDICTING: u64 = 256;
/// What arrives at lamps takes this part of them.
const LIGHTING_LAMPS: u64 = 32;
/// Textures are no worse for light that is no better known than this: a single pixel knows them to some per cent. Small objects
/// that are known less well are not worth waiting for.
const ENOUGH_FOR_TEXTURES: Aim = Aim {
    median: 5e-3,
    tail: f64::INFINITY,
};

/// What all rounds know of the parameters that are free.
#[derive(Debug)]
pub struct Summed {
    /// Means over the rounds.
    pub clusters: Vec<Linearised>,
    /// What they are linearised about.
    pub about: Unknowns,
}

/// Rounds of the paths of one set of clusters, added up.
pub(super) struct Rounds {
    lights: Emitters,
    /// Places of the free parameters.
    places: Vec<usize>,
    /// What the sums are linearised about.
    about: Unknowns,
    sums: Accumulated,
    next: u32,
}

impl Rounds {
    fn mean(&self, roles: &[Role]) -> Vec<Linearised> {
        let mut clusters = self.sums.mean();
        lamp_albedo::hold_exitance(&mut clusters, roles, &self.places);
        clusters
    }
}

/// A part of the rounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Leg {
    /// As far as it takes to look for textures.
    UntilTextures,
    /// All of them.
    UntilDone,
}

/// Relative standard errors of albedo that rounds aim at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aim {
    /// Median over objects.
    pub median: f64,
    /// What 95 of 100 objects stay below.
    pub tail: f64,
}

impl Pipeline<'_, '_> {
    /// Third stage: rounds of independent paths, added up until the reported errors are small enough; textures as soon as
    /// errors are small enough for them, or after some rounds, however many more are to come.
    pub(super) fn refine(&mut self) -> Result<Termination, Termination> {
        let mut rounds = self.begin_rounds()?;
        let textures = self.monitor.settings.textures;
        if textures && self.aim().1.median < ENOUGH_FOR_TEXTURES.median {
            self.add_rounds(&mut rounds, Leg::UntilTextures)?;
            self.detail()?;
            self.refit()?;
        }
        let ended = self.add_rounds(&mut rounds, Leg::UntilDone)?;
        if textures {
            if self.detail.is_none() {
                self.detail()?;
            }
            self.refit()?;
        }
        Ok(ended)
    }

    /// Clusters weighed, and nothing added up yet.
    fn begin_rounds(&mut self) -> Result<Rounds, Termination> {
        self.monitor.phase("refining");
        let lights = self.lights();
        self.patches = LampPatches::new(&self.problem.scene, &self.roles);
        self.weigh_by_prediction(&lights)?;
        distribute_paths(
            &mut self.clusters,
            self.roles.len(),
            self.budget.round_paths,
        );
        // The albedos of lamps among them.
        let free = roles::free(&self.roles, |k| self.has_free_albedo(k));
        Ok(Rounds {
            lights,
            places: roles::places(&free, self.roles.len()),
            about: self.unknowns.clone(),
            sums: Accumulated::default(),
            next: 0,
        })
    }

    /// Adds rounds until the reported errors are small enough, or there are as many as there may be.
    fn add_rounds(&mut self, rounds: &mut Rounds, leg: Leg) -> Result<Termination, Termination> {
        if rounds.next > 0 && rounds.next >= self.aim_of(leg).0 {
            return Ok(Termination::Steps);
        }
        let started = self.monitor.seconds();
        self.monitor.phase("refining");
        let mut outcome = Termination::Steps;
        loop {
            // What is asked for may change while a solve runs.
            let (most, aim) = self.aim_of(leg);
            if rounds.next >= most {
                break;
            }
            let round = rounds.next;
            rounds.next += 1;
            // What lamps reflect is not linearised but followed.
            self.light_patches(round);
            let linearised =
                self.linearised(&rounds.lights, 2, round, &rounds.about, &rounds.places)?;
            rounds.sums.add(linearised);
            let mut clusters = rounds.mean(&self.roles);
            self.leave_textures_out(&mut clusters);
            let found = self.descend(clusters, &rounds.about);
            self.robust = found.robust;
            self.path_noise = path_noise::fractions(&found.clusters, self.roles.len());
            // Textures stand for what was found about the first point.
            let may_restart = self.detail.is_none() && round < most.min(self.budget.rounds) / 4;
            let far = may_restart && is_nonlinear(&rounds.about, &self.unknowns, &self.errors);
            self.describe();
            self.monitor
                .report(&self.estimate, &|_| self.checkpoint.clone())?;
            if far {
                rounds.about = self.unknowns.clone();
                rounds.sums = Accumulated::default();
                continue;
            }
            let reported = self.reported();
            let fraction = (aim.median / reported.all[0]).powi(2);
            self.monitor.progress.fraction = Some(fraction.min(1.0) as f32);
            if reported.is_enough([aim.median, aim.tail]) {
                outcome = Termination::Converged;
                break;
            }
        }
        self.summed = Some(Summed {
            clusters: rounds.mean(&self.roles),
            about: rounds.about.clone(),
        });
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

    /// Fits all that is free, the lamps' own albedos among it, to clusters linearised about `about`, and takes what was found.
    pub(super) fn descend(&mut self, clusters: Vec<Linearised>, about: &Unknowns) -> Descended {
        let free = roles::free(&self.roles, |k| self.has_free_albedo(k));
        let prior = lamp_albedo::beliefs(&self.prior, &self.roles);
        let found = descend(clusters, about, &self.unknowns, &free, &prior);
        let equations = jackknifed(
            found.equations.clone(),
            &found.clusters,
            &found.robust,
            &free,
        );
        let errors = standard_errors(&equations, &free, self.roles.len());
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

    /// Rounds at most up to the end of a leg, and the errors aimed at.
    fn aim_of(&self, leg: Leg) -> (u32, Aim) {
        let (most, aim) = self.aim();
        match leg {
            Leg::UntilTextures => (self.budget.texture_rounds.min(most), ENOUGH_FOR_TEXTURES),
            Leg::UntilDone => (most, aim),
        }
    }

    /// Rounds at most, and the errors aimed at: the preset's, or without end a smaller median that was asked for.
    fn aim(&self) -> (u32, Aim) {
        let asked = self.monitor.settings.target_error * 0.01;
        let (most, median) = if asked > 0.0 && asked < self.budget.median_error {
            (u32::MAX, asked)
        } else {
            (self.budget.rounds, self.budget.median_error)
        };
        let tail = self.budget.tail_error;
        (most, Aim { median, tail })
    }

    /// Finds out what the patches of lamps reflect, as the room is known by now.
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

    /// Weighs the clusters by what a few paths of their own predict, of which those of the rounds are independent.
    fn weigh_by_prediction(&mut self, lights: &Emitters) -> Result<(), Termination> {
        let paths = self.budget.round_paths / PREDICTING;
        distribute_paths(&mut self.clusters, self.roles.len(), paths);
        let least =
            (self.budget.round_paths / self.clusters.len().max(1) as u64).min(MIN_PREDICTING);
        for cluster in &mut self.clusters {
            let a_pixel = least.div_ceil(2 * cluster.pixels.len() as u64);
            cluster.paths = cluster.paths.max(a_pixel as u32);
        }
        let levels = self.levels(lights, 3)?;
        for (cluster, level) in self.clusters.iter_mut().zip(levels) {
            cluster.weigh(level);
        }
        Ok(())
    }

    /// How large the relative standard errors of albedo are over the reflectors that enough pixels see.
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
        let relative =
            |k: usize| relative_to_albedo(self.errors.albedo[k], self.unknowns.albedo[k]);
        Reported {
            all: quantiles(&relative),
            of_paths: quantiles(&|k| relative(k) * self.path_noise[k].sqrt()),
        }
    }
}

/// Relative standard errors of albedo: the median over objects, and what 95 of 100 stay below.
struct Reported {
    all: [f64; 2],
    /// The part of them that the noise of the paths makes.
    of_paths: [f64; 2],
}

impl Reported {
    /// Whether more paths would gain little: the error is small, or next to none of it is theirs.
    fn is_enough(&self, targets: [f64; 2]) -> bool {
        (0..2).all(|i| self.all[i] < targets[i] || self.of_paths[i] < self.all[i] * NEGLIGIBLE)
    }
}

/// Whether a step is so long that what is left of it to second order, about its square, is no longer small against the standard
/// errors: albedos count in full, emissions relative to themselves. Lamps that are hardly known count not at all: light is linear
/// in them, and what they multiply moves little with them.
fn is_nonlinear(from: &Unknowns, to: &Unknowns, errors: &StandardErrors) -> bool {
    let exceeds = |step: Vec3, size: Vec3, error: Vec3| {
        let known = error.cmpgt(Vec3::ZERO) & error.cmplt(Vec3::INFINITY);
        (known & (step * step).cmpgt(size * error * NONLINEAR)).any()
    };
    let albedo = (from.albedo.iter().zip(&to.albedo).zip(&errors.albedo))
        .any(|((a, b), error)| exceeds(*b - *a, Vec3::ONE, *error));
    let emission =
        (from.emission.iter().zip(&to.emission).zip(&errors.emission)).any(|((a, b), error)| {
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
    fn a_step_is_nonlinear_by_its_square_against_its_own_error() {
        let unknowns = |albedo: f32, emission: f32| {
            let mut unknowns = Unknowns::new(2);
            unknowns.albedo[0] = Vec3::splat(albedo);
            unknowns.emission[1] = Vec3::splat(emission);
            unknowns
        };
        let mut errors = StandardErrors {
            albedo: vec![Vec3::splat(0.06), Vec3::splat(0.5)],
            emission: vec![Vec3::INFINITY, Vec3::splat(0.01)],
        };
        let from = unknowns(0.5, 10.0);
        // What is hardly known may move far, what is well known may not.
        assert!(!is_nonlinear(&from, &unknowns(0.6, 10.0), &errors));
        errors.albedo[0] = Vec3::splat(0.003);
        assert!(is_nonlinear(&from, &unknowns(0.6, 10.0), &errors));
        assert!(!is_nonlinear(&from, &unknowns(0.51, 10.0), &errors));
        // Lamps relative to themselves, in any unit.
        assert!(!is_nonlinear(&from, &unknowns(0.5, 10.1), &errors));
        assert!(is_nonlinear(&from, &unknowns(0.5, 10.3), &errors));
        // One that is hardly known may vanish.
        errors.emission[1] = Vec3::splat(4.0);
        assert!(!is_nonlinear(&from, &unknowns(0.5, 0.0), &errors));
    }
}
