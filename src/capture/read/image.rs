//! Reads photographs from EXR, Radiance HDR, PNG (8 and 16 bit) and JPEG into linear radiance.

use crate::capture::camera::Intrinsics;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::{Encoding, Photograph, PhotographSource};
use crate::capture::read::cut_short;
use crate::error::{Error, Result};
use crate::math::color::srgb_to_linear;
use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, Rgba};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

/// Photographs of more pixels are refused before anything is allocated (RGB in f32: 3 GiB).
pub const MAX_PIXELS: u64 = 1 << 28;
/// The data window of an EXR may hold this many times the pixels of its display window ...
const MAX_DATA_RATIO: u64 = 16;
/// ... or this number of pixels, whichever is more: decoding holds whole rows of the data window.
const MIN_DATA_LIMIT: u64 = 1 << 20;

/// Remedy for a photograph that cannot be decoded completely.
const COPY_AGAIN: &str =
    "copy it again from where it came, or take its frame out of transforms.json";

/// The header of a photograph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Header {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// How the values are stored.
    pub encoding: Encoding,
    /// Orientation by EXIF; upright if EXIF has none.
    pub orientation: Orientation,
    /// Exposure time × ISO / F², if EXIF has it.
    pub exif_exposure: Option<f64>,
}

/// Reads a photograph's header.
///
/// # Errors
/// The file cannot be read, is not an image of a known format, is empty or has more than [`MAX_PIXELS`] pixels.
pub fn header(path: &Path) -> Result<Header> {
    let mut decoder = decoder(path)?;
    let (width, height) = decoder.dimensions();
    let encoding = encoding(path, decoder.color_type())?;
    let exif = decoder.exif_metadata().ok().flatten();
    let exif = exif.and_then(|block| exif::Reader::new().read_raw(block).ok());
    let orientation = exif.as_ref().and_then(|exif| {
        let field = exif.get_field(exif::Tag::Orientation, exif::In::PRIMARY)?;
        Orientation::from_exif(field.value.get_uint(0)?)
    });
    Ok(Header {
        width,
        height,
        encoding,
        orientation: orientation.unwrap_or_default(),
        exif_exposure: exif.as_ref().and_then(exif_exposure),
    })
}

impl PhotographSource {
    /// Reads the photograph and divides by the exposure. Also returns the number of pixels with negative or non-finite values.
    ///
    /// # Errors
    /// The file cannot be read, is not an image, or has another size than the camera.
    pub fn load(
        &self,
        intrinsics: &Intrinsics,
        exposure: Option<f64>,
    ) -> Result<(Arc<Photograph>, usize)> {
        match self {
            Self::Memory(photograph) => Ok((photograph.clone(), 0)),
            Self::File(path, orientation) => {
                let (photograph, invalid) = read(path, *orientation, intrinsics, exposure)?;
                Ok((Arc::new(photograph), invalid))
            }
        }
    }
}

/// Reads a photograph and divides linear values by the exposure. Pixels with alpha below 0.5 or with negative or non-finite
/// values are unusable and black. Also returns the number of pixels with negative or non-finite values.
///
/// # Errors
/// The file cannot be read, is not an image, or its size after `orientation` differs from the camera's.
pub fn read(
    path: &Path,
    orientation: Orientation,
    intrinsics: &Intrinsics,
    exposure: Option<f64>,
) -> Result<(Photograph, usize)> {
    let decoder = decoder(path)?;
    let stored = <[u32; 2]>::from(decoder.dimensions());
    let [width, height] = orientation.size(stored);
    if (width, height) != (intrinsics.width, intrinsics.height) {
        return Err(Error::file(
            path,
            format!(
                "is {width}×{height} pixels, but its camera {}×{}",
                intrinsics.width, intrinsics.height
            ),
            "correct the intrinsics or use photographs of the camera's size",
        ));
    }
    let encoding = encoding(path, decoder.color_type())?;
    if cut_short::jpeg(path).map_err(|e| Error::io(path, &e))? {
        return Err(Error::file(
            path,
            "ends before its picture is whole",
            COPY_AGAIN,
        ));
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(|e| broken(path, &e))?;
    let scale = (1.0 / exposure.unwrap_or(1.0)) as f32;
    let (multiplier, saturation) = match encoding {
        Encoding::Linear => (hdr_multiplier(path)?, Vec3::INFINITY),
        Encoding::Srgb8 | Encoding::Srgb16 => (Vec3::ONE, Vec3::splat(scale)),
    };
    let values = linear_values(decoded, encoding);

    let mut usable = Vec::with_capacity(values.len());
    let mut invalid = 0;
    let pixels: Vec<Vec3> = values
        .iter()
        .map(|&[r, g, b, alpha]| {
            let rgb = Vec3::new(r, g, b) / multiplier * scale;
            let valid = rgb.is_finite() && rgb.min_element() >= 0.0;
            invalid += usize::from(!valid);
            let good = valid && alpha >= 0.5;
            usable.push(good);
            if good { rgb } else { Vec3::ZERO }
        })
        .collect();
    if usable.iter().all(|&good| good) {
        usable.clear();
    }
    let photograph = Photograph {
        usable,
        ..Photograph::new(stored, pixels, encoding, saturation)
    };
    match orientation == Orientation::default() {
        true => Ok((photograph, invalid)),
        false => Ok((photograph.oriented(orientation), invalid)),
    }
}

/// Exposure time × ISO / F² of an EXIF record: the linear multiplier up to the sensor's own scale.
///
/// `None` if the time is absent or the numbers are impossible. Absent ISO and F-number count as 100 and 1: phones have a fixed
/// aperture.
fn exif_exposure(exif: &exif::Exif) -> Option<f64> {
    let number = |tag| -> Option<f64> {
        let field = exif.get_field(tag, exif::In::PRIMARY)?;
        match &field.value {
            exif::Value::Rational(v) => v.first().map(exif::Rational::to_f64),
            value => value.get_uint(0).map(f64::from),
        }
    };
    let time = number(exif::Tag::ExposureTime)?;
    let iso = number(exif::Tag::PhotographicSensitivity).unwrap_or(100.0);
    let aperture = number(exif::Tag::FNumber).unwrap_or(1.0);
    let exposure = time * iso / 100.0 / (aperture * aperture);
    (exposure.is_finite() && exposure > 0.0).then_some(exposure)
}

/// Opens the decoder for the format of the file's first bytes; checks the size and limits memory.
fn decoder(path: &Path) -> Result<impl ImageDecoder> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = ImageReader::new(BufReader::new(file))
        .with_guessed_format()
        .map_err(|e| Error::io(path, &e))?;
    match reader.format() {
        Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Hdr) => {}
        Some(ImageFormat::OpenExr) => check_exr_windows(path)?,
        _ => {
            return Err(Error::file(
                path,
                "is not an EXR, HDR, PNG or JPEG image",
                "convert it to one of these",
            ));
        }
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PIXELS * 16 * 2);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| broken(path, &e))?;
    let (width, height) = decoder.dimensions();
    check_size(path, u64::from(width), u64::from(height))?;
    Ok(decoder)
}

/// Checks the sizes of an EXR's data window and display window.
fn check_exr_windows(path: &Path) -> Result<()> {
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(|e| {
        Error::file(
            path,
            format!("is a broken EXR file: {e}"),
            "export it again",
        )
    })?;
    for header in &meta.headers {
        let stored = header.layer_size;
        let shown = header.shared_attributes.display_window.size;
        for size in [stored, shown] {
            check_size(path, size.x() as u64, size.y() as u64)?;
        }
        let limit = (shown.area() as u64 * MAX_DATA_RATIO).max(MIN_DATA_LIMIT);
        if stored.area() as u64 > limit {
            return Err(Error::file(
                path,
                format!(
                    "stores {}×{} pixels for a picture of {}×{}",
                    stored.x(),
                    stored.y(),
                    shown.x(),
                    shown.y()
                ),
                "crop it to the picture's edge",
            ));
        }
    }
    Ok(())
}

fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
    if width.saturating_mul(height) == 0 {
        return Err(Error::file(path, "has no pixels", "export it again"));
    }
    if width.saturating_mul(height) > MAX_PIXELS {
        return Err(Error::file(
            path,
            format!("claims {width}×{height} pixels, more than the limit of {MAX_PIXELS}"),
            "make it smaller",
        ));
    }
    Ok(())
}

/// The factor on the values of a Radiance HDR file by its EXPOSURE and COLORCORR lines; 1 for other files.
fn hdr_multiplier(path: &Path) -> Result<Vec3> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let Ok(decoder) = HdrDecoder::new(BufReader::new(file)) else {
        return Ok(Vec3::ONE);
    };
    let header = decoder.metadata();
    let correction = header.color_correction.map_or(Vec3::ONE, Vec3::from);
    let factor = correction * header.exposure.unwrap_or(1.0);
    if factor.is_finite() && factor.min_element() > 0.0 {
        Ok(factor)
    } else {
        Err(Error::file(
            path,
            format!("says that its values were multiplied by {factor}"),
            "correct its EXPOSURE and COLORCORR lines, or take them out",
        ))
    }
}

fn encoding(path: &Path, color: ColorType) -> Result<Encoding> {
    match color {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => Ok(Encoding::Srgb8),
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            Ok(Encoding::Srgb16)
        }
        ColorType::Rgb32F | ColorType::Rgba32F => Ok(Encoding::Linear),
        _ => Err(Error::file(
            path,
            format!("the pixel format {color:?} is not supported"),
            "convert it to RGB",
        )),
    }
}

/// Linear red, green, blue and alpha of every pixel.
fn linear_values(image: DynamicImage, encoding: Encoding) -> Vec<[f32; 4]> {
    match encoding {
        Encoding::Linear => image.into_rgba32f().pixels().map(|p| p.0).collect(),
        Encoding::Srgb8 => {
            let table: [f32; 256] = std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0));
            let decode = |v: u8| table[usize::from(v)];
            let linear = |&Rgba([r, g, b, a]): &Rgba<u8>| {
                [decode(r), decode(g), decode(b), f32::from(a) / 255.0]
            };
            image.into_rgba8().pixels().map(linear).collect()
        }
        Encoding::Srgb16 => {
            let decode = |v: u16| srgb_to_linear(f32::from(v) / 65535.0);
            let linear = |&Rgba([r, g, b, a]): &Rgba<u16>| {
                [decode(r), decode(g), decode(b), f32::from(a) / 65535.0]
            };
            image.into_rgba16().pixels().map(linear).collect()
        }
    }
}

fn broken(path: &Path, error: &image::ImageError) -> Error {
    Error::file(path, format!("cannot be decoded: {error}"), COPY_AGAIN)
}
