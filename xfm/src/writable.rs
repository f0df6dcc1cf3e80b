//! Whether a file can be written, found out before the work that it is to hold.

use std::fs::OpenOptions;
use std::io;
use std::path::{Path, PathBuf};

use crate::Error;

/// Makes sure that a file of this name can be put into its folder, which is there. Leaves nothing behind, and what is there
/// already as it is.
///
/// A device or a named pipe is not looked at: opening it may take a reader.
///
/// # Errors
///
/// [`Error::LockedFile`] where a file of this name must not be written to, [`Error::LockedFolder`] where its folder takes
/// none.
pub fn check(file: &Path) -> Result<(), Error> {
    // Through a symbolic link: the file it points at is the one to be replaced.
    let target = match file.metadata() {
        Ok(metadata) if !metadata.is_file() => return Ok(()),
        Ok(_) => {
            // It would be replaced rather than written to; whoever protected it meant that, too.
            OpenOptions::new()
                .append(true)
                .open(file)
                .map_err(|source| Error::LockedFile { file: file.to_owned(), source })?;
            file.canonicalize().unwrap_or_else(|_| file.to_owned())
        }
        Err(_) => file.to_owned(),
    };
    try_in(&folder(&target)).map_err(|source| Error::LockedFolder { file: file.to_owned(), source })
}

/// Makes sure that a folder takes scratch files.
///
/// # Errors
///
/// [`Error::Scratch`] where it does not.
pub fn check_scratch(folder: &Path) -> Result<(), Error> {
    try_in(folder).map_err(|source| Error::Scratch { folder: folder.to_owned(), source })
}

fn folder(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// A file without a name, where the system has such files: nothing is left even of a run that is killed here.
fn try_in(folder: &Path) -> io::Result<()> {
    tempfile::tempfile_in(folder).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_written_passes_and_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let [new, old] = ["new", "old"].map(|name| folder.path().join(name));
        std::fs::write(&old, "what was there before").unwrap();
        check(&new).unwrap();
        check(&old).unwrap();
        check_scratch(folder.path()).unwrap();
        assert!(!new.exists());
        assert_eq!(std::fs::read(&old).unwrap(), b"what was there before");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[test]
    fn what_is_no_folder_takes_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let message = check(&file.join("below")).unwrap_err().to_string();
        assert!(message.starts_with(&*file.join("below").to_string_lossy()), "{message}");
        let message = check_scratch(&file).unwrap_err().to_string();
        assert!(message.contains("--scratch"), "{message}");
    }
}
