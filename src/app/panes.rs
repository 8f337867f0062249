//! Draws the panes in their tiles. Each borrows what it shows; what it asks for is done once it is drawn.

use crate::app::layout::Pane;
use crate::app::picture::quantity::Quantity;
use crate::app::request::Requests;
use crate::app::state::App;
use crate::app::{model, panels, picture, theme};
use egui::{Color32, Stroke, Visuals};
use egui_tiles::{Behavior, SimplificationOptions, TabState, TileId, Tiles, UiResponse};

/// Draws panes for the tree.
pub struct Panes<'a> {
    /// The state they show.
    pub app: &'a mut App,
    /// What they ask for.
    pub requests: &'a mut Requests,
    /// The tabs in front. Only these have a button that closes them, so that all have room for their names.
    pub front: Vec<TileId>,
}

impl Behavior<Pane> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut egui::Ui, _tile: TileId, pane: &mut Pane) -> UiResponse {
        let (document, view, jobs) = (&self.app.document, &mut self.app.view, &self.app.jobs);
        let requests = &mut *self.requests;
        // Panes that fill themselves get no background: a software renderer pays for every layer.
        match *pane {
            Pane::Picture(Quantity::Composite) => {
                picture::hero::pane(ui, document, view, requests);
            }
            Pane::Picture(quantity) => {
                picture::canvas::pane(ui, document, view, requests, quantity);
            }
            Pane::Compare => picture::wipe::pane(ui, document, view, requests),
            Pane::Model => model::pane::pane(ui, document, view, requests),
            other => {
                let panel = theme::tokens(ui).panel;
                ui.painter().rect_filled(ui.max_rect(), 0.0, panel);
                let selected = &view.selection;
                egui::Frame::NONE.inner_margin(theme::GAP).show(ui, |ui| {
                    ui.take_available_space();
                    use panels::*;
                    let own = &mut view.panels;
                    match other {
                        Pane::Objects => {
                            objects::pane(ui, document, selected, &mut own.objects, requests);
                        }
                        Pane::Material => material::pane(ui, document, selected.object, requests),
                        Pane::Lights => {
                            let camera = view.shown.camera(document);
                            lights::pane(ui, document, selected.object, camera, requests);
                        }
                        Pane::Insert => {
                            let tool = &view.tool;
                            insert::pane(ui, document, tool, &mut own.adding, requests);
                        }
                        Pane::Settings => settings::pane(ui, &document.settings, requests),
                        Pane::Capture => capture::pane(ui, document),
                        Pane::Loss => loss::pane(ui, &document.snapshot.progress),
                        Pane::Stages => stages::pane(ui, &document.snapshot.progress),
                        Pane::Trade => {
                            let measured = &jobs.measured;
                            trade::pane(ui, document, measured, &mut own.trade, requests);
                        }
                        _ => log::pane(ui, &jobs.notices),
                    }
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
