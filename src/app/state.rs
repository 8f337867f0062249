//! The state of the window: the newest snapshot, how it is looked at, and what is asked of the worker.

use crate::app::batch::Batch;
use crate::app::connection::Connection;
use crate::app::document::Document;
use crate::app::grouping::Grouping;
use crate::app::insertion::Insertions;
use crate::app::layout::Pane;
use crate::app::model::view::ModelView;
use crate::app::opening::Importing;
use crate::app::panels::objects::ObjectsTable;
use crate::app::pick::Pick;
use crate::app::picture::canvas::Resized;
use crate::app::picture::compare::Compare;
use crate::app::picture::irradiance::Irradiance;
use crate::app::picture::look::Look;
use crate::app::picture::quantity::Quantity;
use crate::app::picture::ramp::{self, Scales};
use crate::app::preferences::Preferences;
use crate::app::shell::dialogs::{Ask, Dialogs};
use crate::app::shell::files::Sheet;
use crate::app::shell::notices::Notices;
use crate::app::shell::palette::Palette;
use crate::app::shell::sessions::Sessions;
use crate::app::shell::status::Memory;
use crate::app::shell::thumbnails::Thumbnails;
use crate::app::trade::TradeView;
use crate::app::undo::History;
use crate::capture::camera::Intrinsics;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::scene::camera::Camera;
use crate::session::command::{Command, Placement, Source, Start, ViewCamera, ViewRequest};
use crate::session::edits::{Edited, Edits};
use crate::session::snapshot::{Level, OpenCapture, Phase, Picture, Snapshot};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;

/// What the view shows.
#[derive(Debug, Clone, Default)]
pub enum Shown {
    /// The chosen frame.
    #[default]
    Frame,
    /// The 3D view's camera, and how often it was taken over.
    Free(Box<Camera>, u64),
}

/// Everything that the window knows.
pub struct App {
    connection: Box<dyn Connection>,
    /// The newest snapshot.
    pub snapshot: Arc<Snapshot>,
    /// The parameters as edited here.
    pub settings: Settings,
    /// How pictures are looked at.
    pub look: Look,
    /// The two pictures compared.
    pub compare: Compare,
    /// The objects of the shown view, in the size of another picture of it.
    pub resized: RefCell<Resized>,
    /// The ends of the scales of false colours.
    pub scales: RefCell<Scales>,
    /// What is beside the photograph as it was changed, under a wipe.
    pub against: Option<Quantity>,
    /// The chosen photograph.
    pub frame: usize,
    /// Whether pictures are of that photograph or of the 3D view.
    pub shown: Shown,
    /// The selected object of the scene.
    pub selected: Option<u32>,
    /// The inserted objects.
    pub insertions: Insertions,
    /// Which faces are one object.
    pub grouping: Grouping,
    /// Changes made by hand to what was found.
    pub edits: Edits,
    /// The estimate with those changes.
    pub estimate: Arc<Estimate>,
    /// Steps of what is edited by hand.
    pub history: History<Document>,
    /// The 3D view.
    pub model: ModelView,
    /// The table of objects.
    pub objects: ObjectsTable,
    /// The trade of speed for exactness.
    pub trade: TradeView,
    /// What the next click in a view is asked for.
    pub picking: Option<Pick>,
    /// Photographs that are being written.
    pub batch: Option<Batch>,
    /// Events.
    pub notices: Notices,
    /// File dialogs.
    pub dialogs: Dialogs,
    /// Saving and exporting.
    pub sheet: Sheet,
    /// The list of sessions.
    pub sessions: Sessions,
    /// The command palette, while it is open.
    pub palette: Option<Palette>,
    /// Whether the window of keys is open.
    pub keys: bool,
    /// Whether the start page covers the panes.
    pub start_page: bool,
    /// The capture's path as typed.
    pub path: String,
    /// Why nothing was opened, with the remedy.
    pub trouble: Option<String>,
    /// A scan that is being imported.
    pub importing: Option<Importing>,
    /// What is remembered between runs.
    pub preferences: Preferences,
    /// How large everything was made, once it was.
    pub size: Option<f32>,
    /// Whether the window is to grow with what is in it.
    pub grows: bool,
    /// A pane to bring to the front in this pass.
    pub bring_forward: Option<Pane>,
    /// Whether the layout is to be reset in this pass.
    pub reset_layout: bool,
    /// Memory in use.
    pub memory: Memory,
    /// The strip of photographs.
    pub thumbnails: Thumbnails,
    /// The most pixels a pane showed along a side in this pass.
    pub pixels_needed: f32,
    /// Whether a pane showed the photograph as it was changed in this pass.
    pub composite_needed: bool,
    /// Whether a pane showed the re-render, or what is made of it, in this pass.
    pub render_needed: bool,
    /// Whether the light of each lamp was asked for apart in this pass.
    pub layers_needed: bool,
    /// Whether a pane showed the irradiance in this pass.
    pub irradiance_needed: bool,
    /// The irradiance of the shown view.
    pub irradiance: Irradiance,
    photograph: Option<(usize, Arc<Picture>)>,
    pending: VecDeque<Command>,
    opening: Option<Source>,
    pub(super) sent_view: Option<(Option<usize>, u64, u32, u32, bool, bool)>,
    pub(super) sent_insertions: Vec<Placement>,
    sent_finish: bool,
    pub(super) sent_edits: Edits,
    pub(super) edited: Edited,
}

impl App {
    /// A window on a session.
    pub fn new(connection: Box<dyn Connection>, preferences: Preferences) -> Self {
        let look = Look {
            tone: preferences.tone,
            ..Look::default()
        };
        Self {
            connection,
            snapshot: Arc::default(),
            settings: Settings::default(),
            look,
            compare: Compare::default(),
            resized: RefCell::default(),
            scales: RefCell::default(),
            against: None,
            frame: 0,
            shown: Shown::Frame,
            selected: None,
            insertions: Insertions::default(),
            grouping: Grouping::default(),
            edits: Edits::default(),
            estimate: Arc::default(),
            history: History::default(),
            model: ModelView::default(),
            objects: ObjectsTable::default(),
            trade: TradeView::default(),
            picking: None,
            batch: None,
            notices: Notices::default(),
            dialogs: Dialogs::default(),
            sheet: Sheet::default(),
            sessions: Sessions::default(),
            palette: None,
            keys: false,
            start_page: false,
            path: String::new(),
            trouble: None,
            importing: None,
            preferences,
            size: None,
            grows: false,
            bring_forward: None,
            reset_layout: false,
            memory: Memory::default(),
            thumbnails: Thumbnails::default(),
            photograph: None,
            pixels_needed: 0.0,
            composite_needed: false,
            render_needed: false,
            layers_needed: false,
            irradiance_needed: false,
            irradiance: Irradiance::default(),
            pending: VecDeque::new(),
            opening: None,
            sent_view: None,
            sent_insertions: Vec::new(),
            sent_finish: true,
            sent_edits: Edits::default(),
            edited: Edited::default(),
        }
    }

    /// Asks something of the worker; kept and tried again while its channel is full.
    pub fn send(&mut self, command: Command) {
        self.pending.push_back(command);
        self.flush();
    }

    /// Asks something of the worker once; false while its channel is full.
    pub(super) fn connect(&self, command: Command) -> bool {
        self.connection.send(command)
    }

    /// Opens a capture.
    pub fn open(&mut self, source: Source) {
        self.start_page = false;
        self.trouble = None;
        self.opening = Some(source.clone());
        self.send(Command::Open(source));
    }

    /// Notes what the session was started with.
    pub fn opened_with(&mut self, start: Option<&Start>) {
        self.opening = start.map(|start| match start {
            Start::Capture(source, _) => source.clone(),
            Start::Results(folder) => Source::Folder(folder.clone()),
        });
    }

    /// What is open.
    pub fn capture(&self) -> Option<&Arc<OpenCapture>> {
        self.snapshot.capture.as_ref()
    }

    /// Whether the start page is shown: nothing is open, or it was asked for.
    pub fn shows_start_page(&self) -> bool {
        self.start_page
            || (self.capture().is_none()
                && matches!(self.snapshot.phase, Phase::Idle | Phase::Failed)
                && self.opening.is_none())
    }

    /// Why nothing is open, in words.
    pub fn nothing_open(&self) -> &'static str {
        match self.snapshot.phase {
            Phase::Loading => "Reading the capture…",
            _ if self.opening.is_some() => "Reading the capture…",
            _ => "No capture is open",
        }
    }

    /// The unit of radiance: relative where photographs of 8 or 16 bits leave the scale open.
    pub fn radiance_unit(&self) -> &'static str {
        let relative = |capture: &Arc<OpenCapture>| {
            let mut photographs = capture.photographs.iter();
            photographs.any(|photograph| photograph.saturation.is_finite())
        };
        match self.capture().is_some_and(relative) {
            true => "relative units",
            false => "W/(sr·m²)",
        }
    }

    /// Number of photographs.
    pub fn frames(&self) -> usize {
        self.capture()
            .map_or(0, |capture| capture.scene.cameras.len())
    }

    /// Goes `by` photographs on, around the ends.
    pub fn step_frame(&mut self, by: isize) {
        let frames = self.frames() as isize;
        if frames > 0 {
            self.show_frame((self.frame as isize + by).rem_euclid(frames) as usize);
        }
    }

    /// Shows a photograph and what belongs to it.
    pub fn show_frame(&mut self, frame: usize) {
        self.frame = frame;
        self.shown = Shown::Frame;
    }

    /// The camera of the shown view.
    pub fn camera(&self) -> Option<&Camera> {
        match &self.shown {
            Shown::Free(camera, _) => Some(camera),
            Shown::Frame => self.capture()?.scene.cameras.get(self.frame),
        }
    }

    /// Takes in what is new and asks for what is missing. Called before every pass, also while the window is hidden.
    pub fn update(&mut self, ctx: &egui::Context) {
        let snapshot = self.connection.latest();
        if snapshot.sequence != self.snapshot.sequence {
            self.take(snapshot);
        }
        while let Some((ask, answer)) = self.dialogs.take() {
            self.answered(ask, answer, ctx);
        }
        if !ctx.input(|input| input.pointer.any_down()) {
            self.settle();
        }
        self.convert_photograph();
        self.find_irradiance();
        self.take_trade();
        self.take_batch();
        self.take_import();
        self.take_models(ctx);
        self.request();
        self.send_grouping();
        self.send_edits();
        self.flush();
        if !self.pending.is_empty() {
            ctx.request_repaint_after(std::time::Duration::from_millis(30));
        }
    }

    fn take(&mut self, snapshot: Arc<Snapshot>) {
        let other_capture = match (&self.snapshot.capture, &snapshot.capture) {
            (Some(old), Some(new)) => !Arc::ptr_eq(old, new),
            (old, new) => old.is_some() != new.is_some(),
        };
        let before = std::mem::replace(&mut self.snapshot, snapshot);
        let events = self.snapshot.events.clone();
        self.notices.take(&events);
        if before.settings != self.snapshot.settings || before.sequence == 0 {
            self.settings = self.snapshot.settings.clone();
        }
        if self.snapshot.phase == Phase::Failed {
            // Said where the person looks.
            if self.opening.take().is_some() && self.capture().is_none() {
                let errors = events.iter().rev().filter(|e| e.level == Level::Error);
                self.trouble = errors.map(|event| event.message.clone()).next();
            }
        }
        if !self.take_grouping(&before) && other_capture {
            self.capture_changed();
        }
    }

    fn capture_changed(&mut self) {
        self.frame = self.snapshot.frame.min(self.frames().saturating_sub(1));
        self.sessions.closed = false;
        self.shown = Shown::Frame;
        self.selected = None;
        self.picking = None;
        self.sent_view = None;
        self.photograph = None;
        self.insertions.take_up(&self.snapshot.inserted);
        self.grouping = Grouping::of(self.capture().map(Arc::as_ref));
        self.take_edits();
        self.sent_insertions = self.insertions.placements();
        self.model = ModelView::default();
        self.look.fit();
        self.scales = RefCell::default();
        if self.capture().is_some() {
            if let Some(Source::Folder(folder)) = self.opening.take() {
                self.preferences.opened(&folder);
            }
            self.opening = None;
            self.expose_automatically();
        }
        self.trade_of_capture();
    }

    fn find_irradiance(&mut self) {
        let view = self.view().filter(|_| self.irradiance_needed).cloned();
        self.irradiance.update(view.as_deref());
    }

    /// Puts the shown photograph's 99th percentile at 1.
    pub fn expose_automatically(&mut self) {
        let photograph = self
            .capture()
            .and_then(|capture| capture.photographs.get(self.frame));
        if let Some(photograph) = photograph {
            let stops = ramp::automatic_exposure(&photograph.pixels);
            self.look.exposure = (stops * 4.0).round() / 4.0;
        }
    }

    /// The chosen photograph, there before the worker has sent anything of its view.
    pub fn photograph(&self) -> Option<Arc<Picture>> {
        let (frame, picture) = self.photograph.as_ref()?;
        (*frame == self.frame && matches!(self.shown, Shown::Frame)).then(|| picture.clone())
    }

    fn convert_photograph(&mut self) {
        if matches!(&self.photograph, Some((frame, _)) if *frame == self.frame) {
            return;
        }
        let photograph = self
            .capture()
            .and_then(|capture| capture.photographs.get(self.frame));
        self.photograph = photograph.map(|photograph| {
            let picture = photograph.picture();
            (self.frame, Arc::new(picture))
        });
    }

    /// Asks for the view and the insertion that are shown, where they differ from those asked for.
    fn request(&mut self) {
        let Some(camera) = self.camera() else {
            return;
        };
        let side = |camera: &Intrinsics| camera.width.max(camera.height);
        let long_side = render_size(side(&camera.intrinsics), self.pixels_needed);
        let file = (self.capture())
            .and_then(|open| open.capture.frames.get(self.frame))
            .filter(|_| self.composite_needed);
        let composite = file.map_or(0, |f| render_size(side(&f.intrinsics), self.pixels_needed));
        let (render, layers) = (self.render_needed, self.layers_needed);
        let (key, view) = match &self.shown {
            Shown::Frame => (
                (Some(self.frame), 0, long_side, composite, render, layers),
                ViewCamera::Frame(self.frame),
            ),
            Shown::Free(camera, count) => (
                (None, *count, long_side, composite, render, layers),
                ViewCamera::Free(camera.clone()),
            ),
        };
        if self.sent_view != Some(key) {
            let request = ViewRequest {
                camera: view,
                long_side,
                composite,
                render,
                layers,
            };
            if self.connection.send(Command::View(request)) {
                self.sent_view = Some(key);
            }
        }
        let finish = self.insertions.finish;
        if finish != self.sent_finish && self.connection.send(Command::Match(finish)) {
            self.sent_finish = finish;
        }
        let placements = self.insertions.placements();
        if placements != self.sent_insertions
            && self.connection.send(Command::Insert(placements.clone()))
        {
            self.sent_insertions = placements;
        }
    }

    fn flush(&mut self) {
        while let Some(command) = self.pending.front() {
            if !self.connection.send(command.clone()) {
                break;
            }
            self.pending.pop_front();
        }
    }

    fn answered(&mut self, ask: Ask, answer: Option<PathBuf>, ctx: &egui::Context) {
        let Some(path) = answer else {
            self.notices.say(
                Level::Info,
                "nothing was chosen; where no file dialog opens, type the path instead",
            );
            match ask {
                Ask::Capture => self.start_page = true,
                Ask::Object => self.bring_forward = Some(Pane::Insert),
                Ask::SaveFolder | Ask::ExportFile => {}
            }
            return;
        };
        match ask {
            Ask::Capture => self.open_path(&path, ctx),
            Ask::SaveFolder | Ask::ExportFile => self.sheet.chosen(ask, path),
            Ask::Object => self.insert(path),
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
