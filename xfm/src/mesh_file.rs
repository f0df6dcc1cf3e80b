//! Whole meshes from files and from standard input.

use std::path::Path;

use mesh_io::{Format, Frame, IndexedMesh, ReadOptions};

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
    read(path, from, mesh_io::read_mesh_with)
}

/// As [`read_mesh`], with positions in a frame of their own where they lie far from zero.
///
/// # Errors
///
/// What is wrong with the file.
pub fn read_mesh_in_frame(
    path: &Path,
    from: Option<Format>,
) -> Result<(IndexedMesh, Frame), Error> {
    read(path, from, mesh_io::read_mesh_in_frame)
}

fn read<T>(
    path: &Path,
    from: Option<Format>,
    read: impl FnOnce(&Path, &ReadOptions<'_>) -> Result<T, mesh_io::Error>,
) -> Result<T, Error> {
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
    let spooled = if path.as_os_str() == "-" { Some(standard_input()?) } else { None };
    let path = spooled.as_deref().unwrap_or(path);
    interrupt::freely(|| Ok(read(path, &options)?))
}

/// The path of standard input. On Unix it has one, and what is read from a path needs no format given.
#[cfg(unix)]
fn standard_input() -> Result<std::path::PathBuf, Error> {
    Ok("/dev/stdin".into())
}

/// A copy of standard input, removed when dropped.
#[cfg(not(unix))]
fn standard_input() -> Result<tempfile::TempPath, Error> {
    let failed = |source| mesh_io::Error::Io {
        name: "standard input".to_owned(),
        action: "keep a copy of it",
        source,
    };
    let mut copy = tempfile::NamedTempFile::new().map_err(failed)?;
    std::io::copy(&mut std::io::stdin().lock(), &mut copy).map_err(failed)?;
    Ok(copy.into_temp_path())
}
