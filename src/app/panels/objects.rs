//! The table of objects: swatches, errors, pixels seen; sortable, with a filter, linked to the views.

use crate::app::action::Action;
use crate::app::controls::{choices, labelled, named, switched};
use crate::app::document::Document;
use crate::app::number::{number, triple};
use crate::app::request::{Request, Requests};
use crate::app::selection::Selection;
use crate::app::theme;
use crate::inverse::estimate::ObjectEstimate;
use crate::math::color::{linear_to_srgb, luminance};
use crate::scene::Object;
use egui::ecolor::Hsva;
use egui::{
    Align, Button, Color32, Key, Label, RichText, Role, Sense, Shape, Stroke, StrokeKind, TextEdit,
    Ui, vec2,
};
use egui_extras::{Column, TableBuilder};
use glam::Vec3;

choices! {
    /// What rows are sorted by: the columns, from the left.
    SortBy {
        Name, "Object", "The capture's name for it";
        Albedo, "Albedo", "Diffuse reflectance";
        Error, "±", "Standard error of the albedo, mean over RGB";
        Emission, "Emission", "Emitted radiance";
        Pixels, "Pixels", "Pixels of all photographs that see it";
    }
}

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
    /// The object whose name is being typed, and the name so far.
    pub renamed: Option<(u32, String)>,
    /// Whether the field of the name is to take the keys.
    pub naming: bool,
}

impl Default for ObjectsTable {
    fn default() -> Self {
        Self {
            sort: SortBy::Pixels,
            descending: true,
            filter: String::new(),
            reveal: false,
            renamed: None,
            naming: false,
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
                SortBy::Albedo => f64::from(luminance(object.albedo)),
                SortBy::Error => f64::from(object.albedo_stderr.element_sum() / 3.0),
                SortBy::Emission => f64::from(luminance(object.emission)),
                SortBy::Pixels => object.seen_pixels as f64,
            })
        };
        // Equal ones stay in the capture's order.
        rows.sort_by(|&a, &b| {
            let (a, b) = if self.descending { (b, a) } else { (a, b) };
            match self.sort {
                SortBy::Name => names[a].cmp(names[b]),
                _ => key(a).total_cmp(&key(b)),
            }
        });
        rows
    }
}

/// Draws the pane.
pub fn pane(
    ui: &mut Ui,
    document: &Document,
    objects: &[Object],
    selection: &Selection,
    table: &mut ObjectsTable,
    requests: &mut Requests,
) {
    let (estimate, unit) = (&document.estimate, document.radiance_unit());
    let area: f64 = objects.iter().map(|object| object.area).sum();
    let albedo = |index: usize| {
        let found = estimate.objects.get(index);
        let told = found.filter(|o| o.identifiable && o.albedo_identifiable);
        told.map(|found| found.albedo)
    };
    let described: Vec<String> = (objects.iter().enumerate())
        .map(|(index, object)| described(object, area, albedo(index)))
        .collect();
    let names: Vec<&str> = described.iter().map(String::as_str).collect();
    ui.horizontal(|ui| {
        let filter = TextEdit::singleline(&mut table.filter);
        labelled(ui, "Filter", filter.desired_width(120.0));
        ui.weak(format!("{} objects", names.len()));
        let common = document.estimate.common_error * 100.0;
        if common > 0.0 {
            let help = "how well one factor of all albedos is known; their ratios are known better";
            ui.weak(format!("all albedos together ± {common:.0} %"))
                .on_hover_text(help);
        }
    });
    ui.horizontal_wrapped(|ui| {
        for action in [Action::JoinObjects, Action::CutOut] {
            let help = format!("{}. The solve then starts over.", action.help());
            requests.button_with_help(ui, action, Button::new(action.text()), &help);
        }
        let named = |object: u32| Some((object, &objects.get(object as usize)?.name));
        if !document.can_regroup() {
            ui.weak("Reading the mesh again…");
        } else if let Some((object, name)) = selection.object.and_then(named) {
            rename(ui, table, object, name, requests);
        }
    });
    let rows = table.rows(&names, &estimate.objects);
    let place = |object: u32| rows.iter().position(|&row| row == object as usize);
    let selected_row = selection.object.and_then(place);
    let mut drawn = TableBuilder::new(ui)
        .id_salt("objects")
        .striped(true)
        .sense(Sense::click())
        .auto_shrink(false)
        .cell_layout(egui::Layout::left_to_right(Align::Center))
        .column(Column::remainder().at_least(84.0).clip(true));
    for (width, least) in [(64.0, 52.0), (48.0, 40.0), (76.0, 60.0), (58.0, 46.0)] {
        drawn = drawn.column(Column::initial(width).at_least(least));
    }
    if std::mem::take(&mut table.reveal)
        && let Some(row) = selected_row
    {
        drawn = drawn.scroll_to_row(row, Some(Align::Center));
    }
    let mut clicked = None;
    drawn
        .header(theme::ROW, |mut header| {
            for sort in SortBy::ALL {
                header.col(|ui| head(ui, table, sort));
            }
        })
        .body(|body| {
            body.rows(theme::ROW, rows.len(), |mut row| {
                let object = rows[row.index()];
                let selected = selection.contains(object as u32);
                row.set_selected(selected);
                let none = ObjectEstimate::default();
                let found = estimate.objects.get(object).unwrap_or(&none);
                cells(&mut row, names[object], found);
                let name = format!("Select {}", names[object]);
                let response = switched(row.response(), Role::Button, selected, &name);
                if response.clicked() {
                    clicked = Some(object as u32);
                }
                response.on_hover_ui(|ui| details(ui, names[object], found, unit));
            });
        });
    if let Some(object) = clicked {
        let more = ui.input(|input| input.modifiers.command);
        let again = !more && selection.object == Some(object);
        requests.ask(Request::Select((!again).then_some(object), more));
    }
}

/// The name of an object, to be typed over.
fn rename(ui: &mut Ui, table: &mut ObjectsTable, object: u32, name: &str, requests: &mut Requests) {
    let mut typed = match table.renamed.take() {
        Some((known, typed)) if known == object => typed,
        _ => name.to_owned(),
    };
    let field = TextEdit::singleline(&mut typed).desired_width(110.0);
    let response = labelled(ui, "Name", field);
    if std::mem::take(&mut table.naming) {
        response.request_focus();
    }
    if !response.lost_focus() {
        table.renamed = Some((object, typed));
    } else if ui.input(|input| input.key_pressed(Key::Enter)) {
        // Enter takes the name; anything else leaves it.
        requests.ask(Request::Rename(object, typed));
    }
}

/// A title that sorts by its column, and the other way round when clicked again.
fn head(ui: &mut Ui, table: &mut ObjectsTable, sort: SortBy) {
    let (title, help) = (sort.name(), sort.help());
    let active = table.sort == sort;
    // Room for the arrow.
    let text = format!("{title}{}", if active { "    " } else { "" });
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
        let arrow = Shape::convex_polygon(corners.to_vec(), color, Stroke::NONE);
        ui.painter().add(arrow);
    }
    let response = named(response, Role::Button, &format!("Sort by {title}"));
    if response.clicked() {
        table.descending = match active {
            true => !table.descending,
            false => sort != SortBy::Name,
        };
        table.sort = sort;
    }
}

fn cells(row: &mut egui_extras::TableRow<'_, '_>, name: &str, object: &ObjectEstimate) {
    let text = |ui: &mut Ui, text: RichText| ui.add(Label::new(text).selectable(false));
    row.col(|ui| {
        let text = RichText::new(name);
        let text = match object.identifiable {
            true => text,
            false => text.weak().italics(),
        };
        ui.add(Label::new(text).truncate().selectable(false));
    });
    row.col(|ui| {
        swatch(ui, object.albedo);
        let mean = match object.albedo_identifiable {
            true => number(object.albedo.element_sum() / 3.0),
            false => "?".to_owned(),
        };
        text(ui, mean.into());
    });
    row.col(|ui| {
        text(ui, number(object.albedo_stderr.element_sum() / 3.0).into());
    });
    row.col(|ui| {
        let peak = object.emission.max_element();
        if peak > 0.0 {
            swatch(ui, object.emission / peak);
            text(ui, number(peak).into());
        } else {
            text(ui, RichText::new("none").weak());
        }
    });
    row.col(|ui| {
        text(ui, object.seen_pixels.to_string().into());
    });
}

fn details(ui: &mut Ui, name: &str, object: &ObjectEstimate, unit: &str) {
    let measured = |value, error| format!("{} ± {}", triple(value), triple(error));
    ui.strong(name);
    let albedo = measured(object.albedo, object.albedo_stderr);
    ui.label(format!("albedo {albedo}"));
    let emission = measured(object.emission, object.emission_stderr);
    ui.label(format!("emission {emission} {unit}"));
    if let Some((roughness, specular)) = object.lobe() {
        let (roughness, specular) = (number(roughness), number(specular));
        ui.label(format!("roughness {roughness}, specular {specular}"));
    }
    ui.label(format!("seen by {} pixels", object.seen_pixels));
    if !object.note.is_empty() {
        ui.colored_label(theme::tokens(ui).warning, &object.note);
    }
}

/// A square of a linear colour.
fn swatch(ui: &mut Ui, color: Vec3) {
    let (rect, _) = ui.allocate_exact_size(vec2(theme::SWATCH, theme::SWATCH), Sense::hover());
    let fill = match color.is_finite() {
        true => theme::swatch(color),
        false => Color32::TRANSPARENT,
    };
    let stroke = (1.0, theme::tokens(ui).outline);
    (ui.painter()).rect(rect, 2.0, fill, stroke, StrokeKind::Inside);
}

/// The name of an object; a segment's says whether it is large or small (in the scene's area), and its colour.
fn described(object: &Object, area: f64, albedo: Option<Vec3>) -> String {
    if !object.name.starts_with("segment ") {
        return object.name.clone();
    }
    let size = match object.area / area {
        fraction if fraction > 0.05 => " large",
        fraction if fraction < 0.003 => " small",
        _ => "",
    };
    let color = albedo.map_or(String::new(), |albedo| format!(" {}", color_word(albedo)));
    match (size, color.as_str()) {
        ("", "") => object.name.clone(),
        _ => format!("{},{size}{color}", object.name),
    }
}

/// The word of a linear colour.
fn color_word(albedo: Vec3) -> &'static str {
    let srgb = albedo.clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let Hsva { h, s, v, .. } = Hsva::from_rgb(srgb.map(linear_to_srgb));
    if v < 0.2 {
        return "black";
    }
    if s < 0.2 {
        return match v {
            v if v < 0.45 => "dark grey",
            v if v < 0.75 => "grey",
            v if v < 0.9 => "light grey",
            _ => "white",
        };
    }
    match h * 360.0 {
        20.0..70.0 if v < 0.6 => "brown",
        20.0..70.0 if s < 0.45 => "beige",
        20.0..45.0 => "orange",
        45.0..70.0 => "yellow",
        70.0..165.0 => "green",
        165.0..195.0 => "cyan",
        195.0..255.0 => "blue",
        255.0..290.0 => "purple",
        290.0..340.0 => "pink",
        _ if s < 0.5 => "brown",
        _ => "red",
    }
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

    #[test]
    fn segments_are_told_by_size_and_colour_and_named_objects_by_their_names() {
        for (name, area, albedo, expected) in [
            ("segment 4", 20.0, Some([0.8; 3]), "segment 4, large white"),
            (
                "segment 4",
                0.1,
                Some([0.3, 0.0, 0.0]),
                "segment 4, small red",
            ),
            ("segment 4", 1.0, Some([0.05, 0.1, 0.4]), "segment 4, blue"),
            ("segment 9", 1.0, None, "segment 9"),
            ("wall", 20.0, Some([0.8; 3]), "wall"),
        ] {
            let object = Object {
                name: name.to_owned(),
                triangles: Vec::new(),
                area,
            };
            let albedo = albedo.map(Vec3::from_array);
            assert_eq!(described(&object, 100.0, albedo), expected);
        }
    }
}
