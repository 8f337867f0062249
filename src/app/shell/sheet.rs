//! The sheets: what is saved, exported or measured, with a typed path.

use crate::app::shell::dialogs::Ask;
use crate::session::command::ExportFormat;
use glam::DVec3;
use std::path::PathBuf;

/// What the open sheet is for, and what is typed in it.
#[derive(Debug, Clone, Default)]
pub enum Sheet {
    /// It is closed.
    #[default]
    Closed,
    /// The sessions that are kept.
    Sessions,
    /// Saving results into the folder.
    Save(String),
    /// Saving the light of each lamp into the file.
    Layers(String),
    /// Exporting one file.
    Export {
        /// The file.
        file: String,
        /// Which of [`FORMATS`].
        format: usize,
        /// Where a probe is taken, in the capture's coordinates.
        at: DVec3,
    },
    /// Saving photographs.
    Photographs(Wanted),
    /// Setting the scale.
    Length {
        /// The length between the clicks in the capture's coordinates.
        found: f64,
        /// What it is.
        metres: f64,
    },
}

/// Which photographs are written, and how.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The folder.
    pub folder: String,
    /// All photographs rather than the shown one.
    pub all: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// Whether noise is smoothed.
    pub denoise: bool,
}

/// The formats for export, in the order shown: name, what reads it, and the format (a probe's point is set at export).
pub const FORMATS: [(&str, &str, ExportFormat); 6] = [
    (
        "GLB",
        "Base colours and emissive strength, for Blender and engines",
        ExportFormat::Glb,
    ),
    (
        "OBJ",
        "With an MTL file and the images of its textures beside it",
        ExportFormat::Obj,
    ),
    ("PLY", "Albedo as vertex colours", ExportFormat::Ply),
    (
        "Mitsuba 3",
        "A scene file that Mitsuba 3 renders",
        ExportFormat::Mitsuba,
    ),
    ("CSV", "The table of objects", ExportFormat::Csv),
    (
        "Light probe",
        "The light at a point as a panorama (.hdr or .exr)",
        ExportFormat::Probe { at: DVec3::ZERO },
    ),
];

/// Which of them is the light at a point.
pub const PROBE: usize = FORMATS.len() - 1;

/// The usual ending of a format's files.
pub fn ending(format: usize) -> &'static str {
    FORMATS[format].2.endings()[0]
}

impl Sheet {
    /// The sheet for saving.
    pub fn save(name: &str) -> Self {
        Self::Save(format!("relit-out/{}", file_name(name)))
    }

    /// The sheet for layers of light.
    pub fn layers(name: &str) -> Self {
        Self::Layers(format!("{}-lights.exr", file_name(name)))
    }

    /// The sheet for exporting in one of [`FORMATS`]; `at` is where a probe would be taken.
    pub fn export(name: &str, format: usize, at: DVec3) -> Self {
        let light = if format == PROBE { "-light" } else { "" };
        let file = format!("{}{light}.{}", file_name(name), ending(format));
        Self::Export { file, format, at }
    }

    /// The sheet for photographs: all of them, into a folder beside the results.
    pub fn photographs(name: &str) -> Self {
        Self::Photographs(Wanted {
            folder: format!("relit-out/{}-photographs", file_name(name)),
            all: true,
            samples: 64,
            denoise: true,
        })
    }

    /// Takes over what a dialog answered.
    pub fn chosen(&mut self, ask: Ask, path: PathBuf) {
        let text = path.to_string_lossy().into_owned();
        match (self, ask) {
            (Self::Save(folder) | Self::Photographs(Wanted { folder, .. }), Ask::SaveFolder) => {
                *folder = text;
            }
            (Self::Export { file, .. } | Self::Layers(file), Ask::ExportFile) => *file = text,
            _ => {}
        }
    }
}

/// A capture's name without what file systems object to.
fn file_name(name: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
    name.replace(|c: char| !is_plain(c), "-")
}
