//! The transport-cache solver. [`Pipeline::run`] is the algorithm of a solve: light field, full paths, gloss, refinement. Each
//! stage is a method in the file of its name and stores its result in the [`Pipeline`].

pub mod budget;
mod describe;
mod emitters;
mod fitting;
mod full_paths;
mod gloss;
mod light_field;
mod misfit;
mod outside;
mod record;
mod refine;
mod saturated_emitters;
mod state;
mod sun;
mod textures;
mod trace;
mod unseen_emitters;

use crate::calibrate::calibrated::{Calibrated, CalibrationOptions};
use crate::calibrate::exposure::Exposures;
use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::error;
use crate::inverse::estimate::Estimate;
use crate::inverse::fit::errors::StandardErrors;
use crate::inverse::fit::prior::{ExpectedAlbedo, Prior};
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::loss::LossProbe;
use crate::inverse::monitor::Monitor;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::paths::clusters::{Cluster, brightness, cluster, mean_radiance};
use crate::inverse::paths::lamp_patches::LampPatches;
use crate::inverse::paths::outside_grid::OutsideGrid;
use crate::inverse::pipeline::budget::Budget;
use crate::inverse::pipeline::state::SolverState;
use crate::inverse::roles::Role;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Solution, Termination};
use crate::inverse::unknowns::Unknowns;
use crate::transport::material::Lobe;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use textures::Detail;

/// Columns and rows of the fitted map of outside light.
const OUTSIDE_WIDTH: usize = 12;
const OUTSIDE_HEIGHT: usize = 6;
/// Greatest number of bounces of losses, textures, lobes and lamp patches; the paths of fits end by Russian roulette alone.
const MAX_DEPTH: u32 = 1000;
const STAGES: u32 = 4;

/// What a step of the algorithm returns; it fails only where the solve has to end early.
type Result<T = ()> = std::result::Result<T, Termination>;

/// The state of a solve.
pub struct Pipeline<'a, 'o> {
    problem: &'a Problem,
    budget: Budget,
    monitor: Monitor<'o>,
    gbuffer: GBuffer,
    clusters: Vec<Cluster>,
    /// Area of the mesh in square metres.
    mesh_area: f64,
    losses: LossProbe,
    max_bounces: u32,
    outside: OutsideGrid,
    /// Whether light comes from outside.
    open: bool,
    /// Measured outside light, if light comes from outside.
    sky: Option<MeasuredOutside>,
    roles: Vec<Role>,
    robust: RobustWeights,
    prior: Prior,
    /// Patches of the lamps, from the third stage on.
    patches: LampPatches,
    /// For each surface, the fraction of its squared residuals that is path noise.
    path_noise: Vec<f64>,
    unknowns: Unknowns,
    errors: StandardErrors,
    /// Variance of the model error, relative to reflected radiance.
    model_variance: f64,
    /// Fraction of the light in the photographs that comes from outside and was not measured there, as the sun is not.
    outside_share: f64,
    /// The rough specular lobe of each object that has one.
    lobes: Vec<Option<Lobe>>,
    /// Exposures, vignetting and response, if any is needed.
    exposures: Option<Exposures>,
    estimate: Estimate,
    /// Textures, after their stage.
    detail: Option<Detail>,
    /// Mean of each surface's brightest channel in the photographs; zero for unseen surfaces.
    brightness: Vec<f32>,
    /// Number of finished stages.
    stages: u32,
    /// The state after the last finished stage.
    checkpoint: Checkpoint,
}

/// Solves a problem with the transport cache.
///
/// # Errors
/// The checkpoint belongs to another capture.
pub fn solve(
    problem: &Problem,
    settings: &Settings,
    resume: Option<&Checkpoint>,
    mut monitor: Monitor,
) -> error::Result<Solution> {
    let budget = Budget::of(settings);
    let objects = problem.scene.objects.len();
    let outside = OutsideGrid {
        first: objects as u32,
        width: OUTSIDE_WIDTH,
        height: OUTSIDE_HEIGHT,
        up: problem.scene.up,
        surroundings: Surroundings::Far,
        sun: None,
    };
    let surfaces = objects + outside.surfaces();
    monitor.phase("looking through the pixels");
    let started = monitor.seconds();
    let Calibrated {
        problem,
        gbuffer,
        exposures,
        warnings,
        rays,
    } = Calibrated::new(
        problem,
        CalibrationOptions {
            hold_out: HoldOut::from(settings),
            seed: settings.seed,
            pixels: budget.gbuffer_pixels,
            leave_out: settings.leave_out,
            exposures: settings.exposures,
        },
    );
    let problem = &problem;
    monitor.progress.rays += rays;
    if !warnings.is_empty() {
        monitor.progress.warnings = warnings;
    }
    let max_bounces = settings.max_bounces().min(MAX_DEPTH);
    let clusters = cluster(problem, &gbuffer, budget.pixels);
    let photographed = mean_radiance(&clusters);
    let mut prior = Prior::new(surfaces, objects, photographed).with_known(&monitor.known);
    if problem.scene.scanned {
        prior = prior.of_scan();
    }
    prior.albedo = ExpectedAlbedo::unknown(surfaces, &gbuffer.seen);
    let mut pipeline = Pipeline {
        problem,
        budget,
        losses: LossProbe::new(problem, settings, 400, 16, max_bounces),
        checkpoint: Checkpoint::new(&monitor.progress, &()),
        monitor,
        sky: None,
        open: false,
        brightness: brightness(&clusters, surfaces),
        clusters,
        gbuffer,
        mesh_area: problem.scene.objects.iter().map(|o| o.area).sum(),
        max_bounces,
        outside,
        errors: StandardErrors {
            albedo: vec![Vec3::splat(0.5); surfaces],
            emission: vec![Vec3::INFINITY; surfaces],
        },
        model_variance: 0.0,
        outside_share: 0.0,
        roles: vec![Role::Reflector; surfaces],
        robust: RobustWeights::even(surfaces),
        prior,
        patches: LampPatches::default(),
        path_noise: vec![1.0; surfaces],
        unknowns: Unknowns::new(surfaces),
        lobes: vec![None; objects],
        exposures: exposures.clone().filter(Exposures::needed),
        estimate: Estimate::default(),
        detail: None,
        stages: 0,
    };
    if let Some(checkpoint) = resume {
        let fits = |state: &SolverState| state.fits(surfaces, outside.surfaces());
        pipeline.restore(checkpoint.state(fits)?);
    }
    pipeline.checkpoint = Checkpoint::new(&pipeline.monitor.progress, &pipeline.state());
    pipeline.hold();
    pipeline.describe();
    if let Some(exposures) = exposures.filter(|_| resume.is_none()) {
        pipeline.tell_exposures(&exposures, started);
    }
    let termination = match pipeline.run() {
        Ok(termination) | Err(termination) => termination,
    };
    Ok(pipeline.finish(termination))
}

impl Pipeline<'_, '_> {
    /// The algorithm: runs the stages that are not finished yet.
    fn run(&mut self) -> Result<Termination> {
        if self.stages < 1 {
            self.light_field()?;
            self.end_stage(1)?;
        }
        let has_rounds = self.budget.rounds > 0;
        // The light field cannot tell whether an unseen surface emits its light or reflects it.
        if self.stages < 2 && (has_rounds || self.is_lit_out_of_sight()) {
            self.full_paths()?;
            self.tell_depth();
            self.end_stage(2)?;
        }
        if !has_rounds {
            return Ok(Termination::Converged);
        }
        if self.stages < 3 {
            if self.monitor.settings.lobes {
                self.gloss()?;
                // The following stages hold the lobes fixed.
                self.settle_lobes(0)?;
            }
            self.end_stage(3)?;
        }
        let ended = self.refine()?;
        self.settle_lobes(1)?;
        self.keep_checkpoint(STAGES);
        Ok(ended)
    }
}
