//! Refines the poses of a scan's photographs against each other and their depth images: tracking leaves errors of about a
//! pixel, which shift composites and blur textures.
//!
//! Points with structure are found in every photograph ([`points`]), looked up in the photographs that see them too
//! ([`matches`]; Lucas and Kanade 1981), and all poses are adjusted together (`adjust`; bundle adjustment, Triggs et al.
//! 2000). A fifth of the points is held out; poses change only if those fit better too.

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
    let mut seen: Vec<Vec<Match>> = Vec::new();
    for round in 0..ROUNDS {
        seen = matches::look_up(&points, &pictures, &poses, round == 0);
        let fitted = Adjustment::new(&points, &seen, &lenses, |point| point % HELD_OUT != 0);
        poses = fitted.adjust(&given, poses);
    }

    let held_out = Adjustment::new(&points, &seen, &lenses, |point| point % HELD_OUT == 0);
    let least = MIN_HELD_OUT * chosen.len();
    let (Some(before), Some(after)) = (
        held_out.median_error(&given, least),
        held_out.median_error(&poses, least),
    ) else {
        return Ok(None);
    };
    if before < SMALL_ERROR || after > MIN_GAIN * before {
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
