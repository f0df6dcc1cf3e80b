//! With the whole mesh in memory.

use std::path::Path;
use std::time::Instant;

use mergetree::{BuildOptions, Forest};
use mesh_io::{Format, Frame, IndexedMesh};
use xfm_format::WriteOptions;

use super::plan::{Mode, Plan};
use super::report::{Built, Stages};
use super::write_options;
use crate::mesh_file::read_mesh_in_frame;
use crate::progress::{Progress, Unit};
use crate::repaired::{self, Repaired};
use crate::{Error, interrupt};

/// Reads, repairs, builds and writes.
///
/// # Errors
///
/// An input that cannot be read, has nothing in it, or is too large for the memory; an output that cannot be written.
pub fn build(
    input: &Path,
    from: Option<Format>,
    output: &Path,
    levels: u32,
    plan: &Plan,
) -> Result<Built, Error> {
    let start = Instant::now();
    let (mesh, frame): (IndexedMesh, Frame) = read_mesh_in_frame(input, from)?;
    let read = start.elapsed();
    let input_triangles = mesh.triangles.len() as u64;
    plan.check_in_core(input, input_triangles)?;
    let start = Instant::now();
    let (forest, repaired) = to_forest(input, mesh)?;
    let collapse = start.elapsed();
    interrupt::check()?;
    let start = Instant::now();
    let options: WriteOptions = write_options(levels, frame);
    let written = xfm_format::write(&forest, output, &options)?;
    Ok(Built {
        mode: Mode::InCore,
        input_triangles,
        nodes: forest.nodes.len() as u64,
        base_triangles: forest.base.faces.len() as u64,
        repaired,
        written,
        scratch_bytes: 0,
        stages: Stages { read, collapse, write: start.elapsed(), ..Stages::default() },
        resumed: false,
    })
}

/// Repairs the mesh and builds its forest. Nothing is on the disk yet, so Ctrl-C may end the process at once.
fn to_forest(input: &Path, mesh: IndexedMesh) -> Result<(Forest, Repaired), Error> {
    interrupt::freely(|| {
        let repaired = halfedge::repair(&mesh.positions, &mesh.triangles)
            .map_err(|source| Error::Repair { file: input.to_owned(), source })?;
        drop(mesh);
        if repaired.mesh.num_faces() == 0 {
            return Err(Error::NothingToBuild { file: input.to_owned() });
        }
        let counts = repaired::counts(&repaired.report);
        const STEPS: f32 = 1000.0;
        let progress = Progress::new("building", Some(STEPS as u64), Unit::Items);
        let forest = mergetree::build(
            repaired.mesh,
            &repaired.positions,
            &BuildOptions::default(),
            &|share| progress.set((share * STEPS) as u64),
        )
        .map_err(|source| Error::Forest { file: input.to_owned(), source })?;
        Ok((forest, counts))
    })
}
