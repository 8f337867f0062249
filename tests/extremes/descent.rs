//! The paper's descent and the path tracer's depth at the ends of their ranges.

use crate::{ROOM, preset, run, run_briefly, scenes};
use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::inverse::settings::{Loss, Preset, Settings};
use relit::inverse::solver::Termination;
use std::sync::Arc;

fn paper(steps: u64) -> Settings {
    Settings {
        steps,
        ..preset(Preset::Paper)
    }
}

#[test]
fn paths_of_one_to_a_thousand_bounces_are_solved() {
    for bounces in [1, 2, 30, 1000] {
        for settings in [paper(60), preset(Preset::Preview), preset(Preset::Balanced)] {
            let settings = Settings {
                bounces,
                textures: false,
                ..settings
            };
            let solution = run_briefly(&ROOM.0, &settings);
            println!(
                "{:?}, {bounces} bounces: {:?}",
                settings.preset, solution.estimate.objects
            );
            assert_ne!(
                solution.termination,
                Termination::Diverged,
                "{bounces} bounces"
            );
            assert!(
                solution.progress.rejected.is_empty(),
                "{:?}",
                solution.progress.rejected
            );
        }
    }
}

#[test]
fn batches_of_one_to_a_million_pixels_are_stepped() {
    for (batch, steps) in [(1, 400), (8, 100), (10_000, 2), (1_000_000, 1)] {
        let solution = run(
            &ROOM.0,
            &Settings {
                batch,
                ..paper(steps)
            },
        );
        assert_eq!(solution.termination, Termination::Steps, "batch {batch}");
        assert_eq!(solution.progress.iterations, steps);
    }
}

#[test]
fn learning_rates_from_a_millionth_to_ten_stay_finite() {
    for learning_rate in [1e-6, 1e-3, 0.1, 1.0, 10.0] {
        for loss in [Loss::L1, Loss::L2] {
            let settings = Settings {
                learning_rate,
                loss,
                ..paper(1_000)
            };
            let solution = run(&ROOM.0, &settings);
            let brightest = solution
                .estimate
                .objects
                .iter()
                .map(|o| o.emission.max_element());
            println!(
                "rate {learning_rate}, {loss:?}: brightest {:.3}",
                brightest.fold(0.0, f32::max)
            );
            assert_eq!(
                solution.termination,
                Termination::Steps,
                "rate {learning_rate}, {loss:?}"
            );
        }
    }
}

/// One pixel whose squared difference no number holds: the descent goes well until it is drawn, then stops, names the
/// cause, and returns what the step before had reached.
#[test]
fn a_descent_that_leaves_the_numbers_stops_with_the_last_good_estimate() {
    let mut problem: Problem = ROOM.0.clone();
    let mut photograph = (*problem.photographs[0]).clone();
    photograph.pixels[300] = Vec3::splat(3e38);
    problem.photographs[0] = Arc::new(photograph);
    let settings = Settings {
        loss: Loss::L2,
        held_out: 0.0,
        ..paper(20_000)
    };
    let solution = run(&problem, &settings);
    assert_eq!(solution.termination, Termination::Diverged);
    let steps = solution.progress.iterations;
    assert!(steps > 10, "it was drawn after {steps} steps already");
    let before = run(&problem, &Settings { steps, ..settings });
    assert_eq!(before.termination, Termination::Steps);
    assert_eq!(solution.estimate.objects, before.estimate.objects);
    assert!(
        solution
            .estimate
            .objects
            .iter()
            .any(|o| o.emission != Vec3::ZERO)
    );
    assert!(solution.checkpoint.is_none());
}

/// Photographs that no emission of theirs can be squared: defined all the same.
#[test]
fn photographs_near_the_end_of_the_numbers_are_defined() {
    for value in [1e-38, 1e18, 1e30] {
        let photographs = ROOM.0.photographs.iter().map(|p| {
            let pixels = p.pixels.iter().map(|&c| c * value).collect();
            Arc::new(scenes::photograph(crate::SIZE, pixels))
        });
        let problem = Problem {
            scene: ROOM.0.scene.clone(),
            photographs: photographs.collect(),
        };
        for settings in [
            paper(50),
            Settings {
                loss: Loss::L2,
                ..paper(50)
            },
            preset(Preset::Preview),
        ] {
            run(&problem, &settings);
        }
    }
}
