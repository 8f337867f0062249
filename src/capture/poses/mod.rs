//! Refines the poses of a scan's photographs against each other and their depth images: tracking leaves errors of about a
//! pixel, which shift composites and blur textures.
//!
//! Points with structure are found in every photograph ([`points`]), looked up in the photographs that see them too
//! ([`matches`]; Lucas and Kanade 1981), and all poses are adjusted together (`adjust`; bundle adjustment, Triggs et al.
//! 2000). A fifth of the points is held out; poses change only if those fit better too, and no further than those ask for.

mod adjust;
mod matches;
mod picture;
mod points;

use crate::capture::camera::Pose;
use crate::capture::scan::{ImportedFrame, Lens};
use crate::error::Result;
use adjust::{Adjustment, turn_between};
use matches::Match;
use picture::Picture;
use points::Point;
use rayon::prelude::*;

/// Rounds of looking up points and adjusting poses; from the second, points are near where they are expected.
const ROUNDS: usize = 3;
/// One point in so many is held out.
const HELD_OUT: usize = 5;
/// Poses change only if the median error of held-out points falls to this part of what it was. Sound poses stay as they are.
const MIN_GAIN: f64 = 0.75;
/// Poses that place points this well, in pixels, are left alone.
const SMALL_ERROR: f64 = 0.5;
/// Fewer matches of held-out points a photograph tell nothing: a few edges that happen to look alike fit any poses.
const MIN_HELD_OUT: usize = 4;
/// Standard deviations of the given poses that are tried, from tight to wide, as parts of the largest ones. A shift of a camera looks
/// much like a turn: matches alone let cameras drift by several times what tracking was off.
const DEVIATIONS: [f64; 5] = [1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0];
/// Standard error of the median length of n two-dimensional normal vectors, relative to it: this over √n.
const MEDIAN_ERROR: f64 = 0.72;
/// More photographs are not refined: the equations of all poses are dense.
const MAX_PHOTOGRAPHS: usize = 400;

/// Refines the poses of the photographs `chosen` (indices, those without depth are left out). Returns a remark on it. Returns
/// `None`, and changes nothing, where held-out points do not gain, and with more than [`MAX_PHOTOGRAPHS`].
///
/// # Errors
/// A photograph or depth image is broken.
pub fn refine(frames: &mut [ImportedFrame], chosen: &[usize]) -> Result<Option<String>> {
    let chosen: Vec<usize> = (chosen.iter().copied())
        .filter(|&i| frames[i].depth.is_some())
        .collect();
    if chosen.len() < 2 || chosen.len() > MAX_PHOTOGRAPHS {
        return Ok(None);
    }
    let pictures: Vec<Picture> = (chosen.par_iter())
        .map(|&i| Picture::load(&frames[i]))
        .collect::<Result<_>>()?;
    let given: Vec<Pose> = chosen.iter().map(|&i| frames[i].pose).collect();
    let lenses: Vec<Lens> = pictures.iter().map(|picture| picture.lens).collect();
    let points: Vec<Point> = (pictures.par_iter().enumerate())
        .flat_map_iter(|(frame, picture)| points::find(frame, picture))
        .collect();

    let mut poses = given.clone();
    let mut widest = [0.0; 2];
    let mut seen: Vec<Vec<Match>> = Vec::new();
    for round in 0..ROUNDS {
        seen = matches::look_up(&points, &pictures, &poses, round == 0);
        let fitted = Adjustment::new(&points, &seen, &lenses, |point| point % HELD_OUT != 0);
        let Some(deviations) = fitted.deviations(&given) else {
            return Ok(None);
        };
        widest = deviations;
        poses = fitted.adjust(&given, poses, widest);
    }

    let held_out = Adjustment::new(&points, &seen, &lenses, |point| point % HELD_OUT == 0);
    let fitted = Adjustment::new(&points, &seen, &lenses, |point| point % HELD_OUT != 0);
    let least = MIN_HELD_OUT * chosen.len();
    let Some(before) = held_out.median_error(&given, least) else {
        return Ok(None);
    };
    if before < SMALL_ERROR {
        return Ok(None);
    }
    let Some((poses, after)) = nearest(&fitted, &held_out, &given, &poses, widest) else {
        return Ok(None);
    };
    if after > MIN_GAIN * before {
        return Ok(None);
    }
    let (mut max_shift, mut max_turn) = (0.0_f64, 0.0_f64);
    for (&frame, (given, pose)) in chosen.iter().zip(given.iter().zip(&poses)) {
        max_shift = max_shift.max(given.center.distance(pose.center));
        max_turn = max_turn.max(turn_between(&given.rotation, &pose.rotation).length());
        frames[frame].pose = *pose;
    }
    Ok(Some(format!(
        "poses: refined by up to {:.1} mm and {:.2}°; points that several photographs show lie {after:.2} pixels off instead of \
         {before:.2} (--keep-poses keeps the scan's)",
        1e3 * max_shift,
        max_turn.to_degrees()
    )))
}

/// The poses nearest to the given ones that fit held-out points as well as any, within one standard error (Breiman et al. 1984), and
/// the median error of these points in pixels. Shifts are bounded first, then turns, each below its largest deviation.
fn nearest(
    fitted: &Adjustment,
    held_out: &Adjustment,
    given: &[Pose],
    poses: &[Pose],
    mut deviations: [f64; 2],
) -> Option<(Vec<Pose>, f64)> {
    let noise = MEDIAN_ERROR / (held_out.matches() as f64).sqrt();
    let mut best = None;
    for kind in 0..deviations.len() {
        let tried: Vec<(f64, Vec<Pose>, f64)> = (DEVIATIONS.par_iter())
            .filter_map(|part| {
                let mut bounded = deviations;
                bounded[kind] *= part;
                let adjusted = fitted.adjust(given, poses.to_vec(), bounded);
                let error = held_out.median_error(&adjusted, 1)?;
                Some((bounded[kind], adjusted, error))
            })
            .collect();
        let least = (tried.iter().map(|t| t.2)).fold(f64::INFINITY, f64::min);
        let tightest = tried.into_iter().find(|t| t.2 <= least * (1.0 + noise));
        let (deviation, adjusted, error) = tightest?;
        deviations[kind] = deviation;
        best = Some((adjusted, error));
    }
    best
}
