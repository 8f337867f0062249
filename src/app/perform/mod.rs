//! What each request does, and when an action makes sense. The one way in which panes, menus and keys change things.

mod click;
mod insert;
mod open;
mod photographs;
mod regroup;
mod trade;

use crate::app::action::{Action, Needs};
use crate::app::layout::{Pane, Workspace};
use crate::app::model::lasso::Lasso;
use crate::app::picture::copy::as_seen;
use crate::app::picture::look::Mode;
use crate::app::picture::quantity::Quantity;
use crate::app::request::{Request, Requests};
use crate::app::shell::dialogs::Ask;
use crate::app::shell::palette::Palette;
use crate::app::shell::sheet::Sheet;
use crate::app::state::App;
use crate::app::tool::Pick;
use crate::inverse::settings::Settings;
use crate::session::command::{Command, Source};
use crate::session::edits::{Edits, ObjectEdit};
use crate::session::snapshot::{Level, Phase};
use egui::{Context, Theme, ViewportCommand};
use glam::DVec3;
use std::collections::HashSet;

impl App {
    /// All actions that make sense now.
    pub fn possible(&self) -> HashSet<Action> {
        let all = Action::ALL.iter().copied();
        all.filter(|&action| self.can(action)).collect()
    }

    /// Whether an action makes sense now.
    fn can(&self, action: Action) -> bool {
        let document = &self.document;
        let ready = match action.needs() {
            Needs::Nothing => true,
            Needs::Capture => document.capture().is_some(),
            Needs::CurrentObjects => document.can_regroup(),
        };
        // What it needs is there; now whether it would do something.
        let selection = &self.view.selection;
        ready
            && match action {
                Action::Undo => document.history.can_undo(),
                Action::Redo => document.history.can_redo(),
                Action::SwitchLamp => self.edited_object().is_some_and(|o| document.is_lamp(o)),
                Action::ResetMaterial => (self.edited_object())
                    .is_some_and(|o| document.edits.object(o) != ObjectEdit::default()),
                Action::JoinObjects => selection.all().len() > 1,
                Action::RenameObject => selection.object.is_some(),
                Action::SolveOn => !document.edits.known().is_empty(),
                Action::ResetEdits => !document.edits.is_empty(),
                Action::ResetLights => document.lights_are_changed(),
                Action::Place | Action::Duplicate | Action::Delete => {
                    document.insertions.chosen.is_some()
                }
                Action::MeasureTrade => {
                    self.jobs.measured.measuring.is_some() || self.can_measure()
                }
                Action::Finish => matches!(document.snapshot.phase, Phase::Solving | Phase::Paused),
                Action::SavePhotographs => self.can_write_photographs(),
                Action::CancelPhotographs => self.jobs.batch.is_some(),
                _ => true,
            }
    }

    /// Does all that was asked.
    pub fn perform_all(&mut self, requests: &mut Requests, ctx: &Context) {
        for request in requests.take() {
            self.perform(request, ctx);
            // Some panes were drawn before.
            ctx.request_repaint();
        }
    }

    /// Does what was asked.
    pub fn perform(&mut self, request: impl Into<Request>, ctx: &Context) {
        let request = request.into();
        if !matches!(request, Request::Place(..)) {
            // It may remove or replace the object that the pointer moves.
            self.view.tool.transform = None;
        }
        match request {
            Request::Act(action) => self.act(action, ctx),
            Request::Click(clicked, more) => self.clicked(clicked, more),
            Request::Select(object, more) => self.view.selection.select(object, more),
            Request::Reveal(object) => {
                self.view.selection.select(Some(object), false);
                self.view.panels.objects.reveal = true;
            }
            Request::Show(frame) => self.view.shown.show(frame),
            Request::LookThrough(frame) => self.look_through(frame),
            Request::Open(source) => self.open(source),
            Request::OpenPath(path) => self.open_path(&path, ctx),
            Request::Resume(folder) => self.resume(folder),
            Request::CancelImport => self.jobs.importing = None,
            Request::Browse(ask) => self.jobs.dialogs.open(ask, ctx),
            Request::Insert(file) => self.insert(file),
            Request::Choose(index) => self.document.insertions.chosen = Some(index),
            Request::Place(index, to) => {
                if let Some(object) = self.document.insertions.objects.get_mut(index) {
                    *object = to;
                    self.document.insertions.chosen = Some(index);
                }
            }
            Request::Hide(index, hidden) => {
                if let Some(object) = self.document.insertions.objects.get_mut(index) {
                    object.hidden = hidden;
                }
            }
            Request::Finish(finish) => self.document.insertions.finish = finish,
            Request::Edit(object, edit) => self.document.edits.set(object, edit),
            Request::Light(objects, gain) => self.document.set_gain(&objects, gain),
            Request::Rename(object, name) => self.rename_object(object, &name),
            Request::CutOut(faces) => self.cut_out(faces),
            Request::Set(settings) => {
                self.document.settings = Settings::clone(&settings);
                self.send(Command::Set(settings));
            }
            Request::Stop(curve, stop) => self.choose_stop(curve, stop),
            Request::KeepTrade => self.keep_trade(),
            Request::Photographs(wanted) => self.write_photographs(&wanted, ctx),
            Request::Length(found, metres) => self.set_length(found, metres),
            Request::Send(command) => self.send(command),
            Request::Say(level, message) => self.say(level, message),
        }
    }

    /// Does what an action says, where it makes sense.
    fn act(&mut self, action: Action, ctx: &Context) {
        if !self.can(action) {
            return;
        }
        match action {
            Action::OpenFolder => self.jobs.dialogs.open(Ask::Capture, ctx),
            Action::OpenRoom => self.open(Source::BuiltInRoom),
            Action::Sessions => self.view.shell.sheet = Sheet::Sessions,
            Action::StartPage => self.view.shell.start.asked ^= true,
            Action::Save => self.view.shell.sheet = Sheet::save(self.capture_name()),
            Action::Export => {
                self.view.shell.sheet = Sheet::export(self.capture_name(), 0, self.probe_point())
            }
            Action::SaveLayers => self.view.shell.sheet = Sheet::layers(self.capture_name()),
            Action::SavePhotographs => {
                self.view.shell.sheet = Sheet::photographs(self.capture_name())
            }
            Action::CancelPhotographs => {
                if let Some(batch) = &self.jobs.batch {
                    batch.task.cancel();
                }
            }
            Action::Probe => self.view.tool.pick(Pick::Probe),
            Action::SetScale => self.view.tool.pick(Pick::Length(None)),
            Action::SetGround => self.view.tool.pick(Pick::Ground),
            Action::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),

            Action::Undo | Action::Redo => self.undo_or_redo(action == Action::Undo),
            Action::CopyPicture => self.copy_picture(ctx),
            Action::InsertObject => {
                self.view.bring_forward(Pane::Insert);
                self.view.panels.adding.typing = true;
            }
            Action::Place => self.view.tool.placing ^= true,
            Action::Duplicate => self.duplicate(),
            Action::Delete => {
                self.document.insertions.delete();
                self.view.tool.placing = false;
            }
            Action::NaiveBesideOurs => {
                let compare = &mut self.view.compare;
                compare.mode = Mode::SideBySide;
                (compare.left, compare.right) = (Quantity::Naive, Quantity::Composite);
                self.view.bring_forward(Pane::Compare);
            }
            Action::WipeNaiveOurs => self.wipe_against(Quantity::Naive),
            Action::BeforeAfter => self.wipe_against(Quantity::Photograph),
            Action::WipeRender => self.wipe_against(Quantity::Render),
            Action::Lights => self.view.bring_forward(Pane::Lights),
            Action::Material => self.view.bring_forward(Pane::Material),
            Action::SwitchLamp => {
                if let Some(object) = self.edited_object() {
                    self.document.switch_lamp(object);
                }
            }
            Action::ResetMaterial => {
                if let Some(object) = self.edited_object() {
                    self.document.edits.set(object, ObjectEdit::default());
                }
            }
            Action::JoinObjects => self.join_objects(),
            Action::CutOut => {
                self.view.bring_forward(Pane::Model);
                self.view.tool.pick(Pick::Lasso);
            }
            Action::RenameObject => {
                self.view.bring_forward(Pane::Objects);
                self.view.panels.objects.naming = true;
            }
            Action::ResetEdits => self.document.edits = Edits::default(),
            Action::ResetLights => self.document.reset_lights(),
            Action::Deselect => self.deselect(),

            Action::RunPause if self.document.is_running() => self.send(Command::Pause),
            Action::RunPause => self.send(Command::Run),
            Action::Step => self.send(Command::Step),
            Action::Finish => self.send(Command::Finish),
            Action::Reset => self.send(Command::Reset),
            Action::StartOver => self.send(Command::StartOver),
            Action::SolveOn => {
                self.jobs.worker.send_edits(&self.document);
                self.send(Command::SolveOn);
            }

            Action::MeasureTrade => {
                self.view.bring_forward(Pane::Trade);
                self.measure_or_cancel(ctx);
            }

            Action::PreviousFrame => self.view.shown.step(-1, self.document.frames()),
            Action::NextFrame => self.view.shown.step(1, self.document.frames()),
            Action::ShowPhotograph => self.view.look.photograph = true,
            Action::Flip => self.view.compare.flip(),
            Action::CompareMode => {
                self.view.compare.mode = self.view.compare.mode.next();
                self.view.bring_forward(Pane::Compare);
            }
            Action::Brighter => self.view.look.exposure += 0.5,
            Action::Darker => self.view.look.exposure -= 0.5,
            Action::AutoExposure => self.expose_automatically(),
            Action::ToneCurve => self.view.look.tone = self.view.look.tone.next(),
            Action::FitPictures => self.view.look.fit(),
            Action::FrameSelection => self.frame_selection(),
            Action::JumpToFrame => self.look_through(self.view.shown.frame),
            Action::RenderFromHere => {
                let camera = Box::new(self.view.model.orbit.camera());
                let before = self.view.shown.free.take();
                self.view.shown.free = before.is_none().then_some(camera);
            }

            Action::Compose => self.preferences.workspace = Workspace::Compose,
            Action::Inspect => self.preferences.workspace = Workspace::Inspect,
            Action::Thumbnails => self.preferences.thumbnails ^= true,
            Action::ResetLayout => self.view.layout.reset = true,
            Action::Larger => self.resize(ctx, Some(1.0)),
            Action::Smaller => self.resize(ctx, Some(-1.0)),
            Action::OwnSize => self.resize(ctx, None),
            Action::Theme => {
                self.preferences.light = !self.preferences.light;
                self.apply_theme(ctx);
            }
            Action::BlenderKeys => self.preferences.blender_keys ^= true,
            Action::Palette => self.view.shell.palette = Some(Palette::default()),
            Action::Keys => self.view.shell.keys ^= true,
        }
    }

    /// The selected object, where something is known of it that can be edited.
    fn edited_object(&self) -> Option<usize> {
        self.document.estimated(self.view.selection.object)
    }

    fn undo_or_redo(&mut self, undo: bool) {
        let before = self.document.insertions.objects.clone();
        self.document.undo_or_redo(undo);
        if self.document.insertions.objects != before {
            self.view.tool.placing = false;
        }
    }

    /// Closes whatever covers the panes; if nothing does, clears selection and tool.
    fn deselect(&mut self) {
        let shell = &mut self.view.shell;
        let open = !matches!(shell.sheet, Sheet::Closed) || shell.start.asked;
        if !(open || shell.keys || shell.palette.is_some()) {
            self.view.selection.select(None, false);
            self.view.model.lasso = Lasso::default();
            self.view.tool.placing = false;
            self.view.tool.pick = None;
        }
        shell.keys = false;
        shell.palette = None;
        shell.sheet = Sheet::Closed;
        shell.start.asked = false;
    }

    /// Shows the remembered theme.
    pub fn apply_theme(&self, ctx: &Context) {
        ctx.set_theme(Theme::from_dark_mode(!self.preferences.light));
    }

    /// Where a light probe is taken if no point was clicked: at the chosen inserted object, or at the 3D view's target.
    fn probe_point(&self) -> DVec3 {
        let chosen = self.document.insertions.chosen();
        let target = self.view.model.orbit.target.as_dvec3();
        let capture = self.document.capture();
        let origin = capture.map_or(DVec3::ZERO, |open| open.scene.origin);
        (chosen.and_then(|(_, object)| object.at)).unwrap_or(target + origin)
    }

    /// Puts a picture beside the changed photograph under a wipe, or takes it away where it is there.
    fn wipe_against(&mut self, quantity: Quantity) {
        let shown = self.preferences.workspace == Workspace::Compose;
        let against = &mut self.view.compare.against;
        let again = shown && *against == Some(quantity);
        *against = (!again).then_some(quantity);
        self.preferences.workspace = Workspace::Compose;
        (self.view).bring_forward(Pane::Picture(Quantity::Composite));
    }

    fn resize(&mut self, ctx: &Context, steps: Option<f32>) {
        let chosen = &mut self.preferences.size;
        self.view.shell.size.resize(ctx, chosen, steps);
    }

    fn capture_name(&self) -> &str {
        self.document.capture().map_or("relit", |open| &open.name)
    }

    fn duplicate(&mut self) {
        if let Some(capture) = self.document.capture() {
            let scene = &capture.scene;
            let aside = scene.up.any_orthonormal_vector() * scene.diameter * 0.05;
            self.document.insertions.duplicate(aside.as_dvec3());
        }
    }

    /// Copies the picture under the pointer, or the re-render, whole and as it is seen, to the clipboard.
    fn copy_picture(&mut self, ctx: &Context) {
        let cursor = self.view.look.cursor;
        let quantity = cursor.map_or(Quantity::Render, |cursor| cursor.over);
        let name = quantity.name();
        let Some(drawn) = self.view.drawn(&self.document, quantity) else {
            return self.say(Level::Warning, format!("copy: there is no {name} yet"));
        };
        ctx.copy_image(as_seen(&drawn, &self.view.look));
        self.say(Level::Info, format!("{name} copied to the clipboard"));
    }

    /// Shows a photograph, and turns the 3D view to its camera.
    fn look_through(&mut self, frame: usize) {
        if let Some(capture) = self.document.capture()
            && let Some(camera) = capture.scene.cameras.get(frame)
        {
            self.view.model.orbit.take_camera(&capture.scene, camera);
            self.view.shown.show(frame);
            self.view.bring_forward(Pane::Model);
        }
    }

    fn frame_selection(&mut self) {
        if let Some(capture) = self.document.capture() {
            let selected = self.view.selection.object;
            self.view.model.orbit.frame(&capture.scene, selected);
            self.view.bring_forward(Pane::Model);
        }
    }
}
