//! `relit render`: a picture of the room in its estimated light, from a photograph's camera or any other.

use crate::capture::camera::{Intrinsics, Pose};
use crate::cli::saved::{Loaded, SavedOptions};
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_rgb};
use crate::export::light_layers;
use crate::export::picture::{shown_at, write_png};
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use crate::session::light::path_options;
use crate::transport::denoise::{denoise, guides};
use crate::transport::film::Film;
use crate::transport::layers::Split;
use clap::Args;
use glam::{DMat3, DMat4, DVec3, Vec3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// `relit render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// The camera of a photograph, counted from 0
    #[arg(
        long,
        value_name = "N",
        required_unless_present = "camera",
        conflicts_with = "camera"
    )]
    frame: Option<usize>,
    /// A camera of its own: JSON with w, h, fl_x, fl_y, cx, cy and transform_matrix as in transforms.json
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Smooths the noise, guided by what each pixel sees
    #[arg(long, conflicts_with = "layers")]
    denoise: bool,
    /// Writes the light of each lamp apart, as named layers of one .exr that add up to the picture
    #[arg(long)]
    layers: bool,
    /// Picture to write, .exr (radiance) or .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// How a picture is written, by its name's ending.
enum Format {
    Exr,
    Png,
}

/// Renders one picture.
///
/// # Errors
/// The results, the camera or the picture cannot be read or written.
pub fn render(arguments: &RenderArguments) -> Result<()> {
    let ending = arguments.out.extension().and_then(|e| e.to_str());
    let format = match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("exr") => Format::Exr,
        Some("png") => Format::Png,
        _ => {
            return Err(Error::usage(
                arguments.out.display(),
                "is neither .exr nor .png",
                "choose one of these",
            ));
        }
    };
    if arguments.layers && matches!(format, Format::Png) {
        return Err(Error::usage(
            arguments.out.display(),
            "a .png has no layers",
            "choose .exr with --layers",
        ));
    }
    let Loaded {
        saved,
        capture,
        estimate,
        ..
    } = arguments.saved.load()?;
    let (camera, frame) = match (arguments.frame, &arguments.camera) {
        (_, Some(path)) => (read_camera(path, capture.scene.origin)?, 0),
        (frame, None) => {
            let frame = frame.unwrap_or(0);
            (capture.full_camera(frame)?, frame)
        }
    };
    let lit = estimate.lit(&capture.scene);
    let options = path_options(&saved.settings);
    let (seed, frame, spp) = (saved.settings.seed, frame as u64, arguments.spp);
    if arguments.layers {
        let split = Split::new(&lit);
        let layers = split.render(&lit, &camera, &options, seed, frame, spp);
        let named = split.sources().iter().copied().zip(&layers);
        return light_layers::write(&arguments.out, &capture.scene, named);
    }
    let rendered = |seed, samples| {
        let mut film = Film::new(&camera);
        film.add(&lit, &camera, &options, seed, frame, samples);
        Picture {
            width: film.width,
            height: film.height,
            pixels: film.mean(),
        }
    };
    let mut picture = if arguments.denoise {
        // Two independent halves tell the noise.
        let half = spp.div_ceil(2);
        let [a, b] = [seed, seed.wrapping_add(1)].map(|seed| rendered(seed, half));
        denoise(&a, &b, &guides(&lit, &camera))
    } else {
        rendered(seed, spp)
    };
    match format {
        Format::Exr => write_rgb(&arguments.out, &picture, Precision::Float),
        Format::Png => {
            // As the photograph is shown, where it saturates.
            let saturation = match arguments.camera {
                None => capture.frame(frame as usize)?.1.saturation,
                Some(_) => Vec3::INFINITY,
            };
            if saturation.is_finite() {
                let exposure = estimate.exposure(frame as usize);
                exposure.apply(&camera.intrinsics, &mut picture);
            }
            write_png(
                &arguments.out,
                &picture,
                shown_at(saturation, &picture.pixels),
            )
        }
    }
}

/// The fields of one frame of transforms.json.
#[derive(Debug, Deserialize)]
struct CameraFile {
    w: u32,
    h: u32,
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
    transform_matrix: [[f64; 4]; 4],
}

/// Largest picture in pixels.
const MOST_PIXELS: u64 = 1 << 28;

fn read_camera(path: &Path, origin: DVec3) -> Result<Camera> {
    let bytes = std::fs::read(path).map_err(|error| Error::io(path, &error))?;
    let file: CameraFile = serde_json::from_slice(&bytes).map_err(|error| {
        Error::file(
            path,
            error,
            "write w, h, fl_x, fl_y, cx, cy and transform_matrix as in transforms.json",
        )
    })?;
    let field = |name: &str, problem: &str, remedy: &str| {
        Err(Error::new(
            format!("{}: {name}", path.display()),
            problem,
            remedy,
        ))
    };
    let pixels = u64::from(file.w) * u64::from(file.h);
    if pixels == 0 || pixels > MOST_PIXELS {
        return field(
            "w, h",
            "no size for a picture",
            "give sizes from 1 to 16384",
        );
    }
    if !(file.fl_x > 0.0 && file.fl_y > 0.0) {
        return field("fl_x, fl_y", "no focal length", "give lengths in pixels");
    }
    let matrix = DMat4::from_cols_array_2d(&file.transform_matrix).transpose();
    let rotation = DMat3::from_mat4(matrix);
    let drift = rotation.transpose() * rotation - DMat3::IDENTITY;
    let rigid =
        drift.to_cols_array().iter().all(|v| v.abs() < 1e-3) && rotation.determinant() > 0.0;
    if !rigid || !matrix.is_finite() {
        return field(
            "transform_matrix",
            "is no rigid motion",
            "give camera-to-world with x right, y up, looking down -z",
        );
    }
    let intrinsics = Intrinsics {
        width: file.w,
        height: file.h,
        fx: file.fl_x,
        fy: file.fl_y,
        cx: file.cx,
        cy: file.cy,
        distortion: [file.k1, file.k2, file.p1, file.p2],
    };
    let pose = Pose {
        rotation,
        center: matrix.w_axis.truncate(),
    };
    Ok(Camera::new(&intrinsics, &pose, origin))
}
