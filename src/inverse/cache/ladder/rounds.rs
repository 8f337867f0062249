//! Rounds of independent paths, added up until the reported errors are small enough or no longer the paths'.

use super::Ladder;
use crate::inverse::cache::accumulate::Accumulated;
use crate::inverse::cache::errors::{jackknifed, standard_errors};
use crate::inverse::cache::evaluate::Linearised;
use crate::inverse::cache::lamp_albedo;
use crate::inverse::cache::lamp_patches::LampPatches;
use crate::inverse::cache::linear::{Descended, descend};
use crate::inverse::cache::path_noise::{self, share_paths};
use crate::inverse::cache::roles::{self, Role};
use crate::inverse::estimate::{ENOUGH_PIXELS, relative_to_albedo};
use crate::inverse::parameters::Unknowns;
use crate::inverse::solver::Termination;
use crate::math::stats::quantile;
use crate::transport::emitters::Emitters;
use crate::transport::path::PathOptions;

/// A step (in albedo, or relative in emission) asks for linearising anew when it is larger than so many times the
/// median error aimed at.
const NONLINEAR: f64 = 10.0;
/// What the paths add to an error is negligible below this share of it: without them it would be 6 % less.
const NEGLIGIBLE: f64 = 1.0 / 3.0;
/// Levels that clusters are weighed by take this part of the paths of a round.
const PREDICTING: u64 = 4;
/// So many go to each cluster besides, or its part of those of a whole round: by a dozen paths a pixel beside a lamp may seem
/// dark, and would then weigh more than all others.
const LEAST_PREDICTING: u64 = 256;
/// What arrives at lamps takes this part of them.
const LIGHTING_LAMPS: u64 = 32;

/// What all rounds know of the parameters that are free.
#[derive(Debug)]
pub struct Summed {
    /// Means over the rounds.
    pub clusters: Vec<Linearised>,
    /// What they are linearised about.
    pub about: Unknowns,
}

impl Ladder<'_, '_> {
    /// Third stage: rounds of independent paths, added up until the reported errors are small enough.
    pub(super) fn rounds(&mut self) -> Result<Termination, Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("refining");
        let lights = self.lights();
        self.patches = LampPatches::new(&self.problem.scene, &self.roles);
        self.weigh_by_prediction(&lights)?;
        share_paths(
            &mut self.clusters,
            self.roles.len(),
            self.budget.round_paths,
        );
        let free = lamp_albedo::free(&self.roles);
        let places = roles::places(&free, self.roles.len());
        let mean = |sums: &Accumulated, roles: &[Role]| {
            let mut clusters = sums.mean();
            lamp_albedo::hold_exitance(&mut clusters, roles, &places);
            clusters
        };
        let mut about = self.unknowns.clone();
        let mut sums = Accumulated::default();
        let mut outcome = Termination::Steps;
        for round in 0.. {
            let (most, aim) = self.aim();
            if round >= most {
                break;
            }
            // What lamps reflect is not linearised but followed.
            self.light_patches(round);
            // Path lengths are steered by what is believed at the start, the same in every round.
            sums.add(self.linearised(&lights, 2, round, &about, &places)?);
            let found = self.descend(mean(&sums, &self.roles), &about);
            self.trust = found.trust;
            self.path_noise = path_noise::shares(&found.clusters, self.roles.len());
            let step = largest_step(&about, &self.unknowns);
            self.describe();
            self.monitor
                .report(&self.estimate, &|_| self.checkpoint.clone())?;
            if f64::from(step) > NONLINEAR * aim && round < self.budget.rounds / 4 {
                about = self.unknowns.clone();
                sums = Accumulated::default();
                continue;
            }
            let reported = self.reported();
            let share = (aim / reported.all[0]).powi(2);
            self.monitor.progress.fraction = Some(share.min(1.0) as f32);
            if reported.is_enough([aim, self.budget.tail_error]) {
                outcome = Termination::Converged;
                break;
            }
        }
        let clusters = mean(&sums, &self.roles);
        self.summed = Some(Summed { clusters, about });
        let reported = self.reported();
        let [median, tail] = reported.all.map(|e| e * 100.0);
        let [median_of_paths, tail_of_paths] = reported.of_paths.map(|e| e * 100.0);
        let why = format!(
            "{} rounds of independent paths: relative standard error of albedo {median:.2} % (median), {tail:.2} % (95 of 100 \
             objects); of that from the paths {median_of_paths:.2} % and {tail_of_paths:.2} %, the rest from the photographs \
             and the model",
            sums.rounds(),
        );
        self.record("refine", started, true, why)?;
        Ok(outcome)
    }

    /// Fits all that is free, the lamps' own albedos among it, to clusters linearised about `about`, and takes what was found.
    pub(super) fn descend(&mut self, clusters: Vec<Linearised>, about: &Unknowns) -> Descended {
        let free = lamp_albedo::free(&self.roles);
        let prior = lamp_albedo::beliefs(&self.prior, &self.roles);
        let found = descend(clusters, about, &free, &prior);
        let equations = jackknifed(
            found.equations.clone(),
            &found.clusters,
            &found.trust,
            &free,
        );
        let errors = standard_errors(&equations, &free, self.roles.len());
        self.unknowns.clone_from(&found.unknowns);
        lamp_albedo::leave_out(&mut self.unknowns, &self.roles);
        self.monitor.progress.iterations += 1;
        self.merge_errors(errors);
        self.hold();
        found
    }

    /// Rounds at most, and the median relative standard error aimed at: the preset's, or without end a smaller one that
    /// was asked for.
    fn aim(&self) -> (u32, f64) {
        let asked = self.monitor.settings.target_error * 0.01;
        if asked > 0.0 && asked < self.budget.median_error {
            (u32::MAX, asked)
        } else {
            (self.budget.rounds, self.budget.median_error)
        }
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
        share_paths(&mut self.clusters, self.roles.len(), paths);
        let least =
            (self.budget.round_paths / self.clusters.len().max(1) as u64).min(LEAST_PREDICTING);
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
            .filter(|&k| self.survey.seen.get(k).is_some_and(|&n| n >= ENOUGH_PIXELS))
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

/// Largest change of an albedo, or relative change of an emission.
fn largest_step(from: &Unknowns, to: &Unknowns) -> f32 {
    let albedo = from
        .albedo
        .iter()
        .zip(&to.albedo)
        .map(|(a, b)| (*a - *b).abs().max_element());
    let emission = from.emission.iter().zip(&to.emission).map(|(a, b)| {
        let size = a.max_element();
        if size > 0.0 {
            (*a - *b).abs().max_element() / size
        } else {
            0.0
        }
    });
    albedo.chain(emission).fold(0.0, f32::max)
}
