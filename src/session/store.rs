//! Sessions that are saved automatically. A capture may have several, each in a folder of its own. Opening a capture
//! continues the newest; starting over leaves it unchanged.

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

/// Shortest time between two saves during a solve.
const SAVE_INTERVAL: Duration = Duration::from_secs(8);
/// Most sessions kept that neither finished nor have edits; all others are kept anyway.
const MAX_UNFINISHED: usize = 8;
/// File of a session's state beside the estimate.
const SESSION: &str = "session.json";
/// File in which earlier versions stored inserted objects.
const INSERTED: &str = "inserted.json";
/// File of the picture for the list of sessions.
pub const THUMBNAIL: &str = "thumbnail.png";
/// File that is locked while a program has the session open.
const LOCK: &str = "in-use";

/// State of a session's solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Running.
    #[default]
    Solving,
    /// Paused.
    Paused,
    /// Ended.
    Finished(Termination),
}

/// The content of `session.json`: a session's state beside its estimate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SessionRecord {
    /// The capture's name.
    pub capture: String,
    /// State of its solve.
    pub state: State,
    /// Whether it finished once or has edits; such a session is only deleted by the user.
    pub precious: bool,
    /// The frame that was shown.
    pub frame: usize,
    /// The inserted objects.
    pub inserted: Vec<Placement>,
    /// Progress of its solve.
    #[serde(default)]
    pub progress: Option<Progress>,
}

/// A session in the list.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// Its folder.
    pub folder: PathBuf,
    /// Name of the capture and of the session.
    pub name: String,
    /// State of its solve.
    pub state: State,
    /// Whether only the user deletes it.
    pub precious: bool,
    /// Time of the last save.
    pub saved: SystemTime,
}

/// Saves and lists sessions.
#[derive(Debug, Default)]
pub(crate) struct SessionStore {
    base: Option<PathBuf>,
    capture: Option<PathBuf>,
    /// Folder and lock of the open session, once it has been saved.
    open: Option<(PathBuf, Option<File>)>,
    precious: bool,
    due: bool,
    written: Option<Instant>,
    kept: Arc<Vec<Kept>>,
}

impl SessionStore {
    /// Keeps sessions in the folder `base`; without one, none are kept.
    pub fn new(base: Option<PathBuf>) -> Self {
        let mut store = Self {
            base,
            ..Self::default()
        };
        store.list();
        store
    }

    /// The newest session of a capture, by its hash, that no other program has open.
    pub fn last(&self, hash: &str) -> Option<PathBuf> {
        let home = self.base.as_ref()?.join(hash);
        let open_here = self.open.as_ref().map(|(folder, _)| folder);
        let mut folders = self.kept.iter().map(|kept| &kept.folder);
        let free = |folder: &&PathBuf| {
            folder.starts_with(&home) && (open_here == Some(*folder) || lock(folder).is_some())
        };
        folders.find(free).cloned()
    }

    /// Begins a new session of a capture, by its hash.
    pub fn begin(&mut self, hash: &str) {
        self.capture = self.base.as_ref().map(|base| base.join(hash));
        self.begin_another();
    }

    /// Begins another session of the same capture.
    pub fn begin_another(&mut self) {
        (self.open, self.precious, self.due) = (None, false, false);
    }

    /// Continues the session in a folder. Begins a new one if the folder is none, or another program has it open.
    pub fn resume(&mut self, hash: &str, folder: &Path, held: &SessionRecord) {
        self.begin(hash);
        let in_base = (self.base.as_ref()).is_some_and(|base| folder.starts_with(base));
        if let Some(lock) = in_base.then(|| lock(folder)).flatten() {
            self.capture = folder.parent().map(Path::to_owned);
            self.open = Some((folder.to_owned(), Some(lock)));
            self.precious = held.precious;
        }
    }

    /// Marks the session as changed.
    pub fn touch(&mut self) {
        self.due = true;
    }

    /// Whether to save: the session has changed, and the last save is long enough ago, or `now`.
    pub fn is_due(&self, now: bool) -> bool {
        (self.rest()).is_some_and(|rest| now || rest.is_zero())
    }

    /// Time until the next save; `None` if nothing has changed.
    pub fn rest(&self) -> Option<Duration> {
        let written = self.written.map_or(Duration::MAX, |at| at.elapsed());
        (self.base.is_some() && self.due).then(|| SAVE_INTERVAL.saturating_sub(written))
    }

    /// Saves the open session, with a thumbnail and its exposure. After a failure nothing more is saved.
    pub fn write(
        &mut self,
        results: &Results,
        held: SessionRecord,
        seen: Option<(Picture, f32)>,
    ) -> Result<()> {
        self.due = false;
        self.written = Some(Instant::now());
        self.precious |= held.precious;
        let held = SessionRecord {
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

    /// Deletes a session, unless it is open.
    pub fn remove(&mut self, folder: &Path) -> Result<()> {
        let is_kept = self.kept.iter().any(|kept| kept.folder == folder);
        if !is_kept || lock(folder).is_none() {
            let remedy = "open another session first";
            return Err(Error::file(folder, "this session is open", remedy));
        }
        fs::remove_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
        self.list();
        Ok(())
    }

    /// All sessions, newest first.
    pub fn kept(&self) -> Arc<Vec<Kept>> {
        self.kept.clone()
    }

    /// The folder of the open session, created and locked if need be; `None` if none are kept.
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

    /// Lists all sessions.
    fn list(&mut self) {
        let inside = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
        let captures = self.base.iter().flat_map(|base| inside(base));
        let folders = captures.flat_map(|capture| inside(&capture.path()));
        let mut kept: Vec<Kept> = (folders.filter_map(|entry| Kept::read(entry.path()))).collect();
        kept.sort_by(|a, b| (b.saved, &a.folder).cmp(&(a.saved, &b.folder)));
        self.kept = Arc::new(kept);
    }

    /// Deletes the oldest sessions that neither finished nor have edits.
    fn prune(&mut self) {
        let unfinished = self.kept.iter().filter(|kept| !kept.precious);
        let mut removed = false;
        for kept in unfinished.skip(MAX_UNFINISHED) {
            // Deletion is tried again at the next save.
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
        let held = read_record(&folder).ok()?.unwrap_or_default();
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

/// Locks a session for as long as the result lives; `None` if another program has it open.
fn lock(folder: &Path) -> Option<File> {
    let file = File::create(folder.join(LOCK)).ok()?;
    file.try_lock().is_ok().then_some(file)
}

fn write(
    folder: &Path,
    results: &Results,
    held: &SessionRecord,
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

/// Reads the state of a session's folder; `None` in another folder of results.
///
/// # Errors
/// The file is broken.
pub fn read_record(folder: &Path) -> Result<Option<SessionRecord>> {
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
    Ok(Some(SessionRecord {
        inserted,
        precious: true,
        ..SessionRecord::default()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A session as it lies in its folder.
    fn made(base: &Path, name: &str, precious: bool) -> PathBuf {
        let folder = base.join(name);
        fs::create_dir_all(&folder).expect("made");
        let held = SessionRecord {
            capture: "room".to_owned(),
            precious,
            ..SessionRecord::default()
        };
        let record = serde_json::to_vec(&held).expect("json");
        fs::write(folder.join(SESSION), record).expect("written");
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
        let mut store = SessionStore::new(Some(base.path().to_owned()));
        assert_eq!(store.kept().len(), MAX_UNFINISHED + 4);
        store.prune();
        assert_eq!(store.kept().len(), MAX_UNFINISHED + 1);
        assert!(finished.exists());
        let kept = store.kept();
        assert!(kept.iter().any(|kept| kept.name == "room, session 1"));
    }

    #[test]
    fn a_session_is_gone_on_with_by_one_program_and_others_begin_their_own() {
        let base = tempfile::tempdir().expect("a folder");
        let first = made(base.path(), "a/session 1", true);
        let store = || SessionStore::new(Some(base.path().to_owned()));
        let mut one = store();
        assert_eq!(one.last("a"), Some(first.clone()));
        assert_eq!(one.last("b"), None);
        one.resume("a", &first, &SessionRecord::default());
        assert!(one.remove(&first).is_err());
        let mut two = store();
        assert_eq!(two.last("a"), None);
        two.resume("a", &first, &SessionRecord::default());
        let second = two.folder().expect("made").expect("a folder");
        assert_eq!(second, base.path().join("a/session 2"));
        // Starting over leaves the session as it is.
        one.begin_another();
        let third = one.folder().expect("made").expect("a folder");
        assert_eq!(third, base.path().join("a/session 3"));
        assert!(first.join(CHECKPOINT).exists() && one.remove(&first).is_ok() && !first.exists());
    }
}
