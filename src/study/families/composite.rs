//! Composites of a chair in photographs of a generated room, compared with the chair truly in the room.

use crate::capture::exposure::{Exposure, Vignetting};
use crate::compose::backdrop::Backdrop;
use crate::compose::naive::{Pasted, harmonics_of_photographs};
use crate::compose::object::ObjectModel;
use crate::compose::placement::{PlacedObject, Placement};
use crate::compose::world::FurnishedScene;
use crate::error::{Error, Result};
use crate::math::color::linear_to_srgb;
use crate::math::picture::Picture;
use crate::math::stats::quantile;
use crate::room::generated::Family;
use crate::scene::Scene;
use crate::study::experiments::{Cylinder, Grid, chair_model, insert, places, up, upright};
use crate::study::families::Plan;
use crate::study::families::row::{RoomRow, Solve};
use crate::study::families::score::{Solved, solved};
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::{DAffine3, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The chair's reflectance.
const ALBEDO: Vec3 = Vec3::new(0.55, 0.33, 0.16);
/// A cylinder around the chair, in metres.
const CHAIR: Cylinder = Cylinder {
    radius: 0.31,
    height: 0.85,
};
/// Gap between floor and chair in metres, for floors that are not quite flat.
const LIFT: f32 = 2e-3;
/// Number of photographs that it is inserted into.
const FRAMES: usize = 2;
/// Range of the fraction of a photograph that it covers.
const COVERED: [f64; 2] = [0.005, 0.3];
/// Samples per pixel of the composite and of the truth, both in two halves and denoised.
const SAMPLES: u32 = 64;
/// Shadow and bleed are the pixels beside the chair that it changes by more than this, at the photograph's exposure.
const CHANGED: f32 = 0.025;
/// Captions of the pictures of a photograph.
const TITLES: [&str; 4] = ["truth", "relit", "naive", "photograph"];
/// Greatest power of the cosine by which the photographs of generated rooms are dimmed off the axis, with a margin.
const MAX_POWER: u32 = 6;

/// Comparison of the composites in a room with the truth; means over its photographs.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct CompositeRow {
    /// The program's version.
    pub relit: String,
    /// Name of the preset.
    pub preset: String,
    /// Width of the photographs in pixels.
    pub width: u32,
    /// Height of the photographs in pixels.
    pub height: u32,
    /// The room's family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Seconds of the solve.
    pub seconds: f64,
    /// PSNR of the composite in dB over the chair, displayed at the photograph's exposure.
    #[serde(rename = "chair_psnr")]
    pub chair: f64,
    /// The same of the naive composite.
    #[serde(rename = "naive_psnr")]
    pub naive: f64,
    /// Ratio of the chair's brightness to the true one.
    pub brightness: f64,
    /// PSNR of the composite in dB over shadow and bleed; `None` if the chair changes no pixel beside it.
    #[serde(rename = "shadow_psnr")]
    pub shadow: Option<f64>,
    /// The same of the photograph without the chair.
    #[serde(rename = "untouched_psnr")]
    pub untouched: Option<f64>,
    /// Least-squares slope of the composite's change there over the true change, over all its photographs; 1 is right.
    pub slope: Option<f64>,
}

/// Generates and solves a room, and inserts a chair into the photographs that see most of it. The pictures are the truth, ours, the
/// naive composite and the photograph. `None` without a visible free place.
///
/// # Errors
/// The room cannot be generated or solved.
pub fn composite(family: Family, seed: u64, plan: &Plan) -> Result<Option<(CompositeRow, Grid)>> {
    let solved = solved(family, seed, plan)?;
    let truth = Arc::new(solved.room.lit.clone());
    let Some(chair) = standing(&truth)? else {
        return Ok(None);
    };
    let true_chair = [placed(&chair, &truth.scene)?];
    let frames = most_seen(&truth, &true_chair);
    let (mut scores, mut pictures) = (Vec::new(), Vec::new());
    for frame in frames {
        let (of_frame, shown) = compare(&solved, frame, &truth, &true_chair, &chair)?;
        scores.push(of_frame);
        pictures.extend(TITLES.map(str::to_owned).into_iter().zip(shown));
    }
    if scores.is_empty() {
        return Ok(None);
    }
    let count = scores.len() as f64;
    let mean = |score: fn(&Scores) -> f64| scores.iter().map(score).sum::<f64>() / count;
    let changed: Vec<[f64; 4]> = scores.iter().filter_map(|s| s.around).collect();
    let [shadow, untouched, product, square] =
        [0, 1, 2, 3].map(|score| changed.iter().map(|around| around[score]).sum::<f64>());
    let frames = changed.len() as f64;
    let around = |mean: f64| (!changed.is_empty()).then_some(mean);
    let row = CompositeRow {
        relit: env!("CARGO_PKG_VERSION").to_owned(),
        preset: plan.preset.word().to_owned(),
        width: plan.size[0],
        height: plan.size[1],
        family,
        seed,
        seconds: solved.solution.progress.seconds,
        chair: mean(|s| s.chair),
        naive: mean(|s| s.naive),
        brightness: mean(|s| s.brightness),
        shadow: around(shadow / frames),
        untouched: around(untouched / frames),
        slope: around(product / square),
    };
    let grid = Grid {
        columns: TITLES.len(),
        exposure: 1.0,
        pictures,
    };
    Ok(Some((row, grid)))
}

impl RoomRow for CompositeRow {
    fn solve(&self) -> Solve<'_> {
        (&self.relit, &self.preset, [self.width, self.height])
    }

    fn room(&self) -> (Family, u64) {
        (self.family, self.seed)
    }
}

impl CompositeRow {
    /// As a line of text.
    pub fn words(&self) -> String {
        let scores = self.shadow.zip(self.untouched).zip(self.slope);
        let around = scores.map_or("none".to_owned(), |((shadow, untouched), slope)| {
            format!("{shadow:.1} dB (untouched {untouched:.1}), slope {slope:.2}")
        });
        format!(
            "{} room {}: chair {:.1} dB (naive {:.1}), brightness {:.2}; shadow {around}; {:.0} s",
            self.family.name(),
            self.seed,
            self.chair,
            self.naive,
            self.brightness,
            self.seconds,
        )
    }
}

/// Summary over rooms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Number of rooms.
    pub rooms: usize,
    /// Rooms in which the chair has a higher PSNR than the naive one.
    pub better: usize,
    /// Median gain in dB over the naive composite.
    pub gain: f64,
    /// Rooms in which the chair's brightness is within 15 %.
    pub bright: usize,
    /// Rooms in which the slope is between 0.7 and 1.3.
    pub strong: usize,
}

impl Decision {
    /// Summarizes rooms.
    pub fn of(rows: &[&CompositeRow]) -> Self {
        let mut gains: Vec<f64> = rows.iter().map(|row| row.chair - row.naive).collect();
        let count =
            |holds: &dyn Fn(&CompositeRow) -> bool| rows.iter().filter(|&&r| holds(r)).count();
        Self {
            rooms: rows.len(),
            better: gains.iter().filter(|&&gain| gain > 0.0).count(),
            gain: quantile(&mut gains, 0.5).unwrap_or(f64::NAN),
            bright: count(&|row| (row.brightness - 1.0).abs() <= 0.15),
            strong: count(&|row| row.slope.is_some_and(|slope| (0.7..=1.3).contains(&slope))),
        }
    }

    /// As a line of text.
    pub fn words(&self) -> String {
        let Self {
            rooms,
            better,
            gain,
            bright,
            strong,
        } = self;
        format!(
            "{rooms} rooms: nearer to the truth than naive in {better}, median gain {gain:.1} dB; brightness within 15 % in \
             {bright}; slope of shadow and bleed 0.7 to 1.3 in {strong}"
        )
    }
}

/// A chair on the true floor, in the room's coordinates.
fn standing(truth: &LitScene) -> Result<Option<Arc<ObjectModel>>> {
    let scene = &truth.scene;
    let up = up(scene);
    let Some(&place) = places(scene, up, CHAIR, 1).first() else {
        return Ok(None);
    };
    let at = (place + up * LIFT).as_dvec3() + scene.origin;
    let stand = DAffine3::from_translation(at) * upright(up);
    chair_model("chair", stand, ALBEDO).map(Some)
}

/// The chair where it is modelled.
fn placed(chair: &Arc<ObjectModel>, scene: &Scene) -> Result<Arc<PlacedObject>> {
    PlacedObject::new(chair.clone(), &Placement::new("chair", None), scene).map(Arc::new)
}

/// The photographs that see most of the chair, without those that it nearly fills.
fn most_seen(truth: &Arc<LitScene>, chair: &[Arc<PlacedObject>]) -> Vec<usize> {
    let world = FurnishedScene::new(truth, chair);
    let seen = |frame: usize| {
        let camera = &truth.scene.cameras[frame];
        let rays = (0..camera.pixels()).map(|pixel| camera.ray(camera.corner(pixel) + 0.5));
        let seen = rays.filter(|ray| world.sees_object(ray)).count();
        seen as f64 / camera.pixels() as f64
    };
    let mut frames: Vec<(f64, usize)> = (0..truth.scene.cameras.len())
        .map(|frame| (seen(frame), frame))
        .filter(|(fraction, _)| (COVERED[0]..=COVERED[1]).contains(fraction))
        .collect();
    frames.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    frames.truncate(FRAMES);
    frames.into_iter().map(|(_, frame)| frame).collect()
}

/// Scores in one photograph.
#[derive(Debug, Clone, Copy)]
struct Scores {
    chair: f64,
    naive: f64,
    brightness: f64,
    /// If the chair changes any pixel beside it: PSNR of the composite over these and of the photograph without the chair, and sums
    /// of the composite's change times the true change and of the squared true change.
    around: Option<[f64; 4]>,
}

/// The exposure and vignetting that bring a render of the empty room nearest to its photograph, by least squares over valid pixels.
fn true_exposure(backdrop: &Backdrop, empty: &Picture, valid: &[bool]) -> Result<Exposure> {
    let of_power = |power: f32| {
        let vignetting = Exposure {
            vignetting: Some(Vignetting {
                power: Vec3::splat(power),
            }),
            ..Exposure::default()
        };
        let (mut product, mut square, mut photographed) = (0.0, 0.0, 0.0);
        for i in (0..valid.len()).filter(|&i| valid[i]) {
            let size = [empty.width, empty.height];
            let light = empty.pixels[i] * vignetting.at(&backdrop.camera.intrinsics, size, i);
            let pixel = backdrop.photograph.pixels[i];
            product += f64::from(light.dot(pixel));
            square += f64::from(light.length_squared());
            photographed += f64::from(pixel.length_squared());
        }
        let exposure = Exposure {
            factor: Vec3::splat((product / square) as f32),
            ..vignetting
        };
        (photographed - product * product / square, exposure)
    };
    let powers = (0..=MAX_POWER * 10).map(|tenths| of_power(tenths as f32 * 0.1));
    let best = powers.filter(|(squares, _)| squares.is_finite());
    let best = best.min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, exposure) = best.ok_or_else(|| Error::new("the photograph", "shows nothing", ""))?;
    Ok(exposure)
}

/// Compares the composite, the naive composite and the photograph of a frame with the truth; also gives all four, the truth first.
fn compare(
    solved: &Solved,
    frame: usize,
    truth: &Arc<LitScene>,
    true_chair: &[Arc<PlacedObject>],
    chair: &Arc<ObjectModel>,
) -> Result<(Scores, [Picture; 4])> {
    let (problem, estimate) = (&solved.problem, &solved.solution.estimate);
    let photograph = &problem.photographs[frame];

    // The truth in the photograph's values.
    let backdrop =
        |scene: &Scene, exposure| Backdrop::new(frame, &scene.cameras[frame], photograph, exposure);
    let true_backdrop = backdrop(&truth.scene, Exposure::default())?;
    let full = PathOptions::default();
    let (_, layers) = insert(truth, &true_backdrop, true_chair, full, [2, 4], SAMPLES);
    let pixels = &photograph.pixels;
    let valid: Vec<bool> = (0..pixels.len())
        .map(|i| photograph.is_usable(i) && !photograph.is_saturated(i))
        .collect();
    let exposure = true_exposure(&true_backdrop, &layers.without, &valid)?;
    let exposed = |i: usize, radiance: &Picture| {
        let size = [radiance.width, radiance.height];
        radiance.pixels[i] * exposure.at(&true_backdrop.camera.intrinsics, size, i)
    };
    let shown = |v: Vec3| v.clamp(Vec3::ZERO, Vec3::ONE);
    let truth_at = |i: usize| shown(exposed(i, &layers.with));
    let change_at = |i: usize| truth_at(i) - shown(exposed(i, &layers.without));

    let scene = &problem.scene;
    let placed = [placed(chair, scene)?];
    let lit = Arc::new(estimate.lit(scene));
    let plain = backdrop(scene, estimate.exposure(frame))?;
    let (ours, _) = insert(&lit, &plain, &placed, full, [1, 3], SAMPLES);
    let pictures: Vec<Picture> = (problem.photographs.iter()).map(|p| p.picture()).collect();
    let light = harmonics_of_photographs(scene.cameras.iter().zip(&pictures));
    let naive = Pasted::new(&plain, &lit, &placed, &[light], Exposure::default());
    let naive = naive.over(&plain.photograph);

    // The chair, and the pixels beside it that it changes.
    let covered: Vec<usize> = (0..pixels.len())
        .filter(|&i| layers.alpha[i] > 0.95)
        .collect();
    let around: Vec<usize> = (0..pixels.len())
        .filter(|&i| {
            layers.alpha[i] == 0.0 && valid[i] && change_at(i).abs().max_element() > CHANGED
        })
        .collect();
    let psnr =
        |indices: &[usize], picture: &dyn Fn(usize) -> Vec3, truth: &dyn Fn(usize) -> Vec3| {
            let squares = indices.iter().map(|&i| {
                let display = |v: Vec3| shown(v).map(linear_to_srgb);
                f64::from((display(picture(i)) - display(truth(i))).length_squared()) / 3.0
            });
            -10.0
                * (squares.sum::<f64>() / indices.len().max(1) as f64)
                    .max(1e-9)
                    .log10()
        };
    // Beside the chair, the true change is added to the photograph itself, so that its noise is no error.
    let true_at = |i: usize| pixels[i] + change_at(i);
    let sum = |value: &dyn Fn(usize) -> f32, indices: &[usize]| -> f64 {
        indices.iter().map(|&i| f64::from(value(i))).sum()
    };
    let ours_at = |i: usize| ours.pixels[i];
    let product = |i: usize| (ours_at(i) - pixels[i]).dot(change_at(i));
    let bright =
        |picture: &dyn Fn(usize) -> Vec3| sum(&|i| shown(picture(i)).element_sum(), &covered);
    let scores = Scores {
        chair: psnr(&covered, &ours_at, &truth_at),
        naive: psnr(&covered, &|i| naive.pixels[i], &truth_at),
        brightness: bright(&ours_at) / bright(&truth_at),
        around: (!around.is_empty()).then(|| {
            [
                psnr(&around, &ours_at, &true_at),
                psnr(&around, &|i| pixels[i], &true_at),
                sum(&product, &around),
                sum(&|i| change_at(i).length_squared(), &around),
            ]
        }),
    };
    let truth = Picture {
        pixels: (0..pixels.len()).map(truth_at).collect(),
        ..layers.with
    };
    Ok((scores, [truth, ours, naive, photograph.picture()]))
}
