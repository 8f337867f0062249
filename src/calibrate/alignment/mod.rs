//! Whether photographs show the mesh from their poses, and how else the files would have to be read for that.
//!
//! Where a mesh has an edge, photographs change more than beside it. For each photograph the mean rank of its changes at the
//! mesh's edges is compared with the same at displaced edges ([`score`]). The sum over photographs is near zero, within one or
//! two, where poses have nothing to do with photographs, and 6 to 40 where they belong together. It needs no other photograph,
//! so that it also tells when all of them are wrong. `relit study readings` measures how often it is right.

mod astray;
mod candidates;
mod edges;
mod score;

use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::reading::{Axes, Reading};
use crate::error::Error;
use crate::scene::Scene;
use crate::scene::camera::Camera;
pub use astray::{Astray, Why};
use edges::edges;
use rayon::prelude::*;
use score::{Contrast, levels};
use std::sync::Arc;

/// Long side in pixels at which photographs are compared: edges a pixel wide, and noise averaged.
const LONG_SIDE: u32 = 128;
/// Photographs that are compared at most, evenly spaced; ...
const MAX_FRAMES: usize = 24;
/// ... with readings near to that of the files so many, ...
const NEAR_FRAMES: usize = 12;
/// ... and all other readings in rounds: so many of the best of a round before on so many photographs.
const ROUNDS: [(usize, usize); 2] = [(usize::MAX, 4), (24, 12)];
/// Of the best readings of the last round so many are looked for a better factor, and then so many are compared on all
/// photographs: where edges are few, a factor that is off by half a step is not among the first two.
const FINALISTS: usize = 6;
/// An agreement that chance gives once in three million times: five standard deviations.
const AGREES: f64 = 5.0;
/// Less than this is what chance gives: two standard deviations.
const CHANCE: f64 = 2.0;
/// Another reading must agree better by so many standard deviations of the difference of two agreements.
const PLAINLY: f64 = 3.0;

/// How well photographs agree with the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// In standard deviations of what chance gives.
    pub agreement: f64,
    /// What follows from it.
    pub decision: Decision,
    /// Single photographs that do not show the mesh from their poses, where the others do.
    pub astray: Vec<Astray>,
}

/// What follows from an agreement.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// Photographs show the mesh from their poses.
    Sound,
    /// Neither this reading nor another is plainly right: there may be too few edges to tell.
    Doubtful,
    /// Read as `reading` says, on top of how it is read now, the photographs agree with the mesh by `agreement`.
    Wrong {
        /// The other reading.
        reading: Reading,
        /// Its agreement.
        agreement: f64,
    },
}

impl Alignment {
    /// Compares photographs, one a camera, with the scene.
    pub fn new(scene: &Scene, photographs: &[Arc<Photograph>]) -> Self {
        let views = Views::new(scene, photographs);
        let given = Reading::default();
        let scores = views.scores(&given, MAX_FRAMES);
        let agreement = total(&scores);
        let decision = match agreement >= AGREES && !views.may_be_another() {
            true => Decision::Sound,
            false => match views.best() {
                Some((reading, found)) if plainly_better(&found, &scores) => Decision::Wrong {
                    reading,
                    agreement: total(&found),
                },
                _ if agreement >= CHANCE => Decision::Sound,
                _ => Decision::Doubtful,
            },
        };
        let astray = match decision {
            Decision::Sound => astray::astray(&views, &scores),
            Decision::Doubtful | Decision::Wrong { .. } => Vec::new(),
        };
        Self {
            agreement,
            decision,
            astray,
        }
    }

    /// The error of a capture that is plainly read wrongly; `before` is how it is read now.
    pub fn error(&self, name: &str, before: &Reading) -> Option<Error> {
        let Decision::Wrong { reading, agreement } = &self.decision else {
            return None;
        };
        Some(Error::new(
            name,
            format!(
                "the photographs do not show the mesh from their poses; they do {} (edges agree by {agreement:.1} standard \
                 deviations instead of {:.1})",
                condition(reading),
                self.agreement
            ),
            match before.then(reading).options().as_str() {
                "" => "leave out the options that say how to read it, or pass --trust-poses to go on as it is".to_owned(),
                options => format!("pass {options}, or --trust-poses to go on as it is"),
            },
        ))
    }

    /// What is to be said of a capture that may be read wrongly.
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

/// What a reading takes for granted, after "they do".
fn condition(reading: &Reading) -> String {
    let mut conditions = Vec::new();
    if reading.axes == Axes::OpenCv {
        conditions.push("if poses have OpenCV's axes".to_owned());
    }
    if reading.mesh_turns != 0 {
        let degrees = 90 * u32::from(reading.mesh_turns);
        conditions.push(format!(
            "if the mesh is turned about its x axis by {degrees}°"
        ));
    }
    if reading.mesh_scale != 1.0 {
        conditions.push(format!(
            "if the mesh is {:.4} times as large",
            reading.mesh_scale
        ));
    }
    if reading.focal != 1.0 {
        conditions.push(format!(
            "if focal lengths are {:.3} times as long",
            reading.focal
        ));
    }
    if reading.lens_scale != 1.0 {
        conditions.push("if the lens is given for another size of the photographs".to_owned());
    }
    if reading.orientation.mirrored {
        conditions.push("if they are mirrored".to_owned());
    }
    if reading.orientation.turns != 0 {
        let degrees = 90 * u32::from(reading.orientation.turns);
        conditions.push(format!("if they are turned by {degrees}°"));
    }
    if reading.shift != 0 {
        conditions.push("if each pose has the photograph of the frame beside it".to_owned());
    }
    conditions.join(" and ")
}

/// The agreement of photographs' scores, each of deviation one by chance.
fn total(scores: &[f64]) -> f64 {
    scores.iter().sum::<f64>() / (scores.len().max(1) as f64).sqrt()
}

/// Whether scores agree, and by plainly more than others of the same photographs.
fn plainly_better(scores: &[f64], others: &[f64]) -> bool {
    let [better, worse] = [scores, others].map(total);
    better >= AGREES && (better - worse) / f64::sqrt(2.0) >= PLAINLY
}

/// The photographs that are compared.
struct Views<'a> {
    scene: &'a Scene,
    photographs: &'a [Arc<Photograph>],
    /// Of each photograph that is compared as it lies in its file.
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

    /// Frames that are compared, evenly spaced.
    fn chosen(&self, most: usize) -> Vec<usize> {
        let count = self.photographs.len();
        let most = most.min(count);
        (0..most).map(|i| i * count / most).collect()
    }

    fn contrast(&self, frame: usize, orientation: Orientation, camera: &Camera) -> Contrast {
        let photograph = &self.photographs[frame];
        let lens = &camera.intrinsics;
        let [width, height] = orientation.size([lens.width, lens.height]);
        // Reduced as it lies in the file, then turned to the camera.
        let levels = levels(photograph, width, height);
        let levels = orientation.apply(&levels, [width, height]);
        Contrast::new(&levels, lens.width, lens.height)
    }

    /// The score of each compared photograph where the capture is read in another way.
    fn scores(&self, reading: &Reading, most: usize) -> Vec<f64> {
        (self.chosen(most).into_par_iter())
            .map(|frame| self.score(frame, reading))
            .collect()
    }

    fn score(&self, frame: usize, reading: &Reading) -> f64 {
        let camera = self.camera(frame, reading).shrunk(LONG_SIDE);
        let edges = edges(self.scene, &camera);
        let count = self.photographs.len() as i64;
        let shown = (frame as i64 + i64::from(reading.shift)).rem_euclid(count) as usize;
        match &self.contrasts[shown] {
            Some(contrast) if reading.orientation == Orientation::default() => {
                contrast.score(&edges)
            }
            _ => (self.contrast(shown, reading.orientation, &camera)).score(&edges),
        }
    }

    /// Whether some other reading could be better than that of the files, although that one agrees.
    fn may_be_another(&self) -> bool {
        let given = Reading::default();
        let near_scores = self.scores(&given, NEAR_FRAMES);
        let nearer = (candidates::near().iter())
            .any(|near| plainly_better(&self.scores(near, NEAR_FRAMES), &near_scores));
        let few = ROUNDS[0].1;
        let agreement = total(&self.scores(&given, few));
        nearer
            || (candidates::exchanged().iter())
                .any(|other| total(&self.scores(other, few)) > agreement)
    }

    /// A camera as another reading has it, relative to the mesh as it is.
    fn camera(&self, frame: usize, reading: &Reading) -> Camera {
        let mut camera = self.scene.cameras[frame].clone();
        let mut rotation = camera.rotation;
        if reading.axes == Axes::OpenCv {
            rotation.y_axis *= -1.0;
            rotation.z_axis *= -1.0;
        }
        let back = reading.mesh_rotation().transpose();
        camera.rotation = back.as_mat3() * rotation;
        let center = camera.center.as_dvec3() + self.scene.origin;
        camera.center = (back * center / reading.mesh_scale - self.scene.origin).as_vec3();
        camera.intrinsics = camera.intrinsics.read_as(reading);
        camera
    }

    /// The reading that agrees best, with its scores; on the way the less promising are left behind.
    fn best(&self) -> Option<(Reading, Vec<f64>)> {
        let ranked = |readings: Vec<Reading>, frames: usize| -> Vec<Reading> {
            let mut scored: Vec<(f64, Reading)> = (readings.into_iter())
                .map(|reading| (total(&self.scores(&reading, frames)), reading))
                .collect();
            scored.sort_by(|a, b| b.0.total_cmp(&a.0));
            scored.into_iter().map(|(_, reading)| reading).collect()
        };
        let mut left = candidates::all();
        for (most, frames) in ROUNDS {
            left.truncate(most);
            left = ranked(left, frames);
        }
        left.truncate(FINALISTS);
        let finer: Vec<Reading> = (left.iter()).flat_map(candidates::finer).collect();
        left.extend(finer);
        let mut finalists = ranked(left, ROUNDS[1].1);
        finalists.truncate(FINALISTS);
        (finalists.into_iter())
            .map(|reading| (reading, self.scores(&reading, MAX_FRAMES)))
            .max_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))
    }
}
