//! Opens what was given: a `.xfm` file, or a mesh that becomes one.

use std::ops::ControlFlow;
use std::path::Path;

use glam::Vec3;
use indicatif::{ProgressBar, ProgressStyle};
use tempfile::TempDir;
use xfm_build::{Input, MeshError, MeshOptions, MeshProgress, build_mesh};
use xfm_format::Precision;
use xfm_pager::{Pager, Session};

use crate::args::Args;
use crate::error::Error;

/// A model ready to be looked at.
pub(crate) struct Model {
    pub(crate) session: Session,
    pub(crate) min: Vec3,
    pub(crate) max: Vec3,
    /// Where a mesh was built; gone with the model.
    pub(crate) _built: Option<TempDir>,
}

/// Opens the file, building it first where it is a mesh.
pub(crate) fn open(args: &Args) -> Result<Model, Error> {
    let is_xfm = args.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("xfm"));
    let (file, built) = if is_xfm {
        (args.file.clone(), None)
    } else {
        let folder = tempfile::tempdir().map_err(Error::file(std::env::temp_dir()))?;
        let file = folder.path().join("model.xfm");
        build(&args.file, &file)?;
        (file, Some(folder))
    };
    let pager = Pager::open(&file, args.pager_options())?;
    let bounds = pager.file().header().bounds;
    let session = Session::new(pager, args.dependencies())?;
    let [min, max] = bounds;
    Ok(Model { session, min, max, _built: built })
}

fn build(input: &Path, output: &Path) -> Result<(), Error> {
    let bar = ProgressBar::new(100).with_style(
        ProgressStyle::with_template("{msg:10} {wide_bar} {percent:>3} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let mut open = || mesh_io::open_source(input);
    let source = open()?;
    let frame = source.frame();
    let mut options = MeshOptions::default();
    options.expected_triangles = source.triangle_count().or_else(|| source.triangle_hint());
    drop(source);
    options.write.origin = frame.origin;
    options.write.precision = if frame.double { Precision::Double } else { Precision::Single };
    let expected = options.expected_triangles;
    let mut show = |progress: MeshProgress| {
        let (message, done, total) = match progress {
            MeshProgress::Collapse(at) => ("building", at.read, expected.unwrap_or(0)),
            MeshProgress::Build(at) => ("writing", at.done, at.total),
            _ => return ControlFlow::Continue(()),
        };
        bar.set_message(message);
        bar.set_position(100 * done / total.max(done).max(1));
        ControlFlow::Continue(())
    };
    let scratch = output.parent().unwrap_or(output);
    let built = build_mesh(Input::File(&mut open), output, scratch, &options, &mut show);
    built.map_err(|source| match source {
        MeshError::Empty => Error::Empty(input.to_owned()),
        source => Error::Build { path: input.to_owned(), source },
    })?;
    bar.finish_and_clear();
    Ok(())
}
