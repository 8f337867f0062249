//! A temporary folder with the tiny room as a capture, in which the program is run.

use crate::files::write_capture;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

/// A folder that holds `room`, and whatever runs of the program leave there.
pub struct Place {
    folder: TempDir,
}

impl Place {
    /// With the capture alone.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_capture(&folder.path().join("room"));
        Self { folder }
    }

    /// A path in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program, to be run there where no display is.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_relit"));
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY");
        command
    }
}
