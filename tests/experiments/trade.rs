//! The trade of speed for exactness, measured on tiny generated rooms with tiny budgets.

use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solver::Termination;
use relit::room::generated::generate;
use relit::room::truth;
use relit::study::trade::plan::{self, Run};
use relit::study::trade::{Curve, Measure, Metric, SolveEvent, Trade, measure, rooms};
use std::cell::Cell;
use std::time::Duration;

/// Size of photographs that are rendered in a moment.
const TINY: [u32; 2] = [24, 18];

/// Solves that end by their work, not by the clock.
fn runs(wanted: &[Preset]) -> Vec<Run> {
    let mut runs = plan::presets(&Settings {
        steps: 2000,
        ..Settings::default()
    });
    runs.retain(|run| wanted.contains(&run.settings.preset));
    runs
}

fn measured(metric: Option<Metric>, runs: &[Run]) -> Vec<Curve> {
    let (problem, truth) = rooms::problem(3, TINY).expect("a room");
    let metric = metric.unwrap_or(truth);
    let limit = Duration::from_secs(3600);
    measure(&problem, &metric, runs, limit, &|| false, &mut |_| {}).expect("measured")
}

#[test]
fn generated_rooms_differ_and_are_lit_seen_and_the_same_for_the_same_seed() {
    for seed in 0..12 {
        let (room, rendering) = generate(seed, TINY);
        let (again, _) = generate(seed, TINY);
        assert_eq!(room.mesh.positions, again.mesh.positions);
        assert_ne!(
            room.mesh.positions,
            generate(seed + 1, TINY).0.mesh.positions
        );
        assert_eq!(room.mesh.objects.len(), room.materials.len());
        let world = room.lit(rendering.size).expect("a scene");
        let seen = truth::seen_pixels(&world);
        let lit = world
            .materials
            .iter()
            .any(|m| m.emission.max_element() > 0.0);
        assert!(lit, "room {seed}");
        assert!(
            world.materials.iter().all(|material| {
                let surface = relit::scene::geometry::Hit {
                    t: 0.0,
                    triangle: 0,
                    b1: 0.3,
                    b2: 0.3,
                };
                let albedo = material.albedo_at(&surface);
                albedo.min_element() >= 0.0 && albedo.max_element() <= 0.95
            }),
            "room {seed}"
        );
        // Cameras stand in the room: each looks at fronts only.
        let pixels = u64::from(TINY[0] * TINY[1]) * room.views.len() as u64;
        assert_eq!(seen.iter().sum::<u64>(), pixels, "room {seed}");
        for camera in &world.scene.cameras {
            for y in 0..TINY[1] {
                for x in 0..TINY[0] {
                    let pixel = glam::Vec2::new(x as f32, y as f32) + 0.5;
                    let ray = camera.ray(pixel);
                    let hit = world.scene.intersect(&ray).expect("closed");
                    let normal = world.scene.normals[hit.triangle as usize];
                    assert!(normal.dot(ray.direction) <= 0.0, "room {seed}");
                }
            }
        }
    }
}

#[test]
fn one_solve_gives_a_course_of_falling_errors_with_what_it_cost() {
    let curves = measured(None, &runs(&[Preset::Preview, Preset::Paper]));
    let [preview, paper] = &curves[..] else {
        panic!("{} curves", curves.len());
    };
    assert_eq!(preview.ended, Some(Termination::Converged));
    assert_eq!(paper.ended, Some(Termination::Steps));
    for curve in &curves {
        assert_eq!(curve.rejected, 0);
        for pair in curve.points.windows(2) {
            assert!(pair[0].seconds <= pair[1].seconds && pair[0].rays <= pair[1].rays);
        }
    }
    // The descent starts in the dark and does not end where it began.
    let errors: Vec<f64> = paper.points.iter().map(|p| p.error).collect();
    assert!(errors.len() >= 2 && errors[0] > 0.1, "{errors:?}");
    assert!(errors[errors.len() - 1] < 0.8 * errors[0], "{errors:?}");
    let end = preview.points.last().expect("an estimate");
    println!("{errors:?} {end:?}");
    assert!(end.error < 0.1 && end.reported.is_some(), "{end:?}");
}

#[test]
fn no_solve_gets_more_than_its_fraction_of_the_time_or_an_estimate_after_it() {
    let (problem, metric) = rooms::problem(3, TINY).expect("a room");
    let all = runs(&[Preset::Reference]);
    let limit = Duration::from_millis(1);
    let curves = measure(&problem, &metric, &all, limit, &|| false, &mut |_| {});
    let curves = curves.expect("measured");
    assert_eq!(curves[0].ended, Some(Termination::Time));
    assert!(curves[0].points.is_empty());
}

#[test]
fn without_a_truth_the_held_out_loss_is_measured() {
    let curves = measured(Some(Metric::HeldOut), &runs(&[Preset::Paper]));
    let errors: Vec<f64> = curves[0].points.iter().map(|p| p.error).collect();
    assert!(errors.len() >= 2, "{errors:?}");
    assert!(errors[errors.len() - 1] < errors[0], "{errors:?}");
}

#[test]
fn a_measurement_that_is_stopped_keeps_what_it_has() {
    let (problem, metric) = rooms::problem(3, TINY).expect("a room");
    let ended = Cell::new(0);
    let curves = measure(
        &problem,
        &metric,
        &runs(&[Preset::Preview, Preset::Paper]),
        Duration::from_secs(3600),
        &|| ended.get() > 0,
        &mut |heard| {
            if matches!(heard, SolveEvent::Ended(_)) {
                ended.set(ended.get() + 1);
            }
        },
    );
    assert_eq!(curves.expect("measured").len(), 1);
}

#[test]
fn files_hold_every_point_and_read_back_the_same() {
    let curves = measured(None, &runs(&[Preset::Preview, Preset::Paper]));
    let trade = Trade::new(
        "room, \"three\"",
        Some("ab".into()),
        Measure::Albedo,
        Duration::from_millis(1500),
        curves,
    );
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(Trade::read(folder.path()), Ok(None));
    trade.write(folder.path()).expect("written");
    let back = Trade::read(folder.path()).expect("read").expect("there");
    assert_eq!(back, trade);
    assert!(back.machine.threads > 0 && !back.machine.cpu.is_empty());

    // The table repeats the numbers to the bit.
    let text = std::fs::read_to_string(folder.path().join("trade.csv")).expect("read");
    let rows: Vec<Vec<&str>> = text.lines().map(|l| l.splitn(10, ',').collect()).collect();
    let column = |name: &str| {
        let header = text.lines().next().expect("a header");
        header.split(',').position(|c| c == name).expect("a column")
    };
    let points: Vec<_> = trade.curves.iter().flat_map(|c| &c.points).collect();
    assert_eq!(rows.len(), points.len() + 1);
    for (row, point) in rows[1..].iter().zip(points) {
        let number = |name: &str| row[column(name)].parse::<f64>();
        assert_eq!(number("seconds"), Ok(point.seconds));
        assert_eq!(number("error"), Ok(point.error));
        assert_eq!(number("reported_error").ok(), point.reported);
        assert_eq!(number("rays"), Ok(point.rays as f64));
    }
    let picture = image::open(folder.path().join("trade.png")).expect("a picture");
    assert!(picture.width() > 400);

    for broken in ["", "{}", "{\"curves\": 3}"] {
        std::fs::write(folder.path().join("trade.json"), broken).expect("written");
        let error = Trade::read(folder.path()).expect_err("broken");
        assert!(error.to_string().contains("trade.json"), "{error}");
    }
}
