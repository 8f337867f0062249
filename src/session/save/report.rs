//! `report.json`: what a solve did and found, in numbers.

use crate::capture::response::TERMS;
use crate::inverse::estimate::ObjectEstimate;
use crate::inverse::settings::Preset;
use crate::inverse::solver::{Stage, Termination};
use crate::math::color::luminance;
use crate::math::nullable::{Rgb, rgb};
use crate::session::save::Results;
use crate::session::save::memory::peak_memory_bytes;
use crate::session::save::named::Named;
use crate::transport::denoise::Denoiser;
use crate::transport::surroundings::Surroundings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The contents of `report.json`. Seconds, linear radiance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The program's version.
    pub relit: String,
    /// Key of all random numbers.
    pub seed: u64,
    /// Which solver ran.
    pub preset: Preset,
    /// Threads that worked.
    pub threads: usize,
    /// From start to end.
    pub seconds: f64,
    /// Reading the capture.
    pub seconds_load: f64,
    /// Solving, pauses excluded.
    pub seconds_solve: f64,
    /// Rendering and writing the results, this file excluded.
    pub seconds_write: f64,
    /// From the solve's start to the first estimate that could be shown.
    pub seconds_to_first_estimate: Option<f64>,
    /// How much there was.
    pub capture: Counts,
    /// What traced the paths of the pictures: a graphics card's name, or `cpu`. The fit's are the processor's.
    pub device: String,
    /// What took the noise out of `render.png`: `builtin`, `oidn` or `none`.
    pub denoiser: &'static str,
    /// Rays traced by the solver.
    pub rays: u64,
    /// The same over `seconds_solve`.
    pub rays_per_second: f64,
    /// Most memory held at a time; `null` where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// Why the solve ended; `null` for a save while it runs.
    pub stopped_because: Option<Termination>,
    /// The model ladder.
    pub stages: Vec<Stage>,
    /// One entry an object.
    pub objects: Named<ObjectEstimate>,
    /// Light from outside the mesh.
    pub outside_light: Option<OutsideSummary>,
    /// Each frame's linear exposure and white balance, their median 1 in each channel.
    pub exposures: Option<Vec<Rgb>>,
    /// The power of the cosine of the angle off the axis by which the lens dims all frames.
    pub vignetting: Option<Rgb>,
    /// The terms of the camera's [`Response`](crate::capture::response::Response).
    pub response: Option<[Rgb; TERMS]>,
    /// Samples dropped, by cause.
    pub rejected_samples: BTreeMap<String, u64>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// The size of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Objects.
    pub objects: usize,
    /// Photographs.
    pub frames: usize,
    /// Pixels of all photographs, as the solver used them.
    pub pixels: u64,
}

/// Light from outside, in short; the map itself lies beside `estimate.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutsideSummary {
    /// Columns of the map.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Mean radiance over the sphere.
    pub mean: Rgb,
    /// Greatest luminance.
    pub brightest: Option<f32>,
    /// How far away it comes from.
    #[serde(default)]
    pub from: String,
}

/// Where the time went.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seconds {
    /// From start to end.
    pub total: f64,
    /// Reading the capture.
    pub load: f64,
    /// Writing the results.
    pub write: f64,
}

impl Report {
    /// The report of a solve.
    pub fn new(results: &Results, seconds: Seconds) -> Self {
        let (capture, settings, estimate) =
            (&results.capture, &results.settings, &results.estimate);
        let (progress, stopped_because) = (&results.progress, results.stopped_because);
        let mut warnings = capture.warnings.clone();
        warnings.extend(progress.warnings.iter().cloned());
        Self {
            relit: env!("CARGO_PKG_VERSION").to_owned(),
            seed: settings.seed,
            preset: settings.preset,
            threads: rayon::current_num_threads(),
            seconds: seconds.total,
            seconds_load: seconds.load,
            seconds_solve: progress.seconds,
            seconds_write: seconds.write,
            seconds_to_first_estimate: progress.seconds_to_first_estimate,
            capture: Counts {
                triangles: capture.scene.triangles.len(),
                objects: capture.scene.objects.len(),
                frames: capture.photographs.len(),
                pixels: capture
                    .photographs
                    .iter()
                    .map(|p| u64::from(p.width) * u64::from(p.height))
                    .sum(),
            },
            device: results.renderer.card().unwrap_or("cpu").to_owned(),
            denoiser: results.denoiser.map_or("none", Denoiser::name),
            rays: progress.rays,
            rays_per_second: if progress.seconds > 0.0 {
                progress.rays as f64 / progress.seconds
            } else {
                0.0
            },
            peak_memory_bytes: peak_memory_bytes(),
            stopped_because,
            stages: progress.stages.clone(),
            objects: Named::objects(&capture.scene, estimate),
            outside_light: estimate.outside.as_ref().map(|outside| {
                let row_angle = |row: usize| {
                    let edge = |r: usize| {
                        (std::f64::consts::PI * r as f64 / f64::from(outside.height)).cos()
                    };
                    (edge(row) - edge(row + 1)) / (2.0 * f64::from(outside.width))
                };
                let mean = (outside.pixels.iter().enumerate())
                    .map(|(i, p)| p.as_dvec3() * row_angle(i / outside.width.max(1) as usize))
                    .sum::<glam::DVec3>();
                let brightest = outside.pixels.iter().map(|&p| luminance(p));
                OutsideSummary {
                    width: outside.width,
                    height: outside.height,
                    mean: rgb(mean.as_vec3()),
                    brightest: brightest.reduce(f32::max).filter(|v| v.is_finite()),
                    from: match outside.surroundings {
                        Surroundings::Far => "far away",
                        Surroundings::Box { .. } => "a box around the mesh",
                    }
                    .to_owned(),
                }
            }),
            exposures: estimate
                .exposures
                .as_ref()
                .map(|exposures| exposures.iter().map(|&e| rgb(e)).collect()),
            vignetting: estimate.vignetting.map(|v| rgb(v.power)),
            response: estimate.response.map(|r| r.terms.map(rgb)),
            rejected_samples: progress.rejected.clone(),
            warnings,
        }
    }
}
