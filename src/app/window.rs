//! The window as eframe sees it: one pass draws bars, panes and what floats over them.

use crate::app::layout::{self, Pane, Workspace};
use crate::app::pace::Pace;
use crate::app::panes::Panes;
use crate::app::picture::inspect;
use crate::app::preferences::Preferences;
use crate::app::request::{Request, Requests};
use crate::app::shell::{
    alignment, files, keys, menu, palette, sessions, start, status, thumbnails, toolbar,
};
use crate::app::state::App;
use crate::app::view::{Needed, Parts};
use crate::app::{action, model, picture, theme};
use crate::say;
use egui::{CentralPanel, Frame, Margin, Panel, Ui};
use egui_tiles::Tree;
use std::path::PathBuf;
use std::sync::Arc;

/// The window.
pub struct Window {
    /// Its state.
    pub app: App,
    /// Where its panes are.
    pub tree: Tree<Pane>,
    /// What they are arranged for.
    workspace: Workspace,
    kept: Option<PathBuf>,
    saved: Preferences,
    /// What is told of every pass.
    pub pace: Option<Arc<Pace>>,
}

impl Window {
    /// A window; `kept` is where its preferences are written.
    pub fn new(cc: &eframe::CreationContext<'_>, mut app: App, kept: Option<PathBuf>) -> Self {
        theme::install(&cc.egui_ctx);
        app.apply_theme(&cc.egui_ctx);
        if let Some(render_state) = &cc.wgpu_render_state {
            picture::gpu::install(render_state);
            model::gpu::install(render_state);
        }
        let workspace = app.preferences.workspace;
        let tree = arranged(&mut app.preferences, workspace);
        let saved = app.preferences.clone();
        Self {
            app,
            tree,
            workspace,
            kept,
            saved,
            pace: None,
        }
    }

    fn bars(&mut self, ui: &mut Ui, requests: &mut Requests) {
        let start_page = self.app.shows_start_page();
        let (app, tree) = (&mut self.app, &mut self.tree);
        let parts = &mut Parts {
            document: &app.document,
            view: &mut app.view,
            requests,
        };
        let workspace = app.preferences.workspace;
        bar(ui, Panel::top("menu"), 6, 2).show(ui, |ui| menu::bar(ui, parts, workspace, tree));
        bar(ui, Panel::top("tools"), 8, 4).show(ui, |ui| toolbar::bar(ui, parts));
        app.preferences.tone = parts.view.look.tone;
        let continued = parts.document.snapshot.continued.as_ref();
        let hidden = parts.view.shell.sessions.closed || start_page;
        if let Some(name) = continued.filter(|_| !hidden) {
            let line = Panel::top("session").exact_size(theme::ROW + 8.0);
            bar(ui, line, 8, 4).show(ui, |ui| sessions::line(ui, parts, name));
        }
        let (status, jobs) = (Panel::bottom("status").exact_size(24.0), &app.jobs);
        let (batch, renderer) = (jobs.batch.as_ref(), &jobs.renderer);
        bar(ui, status, 8, 2).show(ui, |ui| status::bar(ui, parts, batch, renderer));
        if start_page {
            return;
        }
        bar(ui, Panel::bottom("inspector").exact_size(22.0), 8, 2)
            .show(ui, |ui| inspect::bar(ui, parts.document, parts.view));
        if app.preferences.thumbnails && parts.document.frames() > 0 {
            let strip = Panel::bottom("thumbnails").exact_size(theme::THUMBNAIL + 18.0);
            bar(ui, strip, 8, 4).show(ui, |ui| thumbnails::strip(ui, parts));
        }
    }

    fn panes(&mut self, ui: &mut Ui, requests: &mut Requests) {
        let wanted = self.app.preferences.workspace;
        if wanted != self.workspace {
            let before = std::mem::replace(&mut self.workspace, wanted);
            let tree = arranged(&mut self.app.preferences, wanted);
            let tree = std::mem::replace(&mut self.tree, tree);
            *self.app.preferences.layout(before) = Some(tree);
        }
        let asked = std::mem::take(&mut self.app.view.layout);
        if asked.reset {
            self.tree = wanted.first_layout();
        }
        if let Some(pane) = asked.front {
            layout::show(&mut self.tree, pane);
        }
        let fill = theme::tokens(ui).sunken;
        let panel = CentralPanel::no_frame().frame(Frame::NONE.fill(fill));
        panel.show(ui, |ui| {
            if self.app.shows_start_page() {
                let app = &mut self.app;
                let importing = app.jobs.importing.as_ref();
                let importing = importing.map(|(_, task)| task.doing());
                let parts = &mut Parts {
                    document: &app.document,
                    view: &mut app.view,
                    requests,
                };
                start::page(ui, parts, importing, &app.preferences.recent);
                return;
            }
            self.app.view.needed = Needed::default();
            let mut panes = Panes {
                app: &mut self.app,
                requests,
                front: self.tree.active_tiles(),
            };
            self.tree.ui(&mut panes, ui);
        });
    }

    /// Writes the preferences where they differ from what was written last.
    fn save(&mut self) {
        *self.app.preferences.layout(self.workspace) = Some(self.tree.clone());
        if self.app.preferences == self.saved {
            return;
        }
        self.saved = self.app.preferences.clone();
        if let Some(path) = &self.kept
            && let Err(error) = self.saved.save(path)
        {
            let place = path.display();
            say::note(format_args!(
                "{place}: {error}; the layout is not remembered"
            ));
        }
    }
}

/// A bar with margins, in points.
fn bar(ui: &Ui, panel: Panel, x: i8, y: i8) -> Panel {
    panel.frame(Frame::side_top_panel(ui.style()).inner_margin(Margin::symmetric(x, y)))
}

/// The remembered layout of a workspace, or its first.
fn arranged(preferences: &mut Preferences, workspace: Workspace) -> Tree<Pane> {
    let kept = preferences.layout(workspace).clone();
    let kept = kept.filter(|tree| !tree.is_empty());
    kept.unwrap_or_else(|| workspace.first_layout())
}

impl eframe::App for Window {
    fn logic(&mut self, ctx: &egui::Context, _frame: &mut eframe::Frame) {
        self.app.update(ctx);
        let size = &mut self.app.preferences.size;
        self.app.view.shell.size.follow(ctx, size);
        if let Some(pace) = &self.pace {
            let size = ctx.viewport_rect().size() * ctx.pixels_per_point();
            let touched = ctx.input(|input| !input.raw.events.is_empty());
            let (pixels, running) = (size.x * size.y, self.app.document.is_running());
            pace.note(pixels as u64, touched, running);
        }
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let app = &mut self.app;
        if app.view.shell.palette.is_none() {
            app.transform_by_keys(&ctx);
            for action in action::pressed(&ctx, app.shows_start_page()) {
                app.perform(action, &ctx);
            }
        }
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        for path in dropped.iter().map(|file| file.path().to_owned()) {
            app.perform(Request::OpenPath(path), &ctx);
        }
        if !ctx.input(|input| input.pointer.has_pointer()) {
            app.view.look.cursor = None;
        }
        let mut requests = Requests::new(app.possible());
        self.bars(ui, &mut requests);
        self.app.perform_all(&mut requests, &ctx);
        self.panes(ui, &mut requests);
        let (document, view) = (&self.app.document, &mut self.app.view);
        let requests = &mut requests;
        let parts = &mut Parts {
            document,
            view,
            requests,
        };
        files::show(&ctx, parts);
        keys::show(&ctx, &mut view.shell.keys);
        palette::show(&ctx, &mut view.shell.palette, requests);
        self.app.jobs.notices.show(&ctx);
        alignment::show(&ctx, document, requests);
        self.app.perform_all(requests, &ctx);
        // A drag is saved once it has ended.
        if !ctx.input(|input| input.pointer.any_down()) {
            self.save();
        }
    }

    fn on_exit(&mut self) {
        self.save();
    }
}
