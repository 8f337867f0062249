//! What each command does.

use crate::export::{light_layers, scene};
use crate::inverse::held_out::HoldOut;
use crate::session::command::{Command, ExportRequest, OpenOptions, ViewCamera};
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Results};
use crate::session::snapshot::{Level, Phase};
use crate::session::worker::state::Worker;
use crate::session::worker::work::Next;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// How long views have more of the solver's time after another one was asked for …
const LOOKED: Duration = Duration::from_secs(2);
/// … and after lamps, materials or inserted objects were changed, whose pictures a person waits for.
const CHANGED: Duration = Duration::from_secs(15);

impl Worker {
    /// Carries out a command. What cannot be done beside a running solve is returned: the solve ends first.
    pub(super) fn handle(&mut self, command: Command) -> Option<Next> {
        self.touch();
        match command {
            Command::Open(source) => {
                let options = OpenOptions {
                    hold_out: HoldOut::from(&self.settings),
                    check_alignment: true,
                    ..OpenOptions::default()
                };
                return Some(Next::Open(source, options));
            }
            Command::Resume(folder) => return Some(Next::Resume(folder)),
            Command::Reset => {
                self.paused = false;
                self.step = false;
                let open = self.capture.as_ref()?;
                let hold_out = HoldOut::from(&self.settings);
                // Segments that were changed by hand stay.
                let is_cut = open.capture.cut.is_some() && open.options.objects.is_empty();
                return Some(match is_cut && open.options.hold_out != hold_out {
                    true => Next::Recut(hold_out),
                    false => Next::Solve(None),
                });
            }
            Command::Reframe(mut options) => {
                let go_on = self.solving && !self.paused;
                let capture = self.capture.as_ref()?;
                // Whoever asked may not have seen the newest objects.
                options.objects.clone_from(&capture.options.objects);
                return Some(Next::Reframe(options, go_on));
            }
            Command::Regroup(wanted) => {
                let go_on = self.solving && !self.paused;
                let open = self.capture.as_ref();
                if open
                    .is_some_and(|c| c.hash == wanted.hash && c.options.objects != wanted.changes)
                {
                    return Some(Next::Regroup(wanted, go_on));
                }
                self.regroupings += 1;
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
            Command::SolveOn => {
                self.paused = false;
                self.step = false;
                let checkpoint = self.checkpoint.clone();
                return self.capture.is_some().then_some(Next::Solve(checkpoint));
            }
            Command::Set(settings) => self.settings = *settings,
            Command::View(request) => {
                self.answer_for(LOOKED);
                if let ViewCamera::Frame(frame) = request.camera {
                    self.inserting.look(frame);
                }
                self.views.look(request);
            }
            Command::Insert(placements) => {
                self.answer_for(CHANGED);
                self.keeper.touch();
                self.inserting.place(placements);
            }
            Command::Match(matched) => self.inserting.take_finish(matched),
            Command::Edit(edits) => {
                if self.edits != edits {
                    self.answer_for(CHANGED);
                    self.keeper.touch();
                    self.edits = edits;
                    self.views.look_again();
                    self.inserting.update();
                }
            }
            Command::Keep(base) => {
                self.keeper.begin(base);
                self.set_aside();
            }
            Command::Save(folder) => self.save(&folder),
            Command::Export(request) => self.export(&request),
            Command::SaveLayers(path) => self.save_layers(&path),
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
            edits: self.edits.clone(),
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

    /// Sets the last session of the open capture aside, and says that it is there.
    pub(super) fn set_aside(&mut self) {
        let Some(capture) = self.capture.clone() else {
            return;
        };
        if let Err(error) = self.keeper.opened(&capture.hash) {
            self.fail(&error);
        } else if self.keeper.earlier.is_some() {
            let said = "the last session of this capture is kept; File > Take up the last session";
            self.say(Level::Info, said);
        }
    }

    /// Saves the session where that is due.
    pub(super) fn keep(&mut self, now: bool) {
        if !self.keeper.is_due(now) || self.estimate.objects.is_empty() {
            return;
        }
        if let Some(results) = self.results()
            && let Err(error) = (self.keeper).write(&results, self.inserting.placements())
        {
            let said = format!("the session is not kept any longer: {error}");
            self.say(Level::Warning, said);
        }
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
        let estimate = match &request.edits {
            Some(edits) => Arc::new(edits.apply(&self.estimate)),
            None => self.edited(),
        };
        match scene::write(&capture.scene, &estimate, request.format, path) {
            Ok(()) => {
                self.say(Level::Info, format!("exported to {}", path.display()));
                if let Some(lost) = scene::lost(&estimate, request.format) {
                    self.say(Level::Warning, lost);
                }
            }
            Err(error) => self.fail(&error),
        }
    }

    fn save_layers(&mut self, path: &Path) {
        let view = self.views.shown();
        let layers = view.and_then(|view| view.layers.clone());
        let Some((capture, layers)) = self.capture.clone().zip(layers) else {
            self.say(
                Level::Error,
                "layers: none are there; open the pane Lights and wait for its first picture",
            );
            return;
        };
        let pictures = (layers.layers.iter()).map(|(source, picture)| (*source, &**picture));
        match light_layers::write(path, &capture.scene, pictures) {
            Ok(()) => self.say(
                Level::Info,
                format!(
                    "layers at {} samples a pixel saved to {}",
                    layers.samples,
                    path.display()
                ),
            ),
            Err(error) => self.fail(&error),
        }
    }
}
