//! Carries out commands.

use crate::calibrate::held_out::HoldOut;
use crate::capture::place::Coordinates;
use crate::export::picture::shown_at;
use crate::export::{light_layers, scene};
use crate::math::picture::Picture;
use crate::session::command::{Command, ExportRequest, OpenOptions};
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Results};
use crate::session::snapshot::{Level, Phase};
use crate::session::store::{SessionRecord, State};
use crate::session::view::sized::box_filter;
use crate::session::worker::state::{Begin, Next, Worker};
use crate::transport::denoise::Denoiser;
use std::path::Path;

/// Long side of a session's thumbnail in pixels.
const THUMBNAIL: u32 = 120;

impl Worker {
    /// Carries out a command. Returns what has to wait until the running solve has ended.
    pub(super) fn handle(&mut self, command: Command) -> Option<Next> {
        self.touch();
        match command {
            Command::Open(source) => {
                let options = OpenOptions {
                    hold_out: HoldOut::from(&self.state.settings),
                    check_alignment: true,
                    ..OpenOptions::default()
                };
                return Some(Next::Open(source, options, Begin::GoingOn));
            }
            Command::StartOver => {
                let open = self.state.capture.as_ref()?;
                // Without the changes of objects and coordinates by hand.
                let options = OpenOptions {
                    objects: Vec::new(),
                    coordinates: Coordinates::default(),
                    ..open.options.clone()
                };
                let source = open.source.clone();
                return Some(Next::Open(source, options, Begin::Anew));
            }
            Command::Resume(folder) => return Some(Next::Resume(folder)),
            Command::Remove(folder) => {
                if let Err(error) = self.store.remove(&folder) {
                    self.fail(&error);
                }
            }
            Command::Reset => {
                self.keep(true);
                self.store.begin_another();
                self.state.continued = None;
                (self.paused, self.step) = (false, false);
                let open = self.state.capture.as_ref()?;
                let hold_out = HoldOut::from(&self.state.settings);
                // Keep segments that were changed by hand.
                let is_cut = open.capture.segmentation.is_some() && open.options.objects.is_empty();
                return Some(match is_cut && open.options.hold_out != hold_out {
                    true => Next::Recut(Box::new(OpenOptions {
                        hold_out,
                        ..open.options.clone()
                    })),
                    false => Next::Solve(None),
                });
            }
            Command::Reframe(mut options) => {
                let go_on = self.solving && !self.paused;
                let capture = self.state.capture.as_ref()?;
                // The sender may not have seen the newest objects.
                options.objects.clone_from(&capture.options.objects);
                return Some(Next::Reframe(options, go_on));
            }
            Command::Regroup(wanted) => {
                let go_on = self.solving && !self.paused;
                if let Some(open) = &self.state.capture
                    && open.hash == wanted.hash
                    && open.options.objects != wanted.changes
                {
                    return Some(Next::Regroup(wanted, go_on));
                }
                self.state.regroupings += 1;
            }
            Command::Run => return self.go_on(false),
            Command::Step => return self.go_on(true),
            Command::Pause => {
                if self.solving {
                    self.paused = true;
                    self.state.phase = Phase::Paused;
                }
            }
            // Without a running solve there is nothing to end.
            Command::Finish => return self.solving.then_some(Next::Wait),
            Command::SolveOn => {
                (self.paused, self.step) = (false, false);
                let checkpoint = self.checkpoint.clone();
                return self
                    .state
                    .capture
                    .is_some()
                    .then_some(Next::Solve(checkpoint));
            }
            Command::Set(settings) => self.state.settings = *settings,
            // The painter has these already.
            Command::View(_) | Command::Match(_) => {}
            Command::Insert(_) => self.store.touch(),
            Command::Edit(edits) => {
                if self.state.edits != edits {
                    self.store.touch();
                    self.state.edits = edits;
                }
            }
            Command::Save(folder) => self.save(&folder),
            Command::Export(request) => self.export(&request),
            Command::SaveLayers(path) => self.save_layers(&path),
        }
        None
    }

    /// Runs on, or one iteration only.
    fn go_on(&mut self, one: bool) -> Option<Next> {
        if !self.solving && self.state.capture.is_none() {
            return None;
        }
        (self.paused, self.step) = (one, one);
        if !self.solving {
            return Some(Next::Solve(self.checkpoint.clone()));
        }
        self.state.phase = if one { Phase::Paused } else { Phase::Solving };
        None
    }

    /// The results in their current state.
    fn results(&self) -> Option<Results> {
        Some(Results {
            capture: self.state.capture.clone()?,
            settings: self.state.settings.clone(),
            estimate: self.state.estimate.clone(),
            edits: self.state.edits.clone(),
            progress: self.state.progress.clone(),
            stopped_because: match self.state.phase {
                Phase::Finished(termination) => Some(termination),
                _ => None,
            },
            checkpoint: self.checkpoint.clone(),
            views: Frames::default(),
            renderer: self.backend.renderer.clone(),
            denoiser: Some(Denoiser::best()),
            started: self.started,
            seconds_load: self.seconds_load,
        })
    }

    /// Saves the session if it is due.
    pub(super) fn keep(&mut self, now: bool) {
        if !self.store.is_due(now) || self.state.estimate.objects.is_empty() {
            return;
        }
        let Some(results) = self.results() else {
            return;
        };
        let (frame, inserted) = self.requests.shown();
        let held = SessionRecord {
            capture: results.capture.name.clone(),
            state: match self.state.phase {
                Phase::Finished(why) => State::Finished(why),
                Phase::Paused | Phase::Failed => State::Paused,
                _ => State::Solving,
            },
            precious: matches!(self.state.phase, Phase::Finished(_))
                || !self.state.edits.is_empty()
                || !inserted.is_empty()
                || !results.capture.options.objects.is_empty(),
            frame,
            inserted,
            progress: Some(self.state.progress.as_ref().clone()),
        };
        if let Err(error) = self.store.write(&results, held, self.thumbnail(frame)) {
            let message = format!("the session is not kept any longer: {error}");
            self.say(Level::Warning, message);
        }
    }

    /// A small version of the shown composite, and the exposure for its display.
    fn thumbnail(&self, frame: usize) -> Option<(Picture, f32)> {
        let capture = self.state.capture.as_ref()?;
        let (_, taken) = capture.frame(frame).ok()?;
        let picture = match self.slot.pictures().insertion {
            Some(shown) if shown.frame == frame => shown.composite.as_ref().clone(),
            _ => taken.picture(),
        };
        let long_side = picture.width.max(picture.height).max(1);
        let scale = (f64::from(THUMBNAIL) / f64::from(long_side)).min(1.0);
        let scaled = |side: u32| (f64::from(side) * scale).round().max(1.0) as u32;
        let [width, height] = [picture.width, picture.height].map(scaled);
        let small = box_filter(&picture, width, height);
        let exposure = shown_at(taken.saturation, &small.pixels);
        Some((small, exposure))
    }

    fn save(&mut self, folder: &Path) {
        let Some(results) = self.results() else {
            return self.say(Level::Error, "save: nothing is open; open a capture first");
        };
        match save::write(folder, &results) {
            Ok(()) => self.say(Level::Info, format!("saved to {}", folder.display())),
            Err(error) => self.fail(&error),
        }
    }

    fn export(&mut self, request: &ExportRequest) {
        let Some(capture) = self.state.capture.clone() else {
            let message = "export: nothing is open; open a capture first";
            return self.say(Level::Error, message);
        };
        let path = &request.path;
        let estimate = self.edited();
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
        let view = self.slot.latest().view.clone();
        let layers = view.and_then(|view| view.layers.clone());
        let Some((capture, layers)) = self.state.capture.clone().zip(layers) else {
            let message = "layers: none are traced yet; wait for the first picture";
            return self.say(Level::Error, message);
        };
        let pictures = (layers.layers.iter()).map(|(source, picture)| (*source, &**picture));
        if let Err(error) = light_layers::write(path, &capture.scene, pictures) {
            return self.fail(&error);
        }
        let (samples, path) = (layers.samples, path.display());
        let message = format!("layers at {samples} samples a pixel saved to {path}");
        self.say(Level::Info, message);
    }
}
