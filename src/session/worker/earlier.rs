//! Continues a kept session, or results of an earlier run.

use crate::capture::place::Coordinates;
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::session::edits::Edits;
use crate::session::open_capture::OpenCapture;
use crate::session::save::{self, Saved};
use crate::session::snapshot::{Level, Phase};
use crate::session::store::{self, SessionRecord, State};
use crate::session::worker::state::{Next, Worker};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) struct Earlier {
    folder: PathBuf,
    saved: Saved,
    held: Option<SessionRecord>,
    estimate: Estimate,
    edits: Edits,
    /// The capture as it was read then, if it was read differently.
    capture: Option<OpenCapture>,
}

impl Worker {
    /// Loads the last session of a capture. `None` if there is none, or if other options or parameters are requested
    /// now. `explicit_settings`: the parameters were given explicitly.
    pub(super) fn last_session(
        &mut self,
        capture: &OpenCapture,
        explicit_settings: bool,
    ) -> Option<Earlier> {
        let folder = self.store.last(&capture.hash)?;
        self.session_in(&folder, capture, explicit_settings)
            .unwrap_or_else(|error| {
                let message =
                    format!("the last session cannot be continued, so a new one begins: {error}");
                self.say(Level::Warning, message);
                None
            })
    }

    fn session_in(
        &self,
        folder: &Path,
        capture: &OpenCapture,
        explicit_settings: bool,
    ) -> Result<Option<Earlier>> {
        let mut saved = save::load(folder)?;
        let (now, then) = (&capture.options, &mut saved.options);
        let other = (now.up.is_some() && now.up != then.up)
            || (now.segments.is_some() && now.segments != then.segments)
            || (!now.reading.is_default() && now.reading != then.reading)
            || (now.coordinates != Coordinates::default() && now.coordinates != then.coordinates);
        if other || (explicit_settings && saved.settings != self.state.settings) {
            return Ok(None);
        }
        then.check_alignment = now.check_alignment;
        then.allow_outside = now.allow_outside;
        let differs = *then != *now;
        let reread = differs.then(|| (self.backend.open)(&capture.source, then));
        let reread = reread.transpose()?;
        let mut earlier = Earlier::new(folder, saved, reread.as_ref().unwrap_or(capture))?;
        earlier.capture = reread;
        Ok(Some(earlier))
    }

    /// Opens a folder of results or of a session.
    pub(super) fn resume(&mut self, folder: &Path) -> Next {
        self.keep(true);
        let before = std::mem::replace(&mut self.state.phase, Phase::Loading);
        self.publish(true);
        let loaded = save::load(folder).and_then(|saved| {
            let capture = (self.backend.open)(&saved.source, &saved.options)?;
            Ok((Earlier::new(folder, saved, &capture)?, capture))
        });
        match loaded {
            Ok((earlier, capture)) => self.go_on_with(earlier, capture),
            Err(error) => {
                self.fail(&error);
                self.recover(before)
            }
        }
    }

    /// Opens a capture in the state of an earlier run. A solve that had ended is not repeated.
    pub(super) fn go_on_with(&mut self, earlier: Earlier, capture: OpenCapture) -> Next {
        let capture = earlier.capture.unwrap_or(capture);
        let held = earlier.held.clone().unwrap_or_default();
        self.store.resume(&capture.hash, &earlier.folder, &held);
        self.adopt(capture);
        self.requests.insert(held.inserted.clone());
        self.state.inserted = Arc::new(held.inserted);
        self.state.frame = held.frame;
        self.requests.show_frame(held.frame);
        self.set_edits(earlier.edits);
        self.state.estimate = Arc::new(earlier.estimate);
        self.state.settings = earlier.saved.settings;
        self.checkpoint = earlier.saved.checkpoint;
        let reached = self.checkpoint.as_ref().map(|c| c.progress.clone());
        self.state.progress = Arc::new(held.progress.or(reached).unwrap_or_default());
        let name = earlier.folder.file_name().unwrap_or_default();
        self.state.continued = Some(name.to_string_lossy().into_owned());
        self.touch();
        self.paused = false;
        match (earlier.held.map(|held| held.state), &self.checkpoint) {
            (Some(State::Finished(why)), _) => self.state.phase = Phase::Finished(why),
            (None, None) => self.state.phase = Phase::Finished(earlier.saved.termination),
            (state, _) => {
                self.paused = state == Some(State::Paused);
                return Next::Solve(self.checkpoint.clone());
            }
        }
        Next::Wait
    }
}

impl Earlier {
    fn new(folder: &Path, saved: Saved, capture: &OpenCapture) -> Result<Self> {
        Ok(Self {
            estimate: saved.estimate_for(capture)?,
            edits: saved.edits_for(capture)?,
            held: store::read_record(folder)?,
            folder: folder.to_owned(),
            saved,
            capture: None,
        })
    }
}
