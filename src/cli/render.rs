//! `relit render`: a picture of the room in its estimated light, from a photograph's camera or another.

use crate::capture::read::camera_file;
use crate::cli::numbers::{from_one, whole};
use crate::cli::options::{DenoiseOptions, DeviceOptions, Replace, SavedOptions};
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_rgb};
use crate::export::light_layers;
use crate::export::overwrite;
use crate::export::picture::{shown_at, write_png};
use crate::render::{Device, Pictures, Renderer};
use crate::say;
use crate::scene::camera::Camera;
use crate::session::light::path_options;
use crate::transport::denoise::guides;
use crate::transport::layers::Split;
use clap::Args;
use glam::Vec3;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct RenderArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// The camera of a photograph, counted from 0
    #[arg(
        long,
        value_name = "N",
        value_parser = whole::<usize>,
        required_unless_present = "camera",
        conflicts_with = "camera"
    )]
    frame: Option<usize>,
    /// Camera file: JSON with w, h, fl_x, fl_y, cx, cy and transform_matrix; optionally other values of a frame of transforms.json
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Samples per pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = from_one::<u32>)]
    spp: u32,
    #[command(flatten)]
    denoise: DenoiseOptions,
    /// Write the light of each lamp as a named layer of one .exr; the layers add up to the picture
    #[arg(long, conflicts_with = "denoise")]
    layers: bool,
    #[command(flatten)]
    device: DeviceOptions,
    /// Picture to write, .exr (radiance) or .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

/// Renders one picture.
pub fn render(arguments: &RenderArguments) -> Result<()> {
    let ending = arguments.out.extension().and_then(|e| e.to_str());
    let wrong = |problem, remedy| Err(Error::usage(arguments.out.display(), problem, remedy));
    let is_png = match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("exr") => false,
        Some("png") => true,
        _ => return wrong("is neither .exr nor .png", "choose one of these"),
    };
    if arguments.layers && is_png {
        return wrong("a .png has no layers", "choose .exr with --layers");
    }
    if arguments.layers && arguments.device.device == Device::Gpu {
        let problem = "the light of each lamp is traced separately by the processor";
        let remedy = "leave out one of --layers and --device";
        return Err(Error::usage("--device gpu", problem, remedy));
    }
    arguments.replace.apply();
    overwrite::check(&arguments.out)?;
    // Only the processor traces light by lamp.
    let renderer = match arguments.layers {
        true => Renderer::processor(),
        false => arguments.device.renderer()?,
    };
    let loaded = arguments.saved.load()?;
    let (capture, estimate, settings) = (loaded.capture, loaded.estimate, loaded.saved.settings);
    let (camera, frame) = match (arguments.frame, &arguments.camera) {
        (_, Some(path)) => {
            let (intrinsics, pose, remarks) = camera_file::read(path)?;
            for remark in remarks {
                say::warning(remark);
            }
            (Camera::new(&intrinsics, &pose, capture.scene.origin), 0)
        }
        (frame, None) => {
            let frame = frame.unwrap_or(0);
            (capture.full_camera(frame)?, frame)
        }
    };
    let lit = estimate.lit(&capture.scene);
    let options = path_options(&settings);
    let (seed, frame, spp) = (settings.seed, frame as u64, arguments.spp);
    if arguments.layers {
        let split = Split::new(&lit);
        let layers = split.render(&lit, &camera, &options, seed, frame, spp);
        let named = split.sources().iter().copied().zip(&layers);
        return light_layers::write(&arguments.out, &capture.scene, named);
    }
    let mut pictures = Pictures::new(&renderer, &lit);
    let mut rendered = |seed, samples| {
        let film = pictures.film(&camera, &options, (seed, frame), samples);
        film.picture()
    };
    let denoiser = arguments.denoise.denoiser(is_png)?;
    let mut picture = if let Some(denoiser) = denoiser {
        // The denoiser estimates the noise from two independent halves.
        let half = spp.div_ceil(2);
        let [a, b] = [seed, seed.wrapping_add(1)].map(|seed| rendered(seed, half));
        denoiser.denoise(&a, &b, &guides(&lit, &camera))
    } else {
        rendered(seed, spp)
    };
    if !is_png {
        return write_rgb(&arguments.out, &picture, Precision::Float);
    }
    // Exposed like the photograph where it saturates.
    let saturation = match arguments.camera {
        None => capture.frame(frame as usize)?.1.saturation,
        Some(_) => Vec3::INFINITY,
    };
    if saturation.is_finite() {
        let exposure = estimate.exposure(frame as usize);
        exposure.apply(&camera.intrinsics, saturation, &mut picture);
    }
    let shown_at = shown_at(saturation, &picture.pixels);
    write_png(&arguments.out, &picture, shown_at)
}
