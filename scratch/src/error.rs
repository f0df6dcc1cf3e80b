//! What can go wrong.

use std::io;
use std::path::PathBuf;

/// A scratch file could not be made, written or read.
#[derive(Debug, thiserror::Error)]
#[error("scratch file in {}: {source}; check its permissions and free space, or choose another folder", folder.display())]
pub struct Error {
    /// The folder it is in.
    pub folder: PathBuf,
    /// What the operating system says.
    pub source: io::Error,
}
