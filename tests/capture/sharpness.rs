//! Which photographs are blurred, by what others show of the same edges.

use glam::Vec3;
use relit::calibrate::held_out::HoldOut;
use relit::calibrate::problem::Problem;
use relit::calibrate::sharpness::Sharpness;
use relit::capture::photograph::Photograph;
use relit::capture::working::load_working;
use relit::inverse::settings::Settings;
use relit::math::rng::Stream;
use relit::room;
use relit::scene::Scene;
use std::sync::{Arc, LazyLock};

/// The built-in room and its photographs at the size that is solved.
static ROOM: LazyLock<Problem> = LazyLock::new(|| {
    let capture = room::capture().expect("it is in the program");
    let capture = capture.at(&load_working(&capture, 4_000_000).expect("reduced"));
    let photographs = capture.frames.iter().map(|frame| frame.load());
    Problem {
        scene: Arc::new(Scene::new(&capture).expect("a scene")),
        photographs: photographs
            .collect::<Result<_, _>>()
            .expect("they are in the program"),
    }
});

/// The room with one photograph changed.
fn with(frame: usize, change: impl Fn(&Photograph, u32, u32) -> Vec3) -> Problem {
    let mut problem = ROOM.clone();
    let photograph = &problem.photographs[frame];
    let pixels = (0..photograph.pixels.len() as u32).map(|pixel| {
        change(
            photograph,
            pixel % photograph.width,
            pixel / photograph.width,
        )
    });
    problem.photographs[frame] = Arc::new(Photograph {
        pixels: pixels.collect(),
        ..Photograph::clone(photograph)
    });
    problem
}

/// The mean over five pixels in a row, as a hand that moved makes it.
fn moved(photograph: &Photograph, x: u32, y: u32) -> Vec3 {
    let row = |x: u32| photograph.pixels[(y * photograph.width + x) as usize];
    let near = x.saturating_sub(2)..(x + 3).min(photograph.width);
    let count = near.len() as f32;
    near.map(row).sum::<Vec3>() / count
}

fn sharpness(problem: &Problem) -> Sharpness {
    let none = vec![false; problem.photographs.len()];
    Sharpness::new(problem, HoldOut::from(&Settings::default()), &none)
}

fn ratios(sharpness: &Sharpness) -> Vec<Option<f64>> {
    let contrast = sharpness.contrast.iter();
    contrast.map(|contrast| Some((*contrast)?.ratio)).collect()
}

#[test]
fn a_blurred_photograph_is_told_from_sharp_and_from_noisy_ones() {
    let usual = ratios(&sharpness(&ROOM));
    println!("{usual:?}");
    let known: Vec<usize> = (0..usual.len()).filter(|&i| usual[i].is_some()).collect();
    assert!(known.len() >= 8);
    for &frame in &known {
        let contrast = usual[frame].expect("known");
        assert!((0.8..1.25).contains(&contrast), "{frame}: {contrast}");
    }
    for &frame in known.iter().step_by(3) {
        let was = usual[frame].expect("known");
        let [blurred, noisy] = [
            with(frame, moved),
            with(frame, |photograph, x, y| {
                let mut stream = Stream::new(5, frame as u64, u64::from(y), u64::from(x));
                let factor = 1.0 + 0.1 * (2.0 * stream.uniform() - 1.0);
                photograph.pixels[(y * photograph.width + x) as usize] * factor
            }),
        ]
        .map(|problem| sharpness(&problem));
        let remark = blurred.remark();
        assert!(remark.is_some_and(|r| r.contains(&format!(": {frame} ("))));
        assert_eq!(noisy.remark(), None);
        let [blurred, noisy] = [ratios(&blurred), ratios(&noisy)];
        println!("{frame}: {was} {:?} {:?}", blurred[frame], noisy[frame]);
        assert!(blurred[frame].is_some_and(|c| c < 0.85 * was), "{frame}");
        assert!(
            noisy[frame].is_some_and(|c| (c / was - 1.0).abs() < 0.1),
            "{frame}"
        );
    }
}

#[test]
fn photographs_that_are_left_out_have_no_say_and_none() {
    let blurred = with(4, moved);
    let mut left_out = vec![false; blurred.photographs.len()];
    left_out[4] = true;
    let [with, without] = [&blurred, &ROOM]
        .map(|p| Sharpness::new(p, HoldOut::from(&Settings::default()), &left_out));
    assert_eq!(with, without);
    assert_eq!(with.contrast[4], None);
    assert_eq!(with.weight(4), 1.0);
}

/// The built-in room without edges; the first photographs have ten times the noise of the others, as those of dark corners have.
#[test]
fn noise_in_a_plain_room_is_no_contrast() {
    let mut problem = ROOM.clone();
    for (frame, photograph) in problem.photographs.iter_mut().enumerate() {
        let noise = if frame < 4 { 0.3 } else { 0.03 };
        let pixels = (0..photograph.pixels.len() as u64).map(|pixel| {
            let mut stream = Stream::new(7, frame as u64, pixel, 0);
            Vec3::splat(0.3 * (noise * stream.normal()).exp())
        });
        *photograph = Arc::new(Photograph {
            pixels: pixels.collect(),
            ..Photograph::clone(photograph)
        });
    }
    assert_eq!(
        ratios(&sharpness(&problem)),
        vec![None; problem.photographs.len()]
    );
}

/// Noise in all photographs changes no contrast by more than three of its standard errors, and these stay small.
#[test]
fn standard_errors_of_contrasts_hold_what_noise_changes() {
    let usual = ratios(&sharpness(&ROOM));
    let mut compared = 0;
    for seed in 0..3 {
        let mut problem = ROOM.clone();
        for (frame, photograph) in problem.photographs.iter_mut().enumerate() {
            let pixels = (photograph.pixels.iter().enumerate()).map(|(pixel, light)| {
                let mut stream = Stream::new(11 + seed, frame as u64, pixel as u64, 0);
                *light * (0.15 * stream.normal()).exp()
            });
            *photograph = Arc::new(Photograph {
                pixels: pixels.collect(),
                ..Photograph::clone(photograph)
            });
        }
        let sharpness = sharpness(&problem);
        assert_eq!(sharpness.remark(), None);
        for (contrast, usual) in sharpness.contrast.iter().zip(&usual) {
            if let (Some(contrast), Some(usual)) = (contrast, usual) {
                let errors = (contrast.ratio / usual).ln().abs() / contrast.error;
                println!("{contrast:?}, {errors} errors from {usual}");
                assert!(errors < 3.0, "{errors}");
                assert!(contrast.error < 0.2, "{}", contrast.error);
                compared += 1;
            }
        }
    }
    assert!(compared > 12, "{compared}");
}
