//! Opens what was given: a `.xfm` file, or a mesh that becomes one.

use std::path::Path;

use glam::Vec3;
use indicatif::{ProgressBar, ProgressStyle};
use tempfile::TempDir;
use xfm_format::{Precision, WriteOptions};
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
    bar.set_message("reading");
    let reading = |done: u64, total: Option<u64>| {
        bar.set_position(total.map_or(0, |total| 100 * done / total.max(1)));
    };
    let options = mesh_io::ReadOptions::default().with_progress(&reading);
    let (mesh, frame) = mesh_io::read_mesh_in_frame(input, &options)?;
    let repaired = halfedge::repair(&mesh.positions, &mesh.triangles)
        .map_err(|source| Error::Repair { path: input.to_owned(), source })?;
    drop(mesh);
    if repaired.mesh.num_faces() == 0 {
        return Err(Error::Empty(input.to_owned()));
    }
    bar.set_message("building");
    let forest = mergetree::build(
        repaired.mesh,
        &repaired.positions,
        &mergetree::BuildOptions::default(),
        &|share| bar.set_position((100.0 * share) as u64),
    )
    .map_err(|source| Error::Build { path: input.to_owned(), source })?;
    bar.set_message("writing");
    let mut options = WriteOptions::default();
    options.origin = frame.origin;
    options.precision = if frame.double { Precision::Double } else { Precision::Single };
    xfm_format::write(&forest, output, &options)?;
    bar.finish_and_clear();
    Ok(())
}
