//! Draws the panes in their tiles. Each borrows what it shows; what it asks for is done once it is drawn.

use crate::app::layout::Pane;
use crate::app::picture::quantity::Quantity;
use crate::app::request::Requests;
use crate::app::state::{App, Jobs};
use crate::app::view::Parts;
use crate::app::{model, panels, picture, theme};
use egui::{Color32, ScrollArea, Stroke, Ui, Visuals};
use egui_tiles::{Behavior, SimplificationOptions, TabState, TileId, Tiles, UiResponse};

/// Draws panes for the tree.
pub struct Panes<'a> {
    pub app: &'a mut App,
    pub requests: &'a mut Requests,
    /// The tabs in front. Only these have a button that closes them, so that all have room for their names.
    pub front: Vec<TileId>,
}

/// Draws a pane of words and numbers.
fn words(ui: &mut Ui, pane: Pane, parts: &mut Parts<'_>, jobs: &Jobs) {
    use panels::*;
    let document = parts.document;
    let progress = &document.snapshot.progress;
    let scrolled = ScrollArea::vertical().auto_shrink(false);
    match (pane, document.capture()) {
        (Pane::Loss, _) => loss::pane(ui, progress),
        (Pane::Trade, _) => trade::pane(ui, parts, &jobs.measured),
        (Pane::Log, _) => report::log(ui, &jobs.notices),
        (Pane::Settings, _) => {
            let settings = &document.settings;
            scrolled.show(ui, |ui| settings::pane(ui, settings, parts.requests));
        }
        (Pane::Stages, _) => {
            scrolled.show(ui, |ui| report::stages(ui, progress));
        }
        (_, None) => {
            ui.weak(document.nothing_open());
        }
        (Pane::Objects, Some(capture)) => {
            let (objects, view) = (&capture.scene.objects, &mut *parts.view);
            let (selection, table) = (&view.selection, &mut view.panels.objects);
            objects::pane(ui, document, objects, selection, table, parts.requests);
        }
        (Pane::Material | Pane::Lights, _) if !document.objects_are_current() => {
            ui.weak("Reading the mesh again…");
        }
        (Pane::Material, Some(capture)) => {
            scrolled.show(ui, |ui| material::pane(ui, parts, &capture.scene));
        }
        (Pane::Lights, Some(capture)) => {
            scrolled.show(ui, |ui| lights::pane(ui, parts, &capture.scene));
        }
        (Pane::Insert, Some(capture)) => {
            scrolled.show(ui, |ui| insert::pane(ui, parts, &capture.scene));
        }
        (_, Some(capture)) => {
            scrolled.show(ui, |ui| report::capture(ui, capture, progress));
        }
    }
}

impl Behavior<Pane> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut Pane) -> UiResponse {
        let (jobs, whole) = (&self.app.jobs, ui.max_rect());
        let parts = &mut Parts {
            document: &self.app.document,
            view: &mut self.app.view,
            requests: self.requests,
        };
        // Panes that fill themselves get no background: a software renderer pays for every layer.
        match *pane {
            Pane::Picture(Quantity::Composite) => picture::hero::pane(ui, parts),
            Pane::Picture(quantity) => picture::canvas::pane(ui, parts, whole, quantity),
            Pane::Compare => picture::wipe::pane(ui, parts),
            Pane::Model => model::pane::pane(ui, parts),
            other => {
                let panel = theme::tokens(ui).panel;
                ui.painter().rect_filled(whole, 0.0, panel);
                egui::Frame::NONE.inner_margin(theme::GAP).show(ui, |ui| {
                    ui.take_available_space();
                    words(ui, other, parts, jobs);
                });
            }
        }
        self.app.perform_all(self.requests, ui.ctx());
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> egui::WidgetText {
        pane.title().into()
    }

    fn is_tab_closable(&self, _tiles: &Tiles<Pane>, tile: TileId) -> bool {
        self.front.contains(&tile)
    }

    fn close_button_outer_size(&self) -> f32 {
        11.0
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions {
            all_panes_must_have_tabs: true,
            ..SimplificationOptions::default()
        }
    }

    fn gap_width(&self, _style: &egui::Style) -> f32 {
        3.0
    }

    fn min_size(&self) -> f32 {
        120.0
    }

    fn tab_bar_color(&self, visuals: &Visuals) -> Color32 {
        theme::of(visuals).sunken
    }

    fn tab_text_color(
        &self,
        visuals: &Visuals,
        _tiles: &Tiles<Pane>,
        _tile: TileId,
        state: &TabState,
    ) -> Color32 {
        let tokens = theme::of(visuals);
        match state.active {
            true => tokens.strong,
            false => tokens.weak,
        }
    }

    fn tab_outline_stroke(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<Pane>,
        _tile: TileId,
        _state: &TabState,
    ) -> Stroke {
        Stroke::NONE
    }
}
