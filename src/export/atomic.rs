//! Writes files atomically: complete or not at all.

use crate::capture::read::confine::folder_of;
use crate::error::{Error, Result};
use crate::export::overwrite;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Why a writer gave up: an I/O error, or any other with a message.
pub type WriteError = Box<dyn std::error::Error + Send + Sync>;

/// Writes a file through `write`. `path` then holds either the complete new content or what it held before.
///
/// Writes a temporary file in the same folder, flushes and renames it. Creates missing folders. Permissions are those of new files.
///
/// # Errors
/// The file is a capture's or of results (see [`overwrite`]), the folder or file cannot be written, the disk is full, or
/// `write` fails; nothing is left behind.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), WriteError>,
) -> Result<()> {
    let io = |error: std::io::Error| Error::io(path, &error);
    // Renaming would replace a device or pipe by a file.
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        let problem = "exists and is no regular file";
        return Err(Error::file(path, problem, "name another file"));
    }
    overwrite::check(path)?;
    let folder = folder_of(path);
    std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;

    let temporary = temporary_names(0o666).tempfile_in(folder).map_err(io)?;

    let mut writer = BufWriter::new(temporary.as_file().try_clone().map_err(io)?);
    write(&mut writer).map_err(|error| match error.downcast::<std::io::Error>() {
        Ok(error) => Error::io(path, &error),
        // The encoders' own errors may hide that the disk is full.
        Err(error) => {
            let remedy = "nothing was written there; see whether the disk has room for it";
            Error::file(path, error, remedy)
        }
    })?;
    writer.flush().map_err(io)?;
    temporary.as_file().sync_all().map_err(io)?;
    temporary.persist(path).map_err(|error| io(error.error))?;
    Ok(())
}

/// Names temporary files and folders, and sets their permissions before the umask.
pub(super) fn temporary_names(mode: u32) -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".relit-").suffix(".partial");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// Writes bytes to a file atomically; see [`write_atomically`].
///
/// # Errors
/// The folder or file cannot be written.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |writer| Ok(writer.write_all(bytes)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("new/a.txt");
        write_bytes(&path, b"old").expect("first write");
        let error = write_atomically(&path, |writer| {
            writer.write_all(b"half of the new")?;
            Err("the numbers ran out".into())
        })
        .expect_err("the writer failed");
        assert_eq!(error.problem, "the numbers ran out");
        assert_eq!(std::fs::read(&path).expect("still there"), b"old");
        let entries = std::fs::read_dir(folder.path().join("new")).expect("folder exists");
        assert_eq!(entries.count(), 1);
    }

    #[test]
    fn a_folder_in_the_way_is_an_error_naming_the_path() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let error = write_bytes(folder.path(), b"x").expect_err("a folder is there");
        assert!(error.place.contains(&folder.path().display().to_string()));
        let file = folder.path().join("file");
        write_bytes(&file, b"x").expect("a file");
        assert!(write_bytes(&file.join("below"), b"x").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_was_written_as_the_umask_says() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("temporary folder");
        let ours = folder.path().join("ours");
        let plain = folder.path().join("plain");
        write_bytes(&ours, b"x").expect("ours");
        std::fs::write(&plain, b"x").expect("plain");
        let mode = |path: &Path| std::fs::metadata(path).expect("file").permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
