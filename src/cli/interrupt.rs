//! Ctrl-C: once to end cleanly, twice to abort.

use crate::error::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an aborted program, as shells count it (128 + SIGINT).
pub const ABORTED: i32 = 130;

/// Whether the person asked to end.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens for Ctrl-C and for the request to terminate.
    ///
    /// # Errors
    /// The system grants no handler.
    pub fn listen() -> Result<Self> {
        let interrupt = Self::default();
        let asked = interrupt.0.clone();
        ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::SeqCst) {
                std::process::exit(ABORTED);
            }
        })
        .map_err(|error| Error::new("Ctrl-C handler", error, "start the program again"))?;
        Ok(interrupt)
    }

    /// Whether it came.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
