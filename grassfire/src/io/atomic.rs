//! Writing without half-written files.

use std::io::{BufWriter, Write};
use std::path::Path;

use super::IoError;

/// Writes a file so that readers see either the old or the new one, never a part.
///
/// 1. A temporary file is made in the same folder. 2. `write` fills it. 3. It is flushed to the disk and renamed.
///
/// # Errors
/// [`IoError::Write`]; the temporary file is gone then and an old file is untouched.
pub fn atomic_write(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), IoError> {
    let fail = |source| IoError::Write {
        file: path.display().to_string(),
        source,
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".grassfire-").suffix(".tmp");
    #[cfg(unix)]
    {
        // Temporary files are private by default; the finished file should follow the umask like any other.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(folder).map_err(fail)?;
    let mut buffer = BufWriter::with_capacity(1 << 16, temporary);
    write(&mut buffer).map_err(fail)?;
    let temporary = buffer.into_inner().map_err(|e| fail(e.into_error()))?;
    temporary.as_file().sync_all().map_err(fail)?;
    temporary.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_leaves_the_old_file_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        atomic_write(&path, |w| w.write_all(b"old")).unwrap();
        let failed = atomic_write(&path, |w| {
            w.write_all(b"half of the new")?;
            Err(std::io::Error::other("disk on fire"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn missing_folder_is_named() {
        let error = atomic_write(Path::new("no/such/folder/a.txt"), |_| Ok(())).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("no/such/folder/a.txt: cannot be written"),
            "{error}"
        );
    }
}
