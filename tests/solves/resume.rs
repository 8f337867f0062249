//! A solve that is taken up again ends where it would have ended anyway, to the bit.

use crate::common;
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::Estimate;
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solve;
use relit::inverse::solver::{Checkpoint, Control, Observer, Progress, Solution, Termination};
use relit::session::command::{OpenOptions, Source};
use relit::session::snapshot::OpenCapture;

fn problem() -> Problem {
    let capture = OpenCapture::new(Source::BuiltInRoom, OpenOptions::default(), common::room())
        .expect("the room is whole");
    Problem {
        scene: capture.scene.clone(),
        photographs: capture.photographs.clone(),
    }
}

/// Keeps every checkpoint as a file would hold it, and stops where it is told to.
struct Keeper {
    kept: Vec<String>,
    stop: fn(&Progress) -> bool,
}

impl Observer for Keeper {
    fn observe(&mut self, progress: &Progress, _: &Estimate) -> Control {
        if (self.stop)(progress) {
            return Control::Stop;
        }
        Control::Continue
    }

    fn offer(&mut self, make: &dyn Fn() -> Checkpoint) {
        self.kept
            .push(serde_json::to_string(&make()).expect("a checkpoint is JSON"));
    }
}

fn run(
    settings: &Settings,
    resume: Option<&Checkpoint>,
    stop: fn(&Progress) -> bool,
) -> (Solution, Vec<Checkpoint>) {
    let mut keeper = Keeper {
        kept: Vec::new(),
        stop,
    };
    let solution = solve(&problem(), settings, resume, &mut keeper).expect("solves");
    let kept = keeper
        .kept
        .iter()
        .map(|text| serde_json::from_str(text).expect("reads back"))
        .collect();
    (solution, kept)
}

fn assert_same(one: &Solution, other: &Solution) {
    assert_eq!(one.termination, other.termination);
    assert_eq!(one.estimate.objects, other.estimate.objects);
    let texels = |s: &Solution| s.estimate.texels.as_ref().map(|t| t.colors.colors.clone());
    assert_eq!(texels(one), texels(other));
    // The course is the same too, seconds apart.
    let curve = |s: &Solution| -> Vec<_> {
        let points = s.progress.losses.iter();
        points.map(|p| (p.iteration, p.train, p.held_out)).collect()
    };
    assert_eq!(curve(one), curve(other));
    let stages = |s: &Solution| -> Vec<_> {
        let stages = s.progress.stages.iter();
        stages.map(|s| (s.name.clone(), s.iterations)).collect()
    };
    assert_eq!(stages(one), stages(other));
    assert_eq!(one.progress.iterations, other.progress.iterations);
}

/// Steps that end in the stage of triangles, which begins after 220.
const STEPS: u64 = 223;

fn paper(steps: u64) -> Settings {
    Settings {
        preset: Preset::Paper,
        batch: 500,
        anneal: false,
        steps,
        ..Settings::default()
    }
}

#[test]
fn the_papers_descent_goes_on_from_any_checkpoint() {
    // Start where the next measurement, 200 steps on, finds the loss standing still: the objects are left then.
    let (begun, _) = run(&paper(20), None, |_| false);
    let mut start = begun.checkpoint.expect("more steps could follow");
    let schedule = serde_json::json!({"losses": vec![1e-9; 7], "until_measured": 200 * 2 * 500});
    assert!(start.state["schedule"].is_object());
    start.state["schedule"] = schedule;

    let (whole, kept) = run(&paper(STEPS), Some(&start), |_| false);
    assert_eq!(whole.termination, Termination::Steps);
    assert!(whole.estimate.texels.is_some(), "it never left the objects");
    let is_coarse = |c: &&Checkpoint| c.state["descent"]["patches"].is_null();
    let coarse = kept.iter().filter(is_coarse).count();
    let fine = kept.len() - coarse;
    assert!(coarse > 0 && fine > 0, "{coarse} {fine}");
    for index in [coarse / 2, coarse + fine / 2] {
        let (resumed, _) = run(&paper(STEPS), Some(&kept[index]), |_| false);
        assert_same(&whole, &resumed);
    }
}

#[test]
fn the_transport_cache_goes_on_from_the_last_finished_stage() {
    // Exposures, light field, objects with their depth, and lobes come first; one round of the refinement is enough to tell.
    let refining = |progress: &Progress| {
        let before = progress.stages.last().map_or(0, |stage| stage.iterations);
        progress.stages.len() == 5 && progress.iterations > before
    };
    let settings = Settings::default();
    let (whole, kept) = run(&settings, None, refining);
    assert_eq!(whole.termination, Termination::Cancelled);
    for stages in [2, 4, 5] {
        let checkpoint = kept
            .iter()
            .find(|c| c.progress.stages.len() == stages)
            .expect("every stage leaves a checkpoint");
        let (resumed, _) = run(&settings, Some(checkpoint), refining);
        assert_same(&whole, &resumed);
    }
}

#[test]
fn a_checkpoint_of_another_solver_or_a_broken_one_is_refused() {
    let (stopped, _) = run(&paper(STEPS), None, |_| true);
    let checkpoint = stopped.checkpoint.expect("a stopped solve can go on");
    let refused = |settings: &Settings, checkpoint: &Checkpoint| {
        let mut keeper = Keeper {
            kept: Vec::new(),
            stop: |_| true,
        };
        let error = solve(&problem(), settings, Some(checkpoint), &mut keeper)
            .expect_err("it does not fit")
            .to_string();
        assert!(error.contains("checkpoint"), "{error}");
    };
    refused(&Settings::default(), &checkpoint);
    for (path, value) in [
        ("/descent/adam/first", serde_json::json!([])),
        ("/descent/albedo/0", serde_json::json!(null)),
        ("/descent/level", serde_json::json!(4_000_000_000u32)),
        (
            "/descent/patches",
            serde_json::json!({"levels": [], "patch_of": [], "depth": []}),
        ),
        ("/descent/expected_albedo", serde_json::json!([])),
    ] {
        let mut broken = checkpoint.clone();
        *broken.state.pointer_mut(path).expect("the field is there") = value;
        refused(&paper(STEPS), &broken);
    }
}
