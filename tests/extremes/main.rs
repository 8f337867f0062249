//! The table of `docs/src/robustness.md`: one test or more for each of its rows.

#[path = "../scenes/mod.rs"]
mod scenes;

mod descent;
mod furnace;
mod lamps;
mod lobes;
mod meshes;
mod photographs;
mod precision;
mod sizes;
mod units;

use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::Estimate;
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress, Solution};
use relit::math::stats::Moments;
use relit::transport::material::Material;
use std::sync::LazyLock;

/// Photographs of [`ROOM`].
pub const SIZE: [u32; 2] = [32, 24];
/// The object of [`ROOM`] that emits.
pub const LAMP: usize = 6;

/// The room of `scenes`, its materials and its photographs.
pub static ROOM: LazyLock<(Problem, Vec<Material>)> = LazyLock::new(|| {
    let (mesh, materials) = scenes::lamp_room();
    let capture = scenes::capture(mesh, &scenes::room_views(), SIZE);
    let problem = scenes::photographed(&capture, &materials, 128, 51);
    (problem, materials)
});

struct Silent;

impl Observer for Silent {
    fn observe(&mut self, _: &Progress, estimate: &Estimate) -> Control {
        assert_sound(estimate);
        Control::Continue
    }
}

/// Solves without steering; every estimate on the way must be sound.
pub fn run(problem: &Problem, settings: &Settings) -> Solution {
    let solution = solve(problem, settings, None, &mut Silent).expect("nothing to resume");
    assert_sound(&solution.estimate);
    solution
}

/// A preset; `balanced` with a quarter of its paths, and content with a median error of four per cent: its first rounds of full
/// paths.
pub fn preset(preset: Preset) -> Settings {
    let (target_error, paths) = match preset {
        Preset::Balanced => (4.0, 375_000),
        _ => (0.0, 0),
    };
    Settings {
        preset,
        target_error,
        paths,
        // Several run at once.
        memory: 1.0,
        ..Settings::default()
    }
}

/// Stops a solve once full paths have told the objects.
struct Brief;

impl Observer for Brief {
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        assert_sound(estimate);
        match progress.stages.iter().any(|stage| stage.name == "objects") {
            true => Control::Stop,
            false => Control::Continue,
        }
    }
}

/// Solves photographs that may never give the error that a preset is content with, as far as full paths tell the objects. No
/// clock ends it: what is asked below would hold of a solve that was cut off before it had begun.
pub fn run_briefly(problem: &Problem, settings: &Settings) -> Solution {
    let solution = solve(problem, settings, None, &mut Brief).expect("nothing to resume");
    assert_sound(&solution.estimate);
    solution
}

/// Finite numbers within their bounds, and what is not known is said.
pub fn assert_sound(estimate: &Estimate) {
    for (k, o) in estimate.objects.iter().enumerate() {
        for v in [o.albedo, o.albedo_stderr, o.emission, o.emission_stderr] {
            assert!(v.is_finite() && v.min_element() >= 0.0, "object {k}: {o:?}");
        }
        assert!(o.albedo.max_element() <= 1.0, "object {k}: {o:?}");
        let known = o.identifiable && o.albedo_identifiable;
        assert!(known || !o.note.is_empty(), "object {k}: {o:?}");
        assert!(o.seen_pixels > 0 || !known, "object {k}: {o:?}");
    }
}

/// Difference of a mean to a number in standard errors; the floor is the rounding of f32 sums.
pub fn z(moments: &Moments, truth: f64) -> f64 {
    (moments.mean - truth) / moments.standard_error().max(1e-6 * truth.abs())
}

/// A grey diffuse material.
pub fn grey(albedo: f32, emission: f32) -> Material {
    Material::diffuse(Vec3::splat(albedo), Vec3::splat(emission))
}
