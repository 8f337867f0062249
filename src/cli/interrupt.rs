//! Requests to end: Ctrl-C, the system's request to terminate, and a terminal that is closed. Work ends cleanly, and the program
//! with the exit code that shells expect, so that what was to follow does not. Ctrl-C again aborts.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What a shell adds to a signal's number for the exit code of a program that it ended.
const ENDED_BY_SIGNAL: i32 = 128;

/// What help says of exit codes.
pub const EXIT_CODES: &str = "Exit codes: 0 done; 1 an error; 2 wrong usage; 130 interrupted by Ctrl-C, 143 asked to terminate, 129 \
                              its terminal closed, each after what there was is saved";

/// Whether the person asked to end.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Listens for the requests.
    ///
    /// # Errors
    /// The system grants no handler.
    pub fn listen() -> Result<Self> {
        let interrupt = Self::default();
        (interrupt.register())
            .map_err(|error| Error::new("Ctrl-C handler", error, "start the program again"))?;
        Ok(interrupt)
    }

    fn register(&self) -> std::io::Result<()> {
        // A closing terminal may say so twice, so that only Ctrl-C aborts.
        let again = Arc::new(AtomicBool::new(false));
        flag::register_conditional_shutdown(SIGINT, ENDED_BY_SIGNAL + SIGINT, again.clone())?;
        flag::register(SIGINT, again)?;
        for signal in [SIGINT, SIGTERM] {
            flag::register_usize(signal, self.0.clone(), signal as usize)?;
        }
        #[cfg(unix)]
        if !is_hangup_ignored() {
            use signal_hook::consts::SIGHUP;
            flag::register_usize(SIGHUP, self.0.clone(), SIGHUP as usize)?;
        }
        Ok(())
    }

    /// Whether it came.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst) != 0
    }

    /// The program's exit code when all is saved: 0 where nobody asked.
    pub fn exit_code(&self) -> i32 {
        match self.0.load(Ordering::SeqCst) {
            0 => 0,
            signal => ENDED_BY_SIGNAL + signal as i32,
        }
    }
}

/// Whether the program was started to outlive its terminal, as by nohup.
#[cfg(unix)]
#[allow(unsafe_code, reason = "nothing safe tells how a signal is treated now")]
fn is_hangup_ignored() -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: nothing is set; what is asked for is written where there is room for it, and zeros are a valid value of it.
    let action = unsafe {
        libc::sigaction(libc::SIGHUP, std::ptr::null(), action.as_mut_ptr());
        action.assume_init()
    };
    action.sa_sigaction == libc::SIG_IGN
}
