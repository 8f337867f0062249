//! What happens before every pass, also while the window is hidden: taking in what is new, and asking for what is missing.

use crate::app::layout::Pane;
use crate::app::model::view::ModelView;
use crate::app::picture::drawn::Derived;
use crate::app::picture::ramp;
use crate::app::shell::dialogs::Ask;
use crate::app::state::App;
use crate::capture::camera::Intrinsics;
use crate::session::command::{Source, ViewCamera, ViewRequest};
use crate::session::snapshot::{Level, Phase, Snapshot};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

impl App {
    /// Takes in what is new and asks for what is missing.
    pub fn update(&mut self, ctx: &egui::Context) {
        let snapshot = self.jobs.worker.latest();
        if snapshot.sequence != self.document.snapshot.sequence {
            self.take(snapshot);
        }
        while let Some((ask, answer)) = self.jobs.dialogs.take() {
            self.answered(ask, answer, ctx);
        }
        let held = ctx.input(|input| input.pointer.any_down());
        if !held && self.view.tool.transform.is_none() {
            self.document.record();
        }
        let (derived, shown) = (&mut self.view.derived, &self.view.shown);
        derived.convert_photograph(&self.document, shown.frame);
        let view = shown.view(&self.document);
        let view = view.filter(|_| self.view.needed.irradiance);
        derived.irradiance.update(view.map(Arc::as_ref));
        self.take_trade();
        self.take_batch();
        self.take_import();
        self.take_models(ctx);
        if self.view.shown.camera(&self.document).is_some() {
            self.request_view();
            self.jobs.worker.send_insertions(&self.document);
        }
        self.jobs.worker.send_regroups(&self.document);
        self.jobs.worker.send_edits(&self.document);
        self.document.apply_edits();
        if !self.jobs.worker.flush() {
            ctx.request_repaint_after(Duration::from_millis(30));
        }
    }

    fn take(&mut self, snapshot: Arc<Snapshot>) {
        let before = std::mem::replace(&mut self.document.snapshot, snapshot);
        let now = self.document.snapshot.clone();
        let open = |snapshot: &Snapshot| snapshot.capture.as_ref().map(Arc::as_ptr);
        let other_capture = open(&before) != open(&now);
        self.jobs.notices.take(&now.events);
        if before.settings != now.settings || before.sequence == 0 {
            self.document.settings = now.settings.clone();
        }
        if now.phase == Phase::Failed
            && self.document.opening.take().is_some()
            && now.capture.is_none()
        {
            // Said where the person looks.
            let mut errors = now.events.iter().rev().filter(|e| e.level == Level::Error);
            self.view.shell.start.problem = errors.next().map(|event| event.message.clone());
        }
        if !self.take_regrouped(&before) && other_capture {
            self.capture_changed();
        }
    }

    fn capture_changed(&mut self) {
        let last = self.document.frames().saturating_sub(1);
        self.view.shown.show(self.document.snapshot.frame.min(last));
        self.view.shell.sessions.closed = false;
        self.view.selection.select(None, false);
        self.view.tool = Default::default();
        self.view.derived = Derived::default();
        self.view.model = ModelView::default();
        self.view.panels.objects.renamed = None;
        self.view.look.fit();
        self.document.start();
        self.jobs.worker.has(&self.document);
        let (opening, open) = (&mut self.document.opening, &self.document.snapshot.capture);
        let opening = opening.take_if(|_| open.is_some());
        if let Some(Source::Folder(folder)) = opening {
            self.preferences.opened(&folder);
        }
        self.expose_automatically();
        self.trade_of_capture();
    }

    /// Puts the shown photograph's 99th percentile at 1.
    pub fn expose_automatically(&mut self) {
        let (capture, frame) = (self.document.capture(), self.view.shown.frame);
        if let Some(photograph) = capture.and_then(|open| open.photographs.get(frame)) {
            let stops = ramp::automatic_exposure(&photograph.pixels);
            self.view.look.exposure = (stops * 4.0).round() / 4.0;
        }
    }

    /// Asks for what the panes show, where it differs from what was asked for.
    fn request_view(&mut self) {
        let (document, shown, needed) = (&self.document, &self.view.shown, &self.view.needed);
        let Some(camera) = shown.camera(document) else {
            return;
        };
        let size = |k: &Intrinsics| render_size(k.width.max(k.height), needed.pixels);
        let long_side = size(&camera.intrinsics);
        let capture = document.capture().filter(|_| needed.composite);
        let file = capture.and_then(|open| open.capture.frames.get(shown.frame));
        let composite = file.map_or(0, |frame| size(&frame.intrinsics));
        self.jobs.worker.send_view(&ViewRequest {
            camera: match &shown.free {
                Some(camera) => ViewCamera::Free(camera.clone()),
                None => ViewCamera::Frame(shown.frame),
            },
            long_side,
            composite,
            render: needed.render,
            layers: needed.layers,
        });
    }

    fn answered(&mut self, ask: Ask, answer: Option<PathBuf>, ctx: &egui::Context) {
        if answer.is_none() {
            let hint = "nothing was chosen; where no file dialog opens, type the path instead";
            self.say(Level::Info, hint);
        }
        match (ask, answer) {
            (Ask::Capture, Some(path)) => self.open_path(&path, ctx),
            (Ask::Capture, None) => self.view.shell.start.asked = true,
            (Ask::Object, Some(path)) => self.insert(path),
            (Ask::Object, None) => self.view.bring_forward(Pane::Insert),
            (_, Some(path)) => self.view.shell.sheet.chosen(ask, path),
            (_, None) => {}
        }
    }
}

/// The smallest of a few sizes that fills the panes, and no more than there is.
fn render_size(full: u32, needed: f32) -> u32 {
    [256, 384, 512, 768, 1024, 1536, 2048]
        .into_iter()
        .find(|&size| size as f32 >= needed)
        .unwrap_or(u32::MAX)
        .min(full)
}
