//! What is known beforehand is held to the bit by every solver, and the rest is solved around it.

use crate::common;
use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::Estimate;
use relit::inverse::known::{Known, Pinned};
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress, Solution};
use relit::session::command::{OpenOptions, Source};
use relit::session::snapshot::OpenCapture;
use std::sync::LazyLock;

const WALLS: usize = 0;
const FLOOR: usize = 1;
const LAMP: usize = 3;

static ROOM: LazyLock<Problem> = LazyLock::new(|| {
    let options = OpenOptions::default();
    let capture = OpenCapture::new(Source::BuiltInRoom, options, common::room());
    let capture = capture.expect("the room can be solved");
    Problem {
        scene: capture.scene.clone(),
        photographs: capture.photographs.clone(),
    }
});

struct Knowing(Known);

impl Observer for Knowing {
    fn observe(&mut self, _: &Progress, _: &Estimate) -> Control {
        Control::Continue
    }

    fn known(&self) -> Known {
        self.0.clone()
    }
}

fn solved(preset: Preset, known: &[(usize, Pinned)]) -> Solution {
    let mut all = Known::default();
    for &(object, pinned) in known {
        all.set(object, pinned);
    }
    let settings = Settings {
        preset,
        steps: 300,
        textures: false,
        hold_out: 0,
        ..Settings::default()
    };
    solve(&ROOM, &settings, None, &mut Knowing(all)).expect("it can be solved")
}

fn albedo(value: Vec3) -> Pinned {
    Pinned {
        albedo: Some(value),
        ..Pinned::default()
    }
}

fn emission(value: Vec3) -> Pinned {
    Pinned {
        emission: Some(value),
        ..Pinned::default()
    }
}

#[test]
fn known_values_are_held_to_the_bit_by_every_solver() {
    let (paint, light) = (Vec3::new(0.31, 0.22, 0.09), Vec3::new(9.5, 7.5, 6.0));
    let known = [
        (FLOOR, albedo(paint)),
        (LAMP, emission(light)),
        (WALLS, emission(Vec3::ZERO)),
    ];
    for preset in [Preset::Preview, Preset::Balanced, Preset::Paper] {
        let objects = solved(preset, &known).estimate.objects;
        assert_eq!(
            (objects[FLOOR].albedo, objects[FLOOR].albedo_stderr),
            (paint, Vec3::ZERO)
        );
        assert_eq!(
            (objects[LAMP].emission, objects[LAMP].emission_stderr),
            (light, Vec3::ZERO)
        );
        assert_eq!(objects[WALLS].emission, Vec3::ZERO);
        assert_eq!(objects[FLOOR].note, "albedo held at a known value");
        // The rest is still found.
        let truth = Vec3::from_array(common::OBJECTS[WALLS].1);
        let off = (objects[WALLS].albedo - truth).abs().max_element();
        println!("{preset:?}: walls {off} off");
        assert!(preset == Preset::Paper || off < 0.05, "{preset:?}: {off}");
    }
}

#[test]
fn a_wrong_value_that_is_held_draws_the_others_after_it() {
    let weak = Vec3::from_array(common::OBJECTS[LAMP].2) * 0.7;
    let solution = solved(Preset::Balanced, &[(LAMP, emission(weak))]);
    let objects = solution.estimate.objects;
    assert_eq!(objects[LAMP].emission, weak);
    // Under a lamp that is taken for weaker the walls must reflect more.
    let truth = Vec3::from_array(common::OBJECTS[WALLS].1);
    println!("walls {} for {truth}", objects[WALLS].albedo);
    assert!((objects[WALLS].albedo - truth).min_element() > 0.03);
}

#[test]
fn a_lamp_with_a_known_albedo_both_reflects_and_glows() {
    let (paint, light) = (Vec3::splat(0.2), Vec3::new(9.0, 8.0, 6.0));
    let both = Pinned {
        albedo: Some(paint),
        emission: Some(light),
    };
    let objects = solved(Preset::Preview, &[(LAMP, both)]).estimate.objects;
    assert_eq!(
        (objects[LAMP].albedo, objects[LAMP].emission),
        (paint, light)
    );
    let objects = solved(Preset::Preview, &[(LAMP, albedo(paint))])
        .estimate
        .objects;
    assert_eq!(objects[LAMP].albedo, paint);
    // What it reflects is no longer counted as its light.
    let off = (objects[LAMP].emission / light - Vec3::ONE)
        .abs()
        .max_element();
    println!("lamp {off} off");
    assert!(off < 0.15, "{}", objects[LAMP].emission);
}
