//! OpenEXR files of linear pictures, single channels, and named layers, losslessly compressed.

use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::math::picture::Picture;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
    LayerAttributes, Text, Vec2, WritableImage, f16,
};
use std::path::Path;

/// Storage format of floating-point values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats: 11 significant bits, largest value 65504.
    Half,
    /// 32-bit floats.
    Float,
}

/// A named group of channels of one size.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Name of the layer; channels are shown as `name.channel`.
    pub name: String,
    /// Its channels in any order: names such as "R" or "Z", and values row by row from the top left.
    pub channels: Vec<(&'static str, FlatSamples)>,
}

impl Layer {
    /// The channels R, G and B of a picture.
    pub fn rgb(name: &str, picture: &Picture, precision: Precision) -> Self {
        let channel = |index: usize| {
            let values = picture.pixels.iter().map(|c| c[index]);
            match precision {
                Precision::Float => FlatSamples::F32(values.collect()),
                Precision::Half => FlatSamples::F16(values.map(f16::from_f32).collect()),
            }
        };
        Self {
            name: name.to_owned(),
            channels: vec![("R", channel(0)), ("G", channel(1)), ("B", channel(2))],
        }
    }

    /// A single channel.
    pub fn single(name: &str, channel: &'static str, samples: FlatSamples) -> Self {
        Self {
            name: name.to_owned(),
            channels: vec![(channel, samples)],
        }
    }
}

/// Writes a linear picture as channels R, G and B.
///
/// # Errors
/// The file cannot be written, or the picture has no pixels.
pub fn write_rgb(path: &Path, picture: &Picture, precision: Precision) -> Result<()> {
    let layer = Layer::rgb("", picture, precision);
    write_layers(path, picture.width, picture.height, vec![layer])
}

/// Writes named layers of one size. A single layer may have an empty name; its channels are then R, G, B, ….
///
/// # Errors
/// The file cannot be written, there is nothing to write, or a channel's length does not match the size.
pub fn write_layers(path: &Path, width: u32, height: u32, layers: Vec<Layer>) -> Result<()> {
    let count = width as usize * height as usize;
    let mut channels = layers.iter().flat_map(|layer| &layer.channels);
    if let Some((name, samples)) = channels.find(|(_, samples)| samples.len() != count) {
        let problem = format!(
            "channel {name} has {} values for {width} × {height} pixels",
            samples.len()
        );
        return Err(Error::file(path, problem, ""));
    }
    if count == 0 || layers.is_empty() {
        return Err(Error::file(path, "the picture has no pixels", ""));
    }

    let size = Vec2(width as usize, height as usize);
    let exr_layer = |layer: Layer| {
        let channels = layer.channels.into_iter();
        let channels = channels.map(|(name, samples)| AnyChannel::new(name, samples));
        let channels = AnyChannels::sort(channels.collect());
        let attributes = match layer.name.as_str() {
            "" => LayerAttributes::default(),
            name => LayerAttributes::named(Text::from(name)),
        };
        exr::prelude::Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels)
    };
    let exr_layers: Vec<_> = layers.into_iter().map(exr_layer).collect();
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    let image = Image::from_layers(attributes, exr_layers);
    write_atomically(path, |writer| {
        let written = image.write().to_buffered(writer);
        written.map_err(|error| match error {
            exr::error::Error::Io(error) => error.into(),
            other => other.into(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn gradient() -> Picture {
        Picture::from_fn(37, 21, |x, y| {
            Vec3::new(x as f32 * 0.1, 1e3 * y as f32, -3.7e-5 * (x * y) as f32)
        })
    }

    #[test]
    fn floats_come_back_bit_for_bit_and_halves_within_their_precision() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let picture = gradient();
        for (precision, tolerance) in [(Precision::Float, 0.0), (Precision::Half, 1.0 / 2048.0)] {
            let path = folder.path().join("a.exr");
            write_rgb(&path, &picture, precision).expect("written");
            let image = image::open(&path).expect("readable by others").to_rgb32f();
            assert_eq!(image.dimensions(), (37, 21));
            for (pixel, expected) in image.pixels().zip(&picture.pixels) {
                let difference = (Vec3::from(pixel.0) - *expected).abs();
                let allowed = expected.abs() * tolerance + tolerance * 1e-6;
                let off = (difference - allowed).max_element();
                assert!(off <= 0.0, "{expected} {difference}");
            }
        }
    }

    #[test]
    fn layers_keep_their_names_channels_and_values() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("layers.exr");
        let picture = gradient();
        let ids: Vec<u32> = (0..37 * 21).map(|i| u32::MAX - i).collect();
        let layers = [
            Layer::rgb("with", &picture, Precision::Float),
            Layer::single("object id", "id", FlatSamples::U32(ids.clone())),
        ];
        write_layers(&path, 37, 21, layers.into()).expect("written");
        let image = exr::prelude::read_all_flat_layers_from_file(&path).expect("an EXR file");
        let channels = |name: &str| {
            let name = Some(Text::from(name));
            let mut layers = image.layer_data.iter();
            let layer = layers.find(|l| l.attributes.layer_name == name);
            &layer.expect("the layer is there").channel_data.list
        };
        let green = &channels("with")[1];
        assert_eq!(green.name, Text::from("G"));
        let values = picture.pixels.iter().map(|c| c.y).collect();
        assert_eq!(green.sample_data, FlatSamples::F32(values));
        let id = &channels("object id")[0];
        assert_eq!(id.sample_data, FlatSamples::U32(ids));
    }

    #[test]
    fn a_picture_of_the_wrong_size_is_refused_and_no_file_appears() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("a.exr");
        let layers = |count| vec![Layer::single("", "Y", FlatSamples::F32(vec![2.5; count]))];
        assert!(write_layers(&path, 3, 3, layers(8)).is_err());
        assert!(write_layers(&path, 0, 3, layers(0)).is_err());
        assert!(!path.exists());
    }
}
