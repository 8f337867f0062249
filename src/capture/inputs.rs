//! The files that this process has read; no output may overwrite them.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

/// Canonical paths.
static READ: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);

/// Registers a file as read.
pub fn note(path: &Path) {
    // A missing file cannot be overwritten.
    if let Ok(path) = path.canonicalize() {
        READ.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(path);
    }
}

/// Whether the file at a canonical path was read.
pub fn holds(path: &Path) -> bool {
    READ.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .contains(path)
}
