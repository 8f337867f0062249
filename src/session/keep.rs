//! Sessions that save by themselves: of each capture as many as were begun, each in a folder of its own. Opening a capture goes on
//! with the newest, and starting over leaves it as it is.

use crate::compose::placement::Placement;
use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::export::picture::write_png;
use crate::inverse::solver::{Progress, Termination};
use crate::math::picture::Picture;
use crate::session::save::{self, CHECKPOINT, Results};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Shortest time between two saves while a solve runs.
const EVERY: Duration = Duration::from_secs(8);
/// Sessions that are kept of those that never ended and in which nothing was changed by hand. All others stay.
const MAX_UNFINISHED: usize = 8;
/// What a session holds beside its estimate is written as.
const SESSION: &str = "session.json";
/// Where programs of before wrote inserted objects.
const INSERTED: &str = "inserted.json";
/// What is seen of a session in the list.
pub const THUMBNAIL: &str = "thumbnail.png";
/// Whoever has the session open holds a lock on this file.
const LOCK: &str = "in-use";

/// Where a session stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Its solve runs.
    #[default]
    Solving,
    /// Its solve is held.
    Paused,
    /// Its solve has ended.
    Finished(Termination),
}

/// What a session holds beside its estimate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// The capture's name.
    pub capture: String,
    /// Where it stands.
    pub state: State,
    /// Whether it ended once, or was changed by hand: only a person removes it.
    pub precious: bool,
    /// The photograph that was shown.
    pub frame: usize,
    /// The inserted objects.
    pub inserted: Vec<Placement>,
    /// How far its solve has come.
    #[serde(default)]
    pub progress: Option<Progress>,
}

/// A session in the list of all.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// Its folder.
    pub folder: PathBuf,
    /// The capture's name and its own.
    pub name: String,
    /// Where it stands.
    pub state: State,
    /// Whether only a person removes it.
    pub precious: bool,
    /// When it was saved last.
    pub saved: SystemTime,
}

/// Keeps the sessions of a program.
#[derive(Debug, Default)]
pub struct Keeper {
    base: Option<PathBuf>,
    capture: Option<PathBuf>,
    /// The open session's folder, locked, once it has one.
    open: Option<(PathBuf, Option<File>)>,
    precious: bool,
    due: bool,
    written: Option<Instant>,
    kept: Arc<Vec<Kept>>,
}

impl Keeper {
    /// Keeps sessions under `base`; none where there is no such folder.
    pub fn new(base: Option<PathBuf>) -> Self {
        let mut keeper = Self {
            base,
            ..Self::default()
        };
        keeper.list();
        keeper
    }

    /// The newest session of a capture, told by its hash, that no other program has open.
    pub fn last(&self, hash: &str) -> Option<PathBuf> {
        let home = self.base.as_ref()?.join(hash);
        let ours = self.open.as_ref().map(|(folder, _)| folder);
        let mut folders = self.kept.iter().map(|kept| &kept.folder);
        let free = |folder: &&PathBuf| {
            folder.starts_with(&home) && (ours == Some(*folder) || lock(folder).is_some())
        };
        folders.find(free).cloned()
    }

    /// A new session of a capture begins, told by its hash.
    pub fn begin(&mut self, hash: &str) {
        self.capture = self.base.as_ref().map(|base| base.join(hash));
        self.begin_anew();
    }

    /// Another session of the same capture begins.
    pub fn begin_anew(&mut self) {
        (self.open, self.precious, self.due) = (None, false, false);
    }

    /// Goes on with the session in a folder, or begins one where the folder is no session or another program has it open.
    pub fn go_on(&mut self, hash: &str, folder: &Path, held: &Held) {
        self.begin(hash);
        let ours = (self.base.as_ref()).is_some_and(|base| folder.starts_with(base));
        if let Some(lock) = ours.then(|| lock(folder)).flatten() {
            self.capture = folder.parent().map(Path::to_owned);
            self.open = Some((folder.to_owned(), Some(lock)));
            self.precious = held.precious;
        }
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

    /// Saves the state of the open session, with a small picture of it and the exposure to show it at. After a failure nothing more is kept.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(
        &mut self,
        results: &Results,
        held: Held,
        seen: Option<(Picture, f32)>,
    ) -> Result<()> {
        self.due = false;
        self.written = Some(Instant::now());
        self.precious |= held.precious;
        let held = Held {
            precious: self.precious,
            ..held
        };
        let written = self.folder().and_then(|folder| match folder {
            Some(folder) => write(&folder, results, &held, seen),
            None => Ok(()),
        });
        if written.is_err() {
            self.base = None;
        }
        self.list();
        self.prune();
        written
    }

    /// Removes a session for good, unless it is open.
    ///
    /// # Errors
    /// It is open, or cannot be removed.
    pub fn remove(&mut self, folder: &Path) -> Result<()> {
        let ours = self.kept.iter().any(|kept| kept.folder == folder);
        if !ours || lock(folder).is_none() {
            let remedy = "open another session first";
            return Err(Error::file(folder, "this session is open", remedy));
        }
        fs::remove_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
        self.list();
        Ok(())
    }

    /// All sessions, the newest first.
    pub fn kept(&self) -> Arc<Vec<Kept>> {
        self.kept.clone()
    }

    /// The folder of the open session, made and locked where it is still to be; `None` where none are kept.
    fn folder(&mut self) -> Result<Option<PathBuf>> {
        if let Some((folder, _)) = &self.open {
            return Ok(Some(folder.clone()));
        }
        let (Some(_), Some(capture)) = (&self.base, &self.capture) else {
            return Ok(None);
        };
        fs::create_dir_all(capture).map_err(|error| Error::io(capture, &error))?;
        for number in 1u32.. {
            let folder = capture.join(format!("session {number}"));
            match fs::create_dir(&folder) {
                Ok(()) => {
                    self.open = Some((folder.clone(), lock(&folder)));
                    return Ok(Some(folder));
                }
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(Error::io(&folder, &error)),
            }
        }
        Ok(None)
    }

    /// Looks for all sessions.
    fn list(&mut self) {
        let inside = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
        let captures = self.base.iter().flat_map(|base| inside(base));
        let folders = captures.flat_map(|capture| inside(&capture.path()));
        let mut kept: Vec<Kept> = (folders.filter_map(|entry| Kept::read(entry.path()))).collect();
        kept.sort_by(|a, b| (b.saved, &a.folder).cmp(&(a.saved, &b.folder)));
        self.kept = Arc::new(kept);
    }

    /// Removes the oldest of those that never ended and were not changed by hand.
    fn prune(&mut self) {
        let unfinished = self.kept.iter().filter(|kept| !kept.precious);
        let mut removed = false;
        for kept in unfinished.skip(MAX_UNFINISHED) {
            // What cannot be removed now is tried again at the next save.
            removed |= lock(&kept.folder).is_some() && fs::remove_dir_all(&kept.folder).is_ok();
        }
        if removed {
            self.list();
        }
    }
}

impl Kept {
    fn read(folder: PathBuf) -> Option<Self> {
        let saved = fs::metadata(folder.join(CHECKPOINT)).and_then(|m| m.modified());
        let held = held(&folder).ok()?.unwrap_or_default();
        let own = folder.file_name()?.to_string_lossy();
        Some(Self {
            saved: saved.ok()?,
            name: match held.capture.is_empty() {
                true => own.into_owned(),
                false => format!("{}, {own}", held.capture),
            },
            state: held.state,
            precious: held.precious,
            folder,
        })
    }
}

/// Takes a session for this program, as long as the result lives; `None` where another one has it.
fn lock(folder: &Path) -> Option<File> {
    let file = File::create(folder.join(LOCK)).ok()?;
    file.try_lock().is_ok().then_some(file)
}

fn write(
    folder: &Path,
    results: &Results,
    held: &Held,
    seen: Option<(Picture, f32)>,
) -> Result<()> {
    save::write_checkpoint(folder, results)?;
    write_atomically(&folder.join(SESSION), |out| {
        Ok(serde_json::to_writer(out, held)?)
    })?;
    match seen {
        Some((picture, exposure)) => write_png(&folder.join(THUMBNAIL), &picture, exposure),
        None => Ok(()),
    }
}

/// What a session's folder holds beside the estimate; `None` in a folder of other results.
///
/// # Errors
/// The file is broken.
pub fn held(folder: &Path) -> Result<Option<Held>> {
    let broken = |path: &Path, error: serde_json::Error| {
        let remedy = "remove the file, which gives up the inserted objects";
        Error::file(path, error, remedy)
    };
    let read = |name: &str| {
        let path = folder.join(name);
        let bytes = path.exists().then(|| fs::read(&path)).transpose();
        (bytes.map_err(|error| Error::io(&path, &error))).map(|bytes| (path, bytes))
    };
    if let (path, Some(bytes)) = read(SESSION)? {
        let held = serde_json::from_slice(&bytes).map_err(|error| broken(&path, error))?;
        return Ok(Some(held));
    }
    let (path, Some(bytes)) = read(INSERTED)? else {
        return Ok(None);
    };
    let inserted = serde_json::from_slice(&bytes).map_err(|error| broken(&path, error))?;
    Ok(Some(Held {
        inserted,
        precious: true,
        ..Held::default()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A session as it lies in its folder.
    fn made(base: &Path, name: &str, precious: bool) -> PathBuf {
        let folder = base.join(name);
        fs::create_dir_all(&folder).expect("made");
        let held = Held {
            capture: "room".to_owned(),
            precious,
            ..Held::default()
        };
        fs::write(
            folder.join(SESSION),
            serde_json::to_vec(&held).expect("json"),
        )
        .expect("written");
        fs::write(folder.join(CHECKPOINT), "{}").expect("written");
        folder
    }

    #[test]
    fn unfinished_sessions_never_take_the_place_of_others() {
        let base = tempfile::tempdir().expect("a folder");
        let finished = made(base.path(), "a/session 1", true);
        for index in 0..MAX_UNFINISHED + 3 {
            made(base.path(), &format!("b/session {index}"), false);
        }
        let mut keeper = Keeper::new(Some(base.path().to_owned()));
        assert_eq!(keeper.kept().len(), MAX_UNFINISHED + 4);
        keeper.prune();
        assert_eq!(keeper.kept().len(), MAX_UNFINISHED + 1);
        assert!(finished.exists());
        assert!(
            keeper
                .kept()
                .iter()
                .any(|kept| kept.name == "room, session 1")
        );
    }

    #[test]
    fn a_session_is_gone_on_with_by_one_program_and_others_begin_their_own() {
        let base = tempfile::tempdir().expect("a folder");
        let first = made(base.path(), "a/session 1", true);
        let keeper = || Keeper::new(Some(base.path().to_owned()));
        let mut one = keeper();
        assert_eq!(one.last("a"), Some(first.clone()));
        assert_eq!(one.last("b"), None);
        one.go_on("a", &first, &Held::default());
        assert!(one.remove(&first).is_err());
        let mut two = keeper();
        assert_eq!(two.last("a"), None);
        two.go_on("a", &first, &Held::default());
        let second = two.folder().expect("made").expect("a folder");
        assert_eq!(second, base.path().join("a/session 2"));
        // Starting over leaves the session as it is.
        one.begin_anew();
        assert_eq!(
            one.folder().expect("made"),
            Some(base.path().join("a/session 3"))
        );
        assert!(first.join(CHECKPOINT).exists() && one.remove(&first).is_ok() && !first.exists());
    }
}
