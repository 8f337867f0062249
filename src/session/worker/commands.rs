//! What each command does.

use crate::export::scene;
use crate::session::command::{Command, ExportRequest, ViewCamera};
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Results};
use crate::session::snapshot::{Level, Phase};
use crate::session::worker::state::Worker;
use crate::session::worker::work::Next;
use std::path::Path;

impl Worker {
    /// Carries out a command. What cannot be done beside a running solve is returned: the solve ends first.
    pub(super) fn handle(&mut self, command: Command) -> Option<Next> {
        self.touch();
        match command {
            Command::Open(source) => return Some(Next::Open(source)),
            Command::Resume(folder) => return Some(Next::Resume(folder)),
            Command::Reset => {
                self.paused = false;
                self.step = false;
                return self.capture.is_some().then_some(Next::Solve(None));
            }
            Command::Quit => return Some(Next::Quit),
            Command::Run => return self.go_on(false),
            Command::Step => return self.go_on(true),
            Command::Pause => {
                if self.solving {
                    self.paused = true;
                    self.phase = Phase::Paused;
                }
            }
            // Without a running solve there is nothing to finish.
            Command::Finish => return self.solving.then_some(Next::Wait),
            Command::Set(settings) => self.settings = *settings,
            Command::View(request) => {
                if let ViewCamera::Frame(frame) = request.camera {
                    self.inserting.look(frame);
                }
                self.views.look(request);
            }
            Command::Insert(placements) => self.inserting.place(placements),
            Command::Save(folder) => self.save(&folder),
            Command::Export(request) => self.export(&request),
        }
        None
    }

    /// Runs on, or one iteration only.
    fn go_on(&mut self, one: bool) -> Option<Next> {
        if self.solving {
            self.paused = one;
            self.step = one;
            self.phase = if one { Phase::Paused } else { Phase::Solving };
            return None;
        }
        self.capture.as_ref()?;
        self.paused = one;
        self.step = one;
        Some(Next::Solve(self.checkpoint.clone()))
    }

    /// What `Save` writes now.
    fn results(&self) -> Option<Results> {
        Some(Results {
            capture: self.capture.clone()?,
            settings: self.settings.clone(),
            estimate: self.estimate.clone(),
            progress: self.progress.clone(),
            stopped_because: match self.phase {
                Phase::Finished(termination) => Some(termination),
                _ => None,
            },
            checkpoint: self.checkpoint.clone(),
            views: Frames::default(),
            started: self.started,
            seconds_load: self.seconds_load,
        })
    }

    fn save(&mut self, folder: &Path) {
        let Some(results) = self.results() else {
            self.say(Level::Error, "save: nothing is open; open a capture first");
            return;
        };
        match save::write(folder, &results) {
            Ok(()) => self.say(Level::Info, format!("saved to {}", folder.display())),
            Err(error) => self.fail(&error),
        }
    }

    fn export(&mut self, request: &ExportRequest) {
        let Some(capture) = self.capture.clone() else {
            self.say(
                Level::Error,
                "export: nothing is open; open a capture first",
            );
            return;
        };
        let path = &request.path;
        match scene::write(&capture.scene, &self.estimate, request.format, path) {
            Ok(()) => self.say(Level::Info, format!("exported to {}", path.display())),
            Err(error) => self.fail(&error),
        }
    }
}
