//! Albedo that varies over an object, found from photographs rendered in memory.

use crate::scenes;
use glam::{DVec3, Vec3};
use relit::calibrate::gbuffer::GBuffer;
use relit::calibrate::held_out::HoldOut;
use relit::calibrate::problem::Problem;
use relit::calibrate::sharpness::Sharpness;
use relit::capture::mesh::Mesh;
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::inverse::settings::Settings;
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress, Termination};
use relit::inverse::texture::{Refined, Step, Task, refine};
use relit::transport::material::{Albedo, Material, Texture};
use std::sync::{Arc, LazyLock};

const BACK: usize = 4;
const LAMP: usize = 6;
const CHECKS: u32 = 6;

/// The room with a checkerboard on its back wall, its photographs, and what one colour an object makes of it.
struct Room {
    problem: Problem,
    poster: Arc<Texture>,
    estimate: Estimate,
}

fn room(size: [u32; 2], samples: u32) -> Room {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, 0.4, DVec3::new(0.1, 0.9, 0.2));
    let colors = [Vec3::new(0.25, 0.30, 0.40), Vec3::new(0.75, 0.60, 0.30)];
    let poster = scenes::checkerboard(mesh.triangles.len(), 2 * BACK, CHECKS, colors);
    let mut materials: Vec<Material> = [0.6, 0.5, 0.4, 0.7, 0.5, 0.6, 0.0]
        .map(|a| Material::diffuse(Vec3::splat(a), Vec3::ZERO))
        .to_vec();
    materials[LAMP].emission = Vec3::new(12.0, 11.0, 10.0);
    let objects = materials.iter().map(|m| ObjectEstimate {
        albedo: match m.albedo {
            Albedo::Constant(color) => color,
            _ => Vec3::ZERO,
        },
        albedo_stderr: Vec3::splat(1e-3),
        emission: m.emission,
        ..ObjectEstimate::default()
    });
    let estimate = Estimate {
        objects: objects.collect(),
        ..Estimate::default()
    };
    materials[BACK].albedo = Albedo::Image(poster.clone(), Vec3::ONE);
    let capture = scenes::capture(mesh, &scenes::back_wall_views(), size);
    Room {
        problem: scenes::photographed(&capture, &materials, samples, 5),
        poster,
        estimate,
    }
}

/// With some seven per cent of noise a pixel.
static ROOM: LazyLock<Room> = LazyLock::new(|| room([64, 48], 96));

static SETTINGS: LazyLock<Settings> = LazyLock::new(Settings::default);

/// All photographs as sharp as each other.
static USUAL: Sharpness = Sharpness {
    contrast: Vec::new(),
};

/// All pixels.
fn gbuffer(problem: &Problem) -> GBuffer {
    GBuffer::new(
        problem,
        HoldOut::from(&*SETTINGS),
        SETTINGS.seed,
        usize::MAX,
    )
}

fn task<'a>(problem: &'a Problem, gbuffer: &'a GBuffer, paths: u64) -> Task<'a> {
    Task {
        problem,
        gbuffer,
        sharpness: &USUAL,
        settings: &SETTINGS,
        paths,
        max_bounces: 1000,
    }
}

fn refined(problem: &Problem, estimate: &Estimate, objects: &[usize], paths: u64) -> Refined {
    let gbuffer = gbuffer(problem);
    let task = task(problem, &gbuffer, paths);
    let (refined, ended) = refine(&task, estimate, objects, &|_| None, &mut |_, _| Ok(()));
    ended.expect("nobody ends it");
    refined
}

static REFINED: LazyLock<Refined> =
    LazyLock::new(|| refined(&ROOM.problem, &ROOM.estimate, &[0, 1, 2, 3, 4, 5], 200_000));

/// For each texel of the back wall: pixels that saw it, and its error and standard error in each channel.
fn errors() -> Vec<(u32, Vec3, Vec3)> {
    let texels = REFINED.texels.as_ref().expect("the poster was found");
    (scenes::texel_errors(texels, &ROOM.poster, 2 * BACK).into_iter())
        .filter(|texel| texel.is_even)
        .map(|texel| (texel.seen, texel.error, texel.stderr))
        .collect()
}

#[test]
fn the_poster_is_found_and_flat_walls_keep_one_colour() {
    for attempt in &REFINED.attempts {
        println!("{attempt:?}");
        assert_eq!(attempt.kept, attempt.object == BACK, "{}", attempt.object);
    }
    assert_eq!(REFINED.attempts.len(), 6);
    let texels = REFINED.texels.as_ref().expect("the poster was found");
    for (object, textured) in texels.textured.iter().enumerate() {
        assert_eq!(*textured, object == BACK);
    }
}

/// The mean square of errors over standard errors is 1 for exact ones; smoothing makes neighbours depend on each other,
/// so that it scatters, and the errors may claim too much as little as too little: 0.0223, 0.66 and 0.0196 are seen.
#[test]
fn its_albedo_is_right_within_the_reported_errors() {
    let seen: Vec<_> = errors()
        .into_iter()
        .filter(|(seen, ..)| *seen > 0)
        .collect();
    let mean =
        |f: &dyn Fn(&(u32, Vec3, Vec3)) -> f32| seen.iter().map(f).sum::<f32>() / seen.len() as f32;
    let error = mean(&|(_, e, _)| e.length_squared() / 3.0).sqrt();
    let z2 = mean(&|(_, e, s)| (*e / *s).length_squared() / 3.0);
    let beyond = mean(&|(_, e, s)| f32::from((*e / *s).abs().max_element() > 3.0));
    println!(
        "{} texels: rms error {error}, mean z² {z2}, {beyond} beyond three",
        seen.len()
    );
    assert!(seen.len() > 1000);
    assert!(error < 0.027, "rms error {error}");
    assert!((0.45..1.0).contains(&z2), "mean square of z is {z2}");
    assert!(beyond < 0.03, "{beyond} are beyond three standard errors");
}

/// Stops a solve some rounds after textures were found.
struct Onwards {
    found_at: Option<u64>,
}

impl Observer for Onwards {
    fn observe(&mut self, progress: &Progress, _: &Estimate) -> Control {
        if self.found_at.is_none() && progress.stages.iter().any(|s| s.name == "refit") {
            self.found_at = Some(progress.iterations);
        }
        match self.found_at {
            Some(found) if progress.iterations >= found + 4 => Control::Stop,
            _ => Control::Continue,
        }
    }
}

/// Errors far below those of one pixel are asked for: textures do not wait for them, and stay in step with the rounds after.
#[test]
fn rounds_go_on_after_textures_and_take_them_along() {
    let settings = Settings {
        paths: 100_000,
        target_error: 0.01,
        ..Settings::default()
    };
    let mut onwards = Onwards { found_at: None };
    let solution = solve(&ROOM.problem, &settings, None, &mut onwards).expect("nothing to resume");
    assert_eq!(solution.termination, Termination::Cancelled);
    let stages: Vec<&str> = (solution.progress.stages.iter())
        .map(|s| s.name.as_str())
        .collect();
    assert_eq!(stages[stages.len() - 3..], ["refine", "textures", "refit"]);
    let estimate = &solution.estimate;
    let texels = estimate.texels.as_ref().expect("the poster was found");
    assert_eq!(texels.textured.iter().filter(|t| **t).count(), 1);
    // Albedos of walls that no photograph sees are open, and with them the lamp's brightness.
    let (lamp, truth) = (&estimate.objects[LAMP], Vec3::new(12.0, 11.0, 10.0));
    let off = (lamp.emission - truth).abs();
    println!("{} ± {}", lamp.emission, lamp.emission_stderr);
    assert!(off.cmple(lamp.emission_stderr * 3.0).all(), "{lamp:?}");
    assert!((off / truth).max_element() < 0.1, "{lamp:?}");
    let back = &estimate.objects[BACK].albedo;
    let truth = REFINED
        .means
        .iter()
        .find(|(k, _)| *k == BACK)
        .expect("found")
        .1;
    assert!(
        (*back / truth - Vec3::ONE).abs().max_element() < 0.03,
        "{back} {truth}"
    );
}

/// Only the right half of the wall is seen.
#[test]
fn what_no_pixel_sees_is_marked_and_takes_its_neighbours_colour() {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, 0.4, DVec3::new(0.1, 0.9, 0.2));
    let view = (DVec3::new(0.9, 0.0, 0.0), DVec3::new(0.8, 0.0, -1.0));
    let capture = scenes::capture(mesh, &[view], [64, 48]);
    let materials = ROOM.estimate.materials();
    let mut painted = materials.clone();
    painted[BACK].albedo = Albedo::Image(ROOM.poster.clone(), Vec3::ONE);
    let problem = scenes::photographed(&capture, &painted, 96, 5);
    let refined = refined(&problem, &ROOM.estimate, &[BACK], 50_000);
    let texels = refined.texels.expect("half a poster is found");
    let first = texels.colors.layout.first[2 * BACK] as usize;
    let last = texels.colors.layout.first[2 * BACK + 2] as usize;
    let unseen: Vec<usize> = (first..last).filter(|&t| texels.seen[t] == 0).collect();
    assert!(unseen.len() * 4 > last - first && unseen.len() < last - first);
    let seen = (first..last).filter(|&t| texels.seen[t] > 0);
    let (low, high) = seen.map(|t| texels.colors.colors[t]).fold(
        (Vec3::INFINITY, Vec3::NEG_INFINITY),
        |(low, high), color| (low.min(color), high.max(color)),
    );
    println!("seen from {low} to {high}");
    for texel in unseen {
        let color = texels.colors.colors[texel];
        assert!(
            color.cmpge(low - 1e-3).all() && color.cmple(high + 1e-3).all(),
            "{color} where {low} to {high} is seen"
        );
        assert!(texels.stderr[texel].min_element() > 0.0);
    }
}

/// A wall of 20,000 triangles, far smaller than the pixels that see it.
#[test]
fn a_dense_mesh_has_no_more_unknowns_than_its_pixels_can_tell_apart() {
    let mut mesh = Mesh::default();
    let side = 100;
    let at =
        |i: i32, j: i32| DVec3::new(f64::from(i) / 50.0 - 1.0, f64::from(j) / 50.0 - 1.0, -1.0);
    for i in 0..side {
        for j in 0..side {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            scenes::quad(&mut mesh, "wall", corners);
        }
    }
    scenes::lamp(&mut mesh, 0.5, DVec3::new(0.0, 1.5, 0.0));
    let capture = scenes::capture(mesh, &[(DVec3::new(0.0, 0.0, 1.0), DVec3::NEG_Z)], [40, 30]);
    let estimate = Estimate {
        objects: vec![
            ObjectEstimate {
                albedo: Vec3::splat(0.5),
                ..ObjectEstimate::default()
            },
            ObjectEstimate {
                emission: Vec3::splat(10.0),
                ..ObjectEstimate::default()
            },
        ],
        ..Estimate::default()
    };
    let problem = scenes::photographed(&capture, &estimate.materials(), 16, 5);
    let refined = refined(&problem, &estimate, &[0], 20_000);
    let [attempt] = refined.attempts.as_slice() else {
        panic!("the wall is tried");
    };
    assert!(attempt.cells < 4 * attempt.pixels, "{attempt:?}");
    assert!(!attempt.kept);
}

#[test]
fn threads_do_not_change_a_bit() {
    let small = room([40, 30], 64);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads start");
        pool.install(|| refined(&small.problem, &small.estimate, &[2, BACK], 60_000))
    };
    let (one, two) = (with(1), with(2));
    let (a, b) = (one.texels.expect("found"), two.texels.expect("found"));
    assert_eq!(a.colors.colors, b.colors.colors);
    assert_eq!((&a.stderr, &a.seen), (&b.stderr, &b.seen));
}

/// Weaker smoothing shows more of the poster, which the residuals tell while it is fitted.
#[test]
fn residuals_fall_while_the_poster_is_fitted() {
    let gbuffer = gbuffer(&ROOM.problem);
    let task = task(&ROOM.problem, &gbuffer, 10_000);
    let mut residuals = Vec::new();
    let mut report = |step: Step, _| {
        residuals.extend(step.residual);
        Ok(())
    };
    let (_, ended) = refine(&task, &ROOM.estimate, &[BACK], &|_| None, &mut report);
    ended.expect("nobody ends it");
    println!("{residuals:?}");
    let least = residuals.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(least > 0.0 && least < 0.7 * residuals[0], "{residuals:?}");
}

#[test]
fn who_ends_it_is_obeyed() {
    let gbuffer = gbuffer(&ROOM.problem);
    let task = task(&ROOM.problem, &gbuffer, 10_000);
    let ended_after = |most: u32| {
        let mut calls = 0;
        refine(&task, &ROOM.estimate, &[BACK], &|_| None, &mut |_, _| {
            calls += 1;
            if calls > most {
                Err(Termination::Cancelled)
            } else {
                Ok(())
            }
        })
    };
    let (early, ended) = ended_after(3);
    assert_eq!(ended, Err(Termination::Cancelled));
    assert!(early.texels.is_none());
    // What was found by then is kept.
    let found = (4..200).map(ended_after).find(|(r, _)| r.texels.is_some());
    let (late, ended) = found.expect("the texture is found at some time");
    assert_eq!(ended, Err(Termination::Cancelled));
    assert!(late.attempts[0].kept);
}

/// Light and texture may fail to agree: what held-out pixels say decides between the states.
#[test]
fn states_that_raise_the_held_out_loss_are_not_kept() {
    let gbuffer = gbuffer(&ROOM.problem);
    let task = task(&ROOM.problem, &gbuffer, 10_000);
    let refined = |loss: &dyn Fn(&Estimate) -> Option<f64>| {
        let (state, ended) = refine(&task, &ROOM.estimate, &[BACK], loss, &mut |_, _| Ok(()));
        ended.expect("nobody ends it");
        state
    };
    let texture = |e: &Estimate| e.texels.as_ref().map(|t| t.colors.colors.len());
    // Worse than one colour: none is kept.
    let refused = refined(&|e| Some(if texture(e).is_some() { 2.0 } else { 1.0 }));
    assert!(refused.texels.is_none() && refused.worse);
    assert!(refused.attempts.iter().all(|a| !a.kept));
    // The last state is worse than the first, which has fewer texels: the first is kept.
    let last = refined(&|_| None);
    let most = last.texels.as_ref().map(|t| t.colors.colors.len());
    let first = refined(&|e| Some(if texture(e) == most { 2.0 } else { 1.0 }));
    let cells = |r: &relit::inverse::texture::Refined| r.attempts[0].cells;
    assert!(first.texels.is_some() && cells(&first) < cells(&last));
}
