//! Work on a thread of its own, which tells how far it is and can be ended.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Work under way. `N` is what it shows on the way, `E` what it ends with. Dropping it asks it to end.
pub struct Task<N, E> {
    name: &'static str,
    course: Arc<Course<N>>,
    thread: Option<JoinHandle<Result<E>>>,
}

/// What the thread tells and hears.
pub struct Course<N> {
    ended: AtomicBool,
    doing: Mutex<String>,
    newest: Mutex<Option<N>>,
    wake: Box<dyn Fn() + Send + Sync>,
}

impl<N> Course<N> {
    /// Says what is done now, in words.
    pub fn say(&self, doing: impl Into<String>) {
        *self.doing.lock().unwrap_or_else(PoisonError::into_inner) = doing.into();
        (self.wake)();
    }

    /// Shows something new in place of what was shown before.
    pub fn show(&self, newest: N) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(newest);
        (self.wake)();
    }

    /// Whether it is to end.
    pub fn is_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }
}

impl<N: Send + 'static, E: Send + 'static> Task<N, E> {
    /// Begins; `wake` is called whenever there is something new.
    ///
    /// # Errors
    /// The system grants no thread.
    pub fn begin(
        name: &'static str,
        wake: impl Fn() + Send + Sync + 'static,
        work: impl FnOnce(&Course<N>) -> Result<E> + Send + 'static,
    ) -> Result<Self> {
        let course = Arc::new(Course {
            ended: AtomicBool::new(false),
            doing: Mutex::default(),
            newest: Mutex::new(None),
            wake: Box::new(wake),
        });
        let shared = course.clone();
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                let end = work(&shared);
                (shared.wake)();
                end
            })
            .map_err(|error| Error::new(name, error, "close other programs and try again"))?;
        Ok(Self {
            name,
            course,
            thread: Some(thread),
        })
    }
}

impl<N, E> Task<N, E> {
    /// Asks it to end soon.
    pub fn cancel(&self) {
        self.course.ended.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked to end.
    pub fn is_cancelled(&self) -> bool {
        self.course.is_ended()
    }

    /// What it is at, in words.
    pub fn doing(&self) -> String {
        let doing = self.course.doing.lock();
        doing.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What it showed since the last call.
    pub fn newest(&self) -> Option<N> {
        let newest = self.course.newest.lock();
        newest.unwrap_or_else(PoisonError::into_inner).take()
    }

    /// How it ended, once it has; to be asked after [`Task::newest`].
    pub fn end(&mut self) -> Option<std::result::Result<E, String>> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(match thread.join() {
            Ok(end) => end.map_err(|error| error.to_string()),
            Err(_) => Err(format!("{}: internal error; try again", self.name)),
        })
    }
}

impl<N, E> Drop for Task<N, E> {
    fn drop(&mut self) {
        self.cancel();
    }
}
