//! Files that are written: there whole or not at all, and whether they can be is known before the work.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::error::Error;

/// Makes sure that `out` can be written: a file in a folder that is there, or a folder that is made where it is missing.
/// Leaves nothing behind.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn check(out: &Path, is_file: bool) -> Result<(), Error> {
    let checked = match out.metadata() {
        Ok(there) if is_file && there.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(there) if is_file && !there.is_file() => return Ok(()),
        // It would be replaced rather than written to; whoever protected it meant that, too.
        Ok(_) if is_file => OpenOptions::new().append(true).open(out).map(drop),
        _ => Ok(()),
    };
    let there = if is_file { folder(out) } else { nearest(out) };
    checked.and_then(|()| tempfile::tempfile_in(&there).map(drop)).map_err(Error::file(out))
}

/// Writes a file in place of what is there; a device or a named pipe is written to.
///
/// # Errors
/// [`Error::File`]; then what was there before is there still.
pub(crate) fn write(file: &Path, bytes: &[u8]) -> Result<(), Error> {
    let written = if file.metadata().is_ok_and(|there| !there.is_file()) {
        std::fs::write(file, bytes)
    } else {
        write_whole(file, bytes)
    };
    written.map_err(Error::file(file))
}

fn write_whole(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // Through a symbolic link: the file it points at is the one to be replaced.
    let target = file.canonicalize().unwrap_or_else(|_| file.to_owned());
    let mut builder = tempfile::Builder::new();
    builder.prefix(".xfm-view-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What any new file gets, less what the process' mask takes away.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut temporary = builder.tempfile_in(folder(&target))?;
    temporary.write_all(bytes)?;
    temporary.persist(&target).map(drop).map_err(|failed| failed.error)
}

fn folder(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The folder that is there already, of those that lead to this one.
fn nearest(folder: &Path) -> PathBuf {
    let there = folder.ancestors().find(|folder| folder.exists());
    there.unwrap_or(Path::new(".")).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_written_anew_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        for text in ["first", "then"] {
            check(&file, true).unwrap();
            write(&file, text.as_bytes()).unwrap();
            assert_eq!(std::fs::read(&file).unwrap(), text.as_bytes());
        }
        check(&folder.path().join("new/folder"), false).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        write(&file, b"here").unwrap();
        let outs =
            [("", true), ("file/below.png", true), ("no/a.png", true), ("file/below", false)];
        for (out, is_file) in outs {
            let out = folder.path().join(out);
            let message = check(&out, is_file).unwrap_err().to_string();
            assert!(message.starts_with(&*out.to_string_lossy()), "{message}");
            assert!(message.ends_with("the free space"), "{message}");
        }
    }
}
