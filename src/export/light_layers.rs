//! The light of each lamp as a layer of an OpenEXR file.

use crate::error::{Error, Result};
use crate::export::exr::{Layer, Precision, write_layers};
use crate::math::picture::Picture;
use crate::scene::Scene;
use crate::transport::layers::LightSource;
use std::path::Path;

/// Name of a layer: the lamp's object, `other lamps`, or `outside light`.
pub fn name(source: LightSource, scene: &Scene) -> &str {
    match source {
        LightSource::Lamp(object) => {
            (scene.objects.get(object as usize)).map_or("lamp", |o| &o.name)
        }
        LightSource::OtherLamps => "other lamps",
        LightSource::Outside => "outside light",
    }
}

/// Writes named layers of one size as 32-bit floats. They add up to the whole picture.
///
/// # Errors
/// There are no layers, or the file cannot be written.
pub fn write<'a>(
    path: &Path,
    scene: &Scene,
    layers: impl IntoIterator<Item = (LightSource, &'a Picture)>,
) -> Result<()> {
    let mut size = None;
    let mut named: Vec<Layer> = Vec::new();
    for (source, picture) in layers {
        size = Some((picture.width, picture.height));
        let mut name = name(source, scene).to_owned();
        // An object may have the name of another layer.
        while named.iter().any(|layer| layer.name == name) {
            name.push('\'');
        }
        named.push(Layer::rgb(&name, picture, Precision::Float));
    }
    let Some((width, height)) = size else {
        let problem = "nothing emits light in this estimate, so there are no layers";
        let remedy = "continue the solve, or give an object an emission";
        return Err(Error::file(path, problem, remedy));
    };
    write_layers(path, width, height, named)
}
