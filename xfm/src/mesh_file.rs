//! Whole meshes from files and from standard input.

use std::path::Path;

use mesh_io::{Format, IndexedMesh, ReadOptions};

use crate::progress::{Progress, Unit};
use crate::{Error, interrupt};

/// Reads a whole mesh, with a progress bar; `-` is standard input.
///
/// The format is `from`, or what the extension says, or else what the content shows. Ctrl-C ends the process here, so
/// nothing may be waiting for its clean-up.
///
/// # Errors
///
/// What is wrong with the file.
pub fn read_mesh(path: &Path, from: Option<Format>) -> Result<IndexedMesh, Error> {
    let progress = Progress::new("reading", None, Unit::Bytes);
    let report = |done, total: Option<u64>| {
        if let Some(total) = total {
            progress.set_total(total);
        }
        progress.set(done);
    };
    let mut options = ReadOptions::default().with_progress(&report);
    if let Some(format) = from {
        options = options.with_format(format);
    }
    interrupt::freely(|| {
        if path.as_os_str() == "-" {
            from_standard_input(from, &options)
        } else {
            Ok(mesh_io::read_mesh_with(path, &options)?)
        }
    })
}

/// On Unix standard input has a path, and what is read from a path needs no format given.
#[cfg(unix)]
fn from_standard_input(
    _from: Option<Format>,
    options: &ReadOptions<'_>,
) -> Result<IndexedMesh, Error> {
    Ok(mesh_io::read_mesh_with(Path::new("/dev/stdin"), options)?)
}

#[cfg(not(unix))]
fn from_standard_input(
    from: Option<Format>,
    _options: &ReadOptions<'_>,
) -> Result<IndexedMesh, Error> {
    let format = from.ok_or(Error::NoFormat)?;
    Ok(mesh_io::read_mesh_from(std::io::stdin().lock(), format, "standard input")?)
}
