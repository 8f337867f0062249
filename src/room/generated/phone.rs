//! Photographs like a phone's: JPEG, automatic exposure, vignetting, blur and noise.

use crate::capture::camera::Intrinsics;
use crate::capture::exposure::{Exposure, Vignetting};
use crate::capture::photograph::{Encoding, Photograph};
use crate::error::{Error, Result};
use crate::export::picture::to_srgb_bytes;
use crate::math::color::{luminance, srgb_to_linear};
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::room::generated::furnisher::Furnisher;
use crate::room::generated::photographed::{Draft, Generated};
use crate::room::photographs::render_lit;
use crate::transport::lit::LitScene;
use glam::Vec3;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageFormat};

/// Key of the camera's random numbers.
const CAMERA_KEY: u64 = 0x0070_686f_6e65;
/// Automatic exposure maps the geometric mean of the luminances to this fraction of saturation.
const MIDDLE_GREY: f64 = 0.18;
/// Smallest luminance for automatic exposure, relative to the arithmetic mean.
const MIN_LUMINANCE: f32 = 1e-3;

pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    f.look_around(6, 14);
    f.expose(24.0, 96.0);
}

pub fn photograph(draft: Draft) -> Result<Generated> {
    let lit = draft.lit()?;
    let rendered = render_lit(&lit, &draft.rendering);
    let rendered: Vec<Picture> = rendered.iter().map(Photograph::picture).collect();
    let files = files(&draft, &lit, &rendered)?;
    let photographs = files.iter().map(|file| decode(file));
    let photographs = photographs.collect::<Result<_>>()?;
    Ok(draft.photographed(lit, photographs))
}

/// Properties of a phone's camera.
struct Phone {
    vignetting: Vignetting,
    /// Standard deviation of the blur in pixels.
    blur: f64,
    /// JPEG quality in percent.
    quality: u8,
    /// Standard deviation of the noise at saturation; below, it falls with the square root of the light (shot noise).
    noise: f32,
}

/// The photographs of what the cameras see as JPEG files.
pub fn files(draft: &Draft, lit: &LitScene, rendered: &[Picture]) -> Result<Vec<Vec<u8>>> {
    let mut stream = Stream::new(draft.seed, CAMERA_KEY, draft.family as u64, 0);
    let mut between = |low: f64, high: f64| low + (high - low) * stream.uniform_f64();
    let phone = Phone {
        vignetting: Vignetting {
            power: Vec3::splat(between(1.0, 4.0) as f32),
        },
        blur: between(0.3, 0.7),
        quality: between(85.0, 96.0) as u8,
        noise: between(0.002, 0.01) as f32,
    };
    (rendered.iter())
        .zip(&lit.scene.cameras)
        .map(|(picture, camera)| {
            let compensation = 2f64.powf(-0.5 + stream.uniform_f64());
            let exposed = phone.expose(picture, &camera.intrinsics, compensation, &mut stream);
            encode(&exposed, phone.quality)
        })
        .collect()
}

impl Phone {
    /// Exposes radiance to sensor values, as fractions of saturation.
    fn expose(
        &self,
        radiance: &Picture,
        lens: &Intrinsics,
        compensation: f64,
        stream: &mut Stream,
    ) -> Picture {
        let mut picture = blurred(radiance, self.blur);
        let exposure = Exposure {
            factor: Vec3::splat((MIDDLE_GREY * compensation / geometric_mean(&picture)) as f32),
            vignetting: Some(self.vignetting),
            response: None,
        };
        exposure.apply(lens, Vec3::INFINITY, &mut picture);
        for value in &mut picture.pixels {
            let light = value.min(Vec3::ONE);
            let deviation = light.map(f32::sqrt) * self.noise;
            let normal = Vec3::from([(); 3].map(|()| stream.normal()));
            *value = (*value + normal * deviation).max(Vec3::ZERO);
        }
        picture
    }
}

/// Geometric mean of the luminances; always positive.
fn geometric_mean(picture: &Picture) -> f64 {
    let luminances = || picture.pixels.iter().map(|p| luminance(*p));
    let count = picture.pixels.len().max(1) as f32;
    let min = (luminances().sum::<f32>() / count * MIN_LUMINANCE).max(f32::MIN_POSITIVE);
    let logs: f64 = luminances().map(|l| f64::from(l.max(min)).ln()).sum();
    (logs / f64::from(count)).exp()
}

/// Gaussian blur; the border pixels are repeated.
fn blurred(picture: &Picture, sigma: f64) -> Picture {
    const REACH: i64 = 2;
    let weights = (-REACH..=REACH).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp());
    let weights: Vec<f64> = weights.collect();
    let total: f64 = weights.iter().sum();
    let along = |picture: &Picture, [dx, dy]: [i64; 2]| {
        Picture::from_fn(picture.width, picture.height, |x, y| {
            let tap = |(i, weight): (i64, &f64)| {
                let at = |p: u32, d: i64, size: u32| {
                    (i64::from(p) + i * d).clamp(0, i64::from(size) - 1) as usize
                };
                let column = at(x, dx, picture.width);
                let row = at(y, dy, picture.height);
                picture.pixels[row * picture.width as usize + column] * (weight / total) as f32
            };
            (-REACH..).zip(&weights).map(tap).sum()
        })
    };
    along(&along(picture, [1, 0]), [0, 1])
}

fn encode(picture: &Picture, quality: u8) -> Result<Vec<u8>> {
    let (values, format) = (to_srgb_bytes(picture, 1.0), ExtendedColorType::Rgb8);
    let mut file = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut file, quality);
    let encoded = encoder.encode(&values, picture.width, picture.height, format);
    encoded.map_err(|error| broken(&error))?;
    Ok(file)
}

pub fn decode(file: &[u8]) -> Result<Photograph> {
    let image = image::load_from_memory_with_format(file, ImageFormat::Jpeg)
        .map_err(|error| broken(&error))?
        .into_rgb8();
    let pixels = image.pixels().map(|pixel| {
        let linear = pixel.0.map(|v| srgb_to_linear(f32::from(v) / 255.0));
        Vec3::from(linear)
    });
    let size = [image.width(), image.height()];
    let pixels = pixels.collect();
    Ok(Photograph::new(size, pixels, Encoding::Srgb8, Vec3::ONE))
}

fn broken(error: &image::ImageError) -> Error {
    Error::new("generated photograph", error, "choose another size")
}
