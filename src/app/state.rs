//! Everything that the window knows. Panes borrow parts of it and return requests.

use crate::app::document::Document;
use crate::app::preferences::Preferences;
use crate::app::shell::dialogs::Dialogs;
use crate::app::shell::notices::Notices;
use crate::app::shell::status::Batch;
use crate::app::task::Task;
use crate::app::trade::Measured;
use crate::app::view::ViewState;
use crate::app::worker::{Connection, Worker};
use crate::render::Renderer;
use crate::session::command::{Command, Source};
use crate::session::snapshot::{Level, Phase};
use std::path::PathBuf;

/// Everything that the window knows.
pub struct App {
    /// What a person would save or undo.
    pub document: Document,
    /// What is shown and how.
    pub view: ViewState,
    /// What runs.
    pub jobs: Jobs,
    /// What is remembered between runs.
    pub preferences: Preferences,
}

/// What runs beside the window: the worker, and work on threads of its own.
pub struct Jobs {
    /// The worker.
    pub worker: Worker,
    /// What traces the paths of pictures.
    pub renderer: Renderer,
    /// Photographs that are being written.
    pub batch: Option<Batch>,
    /// A scan that is being imported, and the folder of the capture that is made of it.
    pub importing: Option<(PathBuf, Task<(), Vec<String>>)>,
    /// The trade of speed for exactness, read or being measured.
    pub measured: Measured,
    /// File dialogs.
    pub dialogs: Dialogs,
    /// What is said of all that runs.
    pub notices: Notices,
}

impl App {
    /// A window on a session.
    pub fn new(connection: Box<dyn Connection>, preferences: Preferences) -> Self {
        let mut view = ViewState::default();
        view.look.tone = preferences.tone;
        Self {
            document: Document::default(),
            view,
            jobs: Jobs {
                worker: Worker::new(connection),
                renderer: Renderer::processor(),
                batch: None,
                importing: None,
                measured: Measured::default(),
                dialogs: Dialogs::default(),
                notices: Notices::default(),
            },
            preferences,
        }
    }

    /// Asks something of the worker; kept and tried again while its channel is full.
    pub fn send(&mut self, command: Command) {
        self.jobs.worker.send(command);
    }

    /// Says something.
    pub fn say(&mut self, level: Level, message: impl Into<String>) {
        self.jobs.notices.say(level, message);
    }

    /// Opens a capture.
    pub fn open(&mut self, source: Source) {
        self.view.shell.start.asked = false;
        self.view.shell.start.problem = None;
        self.document.opening = Some(source.clone());
        self.send(Command::Open(source));
    }

    /// Whether the start page is shown: nothing is open, or it was asked for.
    pub fn shows_start_page(&self) -> bool {
        let document = &self.document;
        let idle = matches!(document.snapshot.phase, Phase::Idle | Phase::Failed);
        self.view.shell.start.asked
            || (idle && document.capture().is_none() && document.opening.is_none())
    }
}
