//! `report.json`: figures of a solve.

use crate::capture::response::TERMS;
use crate::inverse::estimate::ObjectEstimate;
use crate::inverse::settings::Preset;
use crate::inverse::solver::{Stage, Termination};
use crate::math::color::luminance;
use crate::math::nullable::{Rgb, rgb};
use crate::session::save::memory::peak_memory_bytes;
use crate::session::save::named::Named;
use crate::session::save::results::Results;
use crate::transport::denoise::Denoiser;
use crate::transport::environment::row_solid_angle;
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The content of `report.json`. Times in seconds, linear radiance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    pub relit: String,
    pub seed: u64,
    pub preset: Preset,
    pub threads: usize,
    pub seconds: f64,
    pub seconds_load: f64,
    /// Time of solving, without pauses.
    pub seconds_solve: f64,
    /// Time of rendering and writing the results, without this file.
    pub seconds_write: f64,
    /// Time from the start of the solve to the first estimate.
    pub seconds_to_first_estimate: Option<f64>,
    pub capture: Counts,
    /// Device that rendered the pictures: name of a graphics card, or `cpu`. The fit always runs on the processor.
    pub device: String,
    /// Denoiser of `render.png`: `builtin`, `oidn` or `none`.
    pub denoiser: &'static str,
    pub rays: u64,
    /// `rays` over `seconds_solve`.
    pub rays_per_second: f64,
    /// Peak memory; `null` if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
    /// Why the solve ended; `null` during a solve.
    pub stopped_because: Option<Termination>,
    pub stages: Vec<Stage>,
    pub objects: Named<ObjectEstimate>,
    pub outside_light: Option<OutsideSummary>,
    /// Each frame's linear exposure and white balance; their median is 1 in each channel.
    pub exposures: Option<Vec<Rgb>>,
    /// Vignetting of all frames: the power of the cosine of the angle to the optical axis.
    pub vignetting: Option<Rgb>,
    /// The terms of the camera's [`Response`](crate::capture::response::Response).
    pub response: Option<[Rgb; TERMS]>,
    /// Standard error, relative, of the factor that all albedos share.
    pub albedo_common_stderr: f32,
    pub rejected_samples: BTreeMap<String, u64>,
    pub warnings: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub triangles: usize,
    pub objects: usize,
    pub frames: usize,
    /// Pixels of all photographs at the working resolution.
    pub pixels: u64,
}

/// Summary of the light from outside; the map is beside `estimate.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutsideSummary {
    pub width: u32,
    pub height: u32,
    /// Mean radiance over the sphere.
    pub mean: Rgb,
    pub brightest: Option<f32>,
    /// Its distance.
    pub from: &'static str,
    /// The sun beside the map.
    pub sun: Option<Sun>,
}

impl Report {
    /// The report of a solve, whose results were written in `seconds_write`.
    pub fn new(results: &Results, seconds_write: f64) -> Self {
        let (capture, settings, estimate) =
            (&results.capture, &results.settings, &results.estimate);
        let (progress, stopped_because) = (&results.progress, results.stopped_because);
        let exposures = estimate.exposures.as_ref();
        let photographs = capture.photographs.iter();
        let sizes = photographs.map(|p| u64::from(p.width) * u64::from(p.height));
        let mut warnings = capture.warnings.clone();
        warnings.extend(progress.warnings.iter().cloned());
        Self {
            relit: env!("CARGO_PKG_VERSION").to_owned(),
            seed: settings.seed,
            preset: settings.preset,
            threads: rayon::current_num_threads(),
            seconds: results.started.elapsed().as_secs_f64(),
            seconds_load: results.seconds_load,
            seconds_solve: progress.seconds,
            seconds_write,
            seconds_to_first_estimate: progress.seconds_to_first_estimate,
            capture: Counts {
                triangles: capture.scene.triangles.len(),
                objects: capture.scene.objects.len(),
                frames: capture.photographs.len(),
                pixels: sizes.sum(),
            },
            device: results.renderer.card().unwrap_or_else(|| "cpu".to_owned()),
            denoiser: results.denoiser.map_or("none", Denoiser::name),
            rays: progress.rays,
            rays_per_second: match progress.seconds > 0.0 {
                true => progress.rays as f64 / progress.seconds,
                false => 0.0,
            },
            peak_memory_bytes: peak_memory_bytes(),
            stopped_because,
            stages: progress.stages.clone(),
            objects: Named::objects(&capture.scene, estimate),
            outside_light: estimate.outside.as_ref().map(|outside| {
                let [width, height] = [outside.width, outside.height].map(|side| side as usize);
                let share = |row| row_solid_angle(row, width, height) / (4.0 * PI);
                let mean = (outside.means().enumerate())
                    .map(|(i, p)| p.as_dvec3() * share(i / width.max(1)))
                    .sum::<glam::DVec3>();
                let brightest = outside.means().map(luminance);
                OutsideSummary {
                    width: outside.width,
                    height: outside.height,
                    mean: rgb(mean.as_vec3()),
                    brightest: brightest.reduce(f32::max).filter(|v| v.is_finite()),
                    from: match outside.surroundings {
                        Surroundings::Far => "far away",
                        Surroundings::Box { .. } => "a box around the mesh",
                    },
                    sun: outside.sun,
                }
            }),
            exposures: exposures.map(|all| all.iter().copied().map(rgb).collect()),
            vignetting: estimate.vignetting.map(|v| rgb(v.power)),
            response: estimate.response.map(|r| r.terms.map(rgb)),
            albedo_common_stderr: estimate.common_error,
            rejected_samples: progress.rejected.clone(),
            warnings,
        }
    }
}
