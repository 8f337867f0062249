//! `relit edit`: lamps off, walls recoloured.

use crate::cli::arguments::triple;
use crate::cli::saved::{Loaded, SavedOptions};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::session::edits::Edits;
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Results};
use clap::Args;
use glam::Vec3;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// `relit edit`.
#[derive(Debug, Args)]
pub struct EditArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// Radiance that an object emits
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    emission: Vec<(String, Vec3)>,
    /// Diffuse reflectance of an object, 0 to 1
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    albedo: Vec<(String, Vec3)>,
    /// Pictures to write: all frames at full size, N frames, or none [default: 16, long side 1024]
    #[arg(long, value_name = "all|N|none", value_parser = crate::cli::arguments::frames)]
    views: Option<Frames>,
    /// Folder to write into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Changes objects of an estimate and writes it with new re-renders.
///
/// # Errors
/// An object is not there, or files cannot be read or written.
pub fn edit(arguments: &EditArguments) -> Result<()> {
    let Loaded {
        saved,
        capture,
        estimate,
    } = arguments.saved.load()?;
    let mut edits = Edits::default();
    for (name, emission) in &arguments.emission {
        let object = find(&capture.scene, name)?;
        if emission.min_element() < 0.0 {
            return Err(Error::usage(
                format!("--emission {name}"),
                "light cannot be negative",
                "give values of 0 or more",
            ));
        }
        let mut edit = edits.object(object);
        edit.emission = Some(*emission);
        edits.set(object, edit);
    }
    for (name, albedo) in &arguments.albedo {
        let object = find(&capture.scene, name)?;
        if albedo.min_element() < 0.0 || albedo.max_element() > 1.0 {
            return Err(Error::usage(
                format!("--albedo {name}"),
                "a surface reflects between none and all of the light",
                "give values from 0 to 1",
            ));
        }
        let mut edit = edits.object(object);
        edit.albedo = Some(*albedo);
        edits.set(object, edit);
    }
    let results = Results {
        capture,
        settings: saved.settings,
        estimate: Arc::new(edits.apply(&estimate)),
        edits: Edits::default(),
        progress: Arc::default(),
        stopped_because: Some(saved.termination),
        checkpoint: None,
        views: arguments.views.unwrap_or_default(),
        started: Instant::now(),
        seconds_load: 0.0,
    };
    save::write_estimate(&arguments.out, &results)?;
    println!("results in {}", arguments.out.display());
    Ok(())
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

fn named_color(text: &str) -> std::result::Result<(String, Vec3), String> {
    let (name, color) = text
        .rsplit_once('=')
        .ok_or("NAME=r,g,b is wanted".to_owned())?;
    Ok((name.to_owned(), triple(color)?.as_vec3()))
}
