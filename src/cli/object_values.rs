//! Object values on the command line: NAME=R,G,B and NAME=V.

use crate::cli::numbers::triple;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::session::edits::{Edits, ObjectEdit};
use clap::Args;
use glam::Vec3;

/// Emission and material of named objects.
#[derive(Debug, Clone, Default, Args)]
pub struct ObjectValues {
    /// Radiance that an object emits
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub emission: Vec<(String, Vec3)>,
    /// Diffuse reflectance of an object, 0 to 1
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub albedo: Vec<(String, Vec3)>,
    /// GGX roughness of an object's specular lobe, above 0 (mirror-like) to 1; adds a lobe if there is none
    #[arg(long, value_name = "NAME=V", value_parser = named_number)]
    pub roughness: Vec<(String, f32)>,
    /// Specular reflectance of an object at normal incidence, 0 to 1; adds a lobe if there is none, and 0 removes it
    #[arg(long, value_name = "NAME=V", value_parser = named_number)]
    pub specular: Vec<(String, f32)>,
}

/// What is wrong with a reflectance out of range.
const REFLECTANCE: &str = "a surface reflects between none and all of the light";

impl ObjectValues {
    /// Adds the values to `edits` as changes of an estimate; where `known`, as values that a solve holds fixed.
    pub fn add(&self, scene: &Scene, edits: &mut Edits, known: bool) -> Result<()> {
        let mut set = |name: &str, set: &dyn Fn(&mut ObjectEdit)| {
            let object = find(scene, name)?;
            let mut edit = edits.object(object);
            set(&mut edit);
            edit.emission_known |= known && edit.emission.is_some();
            edit.albedo_known |= known && edit.albedo.is_some();
            edits.set(object, edit);
            Ok(())
        };
        let refused = |what: &str, name: &str, problem: &str, remedy: &str| {
            Err(Error::usage(format!("{what} of {name}"), problem, remedy))
        };
        for (name, emission) in &self.emission {
            if emission.min_element() < 0.0 {
                let problem = "light cannot be negative";
                return refused("emission", name, problem, "give values of 0 or more");
            }
            set(name, &|edit| edit.emission = Some(*emission))?;
        }
        for (name, albedo) in &self.albedo {
            if albedo.min_element() < 0.0 || albedo.max_element() > 1.0 {
                return refused("albedo", name, REFLECTANCE, "give values from 0 to 1");
            }
            set(name, &|edit| edit.albedo = Some(*albedo))?;
        }
        for (name, roughness) in &self.roughness {
            if !(*roughness > 0.0 && *roughness <= 1.0) {
                let problem = "a GGX roughness is above 0 and at most 1";
                return refused("roughness", name, problem, "give a value like 0.3");
            }
            set(name, &|edit| edit.roughness = Some(*roughness))?;
        }
        for (name, specular) in &self.specular {
            if !(0.0..=1.0).contains(specular) {
                let remedy = "give a value from 0 (no lobe) to 1";
                return refused("specular reflectance", name, REFLECTANCE, remedy);
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
        let problem = "the capture has no object of this name";
        Error::usage(name, problem, format!("choose among {}", names.join(", ")))
    })
}

pub fn named_color(text: &str) -> std::result::Result<(String, Vec3), String> {
    let (name, color) = text.rsplit_once('=').ok_or("NAME=r,g,b is wanted")?;
    Ok((name.to_owned(), triple(color)?.as_vec3()))
}

pub fn named_number(text: &str) -> std::result::Result<(String, f32), String> {
    let (name, value) = text.rsplit_once('=').ok_or("NAME=v is wanted")?;
    let number = value.parse::<f32>();
    let value = number.map_err(|_| format!("{value:?} is no number"))?;
    if !value.is_finite() {
        return Err(format!("{value} is no finite number"));
    }
    Ok((name.to_owned(), value))
}
