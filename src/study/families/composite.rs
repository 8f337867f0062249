//! A chair put into photographs of a generated room by its estimate, compared with the chair truly there.

use crate::capture::exposure::Exposure;
use crate::compose::backdrop::Backdrop;
use crate::compose::denoise::denoised;
use crate::compose::insert::Insertion;
use crate::compose::naive::{Pasted, harmonics_of_photographs};
use crate::compose::object::ObjectModel;
use crate::compose::placement::{PlacedObject, Placement};
use crate::compose::world::FurnishedScene;
use crate::error::{Error, Result};
use crate::export::table::Table;
use crate::math::color::linear_to_srgb;
use crate::math::picture::Picture;
use crate::math::stats::quantile;
use crate::room::generated::Family;
use crate::room::shape::Modeller;
use crate::scene::Scene;
use crate::study::experiments::{Cylinder, chair, places, up};
use crate::study::families::Plan;
use crate::study::families::score::{Solved, solved};
use crate::transport::denoise::Denoiser;
use crate::transport::lit::Lit;
use crate::transport::material::Material;
use crate::transport::path::PathOptions;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use std::sync::Arc;

/// The chair: reflectance, height, and radius of a cylinder around it in metres.
const ALBEDO: Vec3 = Vec3::new(0.55, 0.33, 0.16);
const CHAIR: Cylinder = Cylinder {
    radius: 0.31,
    height: 0.85,
};
/// How far above the floor it stands, in metres, as on one that is not quite flat.
const LIFT: f32 = 2e-3;
/// Photographs that it is put into.
const FRAMES: usize = 2;
/// Part of a photograph that it covers at least and at most.
const COVERED: [f64; 2] = [0.005, 0.3];
/// Paths a pixel of the composite, in two halves, and of the truth.
const SAMPLES: [u32; 2] = [64, 256];
/// A pixel beside the chair belongs to its shadow and bleed if the chair changes it by so much, at the photograph's exposure.
const CHANGED: f32 = 0.025;

/// How the composites in one room compare with the truth; means over its photographs.
#[derive(Debug, Clone)]
pub struct CompositeRow {
    /// The room's family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Seconds of the solve.
    pub seconds: f64,
    /// PSNR in dB over the chair, as shown at the photograph's exposure: the composite's.
    pub chair: f64,
    /// The naive composite's.
    pub naive: f64,
    /// Brightness of the chair over the true one.
    pub brightness: f64,
    /// PSNR in dB over the shadow and bleed: the composite's; `None` where the chair changes nothing beside itself.
    pub shadow: Option<f64>,
    /// The untouched photograph's.
    pub untouched: Option<f64>,
    /// Least-squares slope of the composite's change there on the true one: 1 is right.
    pub slope: Option<f64>,
}

/// Draws a room, solves it, and puts a chair into the photographs that see most of where it stands; `None` where the floor has no
/// free place in view for one.
///
/// # Errors
/// The room cannot be drawn or solved.
pub fn composite(family: Family, seed: u64, plan: &Plan) -> Result<Option<CompositeRow>> {
    let solved = solved(family, seed, plan)?;
    let truth = Arc::new(solved.room.lit.clone());
    let Some(chair) = standing(&truth)? else {
        return Ok(None);
    };
    let true_chair = [Arc::new(PlacedObject::new(
        chair.clone(),
        &Placement::as_modelled("chair"),
        &truth.scene,
    )?)];
    let frames = max_seen(&truth, &true_chair);
    let scores = (frames.iter())
        .map(|&frame| scores(&solved, frame, &truth, &true_chair, &chair))
        .collect::<Result<Vec<_>>>()?;
    let count = scores.len() as f64;
    let mean = |of: fn(&Scores) -> f64| scores.iter().map(of).sum::<f64>() / count;
    let told: Vec<Beside> = scores.iter().filter_map(|s| s.beside).collect();
    let beside = |of: fn(&Beside) -> f64| {
        let sum: f64 = told.iter().map(of).sum();
        (!told.is_empty()).then(|| sum / told.len() as f64)
    };
    Ok((!scores.is_empty()).then(|| CompositeRow {
        family,
        seed,
        seconds: solved.solution.progress.seconds,
        chair: mean(|s| s.chair),
        naive: mean(|s| s.naive),
        brightness: mean(|s| s.brightness),
        shadow: beside(|b| b.shadow),
        untouched: beside(|b| b.untouched),
        slope: beside(|b| b.slope),
    }))
}

impl CompositeRow {
    /// In a line.
    pub fn words(&self) -> String {
        let told = self.shadow.zip(self.untouched).zip(self.slope);
        let beside = told.map_or("none".to_owned(), |((shadow, untouched), slope)| {
            format!("{shadow:.1} dB (untouched {untouched:.1}), slope {slope:.2}")
        });
        format!(
            "{} room {}: chair {:.1} dB (naive {:.1}), brightness {:.2}; shadow {beside}; {:.0} s",
            self.family.name(),
            self.seed,
            self.chair,
            self.naive,
            self.brightness,
            self.seconds,
        )
    }
}

/// What holds over rooms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Rooms.
    pub rooms: usize,
    /// Those in which the chair is nearer to the truth than the naive one.
    pub better: usize,
    /// Median gain in dB over the naive one.
    pub gain: f64,
    /// Those in which the chair's brightness is within 15 %.
    pub bright: usize,
    /// Those in which the slope lies between 0.7 and 1.3.
    pub strong: usize,
}

impl Decision {
    /// Over some rooms.
    pub fn of(rows: &[CompositeRow]) -> Self {
        let mut gains: Vec<f64> = rows.iter().map(|row| row.chair - row.naive).collect();
        let count =
            |holds: &dyn Fn(&CompositeRow) -> bool| rows.iter().filter(|r| holds(r)).count();
        Self {
            rooms: rows.len(),
            better: gains.iter().filter(|&&gain| gain > 0.0).count(),
            gain: quantile(&mut gains, 0.5).unwrap_or(f64::NAN),
            bright: count(&|row| (row.brightness - 1.0).abs() <= 0.15),
            strong: count(&|row| row.slope.is_some_and(|slope| (0.7..=1.3).contains(&slope))),
        }
    }

    /// In a line.
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

/// The rows as a table.
pub fn table(rows: &[CompositeRow]) -> Table {
    let mut table = Table::new(&[
        "family",
        "seed",
        "seconds",
        "chair_psnr",
        "naive_psnr",
        "brightness",
        "shadow_psnr",
        "untouched_psnr",
        "slope",
    ]);
    for row in rows {
        table.row(&[
            row.family.name().into(),
            row.seed.into(),
            row.seconds.into(),
            row.chair.into(),
            row.naive.into(),
            row.brightness.into(),
            row.shadow.into(),
            row.untouched.into(),
            row.slope.into(),
        ]);
    }
    table
}

/// A chair on the true floor, in the room's coordinates.
fn standing(truth: &Lit) -> Result<Option<Arc<ObjectModel>>> {
    let scene = &truth.scene;
    let up = up(scene);
    let Some(&place) = places(scene, up, CHAIR, 1).first() else {
        return Ok(None);
    };
    let at = (place + up * LIFT).as_dvec3() + scene.origin;
    let upright = DAffine3::from_quat(DQuat::from_rotation_arc(
        DVec3::Y,
        up.as_dvec3().normalize_or(DVec3::Y),
    ));
    let mut modeller = Modeller::default();
    modeller.object("chair");
    modeller.placed(DAffine3::from_translation(at) * upright, chair);
    let mesh = modeller.mesh;
    let corners = (mesh.triangles.iter())
        .map(|corners| corners.map(|i| mesh.positions[i as usize]))
        .collect();
    let material = Material::diffuse(ALBEDO, Vec3::ZERO);
    ObjectModel::from_corners("chair", corners, material).map(|model| Some(Arc::new(model)))
}

/// The photographs that see most of the chair, but not little else.
fn max_seen(truth: &Arc<Lit>, chair: &[Arc<PlacedObject>]) -> Vec<usize> {
    let world = FurnishedScene::new(truth, chair);
    let seen = |frame: usize| {
        let camera = &truth.scene.cameras[frame];
        let [width, height] = [camera.intrinsics.width, camera.intrinsics.height];
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let rays = pixels.map(|[x, y]| camera.ray(Vec2::new(x as f32, y as f32) + 0.5));
        let seen = rays.filter(|ray| world.sees_object(ray)).count();
        seen as f64 / f64::from(width * height)
    };
    let mut frames: Vec<(f64, usize)> = (0..truth.scene.cameras.len())
        .map(|frame| (seen(frame), frame))
        .filter(|(fraction, _)| (COVERED[0]..=COVERED[1]).contains(fraction))
        .collect();
    frames.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    frames.truncate(FRAMES);
    frames.into_iter().map(|(_, frame)| frame).collect()
}

/// Scores of one photograph.
#[derive(Debug, Clone, Copy)]
struct Scores {
    chair: f64,
    naive: f64,
    brightness: f64,
    /// Where the chair changes anything beside itself.
    beside: Option<Beside>,
}

/// Scores over the shadow and bleed.
#[derive(Debug, Clone, Copy)]
struct Beside {
    shadow: f64,
    untouched: f64,
    slope: f64,
}

/// Compares the composite, the naive one and the untouched photograph of a frame with the truth.
fn scores(
    solved: &Solved,
    frame: usize,
    truth: &Arc<Lit>,
    true_chair: &[Arc<PlacedObject>],
    chair: &Arc<ObjectModel>,
) -> Result<Scores> {
    let (problem, estimate) = (&solved.problem, &solved.solution.estimate);
    let photograph = &problem.photographs[frame];
    let options = PathOptions::default();

    // The truth, in the photograph's values: its exposure is the one that the empty room has in it.
    let backdrop =
        |scene: &Scene, exposure| Backdrop::new(frame, &scene.cameras[frame], photograph, exposure);
    let true_backdrop = backdrop(&truth.scene, Exposure::default())?;
    let mut with = Insertion::new(
        true_backdrop,
        truth.clone(),
        true_chair.to_vec(),
        options,
        2,
    );
    with.pass(SAMPLES[1]);
    let layers = with.layers();
    let shows = &photograph.pixels;
    let told: Vec<bool> = (0..shows.len())
        .map(|i| photograph.is_usable(i) && !photograph.is_saturated(i))
        .collect();
    let fitted = (0..shows.len()).filter(|&i| told[i]);
    let (top, bottom) = fitted.fold((0.0, 0.0), |(top, bottom), i| {
        let dark = layers.without.pixels[i];
        (
            top + f64::from(dark.dot(shows[i])),
            bottom + f64::from(dark.dot(dark)),
        )
    });
    if bottom <= 0.0 {
        return Err(Error::new("the photograph", "shows nothing", ""));
    }
    let exposure = (top / bottom) as f32;
    let shown = |v: Vec3| v.clamp(Vec3::ZERO, Vec3::ONE);
    let truth_at = |i: usize| shown(layers.with.pixels[i] * exposure);
    let change_at = |i: usize| truth_at(i) - shown(layers.without.pixels[i] * exposure);

    // The composites.
    let scene = &problem.scene;
    let placed = [Arc::new(PlacedObject::new(
        chair.clone(),
        &Placement::as_modelled("chair"),
        scene,
    )?)];
    let lit = Arc::new(estimate.lit(scene));
    let halves = [1, 3].map(|seed| {
        let backdrop = backdrop(scene, estimate.exposure(frame))?;
        let mut half = Insertion::new(backdrop, lit.clone(), placed.to_vec(), options, seed);
        half.pass(SAMPLES[0] / 2);
        Ok(half)
    });
    let [a, b] = halves;
    let (ours, _) = denoised([&a?, &b?], Denoiser::Builtin);
    let pictures: Vec<Picture> = (problem.photographs.iter()).map(|p| p.picture()).collect();
    let light = harmonics_of_photographs(scene.cameras.iter().zip(&pictures));
    let plain = backdrop(scene, estimate.exposure(frame))?;
    let naive = Pasted::new(&plain, &lit, &placed, &[light], Exposure::default());
    let naive = naive.over(&plain.photograph);

    // The chair, and what it changes around itself.
    let on: Vec<usize> = (0..shows.len())
        .filter(|&i| layers.alpha[i] > 0.95)
        .collect();
    let beside: Vec<usize> = (0..shows.len())
        .filter(|&i| {
            layers.alpha[i] == 0.0 && told[i] && change_at(i).abs().max_element() > CHANGED
        })
        .collect();
    let psnr =
        |pixels: &[usize], picture: &dyn Fn(usize) -> Vec3, truth: &dyn Fn(usize) -> Vec3| {
            let off = pixels.iter().map(|&i| {
                let display = |v: Vec3| shown(v).map(linear_to_srgb);
                f64::from((display(picture(i)) - display(truth(i))).length_squared()) / 3.0
            });
            -10.0
                * (off.sum::<f64>() / pixels.len().max(1) as f64)
                    .max(1e-9)
                    .log10()
        };
    // Beside the chair the true change is put onto the photograph itself, whose noise is nobody's error.
    let truly_changed = |i: usize| shows[i] + change_at(i);
    let sum = |of: &dyn Fn(usize) -> f32, pixels: &[usize]| -> f64 {
        pixels.iter().map(|&i| f64::from(of(i))).sum()
    };
    let ours_at = |i: usize| ours.pixels[i];
    let slope = || {
        let ours = |i: usize| (ours_at(i) - shows[i]).dot(change_at(i));
        sum(&ours, &beside) / sum(&|i| change_at(i).length_squared(), &beside)
    };
    let bright = |of: &dyn Fn(usize) -> Vec3| sum(&|i| shown(of(i)).element_sum(), &on);
    Ok(Scores {
        chair: psnr(&on, &ours_at, &truth_at),
        naive: psnr(&on, &|i| naive.pixels[i], &truth_at),
        brightness: bright(&ours_at) / bright(&truth_at),
        beside: (!beside.is_empty()).then(|| Beside {
            shadow: psnr(&beside, &ours_at, &truly_changed),
            untouched: psnr(&beside, &|i| shows[i], &truly_changed),
            slope: slope(),
        }),
    })
}
