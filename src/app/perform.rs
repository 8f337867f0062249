//! What each action does, and when it makes sense.

use crate::app::action::Action;
use crate::app::layout::{Pane, Workspace};
use crate::app::model::lasso::Lasso;
use crate::app::pick::Pick;
use crate::app::picture::compare::Mode;
use crate::app::picture::quantity::Quantity;
use crate::app::shell::dialogs::Ask;
use crate::app::shell::files::Sheet;
use crate::app::shell::palette::Palette;
use crate::app::state::{App, Shown};
use crate::say;
use crate::session::command::{Command, Source};
use crate::session::edits::Edits;
use crate::session::snapshot::{Level, Phase};
use egui::ViewportCommand;
use glam::DVec3;

/// Whether an action changes or writes what goes by an object's place.
fn goes_by_object(action: Action) -> bool {
    matches!(
        action,
        Action::Undo
            | Action::Redo
            | Action::SwitchLamp
            | Action::ResetMaterial
            | Action::ResetEdits
            | Action::ResetLights
            | Action::SolveOn
            | Action::Save
            | Action::Export
            | Action::SaveLayers
            | Action::SavePhotographs
            | Action::SetScale
            | Action::SetGround
    )
}

impl App {
    /// Whether an action makes sense now.
    pub fn can(&self, action: Action) -> bool {
        let open = self.capture().is_some();
        if goes_by_object(action) && !self.is_steady() {
            return false;
        }
        match action {
            Action::Undo => self.history.can_undo(),
            Action::Redo => self.history.can_redo(),
            Action::SwitchLamp => self.can_switch_lamp(),
            Action::ResetMaterial => self.can_reset_material(),
            Action::JoinObjects => self.can_regroup() && self.chosen_objects().len() > 1,
            Action::RenameObject => self.can_regroup() && self.selected.is_some(),
            Action::CutOut => self.can_regroup(),
            Action::SolveOn => !self.edits.known().is_empty(),
            Action::ResetEdits => !self.edits.is_empty(),
            Action::ResetLights => self.lights_are_changed(),
            Action::Place | Action::Duplicate | Action::Delete => self.insertions.chosen.is_some(),
            Action::MeasureTrade => self.trade.doing().is_some() || self.can_measure(),
            Action::Finish => matches!(self.snapshot.phase, Phase::Solving | Phase::Paused),
            Action::SavePhotographs => self.can_write_photographs(),
            Action::CancelPhotographs => self.batch.is_some(),
            Action::Save
            | Action::SaveLayers
            | Action::Export
            | Action::Probe
            | Action::SetScale
            | Action::SetGround
            | Action::CopyPicture
            | Action::InsertObject
            | Action::Lights
            | Action::Material
            | Action::BeforeAfter
            | Action::WipeRender
            | Action::WipeNaiveOurs
            | Action::RunPause
            | Action::Step
            | Action::Reset
            | Action::StartOver
            | Action::PreviousFrame
            | Action::NextFrame
            | Action::FrameSelection
            | Action::JumpToFrame
            | Action::RenderFromHere
            | Action::AutoExposure => open,
            _ => true,
        }
    }

    /// Does what an action says.
    pub fn perform(&mut self, action: Action, ctx: &egui::Context) {
        if !self.can(action) {
            return;
        }
        match action {
            Action::OpenFolder => self.ask(Ask::Capture, ctx),
            Action::OpenRoom => self.open(Source::BuiltInRoom),
            Action::Sessions => self.sheet = Sheet::Sessions,
            Action::StartPage => self.start_page = !self.start_page,
            Action::Save => self.sheet = Sheet::save(self.capture_name()),
            Action::Export => self.sheet = Sheet::export(self.capture_name(), self.probe_point()),
            Action::SaveLayers => self.sheet = Sheet::layers(self.capture_name()),
            Action::SavePhotographs => self.sheet = Sheet::photographs(self.capture_name()),
            Action::CancelPhotographs => {
                if let Some(batch) = &self.batch {
                    batch.cancel();
                }
            }
            Action::Probe => self.pick(Pick::Probe),
            Action::SetScale => self.pick(Pick::Length(None)),
            Action::SetGround => self.pick(Pick::Ground),
            Action::Screenshot => self.screenshot(ctx),
            Action::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),

            Action::Undo => self.undo(),
            Action::Redo => self.redo(),
            Action::CopyPicture => self.copy_picture(ctx),
            Action::InsertObject => {
                self.bring_forward = Some(Pane::Insert);
                self.insertions.typing = true;
            }
            Action::Place => self.insertions.placing = !self.insertions.placing,
            Action::Duplicate => self.duplicate(),
            Action::Delete => self.insertions.delete(),
            Action::NaiveBesideOurs => {
                self.compare_pictures(Mode::SideBySide, Quantity::Naive, Quantity::Composite);
            }
            Action::WipeNaiveOurs => self.wipe_against(Quantity::Naive),
            Action::BeforeAfter => self.wipe_against(Quantity::Photograph),
            Action::WipeRender => self.wipe_against(Quantity::Render),
            Action::Lights => self.bring_forward = Some(Pane::Lights),
            Action::Material => self.bring_forward = Some(Pane::Material),
            Action::SwitchLamp => self.switch_lamp(),
            Action::ResetMaterial => self.reset_material(),
            Action::JoinObjects => self.join_objects(),
            Action::CutOut => {
                self.bring_forward = Some(Pane::Model);
                self.pick(Pick::Lasso);
            }
            Action::RenameObject => {
                self.bring_forward = Some(Pane::Objects);
                self.grouping.naming = true;
            }
            Action::ResetEdits => self.edits = Edits::default(),
            Action::ResetLights => self.reset_lights(),
            Action::Deselect => {
                // What covers the panes goes first.
                let open = !matches!(self.sheet, Sheet::Closed);
                if !(open || self.keys || self.palette.is_some() || self.start_page) {
                    self.choose(None, false);
                    self.model.lasso = Lasso::default();
                    self.insertions.placing = false;
                    self.picking = None;
                }
                self.keys = false;
                self.palette = None;
                self.sheet = Sheet::default();
                self.start_page = false;
            }

            Action::RunPause => self.run_or_pause(),
            Action::Step => self.send(Command::Step),
            Action::Finish => self.send(Command::Finish),
            Action::Reset => self.send(Command::Reset),
            Action::StartOver => self.send(Command::StartOver),
            Action::SolveOn => {
                self.send_edits();
                self.send(Command::SolveOn);
            }

            Action::MeasureTrade => {
                self.bring_forward = Some(Pane::Trade);
                self.measure_or_cancel(ctx);
            }

            Action::PreviousFrame => self.step_frame(-1),
            Action::NextFrame => self.step_frame(1),
            Action::ShowPhotograph => self.look.photograph = true,
            Action::Flip => self.compare.flip(),
            Action::CompareMode => {
                self.compare.next_mode();
                self.bring_forward = Some(Pane::Compare);
            }
            Action::Brighter => self.look.exposure += 0.5,
            Action::Darker => self.look.exposure -= 0.5,
            Action::AutoExposure => self.expose_automatically(),
            Action::ToneCurve => {
                self.look.tone = self.look.tone.next();
                self.preferences.tone = self.look.tone;
            }
            Action::FitPictures => self.look.fit(),
            Action::FrameSelection => self.frame_selection(),
            Action::JumpToFrame => self.jump_to_frame(self.frame),
            Action::RenderFromHere => self.render_from_here(),

            Action::Compose => self.preferences.workspace = Workspace::Compose,
            Action::Inspect => self.preferences.workspace = Workspace::Inspect,
            Action::Thumbnails => self.preferences.thumbnails = !self.preferences.thumbnails,
            Action::ResetLayout => self.reset_layout = true,
            Action::Larger => self.resize(ctx, Some(1.0)),
            Action::Smaller => self.resize(ctx, Some(-1.0)),
            Action::OwnSize => self.resize(ctx, None),
            Action::Theme => {
                self.preferences.light = !self.preferences.light;
                self.apply_theme(ctx);
            }
            Action::Palette => self.palette = Some(Palette::default()),
            Action::Keys => self.keys = !self.keys,
        }
    }

    /// Opens a file dialog.
    pub fn ask(&mut self, ask: Ask, ctx: &egui::Context) {
        let ctx = ctx.clone();
        self.dialogs.open(ask, move || ctx.request_repaint());
    }

    /// Shows the remembered theme.
    pub fn apply_theme(&self, ctx: &egui::Context) {
        ctx.set_theme(if self.preferences.light {
            egui::Theme::Light
        } else {
            egui::Theme::Dark
        });
    }

    /// Whether the solver runs, and would be paused by "Run / Pause".
    pub fn is_running(&self) -> bool {
        matches!(self.snapshot.phase, Phase::Solving | Phase::Loading)
    }

    fn run_or_pause(&mut self) {
        let command = if self.is_running() {
            Command::Pause
        } else {
            Command::Run
        };
        self.send(command);
    }

    /// Where a probe is taken that was not clicked: at the chosen inserted object, or at the 3D view's target.
    fn probe_point(&self) -> DVec3 {
        let chosen = self
            .insertions
            .chosen
            .and_then(|index| self.insertions.objects.get(index));
        let target = self.model.orbit.target.as_dvec3();
        let origin = self
            .capture()
            .map_or(DVec3::ZERO, |capture| capture.scene.origin);
        (chosen.and_then(|object| object.placement.at)).unwrap_or(target + origin)
    }

    fn compare_pictures(&mut self, mode: Mode, left: Quantity, right: Quantity) {
        self.compare.mode = mode;
        self.compare.left = left;
        self.compare.right = right;
        self.bring_forward = Some(Pane::Compare);
    }

    /// Puts a picture beside the changed photograph under a wipe, or takes it away where it is there.
    fn wipe_against(&mut self, quantity: Quantity) {
        let shown = self.preferences.workspace == Workspace::Compose;
        let again = shown && self.against == Some(quantity);
        self.against = (!again).then_some(quantity);
        self.preferences.workspace = Workspace::Compose;
        self.bring_forward = Some(Pane::Picture(Quantity::Composite));
    }

    fn capture_name(&self) -> &str {
        self.capture()
            .map_or("relit", |capture| capture.name.as_str())
    }

    fn duplicate(&mut self) {
        if let Some(capture) = self.capture() {
            let scene = &capture.scene;
            let aside = scene.up.any_orthonormal_vector() * scene.diameter * 0.05;
            self.insertions.duplicate(aside.as_dvec3());
        }
    }

    /// Turns the 3D view to a photograph's camera.
    pub fn jump_to_frame(&mut self, frame: usize) {
        if let Some(capture) = self.capture().cloned()
            && let Some(camera) = capture.scene.cameras.get(frame)
        {
            self.model.orbit.take_camera(&capture.scene, camera);
            self.show_frame(frame);
            self.bring_forward = Some(Pane::Model);
        }
    }

    fn frame_selection(&mut self) {
        if let Some(capture) = self.capture().cloned() {
            self.model.orbit.frame(&capture.scene, self.selected);
            self.bring_forward = Some(Pane::Model);
        }
    }

    fn render_from_here(&mut self) {
        let Some(capture) = self.capture().cloned() else {
            return;
        };
        self.shown = match &self.shown {
            Shown::Free(..) => Shown::Frame,
            Shown::Frame => Shown::Free(Box::new(self.model.orbit.camera(&capture.scene)), 0),
        };
    }

    fn screenshot(&mut self, ctx: &egui::Context) {
        let path = (1..)
            .map(|n| std::path::PathBuf::from(format!("relit-{n}.png")))
            .find(|path| !path.exists())
            .unwrap_or_default();
        self.notices
            .say(Level::Info, format!("screenshot: {}", path.display()));
        let finished = egui::ScreenshotCallback::new(move |image| {
            let bytes: Vec<u8> = image
                .pixels
                .iter()
                .flat_map(|p| [p.r(), p.g(), p.b()])
                .collect();
            let [width, height] = image.size.map(|side| side as u32);
            if let Some(picture) = image::RgbImage::from_raw(width, height, bytes)
                && let Err(error) = picture.save(&path)
            {
                say::aside(format_args!(
                    "{}: {error}; choose a folder that can be written",
                    path.display()
                ));
            }
        });
        ctx.send_viewport_cmd(ViewportCommand::Screenshot(finished));
    }
}
