//! Writes a scene and its estimate for other programs.

use crate::error::Result;
use crate::export::part::{mapped_parts, parts};
use crate::export::table::Table;
use crate::export::{glb, mitsuba, obj, overwrite, ply, probe};
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::scene::Scene;
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

/// Formats that other programs read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Format {
    /// Scene with base colours and emissive strength.
    Glb,
    /// Scene as OBJ and MTL, with textures as images.
    Obj,
    /// Scene as PLY with vertex colours.
    Ply,
    /// Scene as a Mitsuba 3 XML file.
    Mitsuba,
    /// Table of objects.
    Csv,
    /// The light at a point as a panorama.
    Probe {
        /// The point, in the capture's coordinates.
        at: DVec3,
    },
}

impl Format {
    /// File extensions, the usual one first.
    pub const fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Glb => &["glb"],
            Self::Obj => &["obj"],
            Self::Ply => &["ply"],
            Self::Mitsuba => &["xml"],
            Self::Csv => &["csv"],
            Self::Probe { .. } => &["hdr", "exr"],
        }
    }
}

/// What a format cannot hold of an estimate, as a sentence; `None` if nothing is lost.
pub fn lost(estimate: &Estimate, format: Format) -> Option<&'static str> {
    let holds_light = matches!(format, Format::Glb | Format::Obj | Format::Mitsuba);
    (holds_light && estimate.outside.is_some()).then_some(
        "light from outside the mesh is not in the file; write it as a panorama (a light probe) beside it",
    )
}

/// Writes a scene and its estimate for another program.
///
/// # Errors
/// The file may not be replaced (see [`overwrite`]) or cannot be written, a panorama's extension is wrong, or the format cannot
/// hold the scene.
pub fn write(scene: &Arc<Scene>, estimate: &Estimate, format: Format, path: &Path) -> Result<()> {
    // Check before any file beside `path` is written.
    overwrite::check(path)?;
    match format {
        Format::Glb => {
            let (parts, atlas) = mapped_parts(scene, estimate);
            glb::write(path, scene, &parts, atlas.as_ref().map(|a| &a.picture))
        }
        Format::Obj => {
            let (parts, atlas) = mapped_parts(scene, estimate);
            obj::write(path, &parts, atlas.as_ref().map(|a| &a.picture))
        }
        Format::Ply => ply::write_scene(path, &parts(scene, estimate)),
        Format::Mitsuba => mitsuba::write(path, scene, &parts(scene, estimate)),
        Format::Csv => table(scene, estimate).write(path),
        Format::Probe { at } => probe::write(path, &estimate.lit(scene), at),
    }
}

/// The table of objects, a row for each: estimates, standard errors, and how much it was seen.
fn table(scene: &Scene, estimate: &Estimate) -> Table {
    let colors = |name: &str| ["r", "g", "b"].map(|channel| format!("{name}_{channel}"));
    let mut columns = vec!["name".to_owned()];
    for name in ["albedo", "albedo_stderr", "emission", "emission_stderr"] {
        columns.extend(colors(name));
    }
    let rest = [
        "roughness",
        "specular",
        "seen_pixels",
        "triangles",
        "area",
        "identifiable",
        "albedo_identifiable",
        "note",
    ];
    columns.extend(rest.map(str::to_owned));
    let mut table = Table::new(&columns.join(","));

    let unknown = ObjectEstimate::default();
    for (index, object) in scene.objects.iter().enumerate() {
        let known = estimate.objects.get(index).unwrap_or(&unknown);
        table.row((
            &object.name,
            [known.albedo, known.albedo_stderr],
            [known.emission, known.emission_stderr],
            known.roughness,
            known.specular,
            known.seen_pixels,
            object.triangles.len(),
            object.area,
            known.identifiable,
            known.albedo_identifiable,
            &known.note,
        ));
    }
    table
}
