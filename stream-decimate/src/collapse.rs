//! Collapses of a mesh of any size, told one by one: what a hierarchy is made of.
//!
//! One pass over a stream of triangles, in a buffer of fixed size, as in decimation; but nothing is written: whenever the buffer
//! is full it is collapsed to half, the cheapest collapses first, and in the end to almost nothing. What stays keeps its
//! place, so that each level of detail has only vertices of the input. In a buffer that holds the whole mesh this is the
//! in-core way.

mod collapser;
pub(crate) mod measure;
mod report;
mod round;

use std::num::NonZeroUsize;
use std::path::Path;

use mesh_io::TriangleSource;
use scratch::Scratch;

pub use report::{CollapseReport, Collapsed, CollapsedFace, CollapsedMesh, CollapsedVertex};

use crate::finality::{self, Direct, Feed};
use crate::presort::{self, Open};
use crate::run::with_reader;
use crate::{Error, Observer, OptionsError};
use collapser::Collapser;

/// How a mesh is collapsed. The same options and the same input give the same collapses.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CollapseOptions {
    /// Triangles the buffer holds at most, 64 or more. Memory depends on this alone. Default 4,000,000.
    pub buffer_triangles: usize,
    /// Vertices the buffer holds at most, 48 or more. Default `None`: half as many again as a closed mesh has.
    pub buffer_vertices: Option<usize>,
    /// Triangles at which to stop; more are left where topology or geometry forbid to go on. Default 256.
    pub base_triangles: usize,
    /// Threads to use at most; the result does not depend on it. Default `None`: as many as there are cores.
    pub threads: Option<NonZeroUsize>,
    /// How much colours count where vertices have some: a colour that is wrong by all of one component (red where there was
    /// black) costs as much as a surface that is wrong by this share of the diagonal of the bounding box of what has been
    /// read. 0 or more; 0 is not at all. Default 0.002.
    pub colour_weight: f32,
}

impl Default for CollapseOptions {
    fn default() -> Self {
        Self {
            buffer_triangles: 4_000_000,
            buffer_vertices: None,
            base_triangles: 256,
            threads: None,
            colour_weight: 0.002,
        }
    }
}

impl CollapseOptions {
    /// Names of vertices are below this.
    pub fn num_vertex_names(&self) -> u32 {
        // Where boundaries meet in a vertex, it becomes several when they are known to be boundaries.
        let vertices = self.most_vertices();
        u32::try_from(vertices + vertices / 8 + 64).unwrap_or(u32::MAX)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// The first field that is out of its range.
    pub fn check(&self) -> Result<(), OptionsError> {
        if self.buffer_triangles < 64 {
            return Err(OptionsError::Buffer(self.buffer_triangles));
        }
        if !(self.colour_weight >= 0.0 && self.colour_weight <= 1e6) {
            return Err(OptionsError::ColourWeight(self.colour_weight));
        }
        Ok(())
    }

    fn most_vertices(&self) -> usize {
        // Fewer would leave no room for a triangle in a buffer that is as good as full.
        self.buffer_vertices.unwrap_or(self.buffer_triangles * 3 / 4).max(48)
    }

    /// Names of faces are below this.
    pub fn num_face_names(&self) -> u32 {
        u32::try_from(self.buffer_triangles + 8).unwrap_or(u32::MAX)
    }

    /// Memory that a buffer takes in bytes for each vertex that is there, beside a few megabytes always.
    pub const BYTES_PER_VERTEX: u64 = 280;
    /// And for each triangle.
    pub const BYTES_PER_TRIANGLE: u64 = 24;
    /// And for each vertex once more, where vertices have colours.
    pub const COLOUR_BYTES_PER_VERTEX: u64 = 10;
}

/// In what order the triangles of a file are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReadOrder {
    /// As they come.
    AsIs,
    /// As they come, once the file has been read to learn where each vertex is used for the last time. Only for files that
    /// number their vertices.
    Counted,
    /// Sorted along the longest axis.
    Sorted,
}

/// Collapses a stream in one pass, and tells each collapse in its order. Returns what is left.
///
/// # Errors
/// Options out of range, those of the source and of `tell`, [`Error::Interrupted`] if the observer says so, and
/// [`Error::Unsorted`] if triangles that wait for neighbours crowd the buffer. Boundaries are not taken for true ones before
/// the end, since a triangle that came too late could not be recorded.
pub fn collapse<E: From<Error>>(
    source: &mut (dyn TriangleSource + Send),
    options: &CollapseOptions,
    tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    run(&mut Direct::new(source), options, tell, observer)
}

/// Collapses a file, reading it in some order; scratch files lie in the folder `scratch`.
///
/// After [`Error::Unsorted`] another order may do.
///
/// # Errors
/// As [`collapse`], and those of scratch files.
pub fn collapse_file<E: From<Error>>(
    open: &mut Open<'_>,
    order: ReadOrder,
    scratch: &Path,
    options: &CollapseOptions,
    tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    let folder = Scratch::new(scratch);
    match order {
        ReadOrder::AsIs => collapse(&mut *open().map_err(Error::from)?, options, tell, observer),
        ReadOrder::Counted => run(
            &mut finality::count(open().map_err(Error::from)?, &folder, observer)?,
            options,
            tell,
            observer,
        ),
        ReadOrder::Sorted => {
            let bytes = presort::DEFAULT_BYTES;
            run(&mut presort::presort(open, &folder, bytes, observer)?, options, tell, observer)
        }
    }
}

fn run<E: From<Error>>(
    feed: &mut dyn Feed,
    options: &CollapseOptions,
    tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    let mut collapser = Collapser::new(options, feed.has_colours())?;
    with_reader(feed, observer, |batch, observer| -> Result<_, E> {
        if let Some(batch) = batch {
            collapser.push(batch.triangles, batch.colours, batch.finality, tell, observer)?;
        }
        Ok(collapser.progress())
    })?;
    collapser.finish(tell, observer)
}
