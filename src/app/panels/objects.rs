//! The table of objects: swatches, errors, pixels seen; sortable, with a filter, linked to the views.

use crate::app::action::Action;
use crate::app::describe::described;
use crate::app::picture::inspect::{number, triple};
use crate::app::state::App;
use crate::app::theme;
use crate::inverse::estimate::ObjectEstimate;
use egui::{Align, Button, Color32, Key, Sense, TextEdit, Ui, vec2};
use egui_extras::{Column, TableBuilder};
use glam::Vec3;

/// What rows are sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SortBy {
    /// Name.
    Name,
    /// Luminance of the albedo.
    Albedo,
    /// Standard error of the albedo.
    Error,
    /// Luminance of the emission.
    Emission,
    /// Pixels that see it.
    Pixels,
}

/// The columns that can be sorted by, with titles and tooltips.
const COLUMNS: [(SortBy, &str, &str); 5] = [
    (SortBy::Name, "Object", "The capture's name for it"),
    (SortBy::Albedo, "Albedo", "Diffuse reflectance"),
    (
        SortBy::Error,
        "±",
        "Standard error of the albedo, mean over RGB",
    ),
    (SortBy::Emission, "Emission", "Emitted radiance"),
    (
        SortBy::Pixels,
        "Pixels",
        "Pixels of all photographs that see it",
    ),
];

/// How the table is shown.
#[derive(Debug)]
pub struct ObjectsTable {
    /// What rows are sorted by.
    pub sort: SortBy,
    /// Whether the largest come first.
    pub descending: bool,
    /// Only names that contain this, in any case.
    pub filter: String,
    /// Whether to scroll to the selected row.
    pub reveal: bool,
}

impl Default for ObjectsTable {
    fn default() -> Self {
        Self {
            sort: SortBy::Pixels,
            descending: true,
            filter: String::new(),
            reveal: false,
        }
    }
}

impl ObjectsTable {
    /// Indices of the objects in the order shown.
    pub fn rows(&self, names: &[&str], estimates: &[ObjectEstimate]) -> Vec<usize> {
        let filter = self.filter.to_lowercase();
        let mut rows: Vec<usize> = (0..names.len())
            .filter(|&row| filter.is_empty() || names[row].to_lowercase().contains(&filter))
            .collect();
        let key = |row: usize| {
            estimates.get(row).map_or(0.0, |object| match self.sort {
                SortBy::Name => 0.0,
                SortBy::Albedo => f64::from(crate::math::color::luminance(object.albedo)),
                SortBy::Error => f64::from(object.albedo_stderr.element_sum() / 3.0),
                SortBy::Emission => f64::from(crate::math::color::luminance(object.emission)),
                SortBy::Pixels => object.seen_pixels as f64,
            })
        };
        rows.sort_by(|&a, &b| {
            let by_key = match self.sort {
                SortBy::Name => names[a].cmp(names[b]),
                _ => key(a).total_cmp(&key(b)),
            };
            let by_key = if self.descending {
                by_key.reverse()
            } else {
                by_key
            };
            // Equal ones stay in the capture's order.
            by_key.then(a.cmp(&b))
        });
        rows
    }
}

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    let Some(capture) = app.capture().cloned() else {
        ui.weak(app.nothing_open());
        return;
    };
    let (estimate, unit) = (app.estimate.clone(), app.radiance_unit());
    let objects = &capture.scene.objects;
    let area: f64 = objects.iter().map(|object| object.area).sum();
    let told = |index: usize| {
        let found = estimate.objects.get(index);
        found
            .filter(|o| o.identifiable && o.albedo_identifiable)
            .map(|found| found.albedo)
    };
    let described: Vec<String> = (objects.iter().enumerate())
        .map(|(index, object)| described(object, area, told(index)))
        .collect();
    let names: Vec<&str> = described.iter().map(String::as_str).collect();
    ui.horizontal(|ui| {
        let label = ui.label("Filter");
        ui.add(TextEdit::singleline(&mut app.objects.filter).desired_width(120.0))
            .labelled_by(label.id);
        ui.weak(format!("{} objects", names.len()));
    });
    let own: Vec<&str> = objects.iter().map(|o| o.name.as_str()).collect();
    changes(ui, app, &own);
    let rows = app.objects.rows(&names, &estimate.objects);
    let selected_row = app
        .selected
        .and_then(|object| rows.iter().position(|&row| row == object as usize));
    let mut table = TableBuilder::new(ui)
        .id_salt("objects")
        .striped(true)
        .sense(Sense::click())
        .auto_shrink(false)
        .cell_layout(egui::Layout::left_to_right(Align::Center))
        .column(Column::remainder().at_least(84.0).clip(true))
        .column(Column::initial(64.0).at_least(52.0))
        .column(Column::initial(48.0).at_least(40.0))
        .column(Column::initial(76.0).at_least(60.0))
        .column(Column::initial(58.0).at_least(46.0));
    if std::mem::take(&mut app.objects.reveal)
        && let Some(row) = selected_row
    {
        table = table.scroll_to_row(row, Some(Align::Center));
    }
    let mut clicked = None;
    table
        .header(theme::ROW, |mut header| {
            for (sort, title, help) in COLUMNS {
                header.col(|ui| head(ui, &mut app.objects, sort, title, help));
            }
        })
        .body(|body| {
            body.rows(theme::ROW, rows.len(), |mut row| {
                let object = rows[row.index()];
                let chosen = app.selected == Some(object as u32)
                    || app.grouping.also.contains(&(object as u32));
                row.set_selected(chosen);
                let none = ObjectEstimate::default();
                let found = estimate.objects.get(object).unwrap_or(&none);
                cells(&mut row, names[object], found);
                let response = row.response();
                response.widget_info(|| {
                    egui::WidgetInfo::selected(
                        egui::Role::Button,
                        true,
                        chosen,
                        format!("Select {}", names[object]),
                    )
                });
                if response.clicked() {
                    clicked = Some(object as u32);
                }
                response.on_hover_ui(|ui| details(ui, names[object], found, unit));
            });
        });
    if let Some(object) = clicked {
        let more = ui.input(|input| input.modifiers.command);
        let again = !more && app.selected == Some(object);
        app.choose((!again).then_some(object), more);
    }
}

/// Buttons and a field that change which faces are one object, and its name.
fn changes(ui: &mut Ui, app: &mut App, names: &[&str]) {
    let ctx = ui.ctx().clone();
    ui.horizontal_wrapped(|ui| {
        for action in [Action::JoinObjects, Action::CutOut] {
            let button = ui.add_enabled(app.can(action), Button::new(action.text()));
            let help = format!("{}. The solve then starts over.", action.help());
            if button.on_hover_text(help).clicked() {
                app.perform(action, &ctx);
            }
        }
        if !app.can_regroup() {
            ui.weak("Reading the mesh again…");
        } else if let Some((object, name)) =
            (app.selected).and_then(|object| Some((object, *names.get(object as usize)?)))
        {
            rename(ui, app, object, name);
        }
    });
}

/// The name of an object, to be typed over.
fn rename(ui: &mut Ui, app: &mut App, object: u32, name: &str) {
    if app.grouping.name.0 != Some(object) {
        app.grouping.name = (Some(object), name.to_owned());
    }
    let label = ui.label("Name");
    let field = TextEdit::singleline(&mut app.grouping.name.1).desired_width(110.0);
    let response = ui.add(field).labelled_by(label.id);
    if std::mem::take(&mut app.grouping.naming) {
        response.request_focus();
    }
    if response.lost_focus() {
        // Enter takes the name; anything else leaves it.
        let typed = std::mem::take(&mut app.grouping.name).1;
        if ui.input(|input| input.key_pressed(Key::Enter)) {
            app.rename_object(object, &typed);
        }
    }
}

/// A title that sorts by its column, and the other way round when clicked again.
fn head(ui: &mut Ui, table: &mut ObjectsTable, sort: SortBy, title: &str, help: &str) {
    let active = table.sort == sort;
    let text = if active {
        format!("{title}    ")
    } else {
        title.to_owned()
    };
    let response = ui
        .selectable_label(active, text)
        .on_hover_text(format!("{help}. Click to sort."));
    if active {
        // The shipped fonts have no arrows.
        let middle = response.rect.right_center() - vec2(11.0, 0.0);
        let down = if table.descending { 1.0 } else { -1.0 };
        let corners = [vec2(-4.0, -2.5), vec2(4.0, -2.5), vec2(0.0, 3.5)]
            .map(|v| middle + v * vec2(1.0, down));
        let color = theme::tokens(ui).strong;
        ui.painter().add(egui::Shape::convex_polygon(
            corners.to_vec(),
            color,
            egui::Stroke::NONE,
        ));
    }
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Sort by {title}"))
    });
    if response.clicked() {
        table.descending = if active {
            !table.descending
        } else {
            sort != SortBy::Name
        };
        table.sort = sort;
    }
}

fn cells(row: &mut egui_extras::TableRow<'_, '_>, name: &str, object: &ObjectEstimate) {
    row.col(|ui| {
        let text = egui::RichText::new(name);
        let text = if object.identifiable {
            text
        } else {
            text.weak().italics()
        };
        ui.add(egui::Label::new(text).truncate().selectable(false));
    });
    row.col(|ui| {
        swatch(ui, object.albedo);
        let known = object.albedo_identifiable;
        let mean = if known {
            number(object.albedo.element_sum() / 3.0)
        } else {
            "?".to_owned()
        };
        ui.add(egui::Label::new(mean).selectable(false));
    });
    row.col(|ui| {
        let text = number(object.albedo_stderr.element_sum() / 3.0);
        ui.add(egui::Label::new(text).selectable(false));
    });
    row.col(|ui| {
        let peak = object.emission.max_element();
        if peak > 0.0 {
            swatch(ui, object.emission / peak);
            ui.add(egui::Label::new(number(peak)).selectable(false));
        } else {
            ui.add(egui::Label::new(egui::RichText::new("none").weak()).selectable(false));
        }
    });
    row.col(|ui| {
        ui.add(egui::Label::new(object.seen_pixels.to_string()).selectable(false));
    });
}

fn details(ui: &mut Ui, name: &str, object: &ObjectEstimate, unit: &str) {
    ui.strong(name);
    ui.label(format!(
        "albedo {} ± {}",
        triple(object.albedo),
        triple(object.albedo_stderr)
    ));
    ui.label(format!(
        "emission {} ± {} {unit}",
        triple(object.emission),
        triple(object.emission_stderr)
    ));
    if let Some((roughness, specular)) = object.lobe() {
        ui.label(format!(
            "roughness {}, specular {}",
            number(roughness),
            number(specular)
        ));
    }
    ui.label(format!("seen by {} pixels", object.seen_pixels));
    if !object.note.is_empty() {
        ui.colored_label(theme::tokens(ui).warning, &object.note);
    }
}

/// A square of a linear colour.
fn swatch(ui: &mut Ui, color: Vec3) {
    let (rect, _) = ui.allocate_exact_size(vec2(theme::SWATCH, theme::SWATCH), Sense::hover());
    let fill = if color.is_finite() {
        theme::swatch(color)
    } else {
        Color32::TRANSPARENT
    };
    let stroke = (1.0, theme::tokens(ui).outline);
    ui.painter()
        .rect(rect, 2.0, fill, stroke, egui::StrokeKind::Inside);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_sorted_filtered_and_turned_round() {
        let names = ["Lamp", "wall", "lamp shade"];
        let estimates: Vec<ObjectEstimate> = [(5, 9.0), (50, 0.0), (7, 0.0)]
            .map(|(seen_pixels, emission)| ObjectEstimate {
                seen_pixels,
                emission: Vec3::splat(emission),
                ..ObjectEstimate::default()
            })
            .into();
        let mut table = ObjectsTable::default();
        assert_eq!(table.rows(&names, &estimates), [1, 2, 0]);
        table.sort = SortBy::Emission;
        assert_eq!(table.rows(&names, &estimates)[0], 0);
        table.filter = "LAMP".into();
        table.sort = SortBy::Pixels;
        table.descending = false;
        assert_eq!(table.rows(&names, &estimates), [0, 2]);
    }
}
