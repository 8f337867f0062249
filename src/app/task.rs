//! Work on a thread of its own, which tells how far it is and can be ended.

use crate::error::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Work under way. `N` is what it shows on the way, `E` what it ends with. Dropping it asks it to end.
pub struct Task<N, E> {
    progress: Arc<Progress<N>>,
    end: Receiver<std::result::Result<E, String>>,
}

/// What the thread tells and hears.
pub struct Progress<N> {
    cancelled: AtomicBool,
    doing: Mutex<String>,
    newest: Mutex<Option<N>>,
    ctx: egui::Context,
}

impl<N> Progress<N> {
    /// Says what is done now, in words.
    pub fn say(&self, doing: impl Into<String>) {
        *locked(&self.doing) = doing.into();
        self.ctx.request_repaint();
    }

    /// Shows something new in place of what was shown before.
    pub fn show(&self, newest: N) {
        *locked(&self.newest) = Some(newest);
        self.ctx.request_repaint();
    }

    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl<N: Send + 'static, E: Send + 'static> Task<N, E> {
    /// Begins; the window is painted again whenever there is something new.
    pub fn begin(
        name: &'static str,
        ctx: &egui::Context,
        work: impl FnOnce(&Progress<N>) -> Result<E> + Send + 'static,
    ) -> Result<Self> {
        let progress = Arc::new(Progress {
            cancelled: AtomicBool::new(false),
            doing: Mutex::default(),
            newest: Mutex::new(None),
            ctx: ctx.clone(),
        });
        let shared = progress.clone();
        let (sender, end) = channel();
        std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                let end = match catch_unwind(AssertUnwindSafe(|| work(&shared))) {
                    Ok(end) => end.map_err(|error| error.to_string()),
                    Err(_) => Err(format!("{name}: internal error; try again")),
                };
                // Nobody hears it where the task was dropped.
                let _ = sender.send(end);
                shared.ctx.request_repaint();
            })
            .map_err(|error| Error::new(name, error, "close other programs and try again"))?;
        Ok(Self { progress, end })
    }
}

impl<N, E> Task<N, E> {
    /// Asks it to end soon.
    pub fn cancel(&self) {
        self.progress.cancelled.store(true, Ordering::Relaxed);
    }

    /// What it is at, in words.
    pub fn doing(&self) -> String {
        locked(&self.progress.doing).clone()
    }

    /// What it showed since the last call.
    pub fn newest(&self) -> Option<N> {
        locked(&self.progress.newest).take()
    }

    /// How it ended, once it has; to be asked after [`Task::newest`].
    pub fn end(&mut self) -> Option<std::result::Result<E, String>> {
        self.end.try_recv().ok()
    }
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<N, E> Drop for Task<N, E> {
    fn drop(&mut self) {
        self.cancel();
    }
}
