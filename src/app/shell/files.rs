//! The sheet for saving results and exporting: a typed path, a dialog where there is one.

use crate::app::shell::dialogs::Ask;
use crate::app::shell::photographs::{self, Wanted};
use crate::app::shell::sessions;
use crate::app::state::App;
use crate::session::command::{Command, ExportFormat, ExportRequest};
use egui::{DragValue, Id, Key, Modal, Role, TextEdit, Ui, WidgetInfo};
use glam::DVec3;
use std::path::PathBuf;

/// What the sheet is for.
#[derive(Debug, Clone, Default)]
pub enum Sheet {
    /// It is closed.
    #[default]
    Closed,
    /// The sessions that are kept.
    Sessions,
    /// Saving results into a folder.
    Save {
        /// The folder as typed.
        folder: String,
    },
    /// Saving the light of each lamp.
    Layers {
        /// The file as typed.
        file: String,
    },
    /// Exporting one file.
    Export {
        /// The file as typed.
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

/// A format that can be exported: its name, and what reads it.
struct Format {
    name: &'static str,
    help: &'static str,
    format: ExportFormat,
}

/// All formats, in the order shown. The probe's point is filled in when it is exported.
const FORMATS: [Format; 6] = [
    Format {
        name: "GLB",
        help: "Base colours and emissive strength, for Blender and engines",
        format: ExportFormat::Glb,
    },
    Format {
        name: "OBJ",
        help: "With an MTL file and the images of its textures beside it",
        format: ExportFormat::Obj,
    },
    Format {
        name: "PLY",
        help: "Albedo as vertex colours",
        format: ExportFormat::Ply,
    },
    Format {
        name: "Mitsuba 3",
        help: "A scene file that Mitsuba 3 renders",
        format: ExportFormat::Mitsuba,
    },
    Format {
        name: "CSV",
        help: "The table of objects",
        format: ExportFormat::Csv,
    },
    Format {
        name: "Light probe",
        help: "The light at a point as a panorama (.hdr or .exr)",
        format: ExportFormat::Probe { at: DVec3::ZERO },
    },
];

impl Format {
    /// The usual ending of its files.
    fn ending(&self) -> &'static str {
        self.format.endings()[0]
    }
}

impl Sheet {
    /// The sheet for saving.
    pub fn save(name: &str) -> Self {
        Self::Save {
            folder: format!("relit-out/{}", file_name(name)),
        }
    }

    /// The sheet for layers of light.
    pub fn layers(name: &str) -> Self {
        Self::Layers {
            file: format!("{}-lights.exr", file_name(name)),
        }
    }

    /// The sheet for exporting; `at` is where a probe would be taken.
    pub fn export(name: &str, at: DVec3) -> Self {
        Self::Export {
            file: format!("{}.{}", file_name(name), FORMATS[0].ending()),
            format: 0,
            at,
        }
    }

    /// The sheet for exporting the light at a point.
    pub fn probe(name: &str, at: DVec3) -> Self {
        let last = FORMATS.len() - 1;
        Self::Export {
            file: format!("{}-light.{}", file_name(name), FORMATS[last].ending()),
            format: last,
            at,
        }
    }

    /// The sheet for photographs.
    pub fn photographs(name: &str) -> Self {
        Self::Photographs(Wanted::new(name))
    }

    /// Takes over what a dialog answered.
    pub fn chosen(&mut self, ask: Ask, path: PathBuf) {
        let text = path.to_string_lossy().into_owned();
        match (self, ask) {
            (Self::Save { folder } | Self::Photographs(Wanted { folder, .. }), Ask::SaveFolder) => {
                *folder = text
            }
            (Self::Export { file, .. } | Self::Layers { file }, Ask::ExportFile) => *file = text,
            _ => {}
        }
    }
}

/// A capture's name without what file systems object to.
pub(in crate::app) fn file_name(name: &str) -> String {
    name.chars()
        .map(|c| {
            if c.is_alphanumeric() || c == '-' || c == '_' {
                c
            } else {
                '-'
            }
        })
        .collect()
}

/// Draws the sheet while it is open.
pub fn show(ctx: &egui::Context, app: &mut App) {
    if matches!(app.sheet, Sheet::Closed) {
        return;
    }
    let modal = Modal::new(Id::unique("sheet")).show(ctx, |ui| {
        ui.set_width(420.0);
        let mut sheet = app.sheet.clone();
        let close = match &mut sheet {
            Sheet::Closed => true,
            Sheet::Sessions => sessions::sheet(ui, app),
            Sheet::Save { folder } => save(ui, app, folder),
            Sheet::Layers { file } => layers(ui, app, file),
            Sheet::Export { file, format, at } => export(ui, app, file, format, at),
            Sheet::Length { found, metres } => length(ui, app, *found, metres),
            Sheet::Photographs(wanted) => photographs::sheet(ui, app, wanted),
        };
        app.sheet = if close { Sheet::Closed } else { sheet };
    });
    if modal.should_close() {
        app.sheet = Sheet::Closed;
    }
}

/// Draws the sheet for saving; true when it is to close.
fn save(ui: &mut Ui, app: &mut App, folder: &mut String) -> bool {
    ui.heading("Save results");
    ui.label("Estimate, report, loss, scene and pictures, as `relit solve` writes them.");
    let entered = path_field(ui, app, "Folder", folder, Ask::SaveFolder);
    let (clicked, cancel) = buttons(ui, "Save", !folder.trim().is_empty());
    let go = (clicked || entered) && !folder.trim().is_empty();
    if go {
        app.send(Command::Save(PathBuf::from(folder.trim())));
    }
    go || cancel
}

/// Draws the sheet for layers of light; true when it is to close.
fn layers(ui: &mut Ui, app: &mut App, file: &mut String) -> bool {
    ui.heading("Save light layers");
    ui.label("One OpenEXR file with the light of each lamp, as the shown view has it so far.");
    app.layers_needed = true;
    let layers = app.view().and_then(|view| view.layers.as_ref());
    ui.weak(layers.map_or_else(
        || "Tracing the light of each lamp…".to_owned(),
        |layers| format!("{} samples a pixel so far", layers.samples),
    ));
    let ready = layers.is_some() && !file.trim().is_empty();
    let entered = path_field(ui, app, "File", file, Ask::ExportFile);
    let (clicked, cancel) = buttons(ui, "Save", ready);
    let go = (clicked || entered) && ready;
    if go {
        app.send(Command::SaveLayers(PathBuf::from(file.trim())));
    }
    go || cancel
}

/// Draws the sheet for exporting; true when it is to close.
fn export(
    ui: &mut Ui,
    app: &mut App,
    file: &mut String,
    chosen: &mut usize,
    at: &mut DVec3,
) -> bool {
    ui.heading("Export");
    ui.horizontal_wrapped(|ui| {
        for (index, format) in FORMATS.iter().enumerate() {
            let response = ui
                .selectable_label(*chosen == index, format.name)
                .on_hover_text(format.help);
            if response.clicked() {
                *chosen = index;
                *file = PathBuf::from(&*file)
                    .with_extension(format.ending())
                    .to_string_lossy()
                    .into_owned();
            }
        }
    });
    let format = &FORMATS[(*chosen).min(FORMATS.len() - 1)];
    ui.weak(format.help);
    if matches!(format.format, ExportFormat::Probe { .. }) {
        probe_point(ui, app, at);
    }
    let entered = path_field(ui, app, "File", file, Ask::ExportFile);
    let (clicked, cancel) = buttons(ui, "Export", !file.trim().is_empty());
    let go = (clicked || entered) && !file.trim().is_empty();
    if go {
        let format = match format.format {
            ExportFormat::Probe { .. } => ExportFormat::Probe { at: *at },
            other => other,
        };
        app.send(Command::Export(ExportRequest {
            format,
            path: PathBuf::from(file.trim()),
        }));
    }
    go || cancel
}

/// Draws the sheet for a length; true when it is to close.
fn length(ui: &mut Ui, app: &mut App, found: f64, metres: &mut f64) -> bool {
    ui.heading("Set the scale");
    ui.label(format!(
        "The clicked length is {found:.3} now. Inserted objects keep their own size in metres."
    ));
    ui.horizontal(|ui| {
        let label = ui.label("Length");
        let drag = DragValue::new(metres)
            .range(1e-6..=1e6)
            .speed(found * 1e-3)
            .max_decimals(4)
            .suffix(" m");
        ui.add(drag).labelled_by(label.id);
    });
    let (clicked, cancel) = buttons(ui, "Set", *metres > 0.0);
    if clicked {
        app.set_length(found, *metres);
    }
    clicked || cancel
}

/// Three numbers for the point of a probe.
fn probe_point(ui: &mut Ui, app: &App, at: &mut DVec3) {
    let diameter = app.capture().map_or(1.0, |c| f64::from(c.scene.diameter));
    ui.horizontal(|ui| {
        ui.label("Point").on_hover_text(
            "In the capture's coordinates; File > Light probe by click takes it from a view",
        );
        for (axis, value) in ["x", "y", "z"].into_iter().zip(at.as_mut()) {
            let drag = DragValue::new(value)
                .speed(diameter * 1e-3)
                .max_decimals(3)
                .prefix(format!("{axis} "));
            ui.add(drag).widget_info(|| {
                WidgetInfo::labeled(Role::SpinButton, true, format!("Point {axis}"))
            });
        }
    });
}

/// A field for a path, which takes the keys at once; true when Enter is pressed in it.
pub(super) fn path_field(
    ui: &mut Ui,
    app: &mut App,
    name: &str,
    path: &mut String,
    ask: Ask,
) -> bool {
    ui.horizontal(|ui| {
        let label = ui.label(name);
        let response = ui
            .add(TextEdit::singleline(path).desired_width(270.0))
            .labelled_by(label.id);
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if ui.memory(|memory| memory.focused().is_none()) {
            response.request_focus();
        }
        if ui.button("Browse…").clicked() {
            app.ask(ask, &ui.ctx().clone());
        }
        entered
    })
    .inner
}

/// The two buttons at the end: whether each was clicked.
pub(super) fn buttons(ui: &mut Ui, go: &str, enabled: bool) -> (bool, bool) {
    ui.horizontal(|ui| {
        let cancel = ui.button("Cancel").clicked();
        let go = ui.add_enabled(enabled, egui::Button::new(go)).clicked();
        (go, cancel)
    })
    .inner
}
