//! The error type of the whole program: place, problem and remedy.

use std::any::Any;
use std::fmt;
use std::path::Path;

/// A failure that a person can act on.
///
/// Printed as one line, `place: problem; remedy`. `place` names the file and, where known, the line or field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    /// The file, field, option or stage concerned.
    pub place: String,
    /// What is wrong.
    pub problem: String,
    /// What the person can do; empty if nothing helps.
    pub remedy: String,
    /// Whether the command was used wrongly (exit code 2) rather than failed (exit code 1).
    pub usage: bool,
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// The message of a caught panic.
pub fn panic_message(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
}

impl Error {
    /// An error at `place` with a `problem` and a `remedy`.
    pub fn new(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self {
            place: place.to_string(),
            problem: problem.to_string(),
            remedy: remedy.to_string(),
            usage: false,
        }
    }

    /// An error about a file.
    pub fn file(path: &Path, problem: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self::new(path.display(), problem, remedy)
    }

    /// An input/output failure on a file.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let remedy = match error.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check the permissions",
            std::io::ErrorKind::StorageFull => "free some disk space",
            std::io::ErrorKind::ReadOnlyFilesystem => "choose a folder that can be written",
            _ => "check that the file can be read and written",
        };
        Self::file(path, error, remedy)
    }

    /// An error of wrong usage (exit code 2).
    pub fn usage(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self {
            usage: true,
            ..Self::new(place, problem, remedy)
        }
    }

    /// The process exit code for this error: 2 for wrong usage, else 1.
    pub fn exit_code(&self) -> i32 {
        if self.usage { 2 } else { 1 }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.problem)?;
        if !self.remedy.is_empty() {
            write!(f, "; {}", self.remedy)?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {}
