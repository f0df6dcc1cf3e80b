//! Opening `.xfm` files.

use std::path::Path;

use mesh_io::Frame;
use xfm_format::{Header, Precision, Storage, XfmFile};

use crate::Error;

/// The frame of the input that the positions of a file are in.
pub fn frame(header: &Header) -> Frame {
    Frame { origin: header.origin, double: header.precision == Precision::Double }
}

/// Opens a `.xfm` file; what is another kind of file is told how to become one.
///
/// # Errors
///
/// What is wrong with the file.
pub fn open(path: &Path) -> Result<XfmFile, Error> {
    XfmFile::open(path).map_err(|error| named(error, path))
}

/// The same of a file that something else reads.
///
/// # Errors
///
/// What is wrong with the file.
pub fn from_storage(storage: Box<dyn Storage>, path: &Path) -> Result<XfmFile, Error> {
    XfmFile::from_storage(storage, path).map_err(|error| named(error, path))
}

fn named(error: xfm_format::Error, path: &Path) -> Error {
    match error {
        xfm_format::Error::NotXfm { .. } => Error::NotXfm { file: path.to_owned() },
        other => Error::Format(other),
    }
}
