//! Whether a file holds a mesh whole: in core after the repair that a build does, or as two streams of triangles.

use std::fmt;
use std::path::Path;

use glam::Vec3;
use mesh_io::{Frame, Triangle};
use scratch::Scratch;
use serde::Serialize;
use xfm_format::{Encoding, XfmFile};

use super::VerifyArgs;
use crate::full::full_mesh;
use crate::level::{self, Wanted};
use crate::mesh_file::read_mesh_in_frame;
use crate::mesh_stream::{Input, scratch_beside, scratch_folder};
use crate::progress::{Progress, Unit};
use crate::repaired::{self, Repaired};
use crate::same_soup::{Side, SoupComparison};
use crate::same_surface::difference;
use crate::{Error, interrupt, text, xfm_file};

/// Anonymous memory that comparing in core takes per triangle at its peak, with a reserve.
const BYTES_PER_TRIANGLE: u64 = 400;
/// And always.
const BYTES_ALWAYS: u64 = 24 << 20;
/// Scratch space for each triangle: its finest mesh and what is compared.
const SCRATCH_BYTES_PER_TRIANGLE: u64 = 90;
/// Triangles read at once.
const BATCH: usize = 1 << 14;

/// The comparison with the input.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Comparison {
    mode: &'static str,
    input_triangles: u64,
    /// Triangles of the input after its repair, where that was done.
    #[serde(skip_serializing_if = "Option::is_none")]
    repaired_triangles: Option<u64>,
    missing: u64,
    extra: u64,
    repaired: Repaired,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "input: {} triangles, ", text::count(self.input_triangles))?;
        let repaired = repaired::words(&self.repaired);
        match self.repaired_triangles {
            Some(triangles) => write!(
                f,
                "{} after repair ({})",
                text::count(triangles),
                repaired.as_deref().unwrap_or("nothing to repair")
            )?,
            None => write!(
                f,
                "compared as they are (left out: {})",
                repaired.as_deref().unwrap_or("none")
            )?,
        }
        write!(f, "; missing {}, extra {}", text::count(self.missing), text::count(self.extra))
    }
}

/// Compares a file with the mesh it was built from; a message says what is wrong, if anything is.
pub(super) fn compare(
    file: &XfmFile,
    input: &Path,
    args: &VerifyArgs,
) -> Result<(Comparison, Option<String>), Error> {
    let needed = file.header().input_triangles.saturating_mul(BYTES_PER_TRIANGLE);
    if needed.saturating_add(BYTES_ALWAYS) <= args.memory {
        interrupt::freely(|| in_core(file, input, args))
    } else {
        streaming(file, input, args)
    }
}

fn in_core(
    file: &XfmFile,
    input: &Path,
    args: &VerifyArgs,
) -> Result<(Comparison, Option<String>), Error> {
    let (mut mesh, frame) = read_mesh_in_frame(input, args.from)?;
    let of_file = xfm_file::frame(file.header());
    if frame.origin != of_file.origin {
        mesh.positions.iter_mut().for_each(|position| *position = into(of_file, frame, *position));
    }
    let mut repaired = halfedge::repair(&mesh.positions, &mesh.triangles)
        .map_err(|source| Error::Repair { file: input.to_owned(), source })?;
    let corners = repaired.mesh.faces().filter_map(|face| repaired.mesh.corners(face));
    let mut expected: Vec<[u32; 3]> = corners.map(|t| t.map(|vertex| vertex.get())).collect();
    // Building welds whatever lies at one place, and leaves out what is no surface then.
    let mut no_surface = leave_out_no_surface(&repaired.positions, &mut expected);
    repaired.positions.iter_mut().for_each(|position| *position = rounded(file, *position));
    let mut full = level::extract(&mut file.read_forest()?, &Wanted::Full, |_| false)
        .map_err(|source| Error::Base { file: file.path().to_owned(), source })?;
    if file.header().encoding != Encoding::Exact {
        // What became so by rounding is in the file.
        no_surface += leave_out_no_surface(&repaired.positions, &mut expected);
        leave_out_no_surface(&full.positions, &mut full.triangles);
    }
    let found = difference((&repaired.positions, &expected), (&full.positions, &full.triangles));
    let mut counts = repaired::counts(&repaired.report);
    counts.insert("repeated_triangles", found.repeated);
    counts.insert("triangles_without_surface", no_surface);
    let comparison = Comparison {
        mode: "in-core",
        input_triangles: mesh.triangles.len() as u64,
        repaired_triangles: Some(expected.len() as u64),
        missing: found.missing,
        extra: found.extra,
        repaired: counts,
    };
    let wrong = found.near.map(|near| {
        let blocked = match full.damaged {
            0 => String::new(),
            nodes => format!(" ({} nodes could not be split)", text::count(nodes as u64)),
        };
        wrong(&comparison, expected.len() as u64, of_file, near.into(), input) + &blocked
    });
    Ok((comparison, wrong))
}

fn streaming(
    file: &XfmFile,
    input: &Path,
    args: &VerifyArgs,
) -> Result<(Comparison, Option<String>), Error> {
    let folder = scratch_folder(args.scratch.as_deref(), || scratch_beside(file.path()))?;
    let scratch = Scratch::new(folder);
    let triangles = file.header().input_triangles;
    let on_disk = triangles.saturating_mul(SCRATCH_BYTES_PER_TRIANGLE);
    scratch.require(on_disk.saturating_sub(args.memory / 2))?;
    // What is found out about the file while its triangles are compared takes one half.
    let half = args.memory / 2;
    let mut comparison =
        SoupComparison::new(&scratch, triangles, half.saturating_sub(BYTES_ALWAYS).max(1 << 20));
    let mut full = full_mesh(file, &scratch, half)?;
    full.corners(|batch| comparison.push(Side::File, batch))?;
    drop(full);

    let of_file = xfm_file::frame(file.header());
    let source = Input::new(input, args.from);
    let progress = Progress::new("comparing", Some(triangles), Unit::Items);
    let mut source = source.open()?;
    let frame = source.frame();
    let mut batch: Vec<Triangle> = Vec::with_capacity(BATCH);
    while source.read(&mut batch, BATCH)? > 0 {
        interrupt::check()?;
        if frame.origin != of_file.origin {
            let corners = batch.as_flattened_mut();
            corners.iter_mut().for_each(|corner| *corner = into(of_file, frame, *corner));
        }
        if file.header().encoding != Encoding::Exact {
            let corners = batch.as_flattened_mut();
            corners.iter_mut().for_each(|corner| *corner = rounded(file, *corner));
        }
        comparison.push(Side::Input, &batch)?;
        progress.advance(batch.len() as u64);
        batch.clear();
    }
    drop((source, batch));
    let found = comparison.finish()?;
    let left_out =
        [("triangles_without_surface", found.no_surface), ("repeated_triangles", found.repeated)];
    let comparison = Comparison {
        mode: "streaming",
        input_triangles: found.input_triangles,
        repaired_triangles: None,
        missing: found.missing,
        extra: found.extra,
        repaired: left_out.into_iter().collect(),
    };
    let wrong =
        found.near.map(|near| wrong(&comparison, found.input_triangles, of_file, near, input));
    Ok((comparison, wrong))
}

/// Leaves out triangles with two corners at one place; returns how many.
fn leave_out_no_surface(positions: &[Vec3], triangles: &mut Vec<[u32; 3]>) -> u64 {
    let before = triangles.len();
    triangles.retain(|t| {
        let [a, b, c] = t.map(|vertex| positions[vertex as usize]);
        a != b && b != c && c != a
    });
    (before - triangles.len()) as u64
}

/// A position as the file has it; itself, where that has no place for it.
fn rounded(file: &XfmFile, position: Vec3) -> Vec3 {
    file.header().rounding.position(position).unwrap_or(position)
}

/// A position of one frame in another one.
fn into(other: Frame, frame: Frame, position: Vec3) -> Vec3 {
    other.from_file(frame.to_file(position))
}

fn wrong(found: &Comparison, of: u64, frame: Frame, near: Vec3, input: &Path) -> String {
    let near = frame.to_file(near).to_array().map(|c| c.to_string()).join(", ");
    format!(
        "{} of {} are missing and {} are not in {}, one of them at {near}",
        text::count(found.missing),
        text::count(of),
        text::count(found.extra),
        input.display()
    )
}
