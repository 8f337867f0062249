//! Files that this run of the program has read, wherever they lie: no output of it may take their place.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

/// Canonical paths.
static READ: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);

/// Remembers a file that is read.
pub fn note(path: &Path) {
    // A file that is not there will not be replaced.
    if let Ok(path) = path.canonicalize() {
        READ.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(path);
    }
}

/// Whether a file was read; its path is canonical.
pub fn holds(path: &Path) -> bool {
    READ.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .contains(path)
}
