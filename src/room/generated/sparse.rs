//! Rooms with few and noisy photographs.

use crate::error::Result;
use crate::math::color::luminance;
use crate::math::rng::{Stream, splitmix64};
use crate::math::stats::quantile;
use crate::room::generated::furnisher::Furnisher;
use crate::room::generated::photographed::{Draft, Generated};
use crate::room::model::linear_photograph;
use crate::scene::camera::Camera;
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::Vec3;

pub const PHOTOGRAPHS: usize = 6;
/// Range of the standard deviation of a pixel, relative to its value.
pub const NOISE: [f64; 2] = [0.05, 0.15];
/// Key of the added noise.
const NOISE_KEY: u64 = 0x7370_6172_7365;
/// Samples per pixel added at a time.
const STEP: u32 = 16;
/// Samples per pixel up to which the noise drawn for the room is aimed at; beyond, the largest of all rooms.
const ENOUGH_SAMPLES: u32 = 128;
/// Most samples per pixel.
const MAX_SAMPLES: u32 = 512;
/// Median absolute value of the standard normal distribution.
const NORMAL_MEDIAN: f64 = 0.674_49;

/// A plain room and six views of it.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    f.look_around(PHOTOGRAPHS, PHOTOGRAPHS);
    f.samples = ENOUGH_SAMPLES;
}

/// Photographs whose noise has a standard deviation drawn for the room: rendered until theirs is below it, then the rest is added.
pub fn photograph(draft: Draft) -> Result<Generated> {
    let lit = draft.lit()?;
    let mut stream = Stream::new(draft.seed, NOISE_KEY, 0, 0);
    let noise = NOISE[0] + (NOISE[1] - NOISE[0]) * stream.uniform_f64();
    let photographs = (0..).zip(&lit.scene.cameras).map(|(frame, camera)| {
        let (mut pixels, rendered_noise) = trace(&lit, camera, draft.rendering.seed, frame, noise);
        let missing = noise * noise - rendered_noise * rendered_noise;
        let missing = missing.max(0.0).sqrt();
        for pixel in &mut pixels {
            let factor = Vec3::from([(); 3].map(|()| stream.normal()));
            *pixel *= (Vec3::ONE + factor * missing as f32).max(Vec3::ZERO);
        }
        linear_photograph(draft.rendering.size, pixels)
    });
    let photographs = photographs.collect();
    Ok(draft.photographed(lit, photographs))
}

/// Renders a picture. Returns it with the standard deviation of its pixels relative to their values: below `noise`,
/// or, where that takes too many samples, below the largest of all rooms.
fn trace(lit: &LitScene, camera: &Camera, seed: u64, frame: u64, noise: f64) -> (Vec<Vec3>, f64) {
    let mut films = [Film::new(camera), Film::new(camera)];
    let options = PathOptions::default();
    loop {
        for (film, seed) in films.iter_mut().zip([seed, splitmix64(seed)]) {
            film.add(lit, camera, &options, seed, frame, STEP / 2);
        }
        let [a, b] = films.each_ref().map(Film::mean);
        let mut differences: Vec<f64> = (a.iter().zip(&b))
            .map(|(a, b)| [luminance(*a), luminance(*b)].map(f64::from))
            .filter(|[a, b]| a + b > 0.0)
            .map(|[a, b]| (a - b).abs() / (a + b))
            .collect();
        // Half the difference of two half-sample pictures has the standard deviation of their mean.
        let rendered_noise = quantile(&mut differences, 0.5).unwrap_or(0.0) / NORMAL_MEDIAN;
        let samples = 2 * films[0].samples;
        let wanted = match samples < ENOUGH_SAMPLES {
            true => 0.9 * noise,
            false => 0.9 * NOISE[1],
        };
        if rendered_noise <= wanted || samples >= MAX_SAMPLES {
            let mean = a.iter().zip(&b).map(|(a, b)| (*a + *b) * 0.5);
            return (mean.collect(), rendered_noise);
        }
    }
}
