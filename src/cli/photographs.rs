//! Writes composited photographs with a progress bar; Ctrl-C stops after the last complete one.

use crate::cli::interrupt::Interrupt;
use crate::cli::progress::{LENGTH, bar};
use crate::error::Result;
use crate::render::Renderer;
use crate::say;
use crate::session::photographs::Photographs;
use std::path::PathBuf;

/// Writes photographs and prints the paths of their files. Returns the exit code.
///
/// # Errors
/// A file cannot be read or written.
pub fn write_with_progress(
    work: &Photographs,
    renderer: &Renderer,
    prefix: &dyn Fn(usize) -> PathBuf,
) -> Result<i32> {
    let interrupt = Interrupt::listen()?;
    let bar = bar("{bar:24} photograph {msg}, {eta} left");
    let written = work.write_with(renderer, prefix, &|doing| {
        bar.set_position((f64::from(doing.fraction) * LENGTH as f64) as u64);
        bar.set_message(format!("{:03}", doing.frame));
        !interrupt.requested()
    });
    bar.finish_and_clear();
    let written = written?;
    for warning in &written.warnings {
        say::warning(warning);
    }
    let (done, all) = (written.photographs, work.frames.len());
    if done < all {
        say::note(format_args!(
            "interrupted after {done} of {all} photographs"
        ));
    }
    for path in &written.files {
        say::line(path.display());
    }
    Ok(interrupt.exit_code())
}
