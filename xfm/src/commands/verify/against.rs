//! Whether a file holds a mesh whole: in core after the repair that a build does, or as two streams of triangles.

use std::fmt;
use std::path::Path;

use glam::Vec3;
use mesh_io::{Frame, IndexedSource, Triangle};
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
use crate::same_colours::{ColourComparison, ColourDifference};
use crate::same_soup::{Side, SoupComparison};
use crate::same_surface::difference;
use crate::{Error, interrupt, text, xfm_file};

/// Anonymous memory that comparing in core takes per triangle at its peak, with a reserve.
const BYTES_PER_TRIANGLE: u64 = 400;
/// And always.
const BYTES_ALWAYS: u64 = 24 << 20;
/// Scratch space for each triangle: its finest mesh and what is compared.
const SCRATCH_BYTES_PER_TRIANGLE: u64 = 90;
/// And where colours are compared: of half a vertex of the file and three corners of the input.
const SCRATCH_COLOUR_BYTES: u64 = 60;
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
    /// Vertices with a colour that the input does not have there, where both have colours.
    #[serde(skip_serializing_if = "Option::is_none")]
    recoloured: Option<u64>,
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
        write!(f, "; missing {}, extra {}", text::count(self.missing), text::count(self.extra))?;
        match self.recoloured {
            Some(vertices) => write!(f, "; other colours {}", text::count(vertices)),
            None => Ok(()),
        }
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
    let colours =
        Colours { of_file: file.header().has_colour(), of_input: !mesh.colours.is_empty() };
    let mut recoloured = None;
    if colours.are_compared() {
        let folder = scratch_folder(args.scratch.as_deref(), || scratch_beside(file.path()))?;
        let vertices = full.positions.len() as u64;
        let mut comparison = ColourComparison::new(&Scratch::new(folder), vertices, args.memory);
        for (&position, &colour) in full.positions.iter().zip(&full.colours) {
            comparison.push(Side::File, position, colour)?;
        }
        for corner in mesh.triangles.as_flattened().iter().map(|&v| v as usize) {
            comparison.push(Side::Input, mesh.positions[corner], mesh.colours[corner])?;
        }
        recoloured = Some(comparison.finish()?);
    }
    let mut counts = repaired::counts(&repaired.report);
    counts.insert("repeated_triangles", found.repeated);
    counts.insert("triangles_without_surface", no_surface);
    let comparison = Comparison {
        mode: "in-core",
        input_triangles: mesh.triangles.len() as u64,
        repaired_triangles: Some(expected.len() as u64),
        missing: found.missing,
        extra: found.extra,
        recoloured: recoloured.map(|found| found.differ),
        repaired: counts,
    };
    let wrong = found.near.map(|near| {
        let blocked = match full.damaged {
            0 => String::new(),
            nodes => format!(" ({} nodes could not be split)", text::count(nodes as u64)),
        };
        wrong(&comparison, expected.len() as u64, of_file, near.into(), input) + &blocked
    });
    Ok((comparison, wrong.or(colours.wrong(recoloured, of_file, input))))
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
    let source = Input::new(input, args.from);
    let mut source = source.open()?;
    let colours = Colours { of_file: file.header().has_colour(), of_input: source.has_colours() };
    let for_colours = if colours.are_compared() { SCRATCH_COLOUR_BYTES } else { 0 };
    let on_disk = on_disk.saturating_add(triangles.saturating_mul(for_colours));
    scratch.require(on_disk.saturating_sub(args.memory / 2))?;
    // What is found out about the file while its triangles are compared takes one half.
    let half = args.memory / 2;
    let mut comparison =
        SoupComparison::new(&scratch, triangles, half.saturating_sub(BYTES_ALWAYS).max(1 << 20));
    let mut full = full_mesh(file, &scratch, half)?;
    full.corners(|batch| comparison.push(Side::File, batch))?;
    let mut of_colours = None;
    if colours.are_compared() {
        let mut both =
            ColourComparison::new(&scratch, full.num_vertices(), (half / 4).max(1 << 20));
        full.vertices(|positions, colours| {
            let mut vertices = positions.iter().zip(colours);
            vertices.try_for_each(|(&position, &colour)| both.push(Side::File, position, colour))
        })?;
        of_colours = Some(both);
    }
    drop(full);

    let of_file = xfm_file::frame(file.header());
    let progress = Progress::new("comparing", Some(triangles), Unit::Items);
    let frame = source.frame();
    let mut batch: Vec<Triangle> = Vec::with_capacity(BATCH);
    let (mut numbers, mut of_corners) = (Vec::new(), Vec::new());
    while match &of_colours {
        Some(_) => source.read_numbered(&mut batch, &mut numbers, BATCH)?,
        None => source.read(&mut batch, BATCH)?,
    } > 0
    {
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
        if let Some(both) = &mut of_colours {
            of_corners.clear();
            source.look_up_colours(&numbers, &mut of_corners);
            numbers.clear();
            let corners = batch.as_flattened().iter().zip(of_corners.as_flattened());
            for (&position, &colour) in corners {
                both.push(Side::Input, position, colour)?;
            }
        }
        progress.advance(batch.len() as u64);
        batch.clear();
    }
    drop((source, batch));
    let found = comparison.finish()?;
    let recoloured = of_colours.map(ColourComparison::finish).transpose()?;
    let left_out =
        [("triangles_without_surface", found.no_surface), ("repeated_triangles", found.repeated)];
    let comparison = Comparison {
        mode: "streaming",
        input_triangles: found.input_triangles,
        repaired_triangles: None,
        missing: found.missing,
        extra: found.extra,
        recoloured: recoloured.map(|found| found.differ),
        repaired: left_out.into_iter().collect(),
    };
    let wrong =
        found.near.map(|near| wrong(&comparison, found.input_triangles, of_file, near, input));
    Ok((comparison, wrong.or(colours.wrong(recoloured, of_file, input))))
}

/// Who has colours.
#[derive(Debug, Clone, Copy)]
struct Colours {
    of_file: bool,
    of_input: bool,
}

impl Colours {
    fn are_compared(self) -> bool {
        self.of_file && self.of_input
    }

    /// What is wrong with the colours, if anything is. An input without colours says nothing about those of the file.
    fn wrong(self, found: Option<ColourDifference>, frame: Frame, input: &Path) -> Option<String> {
        if self.of_input && !self.of_file {
            return Some(format!(
                "the vertices of {} have colours, and these have none",
                input.display()
            ));
        }
        let ColourDifference { differ, near } = found?;
        let near = frame.to_file(near?).to_array().map(|c| c.to_string()).join(", ");
        Some(format!(
            "{} vertices have other colours than in {}, one of them at {near}",
            text::count(differ),
            input.display()
        ))
    }
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
