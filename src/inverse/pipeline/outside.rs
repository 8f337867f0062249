//! Light from outside the mesh: from infinity, with and without a sun, or from a box around a scan.

use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::fit::equations::NormalEquations;
use crate::inverse::fit::errors::StandardErrors;
use crate::inverse::fit::gauss_newton::{MIN_DAMPING, propose};
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::clusters::mean_radiance;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::misfit::Misfit;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::{self, Role};
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::transport::emitters::Emitters;
use crate::transport::surroundings::Surroundings;
use glam::{DVec3, Vec3};

/// Least fraction of paths that leave the mesh for which outside light is tried.
const ESCAPING: f64 = 1e-3;
/// Least relative fall of the squared error by outside light, then by a sun, and by a scan's outside light without measurements.
const OUTSIDE_GAIN: f64 = 0.03;
/// Greatest number of times that a sun's direction is refined.
const REFINEMENTS: usize = 2;
/// Standard errors by which a sun's light exceeds zero, as usual for one unknown: the squared error decides about its direction.
const SUN_ERRORS: f32 = 3.0;

/// Stored paths that end in measured radiance, and what more of them are traced with.
#[derive(Clone, Copy)]
pub(super) struct LightField<'a> {
    pub cache: &'a PathCache,
    pub lights: &'a Emitters,
    pub measured: &'a MeasuredRadiance,
}

/// What a trial changes, to go back to.
#[derive(Clone)]
pub(super) struct Found {
    roles: Vec<Role>,
    unknowns: Unknowns,
    errors: StandardErrors,
    robust: RobustWeights,
    prior: Prior,
    sun: Option<Vec3>,
    open: bool,
    outside_share: f64,
    sky: Option<MeasuredOutside>,
}

/// A fit of the light field with outside light.
struct Trial {
    found: Found,
    misfit: Misfit,
    /// The paths, if new ones were traced.
    paths: Option<PathCache>,
}

impl Pipeline<'_, '_> {
    /// Sets the prior of unmeasured outside directions from the measured ones.
    pub(super) fn expect_of_outside(&mut self) {
        if let Some(sky) = &self.sky {
            self.prior = self.prior.clone().with_sky(sky.expected());
        }
    }

    /// Tries light from outside the mesh, where paths leave it. A scan gets it without a test: what was not scanned reflects light,
    /// if nothing else, and the light field without it makes walls lighter, or gives them light of their own, until nothing is left
    /// to improve.
    pub(super) fn light_from_outside(&mut self, field: LightField) -> Result {
        let escaping = field.cache.fraction_ending_on(self.outside.first);
        if escaping <= ESCAPING || !self.monitor.settings.outside_light {
            return Ok(());
        }
        let started = self.monitor.seconds();
        self.monitor.phase("trying light from outside");
        let leave = format!("{:.1} % of the paths leave the mesh", escaping * 100.0);
        let scene = &self.problem.scene;
        let what = if scene.scanned {
            self.light_around_scan(field)?
        } else {
            self.light_through_windows(field)?
        };
        // The chosen light is fitted to as many paths as the light field.
        let mut held = Vec::new();
        let has_more = self.budget.trial_paths < self.budget.light_field_paths;
        if self.open && (has_more || scene.scanned) {
            let paths = self.paths_of(field, self.budget.light_field_paths)?;
            self.weigh(&paths)?;
            held = self.hold_saturated(&paths)?;
        }
        self.describe();
        let mut why = format!("{leave}; light from there {what}");
        if !held.is_empty() {
            let names = held.join(", ");
            why.push_str(&format!(
                "; no more light than saturated photographs show is given to {names}, whose light the rest does not call for"
            ));
        }
        self.record("outside light", started, self.open, why)
    }

    /// Tries light from infinity, without a sun and with one if there is a candidate. Keeps it if the light field's squared error
    /// falls clearly. A mesh that is not a scan is assumed to lack windows only. Returns in words what the light does.
    fn light_through_windows(&mut self, field: LightField) -> Result<String> {
        // A linear step estimates the gain at a small fraction of the cost of a trial.
        let gain = self.outside_gain(field.cache);
        if gain < OUTSIDE_GAIN {
            return Ok(format!(
                "would change the squared error by {:.1} %, so it is not called for",
                -gain * 100.0
            ));
        }
        let without = self.found();
        let before = Misfit::new(field.cache, &without.unknowns);
        let sky = self.measured_outside(Surroundings::Far);
        let plain = self.fit_open(sky, Surroundings::Far, None, field)?;
        let best = self.with_sun(without.clone(), plain, field)?;
        if !before.falls(&best.misfit, OUTSIDE_GAIN * before.mean()) {
            self.go_back_to(without);
            return Ok("is not called for".to_owned());
        }
        let gain = 1.0 - best.misfit.mean() / before.mean();
        self.go_back_to(best.found);
        Ok(format!(
            "changes the squared error by {:.1} % and comes from far away{}",
            -gain * 100.0,
            self.sun_in_words()
        ))
    }

    /// Fits light from a box around a scan: as photographs measured it where they see past the mesh, with a sun if there is one, and
    /// without these measurements. What is seen through a hole may be as near as a lamp that has no depth, and on the box it would
    /// light the wrong places. Returns in words what the light does.
    fn light_around_scan(&mut self, field: LightField) -> Result<String> {
        let scene = &self.problem.scene;
        let cameras = scene.cameras.iter().map(|camera| camera.center);
        let around = Surroundings::around(scene.positions.iter().copied().chain(cameras));
        let around = around.unwrap_or(Surroundings::Far);
        let from = match around {
            Surroundings::Far => "far away",
            Surroundings::Box { .. } => "a box around the mesh",
        };
        let without = self.found();
        let unmeasured = self.fit_open(None, around, None, field)?;
        let sky = self.measured_outside(around);
        if sky.is_none() {
            return Ok(format!("comes from {from}"));
        }
        self.go_back_to(without.clone());
        let plain = self.fit_open(sky, around, None, field)?;
        let measured = self.with_sun(without, plain, field)?;
        if unmeasured.misfit.mean() < (1.0 - OUTSIDE_GAIN) * measured.misfit.mean() {
            self.go_back_to(unmeasured.found);
            return Ok(format!(
                "comes from {from}; what photographs show past the mesh does not explain it"
            ));
        }
        self.go_back_to(measured.found);
        Ok(format!("comes from {from}{}", self.sun_in_words()))
    }

    pub(super) fn measured_outside(&self, surroundings: Surroundings) -> Option<MeasuredOutside> {
        MeasuredOutside::new(
            self.problem,
            &self.gbuffer,
            surroundings,
            self.outside.size(),
        )
    }

    /// Searches for a sun after a fit of outside light without one, and fits with the best candidate. Returns the fit with the sun
    /// if it lowers the squared error clearly and the sun shines, else that without.
    fn with_sun(&mut self, without: Found, mut plain: Trial, field: LightField) -> Result<Trial> {
        let sun = self.find_sun(plain.paths.take().as_ref().unwrap_or(field.cache));
        if sun.is_none() {
            return Ok(plain);
        }
        // To a scan's light it is also added as it is; the better of both is taken.
        let added = match self.problem.scene.scanned {
            true => Some(self.add_sun(sun, without.prior.clone(), field)?),
            false => None,
        };
        // With the sun known, windows and lamps are told apart anew.
        self.go_back_to(without);
        let sky = plain.found.sky.clone();
        let anew = self.fit_open(sky, self.outside.surroundings, sun, field)?;
        let mut sunny = match added {
            Some(added) if added.misfit.mean() < anew.misfit.mean() => {
                self.go_back_to(added.found.clone());
                added
            }
            _ => anew,
        };
        for _ in 0..REFINEMENTS {
            let Some(refined) = self.move_sun(&sunny, field)? else {
                break;
            };
            sunny = refined;
        }
        // A scan's mesh adds to the noise, which would hide suns, as in room 22 of `relit trade --rooms 24 --family scanned --preset
        // preview`.
        let needed = OUTSIDE_GAIN * plain.misfit.mean();
        let falls = match self.problem.scene.scanned {
            true => plain.misfit.mean() - sunny.misfit.mean() > needed,
            false => plain.misfit.falls(&sunny.misfit, needed),
        };
        Ok(match falls && self.sun_shines() {
            true => sunny,
            false => plain,
        })
    }

    /// Adds a sun to the present fit. `prior` expects nothing of what was found without it.
    fn add_sun(&mut self, sun: Option<Vec3>, prior: Prior, field: LightField) -> Result<Trial> {
        self.outside.sun = sun;
        self.prior = prior;
        self.expect_of_outside();
        let surface = self.outside.sun_surface() as usize;
        self.roles[surface] = Role::Unseen;
        self.unknowns.emission[surface] = mean_radiance(&self.clusters);
        self.robust = RobustWeights::even(self.roles.len());
        let paths = self.settled(field)?;
        self.weigh(&paths)?;
        self.trial(Some(paths), field.cache)
    }

    /// Moves the sun of the present fit to where it explains the photographs better, if that lowers the squared error.
    fn move_sun(&mut self, sunny: &Trial, field: LightField) -> Result<Option<Trial>> {
        let sun = self.refine_sun(sunny.paths.as_ref().unwrap_or(field.cache));
        if sun == self.outside.sun {
            return Ok(None);
        }
        self.outside.sun = sun;
        let paths = self.settled(field)?;
        let moved = self.trial(Some(paths), field.cache)?;
        if moved.misfit.mean() < sunny.misfit.mean() {
            return Ok(Some(moved));
        }
        self.go_back_to(sunny.found.clone());
        Ok(None)
    }

    /// Traces paths in the present light from outside, fits to them and settles the roles; returns the paths.
    fn settled(&mut self, field: LightField) -> Result<PathCache> {
        let paths = self.paths_of(field, self.budget.trial_paths)?;
        let fitted = self.fit(&paths)?;
        self.settle_roles(&paths, fitted)?;
        Ok(paths)
    }

    /// Where the sun stands, for reports; empty without one.
    fn sun_in_words(&self) -> String {
        self.outside.sun.map_or(String::new(), |sun| {
            let height = sun.dot(self.problem.scene.up).asin().to_degrees();
            format!(", with a sun {height:.0}° above the horizon")
        })
    }

    /// Whether the fitted sun is brighter than nothing by its standard errors.
    fn sun_shines(&self) -> bool {
        let sun = self.outside.sun_surface() as usize;
        let found = luminance(self.unknowns.emission[sun]);
        found > SUN_ERRORS * luminance(self.errors.emission[sun])
    }

    /// Tells lamps from walls with light from outside, measured in the directions of `sky`, and a sun if its direction is given.
    fn fit_open(
        &mut self,
        sky: Option<MeasuredOutside>,
        surroundings: Surroundings,
        sun: Option<Vec3>,
        field: LightField,
    ) -> Result<Trial> {
        self.open = true;
        self.outside.surroundings = surroundings;
        self.outside.sun = sun;
        self.sky = sky;
        self.expect_of_outside();
        let as_stored = self.sky.is_none() && surroundings == Surroundings::Far && sun.is_none();
        let paths = match as_stored {
            true => None,
            false => Some(self.paths_of(field, self.budget.trial_paths)?),
        };
        self.tell_lamps(paths.as_ref().unwrap_or(field.cache), Role::Unseen)?;
        self.trial(paths, field.cache)
    }

    /// Paths as of the light field, with the present light from outside.
    fn paths_of(&mut self, field: LightField, count: u64) -> Result<PathCache> {
        let (paths, _) = self.stored(field.lights, Some(field.measured), 0, count)?;
        Ok(paths)
    }

    /// Fits again with the expected colours of outside light. `paths` replace the stored ones of `cache`.
    fn trial(&mut self, paths: Option<PathCache>, cache: &PathCache) -> Result<Trial> {
        let cache = paths.as_ref().unwrap_or(cache);
        self.expect_colors_of_outside();
        self.weigh(cache)?;
        Ok(Trial {
            misfit: Misfit::new(cache, &self.unknowns),
            found: self.found(),
            paths,
        })
    }

    pub(super) fn found(&self) -> Found {
        Found {
            roles: self.roles.clone(),
            unknowns: self.unknowns.clone(),
            errors: self.errors.clone(),
            robust: self.robust.clone(),
            prior: self.prior.clone(),
            sun: self.outside.sun,
            open: self.open,
            outside_share: self.outside_share,
            sky: self.sky.clone(),
        }
    }

    pub(super) fn go_back_to(&mut self, found: Found) {
        self.roles = found.roles;
        self.unknowns = found.unknowns;
        self.errors = found.errors;
        self.robust = found.robust;
        self.prior = found.prior;
        self.outside.sun = found.sun;
        self.open = found.open;
        self.outside_share = found.outside_share;
        self.sky = found.sky;
    }

    /// Sets the prior of outside light to its expected colours at the fitted brightness.
    fn expect_colors_of_outside(&mut self) {
        let photographed = mean_radiance(&self.clusters);
        let bound = self.sky.as_ref().map(|sky| sky.mean_bound());
        let grid = self.outside;
        let is_joint = self.prior.sky().is_some();
        let color = |surface: u32, expected: Vec3| match bound {
            // Sunlight falls on what it lights directly, so that each of its channels is determined.
            _ if surface == grid.sun_surface() => None,
            Some(bound) if grid.is_excess(surface) => Some(bound),
            // Its channels have one brightness already.
            Some(_) if is_joint => None,
            Some(_) => Some(expected),
            None => Some(photographed),
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
        let terms = PriorTerms::new(&equations, &free, &self.unknowns);
        let (after, _) = propose(&equations, &terms, &free, &self.unknowns, MIN_DAMPING);
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
}
