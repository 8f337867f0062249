//! Requests to terminate: Ctrl-C, SIGTERM, and a closed terminal (SIGHUP). Running work stops cleanly, saves its
//! results, and the program exits with the code that shells expect. A second Ctrl-C aborts at once.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Shells report 128 + the signal's number as the exit code of a program that a signal ended.
const ENDED_BY_SIGNAL: i32 = 128;

/// Help text on exit codes.
pub const EXIT_CODES: &str = "Exit codes: 0 done; 1 an error; 2 wrong usage; 130 interrupted by Ctrl-C, 143 asked to terminate, 129 \
                              its terminal closed, each after what there was is saved";

/// The number of the signal that asked the program to terminate; 0 if none.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Installs the signal handlers.
    pub fn listen() -> Result<Self> {
        let interrupt = Self::default();
        (interrupt.register())
            .map_err(|error| Error::new("Ctrl-C handler", error, "start the program again"))?;
        Ok(interrupt)
    }

    fn register(&self) -> std::io::Result<()> {
        // A closing terminal may send SIGHUP twice, so only a second Ctrl-C aborts.
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

    pub fn requested(&self) -> bool {
        self.0.load(Ordering::SeqCst) != 0
    }

    /// The program's exit code after saving: 0 if termination was not requested.
    pub fn exit_code(&self) -> i32 {
        match self.0.load(Ordering::SeqCst) {
            0 => 0,
            signal => ENDED_BY_SIGNAL + signal as i32,
        }
    }
}

/// Whether SIGHUP is ignored, as under nohup: the program is to outlive its terminal.
#[cfg(unix)]
#[allow(unsafe_code, reason = "no safe API reads a signal's disposition")]
fn is_hangup_ignored() -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: with a null `act`, sigaction only writes the current disposition to `oldact`; all-zero bytes are a valid
    // sigaction.
    let action = unsafe {
        libc::sigaction(libc::SIGHUP, std::ptr::null(), action.as_mut_ptr());
        action.assume_init()
    };
    action.sa_sigaction == libc::SIG_IGN
}
