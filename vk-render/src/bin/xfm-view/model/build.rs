//! A mesh becomes a hierarchy before it is looked at.

use std::fs::{self, Metadata};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use tempfile::TempDir;
use xfm_build::{Input, MeshError, MeshOptions, MeshProgress, build_mesh};
use xfm_format::Precision;

use crate::error::Error;
use crate::model::opening::Progress;
use crate::output;

/// Files of this many bytes and more are built beside themselves, so that the second look is quick.
const LARGE_BYTES: u64 = 64 << 20;

/// Where the hierarchy of a mesh lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Cache {
    /// Beside meshes from 64 MiB on, else in a temporary place
    #[default]
    Auto,
    /// Beside the mesh, as its name and `.xfm`; used again while it is newer than the mesh
    Beside,
    /// In a temporary place, gone with the viewer
    Temporary,
}

/// A hierarchy, and the folder that goes with it where it is temporary.
pub(super) type Built = (PathBuf, Option<TempDir>);

/// Finds the hierarchy of a mesh or builds it, telling `progress`, which may break it off.
pub(super) fn find_or_build(
    input: &Path,
    cache: Cache,
    progress: &Progress,
) -> Result<Built, Error> {
    let known = fs::metadata(input).map_err(Error::file(input))?;
    if known.is_dir() {
        return Err(Error::Folder(input.to_owned()));
    }
    let mut name = input.as_os_str().to_owned();
    name.push(".xfm");
    let beside = PathBuf::from(name);
    if cache != Cache::Temporary && fs::metadata(&beside).is_ok_and(|m| is_newer(&m, &known)) {
        return Ok((beside, None));
    }
    if cache == Cache::Beside || (cache == Cache::Auto && known.len() >= LARGE_BYTES) {
        match output::check(&beside, true).and_then(|()| build(input, &beside, progress)) {
            Ok(()) => return Ok((beside, None)),
            // There it may not be written, or there is no room; another disk may do.
            Err(Error::File { .. } | Error::Build { source: MeshError::Build(_), .. })
                if cache == Cache::Auto => {}
            Err(error) => return Err(error),
        }
    }
    let folder = tempfile::Builder::new()
        .prefix("xfm-view-")
        .tempdir()
        .map_err(Error::file(std::env::temp_dir()))?;
    let file = folder.path().join("model.xfm");
    build(input, &file, progress)?;
    Ok((file, Some(folder)))
}

fn is_newer(built: &Metadata, mesh: &Metadata) -> bool {
    matches!((built.modified(), mesh.modified()), (Ok(built), Ok(mesh)) if built > mesh)
}

fn build(input: &Path, output: &Path, progress: &Progress) -> Result<(), Error> {
    let mut open = || mesh_io::open_source(input);
    let source = open()?;
    let frame = source.frame();
    let mut options = MeshOptions::default();
    options.expected_triangles = source.triangle_count().or_else(|| source.triangle_hint());
    drop(source);
    options.write.origin = frame.origin;
    options.write.precision = if frame.double { Precision::Double } else { Precision::Single };
    let expected = options.expected_triangles;
    let mut show = |step: MeshProgress| {
        match step {
            MeshProgress::Collapse(at) => {
                progress.tell(0, at.read, expected.or(at.expected).unwrap_or(0));
            }
            MeshProgress::Build(at) => progress.tell(1, at.done, at.total),
            _ => {}
        }
        if progress.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let scratch = output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    build_mesh(Input::File(&mut open), output, scratch, &options, &mut show).map_err(|source| {
        match source {
            MeshError::Empty => Error::Empty(input.to_owned()),
            source => Error::Build { path: input.to_owned(), source },
        }
    })?;
    Ok(())
}
