//! Object values on the command line: NAME=R,G,B and NAME=V.

use crate::cli::numbers::triple;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::session::edits::{Edits, ObjectEdit};
use glam::Vec3;

/// Emission and material of named objects.
#[derive(Debug, Clone, Default)]
pub struct ObjectValues {
    /// Radiance, W·sr⁻¹·m⁻².
    pub emission: Vec<(String, Vec3)>,
    /// Diffuse reflectance, 0 to 1.
    pub albedo: Vec<(String, Vec3)>,
    /// GGX roughness α, above 0 and up to 1.
    pub roughness: Vec<(String, f32)>,
    /// Specular reflectance at normal incidence, 0 to 1; 0 removes the lobe.
    pub specular: Vec<(String, f32)>,
}

impl ObjectValues {
    /// Adds the values to `edits` as changes of an estimate.
    ///
    /// # Errors
    /// An object does not exist, or a value is out of range.
    pub fn change(&self, scene: &Scene, edits: &mut Edits) -> Result<()> {
        self.apply(scene, edits, |_| {})
    }

    /// Adds the values to `edits` as known values, which a solve holds fixed.
    ///
    /// # Errors
    /// As [`ObjectValues::change`].
    pub fn hold(&self, scene: &Scene, edits: &mut Edits) -> Result<()> {
        self.apply(scene, edits, |edit| {
            edit.emission_known |= edit.emission.is_some();
            edit.albedo_known |= edit.albedo.is_some();
        })
    }

    fn apply(
        &self,
        scene: &Scene,
        edits: &mut Edits,
        then: impl Fn(&mut ObjectEdit),
    ) -> Result<()> {
        let mut set = |name: &str, set: &dyn Fn(&mut ObjectEdit)| {
            let object = find(scene, name)?;
            let mut edit = edits.object(object);
            set(&mut edit);
            then(&mut edit);
            edits.set(object, edit);
            Ok(())
        };
        for (name, emission) in &self.emission {
            if emission.min_element() < 0.0 {
                return Err(Error::usage(
                    format!("emission of {name}"),
                    "light cannot be negative",
                    "give values of 0 or more",
                ));
            }
            set(name, &|edit| edit.emission = Some(*emission))?;
        }
        for (name, albedo) in &self.albedo {
            if albedo.min_element() < 0.0 || albedo.max_element() > 1.0 {
                return Err(Error::usage(
                    format!("albedo of {name}"),
                    "a surface reflects between none and all of the light",
                    "give values from 0 to 1",
                ));
            }
            set(name, &|edit| edit.albedo = Some(*albedo))?;
        }
        for (name, roughness) in &self.roughness {
            if !(*roughness > 0.0 && *roughness <= 1.0) {
                return Err(Error::usage(
                    format!("roughness of {name}"),
                    "a GGX roughness is above 0 and at most 1",
                    "give a value like 0.3",
                ));
            }
            set(name, &|edit| edit.roughness = Some(*roughness))?;
        }
        for (name, specular) in &self.specular {
            if !(0.0..=1.0).contains(specular) {
                return Err(Error::usage(
                    format!("specular reflectance of {name}"),
                    "a surface reflects between none and all of the light",
                    "give a value from 0 (no lobe) to 1",
                ));
            }
            set(name, &|edit| edit.specular = Some(*specular))?;
        }
        Ok(())
    }
}

fn find(scene: &Scene, name: &str) -> Result<usize> {
    let index = scene.objects.iter().position(|o| o.name == name);
    index.ok_or_else(|| {
        let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
        Error::usage(
            name,
            "the capture has no object of this name",
            format!("choose among {}", names.join(", ")),
        )
    })
}

/// Parses NAME=R,G,B.
pub fn named_color(text: &str) -> std::result::Result<(String, Vec3), String> {
    let (name, color) = text
        .rsplit_once('=')
        .ok_or("NAME=r,g,b is wanted".to_owned())?;
    Ok((name.to_owned(), triple(color)?.as_vec3()))
}

/// Parses NAME=V.
pub fn named_number(text: &str) -> std::result::Result<(String, f32), String> {
    let (name, value) = text.rsplit_once('=').ok_or("NAME=v is wanted".to_owned())?;
    let value: f32 = value
        .parse()
        .map_err(|_| format!("{value:?} is no number"))?;
    if !value.is_finite() {
        return Err(format!("{value} is no finite number"));
    }
    Ok((name.to_owned(), value))
}
