//! A file that is there whole or not at all.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// A file beside the one it will become; gone when dropped before that.
#[derive(Debug)]
pub(crate) struct TemporaryFile {
    path: PathBuf,
    file: NamedTempFile,
}

impl TemporaryFile {
    /// Creates it in the folder of `path`.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".xfm-").suffix(".tmp");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // What any new file gets, less what the process' mask takes away.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        Ok(Self { path: path.into(), file: builder.tempfile_in(folder(path))? })
    }

    /// The name it will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn file(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// Writes it to the disk and gives it its name.
    pub fn persist(self) -> io::Result<()> {
        self.file.as_file().sync_all()?;
        self.file.persist(&self.path).map_err(|failed| failed.error)?;
        // Makes the renaming last through a power failure, where the system can. A folder that may be written but not
        // read cannot be opened; the file is there all the same.
        #[cfg(unix)]
        if let Ok(folder) = File::open(folder(&self.path)) {
            return folder.sync_all();
        }
        Ok(())
    }
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
