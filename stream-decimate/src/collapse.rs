//! Collapses of a mesh of any size, told one by one: what a hierarchy is made of.
//!
//! One pass over a stream of triangles, in a buffer of fixed size, as in decimation; but nothing is written: whenever the buffer
//! is full it is collapsed to half, the cheapest collapses first, and in the end to almost nothing. What stays keeps its
//! place, so that each level of detail has only vertices of the input. In a buffer that holds the whole mesh this is the
//! in-core way.

mod checkpoint;
mod collapser;
pub(crate) mod measure;
mod report;
mod round;
mod skip;

use std::num::NonZeroUsize;
use std::path::Path;

use mesh_io::TriangleSource;
use scratch::{CheckpointReader, CheckpointWriter, Scratch};

pub use report::{CollapseReport, Collapsed, CollapsedFace, CollapsedMesh, CollapsedVertex};

use crate::finality::{self, Direct, Feed};
use crate::portion::Portion;
use crate::presort::{self, Open};
use crate::run::with_reader;
use crate::{Error, Observer, OptionsError};
use collapser::Collapser;
use skip::skip;

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
    /// Whether vertices have colours, which then are told; otherwise those of the source are not looked at. [`collapse`] and
    /// [`collapse_file`] find that out by themselves. Default no.
    pub colours: bool,
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
            colours: false,
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

    fn with_colours_of(&self, source: &dyn TriangleSource) -> Self {
        Self { colours: source.has_colours(), ..self.clone() }
    }

    fn most_vertices(&self) -> usize {
        // Fewer would leave no room for a triangle in a buffer that is as good as full.
        self.buffer_vertices.unwrap_or(self.buffer_triangles * 3 / 4).max(48)
    }

    /// Names of faces are below this.
    pub fn num_face_names(&self) -> u32 {
        u32::try_from(self.buffer_triangles + 8).unwrap_or(u32::MAX)
    }

    /// Bytes of a checkpoint at most.
    pub fn checkpoint_bytes(&self) -> u64 {
        Portion::saved_vertex_bytes(self.colours) * u64::from(self.num_vertex_names())
            + (Portion::SAVED_NAME_BYTES + Portion::SAVED_LONG_BYTES) * self.buffer_triangles as u64
            + checkpoint::OTHER_BYTES
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
    mut tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    let options = options.with_colours_of(source);
    Collapsing::new(&options)?.run(source, &mut tell, observer)
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
    mut tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    let options = options.with_colours_of(&*open().map_err(Error::from)?);
    Collapsing::new(&options)?.run_file(open, (order, scratch), &mut tell, observer)
}

/// Takes what a run of collapses has to tell. Anything that takes a collapse does, without checkpoints.
pub trait Recorder<E> {
    /// Takes the next collapse.
    ///
    /// # Errors
    /// Its own, which end the run.
    fn tell(&mut self, collapse: &Collapsed) -> Result<(), E>;

    /// Whether a checkpoint is wanted here, of about so many bytes. Asked whenever the buffer has been emptied by half, and
    /// after each round once all is read. What is collapsed does not depend on it.
    fn wants_checkpoint(&mut self, bytes: u64) -> bool {
        let _without_checkpoints = bytes;
        false
    }

    /// Writes a checkpoint, from which [`Collapsing::resume`] goes on with what comes after the collapses told so far.
    ///
    /// # Errors
    /// Its own, which end the run.
    fn checkpoint(&mut self, state: &CollapseState<'_>) -> Result<(), E> {
        let _without_checkpoints = state;
        Ok(())
    }
}

impl<E, F: FnMut(&Collapsed) -> Result<(), E>> Recorder<E> for F {
    fn tell(&mut self, collapse: &Collapsed) -> Result<(), E> {
        self(collapse)
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct CollapseState<'a>(&'a Collapser);

impl CollapseState<'_> {
    /// Adds all that is needed to go on to a checkpoint.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn save(&self, out: &mut CheckpointWriter) -> Result<(), scratch::Error> {
        self.0.save(out)
    }
}

/// A run of collapses, at its beginning or where an earlier one was.
#[derive(Debug)]
pub struct Collapsing(Collapser);

impl Collapsing {
    /// From the beginning.
    ///
    /// # Errors
    /// Options out of range.
    pub fn new(options: &CollapseOptions) -> Result<Self, Error> {
        Ok(Self(Collapser::new(options)?))
    }

    /// From what [`CollapseState::save`] has written, with the same options but for the threads. Everything in it is checked:
    /// whatever it is, what follows is a run of collapses or an error.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] when it is no such state, or of other options; options out of range.
    pub fn resume(options: &CollapseOptions, from: &mut CheckpointReader) -> Result<Self, Error> {
        Ok(Self(Collapser::restore(options, from)?))
    }

    /// Triangles that have been read.
    pub fn num_read(&self) -> u64 {
        self.0.read
    }

    /// Collapses that have been told.
    pub fn num_told(&self) -> u64 {
        self.0.told
    }

    /// As [`collapse`]; what was read before is read once more, and has to be the same.
    ///
    /// # Errors
    /// As [`collapse`], those of the recorder, and [`Error::OtherInput`].
    pub fn run<E: From<Error>>(
        self,
        source: &mut (dyn TriangleSource + Send),
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(CollapsedMesh, CollapseReport), E> {
        run(self.0, &mut Direct::new(source), recorder, observer)
    }

    /// As [`collapse_file`]: in an order, which has to be that of the earlier run, with scratch files in a folder. Where all
    /// has been read before, nothing is read.
    ///
    /// # Errors
    /// As [`run`](Self::run), and those of scratch files.
    pub fn run_file<E: From<Error>>(
        self,
        open: &mut Open<'_>,
        (order, scratch): (ReadOrder, &Path),
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(CollapsedMesh, CollapseReport), E> {
        if self.0.is_finishing {
            return self.0.finish(recorder, observer);
        }
        let folder = Scratch::new(scratch);
        match order {
            ReadOrder::AsIs => self.run(&mut *open().map_err(Error::from)?, recorder, observer),
            ReadOrder::Counted => run(
                self.0,
                &mut finality::count(open().map_err(Error::from)?, &folder, observer)?,
                recorder,
                observer,
            ),
            ReadOrder::Sorted => {
                let bytes = presort::DEFAULT_BYTES;
                let mut sorted = presort::presort(open, &folder, bytes, observer)?;
                run(self.0, &mut sorted, recorder, observer)
            }
        }
    }
}

/// Reads all of a source, and makes sure that it is what a run has read that came to this report.
///
/// # Errors
/// [`Error::OtherInput`] when it is not; those of the source, and [`Error::Interrupted`].
pub fn check_input(
    source: &mut (dyn TriangleSource + Send),
    report: &CollapseReport,
    observer: &mut Observer<'_>,
) -> Result<(), Error> {
    let (read, crc) = (report.input_triangles, report.input_crc);
    skip(&mut Direct::new(source), (read, crc), observer)?.check_end()
}

fn run<E: From<Error>>(
    mut collapser: Collapser,
    feed: &mut dyn Feed,
    recorder: &mut dyn Recorder<E>,
    observer: &mut Observer<'_>,
) -> Result<(CollapsedMesh, CollapseReport), E> {
    let mut feed = skip(feed, (collapser.read, collapser.crc), observer)?;
    if collapser.is_finishing {
        feed.check_end()?;
        return collapser.finish(recorder, observer);
    }
    with_reader(&mut feed, observer, |batch, observer| -> Result<_, E> {
        if let Some(batch) = batch {
            collapser.push(batch, recorder, observer)?;
        }
        Ok(collapser.progress())
    })?;
    collapser.finish(recorder, observer)
}
