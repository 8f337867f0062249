//! Checks that photographs show the mesh from their poses. If they do not, searches for another reading of the files (axes,
//! unit, focal length, orientation, order) with which they do.
//!
//! Image gradients are larger at the projected edges of the mesh than beside them. Each photograph is scored by the mean rank of
//! its gradients at the mesh's edges, relative to displaced edges ([`score`]). The scores of all photographs sum up to within
//! ±2 for unrelated poses, and to 6 to 40 for correct ones. Each photograph is compared with the mesh alone, so the check also
//! works if all poses are wrong. `relit study readings` measures how often the decision is right.

mod candidates;
mod edges;
mod mispaired;
mod score;

use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::reading::{Axes, Reading};
use crate::error::Error;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use edges::edges;
pub use mispaired::{Evidence, MispairedPhotograph};
use rayon::prelude::*;
use score::{Contrast, levels};
use std::sync::Arc;

/// Long side in pixels at which photographs are compared: edges a pixel wide, and noise averaged.
const LONG_SIDE: u32 = 128;
/// Greatest number of photographs that are scored, evenly spaced.
const MAX_FRAMES: usize = 24;
/// Photographs on which readings similar to the given one are scored.
const NEAR_FRAMES: usize = 12;
/// Rounds of the search over readings: the number of readings kept from the previous round, and of photographs.
const ROUNDS: [(usize, usize); 2] = [(usize::MAX, 4), (24, 12)];
/// Readings of the last round whose factor is refined, and refined readings that are scored on all photographs. With few
/// edges, a factor that is off by half a step is not among the first two.
const FINALISTS: usize = 6;
/// Five standard deviations: chance gives such an agreement once in three million times.
const AGREES: f64 = 5.0;
/// Two standard deviations: agreements below are consistent with chance.
const CHANCE: f64 = 2.0;
/// Least advantage of another reading, in standard deviations of the difference of two agreements.
const CLEAR_ADVANTAGE: f64 = 3.0;

/// How well photographs agree with the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Agreement of edges over all scored photographs, in standard deviations of unrelated poses.
    pub agreement: f64,
    /// The decision that follows from it.
    pub decision: Decision,
    /// Single photographs with a wrong pose; searched for only if the decision is [`Decision::Sound`].
    pub mispaired: Vec<MispairedPhotograph>,
}

/// Whether the capture is read correctly.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// Photographs show the mesh from their poses.
    Sound,
    /// Neither this reading nor another is clearly right; there may be too few edges.
    Doubtful,
    /// With `reading` applied on top of the present reading, the photographs agree with the mesh by `agreement`.
    Wrong {
        /// The other reading.
        reading: Reading,
        /// Its agreement.
        agreement: f64,
    },
}

impl Alignment {
    /// Compares the photographs, one per camera, with the mesh.
    pub fn new(scene: &Scene, photographs: &[Arc<Photograph>]) -> Self {
        let views = Views::new(scene, photographs);
        let given = Reading::default();
        let scores = views.scores(&given, MAX_FRAMES);
        let agreement = total(&scores);
        let decision = match agreement >= AGREES && !views.another_may_be_better() {
            true => Decision::Sound,
            false => match views.best() {
                Some((reading, better)) if clearly_better(&better, &scores) => Decision::Wrong {
                    reading,
                    agreement: total(&better),
                },
                _ if agreement >= CHANCE => Decision::Sound,
                _ => Decision::Doubtful,
            },
        };
        let mispaired = match decision {
            Decision::Sound => mispaired::mispaired(&views, &scores),
            Decision::Doubtful | Decision::Wrong { .. } => Vec::new(),
        };
        Self {
            agreement,
            decision,
            mispaired,
        }
    }

    /// The error of a capture that is read wrongly; `before` is its present reading. `None` unless [`Decision::Wrong`].
    pub fn error(&self, name: &str, before: &Reading) -> Option<Error> {
        let Decision::Wrong { reading, agreement } = &self.decision else {
            return None;
        };
        Some(Error::new(
            name,
            format!(
                "the photographs do not show the mesh from their poses; they do {} (edges agree by {agreement:.1} standard \
                 deviations instead of {:.1})",
                reading.conditions(),
                self.agreement
            ),
            match before.then(reading).options().as_str() {
                "" => "leave out the options that say how to read it, or pass --trust-poses to go on as it is".to_owned(),
                options => format!("pass {options}, or --trust-poses to go on as it is"),
            },
        ))
    }

    /// The warning of a capture that may be read wrongly; `None` unless [`Decision::Doubtful`].
    pub fn warning(&self) -> Option<String> {
        (self.decision == Decision::Doubtful).then(|| {
            format!(
                "it cannot be told whether the photographs show the mesh from their poses: edges agree by {:.1} standard \
                 deviations, where 5 are needed to tell; check poses, unit and focal length",
                self.agreement
            )
        })
    }
}

/// The sum of independent scores of standard deviation one, scaled to standard deviation one.
fn total(scores: &[f64]) -> f64 {
    scores.iter().sum::<f64>() / (scores.len().max(1) as f64).sqrt()
}

/// Whether `scores` agree with the mesh, and clearly more than `others` of the same photographs.
fn clearly_better(scores: &[f64], others: &[f64]) -> bool {
    let [better, worse] = [scores, others].map(total);
    better >= AGREES && (better - worse) / f64::sqrt(2.0) >= CLEAR_ADVANTAGE
}

/// The photographs and the mesh that they are scored against.
struct Views<'a> {
    scene: &'a Scene,
    photographs: &'a [Arc<Photograph>],
    /// Gradients of each scored photograph in the orientation of its file.
    contrasts: Vec<Option<Contrast>>,
}

impl<'a> Views<'a> {
    fn new(scene: &'a Scene, photographs: &'a [Arc<Photograph>]) -> Self {
        let mut views = Self {
            scene,
            photographs,
            contrasts: Vec::new(),
        };
        let chosen = views.chosen(MAX_FRAMES);
        views.contrasts = (0..photographs.len())
            .into_par_iter()
            .map(|frame| {
                chosen.contains(&frame).then(|| {
                    let camera = scene.cameras[frame].shrunk(LONG_SIDE);
                    views.contrast(frame, Orientation::default(), &camera)
                })
            })
            .collect();
        views
    }

    /// At most `max` evenly spaced frames.
    fn chosen(&self, max: usize) -> Vec<usize> {
        let count = self.photographs.len();
        let max = max.min(count);
        (0..max).map(|i| i * count / max).collect()
    }

    fn contrast(&self, frame: usize, orientation: Orientation, camera: &Camera) -> Contrast {
        let photograph = &self.photographs[frame];
        let lens = &camera.intrinsics;
        let [width, height] = orientation.size([lens.width, lens.height]);
        // Downscaled in the file's orientation, then turned to the camera's.
        let levels = levels(photograph, width, height);
        let levels = orientation.apply(&levels, [width, height]);
        Contrast::new(&levels, lens.width, lens.height)
    }

    /// The scores of at most `max` photographs with another reading of the capture.
    fn scores(&self, reading: &Reading, max: usize) -> Vec<f64> {
        (self.chosen(max).into_par_iter())
            .map(|frame| self.score(frame, reading))
            .collect()
    }

    fn score(&self, frame: usize, reading: &Reading) -> f64 {
        let camera = self.camera(frame, reading).shrunk(LONG_SIDE);
        let edges = edges(self.scene, &camera);
        let count = self.photographs.len() as i64;
        let photograph = (frame as i64 + i64::from(reading.shift)).rem_euclid(count) as usize;
        match &self.contrasts[photograph] {
            Some(contrast) if reading.orientation == Orientation::default() => {
                contrast.score(&edges)
            }
            _ => (self.contrast(photograph, reading.orientation, &camera)).score(&edges),
        }
    }

    /// Whether another reading may be better than the given one although the given one agrees.
    fn another_may_be_better(&self) -> bool {
        let given = Reading::default();
        let scores = self.scores(&given, NEAR_FRAMES);
        let near_is_better = (candidates::near().iter())
            .any(|near| clearly_better(&self.scores(near, NEAR_FRAMES), &scores));
        let few = ROUNDS[0].1;
        let agreement = total(&self.scores(&given, few));
        near_is_better
            || (candidates::exchanged().iter())
                .any(|other| total(&self.scores(other, few)) > agreement)
    }

    /// A frame's camera with another reading, relative to the unchanged mesh.
    fn camera(&self, frame: usize, reading: &Reading) -> Camera {
        let mut camera = self.scene.cameras[frame].clone();
        let mut rotation = camera.rotation;
        if reading.axes == Axes::OpenCv {
            rotation.y_axis *= -1.0;
            rotation.z_axis *= -1.0;
        }
        let inverse = reading.mesh_rotation().transpose();
        camera.rotation = inverse.as_mat3() * rotation;
        let center = camera.center.as_dvec3() + self.scene.origin;
        camera.center = (inverse * center / reading.mesh_scale - self.scene.origin).as_vec3();
        camera.intrinsics = camera.intrinsics.read_as(reading);
        camera
    }

    /// The reading that agrees best, and its scores; candidates are eliminated in rounds on more and more photographs.
    fn best(&self) -> Option<(Reading, Vec<f64>)> {
        let ranked = |readings: Vec<Reading>, frames: usize| -> Vec<Reading> {
            let mut scored: Vec<(f64, Reading)> = (readings.into_iter())
                .map(|reading| (total(&self.scores(&reading, frames)), reading))
                .collect();
            scored.sort_by(|a, b| b.0.total_cmp(&a.0));
            scored.into_iter().map(|(_, reading)| reading).collect()
        };
        let mut readings = candidates::all();
        for (max, frames) in ROUNDS {
            readings.truncate(max);
            readings = ranked(readings, frames);
        }
        readings.truncate(FINALISTS);
        let finer: Vec<Reading> = (readings.iter()).flat_map(candidates::finer).collect();
        readings.extend(finer);
        let mut finalists = ranked(readings, ROUNDS[1].1);
        finalists.truncate(FINALISTS);
        (finalists.into_iter())
            .map(|reading| (reading, self.scores(&reading, MAX_FRAMES)))
            .max_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))
    }
}
