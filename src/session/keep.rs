//! Sessions that save by themselves: the newest state of each capture in a folder of its own, to be taken up after a kill.

use crate::compose::placement::Placement;
use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::session::save::{self, Results};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Shortest time between two saves while a solve runs.
const EVERY: Duration = Duration::from_secs(8);
/// Sessions that are kept at most; those not touched for longest go first.
const MOST: usize = 16;
/// What a session's inserted objects are written as.
const INSERTED: &str = "inserted.json";
/// What the folder of the session before is called.
const BEFORE: &str = "before";

/// Keeps the sessions of a program.
#[derive(Debug, Default)]
pub struct Keeper {
    base: Option<PathBuf>,
    capture: Option<String>,
    due: bool,
    written: Option<Instant>,
    /// The folder of the last session of the open capture.
    pub earlier: Option<PathBuf>,
}

impl Keeper {
    /// Keeps sessions under `base` from now on.
    pub fn begin(&mut self, base: PathBuf) {
        self.base = Some(base);
    }

    /// Another capture is open, told by its hash: its last session is set aside.
    ///
    /// # Errors
    /// The folder cannot be changed.
    pub fn opened(&mut self, hash: &str) -> Result<()> {
        (self.due, self.earlier) = (false, None);
        self.capture = Some(hash.to_owned());
        let Some(folder) = self.folder() else {
            return Ok(());
        };
        let (now, before) = (folder.join("now"), folder.join(BEFORE));
        if now.exists() {
            let _ = fs::remove_dir_all(&before);
            fs::rename(&now, &before).map_err(|error| Error::io(&before, &error))?;
        }
        self.earlier = before.exists().then_some(before);
        Ok(())
    }

    /// The last session was taken up: this one goes on from it.
    pub fn resumed(&mut self, hash: &str) {
        (self.due, self.earlier) = (false, None);
        self.capture = Some(hash.to_owned());
    }

    /// Something has changed that is worth keeping.
    pub fn touch(&mut self) {
        self.due = true;
    }

    /// Whether it is time to save: something has changed, and the last save is a while ago or `now` is the time.
    pub fn is_due(&self, now: bool) -> bool {
        (self.rest()).is_some_and(|rest| now || rest.is_zero())
    }

    /// How long until it is time to save; `None` where nothing is to be saved.
    pub fn rest(&self) -> Option<Duration> {
        let written = self.written.map_or(Duration::MAX, |at| at.elapsed());
        (self.base.is_some() && self.due).then(|| EVERY.saturating_sub(written))
    }

    /// Saves the state of the open capture. After a failure nothing more is kept.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(&mut self, results: &Results, inserted: &[Placement]) -> Result<()> {
        let Some(folder) = self.folder() else {
            return Ok(());
        };
        self.due = false;
        self.written = Some(Instant::now());
        let written = write(&folder.join("now"), results, inserted);
        match (&written, &self.base) {
            (Ok(()), Some(base)) => prune(base, &folder),
            _ => self.base = None,
        }
        written
    }

    fn folder(&self) -> Option<PathBuf> {
        Some(self.base.as_ref()?.join(self.capture.as_ref()?))
    }
}

fn write(folder: &Path, results: &Results, inserted: &[Placement]) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
    save::write_checkpoint(folder, results)?;
    write_atomically(&folder.join(INSERTED), |out| {
        Ok(serde_json::to_writer_pretty(out, inserted)?)
    })
}

/// The objects that were inserted in a session that is kept in a folder; none in a folder of other results.
///
/// # Errors
/// The file is broken.
pub fn inserted(folder: &Path) -> Result<Vec<Placement>> {
    let path = folder.join(INSERTED);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = fs::read(&path).map_err(|error| Error::io(&path, &error))?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Error::file(&path, error, "remove the file, which gives up the objects"))
}

/// Removes the sessions not touched for longest, but never the one in `current`.
fn prune(base: &Path, current: &Path) {
    let mut sessions: Vec<_> = (fs::read_dir(base).into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .filter(|path| path != current)
        .map(|path| {
            let touched = |name| {
                fs::metadata(path.join(name))
                    .and_then(|m| m.modified())
                    .ok()
            };
            (touched("now").max(touched(BEFORE)), path)
        })
        .collect();
    sessions.sort();
    let superfluous = (sessions.len() + 1).saturating_sub(MOST);
    for (_, path) in sessions.into_iter().take(superfluous) {
        // What cannot be removed now is tried again at the next save.
        let _ = fs::remove_dir_all(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_session_before_is_set_aside_and_the_oldest_go() {
        let base = tempfile::tempdir().expect("a folder");
        let mut keeper = Keeper::default();
        assert!(keeper.opened("a").is_ok() && keeper.earlier.is_none());
        keeper.begin(base.path().to_owned());
        keeper.opened("a").expect("opened");
        assert_eq!(keeper.earlier, None);
        keeper.touch();
        assert!(keeper.is_due(false) && keeper.is_due(true));

        let now = base.path().join("a/now");
        fs::create_dir_all(&now).expect("made");
        fs::write(now.join("mark"), "1").expect("written");
        keeper.opened("a").expect("opened");
        let before = keeper.earlier.clone().expect("an earlier session");
        assert!(before.join("mark").exists() && !now.exists());
        // Opened again with nothing kept in between, it is still there.
        keeper.opened("a").expect("opened");
        assert_eq!(keeper.earlier, Some(before));
        keeper.resumed("a");
        assert_eq!(keeper.earlier, None);

        for index in 0..MOST + 3 {
            fs::create_dir_all(base.path().join(format!("b{index:02}/now"))).expect("made");
        }
        prune(base.path(), &base.path().join("a"));
        assert_eq!(fs::read_dir(base.path()).expect("a folder").count(), MOST);
        assert!(base.path().join("a").exists());
    }
}
