//! Opening `.xfm` files.

use std::path::Path;

use xfm_format::XfmFile;

use crate::Error;

/// Opens a `.xfm` file; what is another kind of file is told how to become one.
///
/// # Errors
///
/// What is wrong with the file.
pub fn open(path: &Path) -> Result<XfmFile, Error> {
    XfmFile::open(path).map_err(|error| match error {
        xfm_format::Error::NotXfm { .. } => Error::NotXfm { file: path.to_owned() },
        other => Error::Format(other),
    })
}
