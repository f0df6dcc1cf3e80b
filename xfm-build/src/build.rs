//! The whole line: from the one who collapses to the file.

use std::fmt;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use glam::Vec3;
use mergetree::{CollapseRecord, Colour, OctNormal};
use scratch::{CheckpointWriter, Scratch};
use xfm_format::WriteReport;

use crate::Error;
use crate::kept::{Draft, Keep};
use crate::link::{LinkOptions, Linked, Linker};
use crate::names::CoarseMesh;
use crate::number::NumberOptions;
use crate::progress::Observer;

/// How a file is built.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// While collapses come: the memory that the linker may take beside the one who collapses, the names, and the file.
    pub link: LinkOptions,
    /// After that: memory that may be taken in all.
    pub number: NumberOptions,
    /// Collapses that are expected, so that there is room for them on the disk; `None` where nobody knows. Default `None`.
    pub expected_nodes: Option<u64>,
    /// Where the log is kept for a later run. Default `None`.
    pub keep: Option<Keep>,
    /// Bytes that the one who collapses adds to a checkpoint at most, so that there is room for them on the disk. Default 0.
    pub checkpoint_bytes: u64,
}

impl BuildOptions {
    /// The defaults with these options for linking.
    pub fn new(link: LinkOptions) -> Self {
        Self {
            link,
            number: NumberOptions::default(),
            expected_nodes: None,
            keep: None,
            checkpoint_bytes: 0,
        }
    }
}

/// What was built, and what it took.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildReport {
    /// What was written.
    pub written: WriteReport,
    /// Number of nodes: of collapses.
    pub nodes: u64,
    /// Triangles of the input.
    pub input_triangles: u64,
    /// Triangles of the coarsest mesh.
    pub base_triangles: u64,
    /// Scratch space at most, in bytes.
    pub scratch_bytes: u64,
    /// Time until all was collapsed and linked; zero where an earlier run had done that.
    pub collapse: Duration,
    /// Time for numbering.
    pub number: Duration,
    /// Time for writing.
    pub write: Duration,
}

impl fmt::Display for BuildReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { nodes, base_triangles, written, .. } = self;
        let [collapse, number, write] =
            [self.collapse, self.number, self.write].map(|time| time.as_secs_f64());
        write!(
            f,
            "{nodes} nodes over {base_triangles} triangles, {} levels deep, {} bytes; \
             collapsed in {collapse:.1} s, numbered in {number:.1} s, written in {write:.1} s",
            written.tree_depth, written.file_bytes
        )
    }
}

/// A collapse with position, normal and colour of the vertex that it removes.
type Collapsed = (CollapseRecord, Vec3, OctNormal, Option<Colour>);

/// Collapses that go to the linker's thread at once.
const BATCH: usize = 1024;
/// Batches that may wait for it.
const WAITING: usize = 4;

/// What goes to the linker's thread.
enum Message {
    Collapses(Vec<Collapsed>),
    /// A checkpoint is to be begun, and sent there; nothing where none is kept.
    Checkpoint(SyncSender<Option<Draft>>),
}

/// Where collapses go, in order; see [`build_from`].
#[derive(Debug)]
pub struct Feed {
    batch: Vec<Collapsed>,
    linker: SyncSender<Message>,
    used: Receiver<Vec<Collapsed>>,
    notes: Vec<u8>,
}

impl Feed {
    /// Takes the next collapse, with position and normal of the vertex that it removes.
    ///
    /// # Errors
    /// [`Error::Stopped`]: the linker has failed, there is no use in going on; [`build_from`] will tell why.
    #[inline]
    pub fn push(
        &mut self,
        record: &CollapseRecord,
        position: Vec3,
        normal: OctNormal,
    ) -> Result<(), Error> {
        self.push_with(record, position, normal, None)
    }

    /// As [`push`](Self::push), with the colour of the vertex if vertices [have colours](LinkOptions::colours).
    ///
    /// # Errors
    /// As [`push`](Self::push).
    #[inline]
    pub fn push_with(
        &mut self,
        record: &CollapseRecord,
        position: Vec3,
        normal: OctNormal,
        colour: Option<Colour>,
    ) -> Result<(), Error> {
        self.batch.push((*record, position, normal, colour));
        if self.batch.len() < BATCH { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<(), Error> {
        let next = self.used.try_recv().unwrap_or_else(|_| Vec::with_capacity(BATCH));
        let batch = std::mem::replace(&mut self.batch, next);
        self.linker.send(Message::Collapses(batch)).map_err(|_| Error::Stopped)
    }

    /// Writes a checkpoint of all that was pushed so far, to which `save` adds what the one who collapses needs to go on from
    /// here: [`Linker::resume`] gives it back. Nothing happens where the log is not [kept](BuildOptions::keep).
    ///
    /// # Errors
    /// Those of `save`, [`Error::Scratch`], and [`Error::Stopped`].
    pub fn checkpoint<E: From<Error>>(
        &mut self,
        save: impl FnOnce(&mut CheckpointWriter) -> Result<(), E>,
    ) -> Result<(), E> {
        self.flush()?;
        let (give, take) = sync_channel(1);
        self.linker.send(Message::Checkpoint(give)).map_err(|_| Error::Stopped)?;
        if let Some(mut draft) = take.recv().map_err(|_| Error::Stopped)? {
            save(&mut draft.writer)?;
            draft.finish()?;
        }
        Ok(())
    }

    /// What is to be written down beside the log when it is whole, where it is kept.
    pub(crate) fn set_notes(&mut self, notes: &[u8]) {
        self.notes = notes.to_vec();
    }
}

/// Builds a file of the collapses that `collapse` gives, in memory that does not grow with their number.
///
/// `collapse` runs on this thread and feeds the linker, which runs on one of its own; in the end it returns the coarsest
/// mesh. Memory it takes by itself is its own affair, and is assumed to be free when it returns.
///
/// # Errors
/// Those of `collapse`, those of [`Linker`], [`Linked::number`] and [`write`](crate::Numbered::write), turned into those of
/// `collapse`.
///
/// # Examples
/// ```
/// # use glam::Vec3;
/// # use halfedge::{HalfEdgeMesh, VertexId};
/// # use mergetree::{CollapseRecord, OctNormal, StarBounds};
/// # use scratch::Scratch;
/// # use std::ops::ControlFlow;
/// # use xfm_build::{BuildOptions, CoarseFace, CoarseMesh, CoarseVertex, Error, LinkOptions, NameBounds};
/// # let folder = tempfile::tempdir()?;
/// # let (folder, path) = (folder.path(), folder.path().join("octahedron.xfm"));
/// // An octahedron, of which one vertex is collapsed.
/// let triangles =
///     [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]];
/// let positions = [Vec3::Z, Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
/// let normal = |v: VertexId| OctNormal::new(positions[v.index()]);
/// let mut mesh = HalfEdgeMesh::from_triangles(6, &triangles)?;
///
/// let options = BuildOptions::new(LinkOptions::new(NameBounds { vertices: 6, faces: 8 }));
/// let report = xfm_build::build_from(
///     |feed| {
///         let h = mesh.outgoing(VertexId::new(0)).next().unwrap();
///         let collapse = mesh.check_collapse(h)?;
///         mesh.apply(&collapse);
///         let (record, v) = (CollapseRecord::new(&collapse, StarBounds::default()), collapse.removed);
///         feed.push(&record, positions[v.index()], normal(v))?;
///         let vertex =
///             |name: VertexId| CoarseVertex { name, position: positions[name.index()], normal: normal(name) };
///         let face = |name| Some(CoarseFace { name, corners: mesh.corners(name)? });
///         Ok::<_, Box<dyn std::error::Error>>(CoarseMesh {
///             vertices: mesh.vertices().map(vertex).collect(),
///             faces: mesh.faces().filter_map(face).collect(),
///             colours: Vec::new(),
///         })
///     },
///     &path,
///     &Scratch::new(folder),
///     &options,
///     &mut |_| ControlFlow::Continue(()),
/// )?;
/// assert_eq!((report.nodes, report.input_triangles, report.base_triangles), (1, 8, 6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn build_from<E: From<Error>>(
    collapse: impl FnOnce(&mut Feed) -> Result<CoarseMesh, E>,
    path: impl AsRef<Path>,
    scratch: &Scratch,
    options: &BuildOptions,
    observer: &mut Observer<'_>,
) -> Result<BuildReport, E> {
    let start = Instant::now();
    let linker = match &options.keep {
        Some(keep) => Linker::new_kept(scratch, &options.link, keep),
        None => Linker::new(scratch, &options.link),
    }?;
    linker.require_with(options.expected_nodes.unwrap_or(0), options.checkpoint_bytes)?;
    let linked = link_from(collapse, linker)?;
    let collapse = start.elapsed();
    let report = finish(linked, path, &options.number, observer)?;
    Ok(BuildReport { collapse, ..report })
}

/// As [`build_from`], going on with the linker of an [earlier run](Linker::resume): `collapse` gives the collapses that come
/// after its checkpoint.
///
/// # Errors
/// As [`build_from`].
pub fn go_on_from<E: From<Error>>(
    collapse: impl FnOnce(&mut Feed) -> Result<CoarseMesh, E>,
    linker: Linker,
    path: impl AsRef<Path>,
    options: &NumberOptions,
    observer: &mut Observer<'_>,
) -> Result<BuildReport, E> {
    let start = Instant::now();
    let linked = link_from(collapse, linker)?;
    let collapse = start.elapsed();
    let report = finish(linked, path, options, observer)?;
    Ok(BuildReport { collapse, ..report })
}

/// Numbers and writes what an earlier run has linked; `None` where there is nothing whole in the scratch folder.
///
/// # Errors
/// Those of [`Linked::resume`], [`Linked::number`] and [`write`](crate::Numbered::write).
pub fn resume(
    path: impl AsRef<Path>,
    scratch: &Scratch,
    options: &BuildOptions,
    observer: &mut Observer<'_>,
) -> Result<Option<BuildReport>, Error> {
    let Some(keep) = &options.keep else { return Ok(None) };
    match Linked::resume(scratch, keep, &options.link.write)? {
        Some(linked) => finish(linked, path, &options.number, observer).map(Some),
        None => Ok(None),
    }
}

pub(crate) fn finish(
    linked: Linked,
    path: impl AsRef<Path>,
    options: &NumberOptions,
    observer: &mut Observer<'_>,
) -> Result<BuildReport, Error> {
    let start = Instant::now();
    let (nodes, base_triangles) = (linked.num_nodes(), linked.num_base_faces());
    let numbered = linked.number(options, observer)?;
    let (number, scratch_bytes) = (start.elapsed(), numbered.scratch_bytes());
    let input_triangles = numbered.totals().input_triangles;
    let start = Instant::now();
    let written = numbered.write(path, observer)?;
    Ok(BuildReport {
        written,
        nodes,
        input_triangles,
        base_triangles,
        scratch_bytes,
        collapse: Duration::ZERO,
        number,
        write: start.elapsed(),
    })
}

/// Runs the one who collapses here and the linker beside.
fn link_from<E: From<Error>>(
    collapse: impl FnOnce(&mut Feed) -> Result<CoarseMesh, E>,
    mut linker: Linker,
) -> Result<Linked, E> {
    let (sender, messages) = sync_channel::<Message>(WAITING);
    let (give_back, used) = sync_channel(WAITING);
    let link = move || -> Result<Linker, Error> {
        for message in messages {
            let mut batch = match message {
                Message::Collapses(batch) => batch,
                Message::Checkpoint(give) => {
                    // Whoever asked waits for it.
                    give.send(linker.checkpoint()?).ok();
                    continue;
                }
            };
            for (record, position, normal, colour) in batch.drain(..) {
                linker.push_with(&record, position, normal, colour)?;
            }
            // Where there are enough of them already it is dropped.
            give_back.try_send(batch).ok();
        }
        Ok(linker)
    };
    thread::scope(|scope| {
        let worker = thread::Builder::new().name("link".to_owned());
        let worker = worker.spawn_scoped(scope, link).map_err(Error::Thread)?;
        let batch = Vec::with_capacity(BATCH);
        let mut feed = Feed { batch, linker: sender, used, notes: Vec::new() };
        let collapsed = collapse(&mut feed);
        let all_sent = feed.flush();
        let notes = std::mem::take(&mut feed.notes);
        drop(feed);
        let linker = match worker.join() {
            Ok(linker) => linker,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        // When the linker has failed, the one who collapses could not but fail too.
        let mut linker = linker?;
        let coarse = collapsed?;
        linker.set_notes(notes);
        debug_assert!(all_sent.is_ok(), "only a linker that has failed takes nothing");
        Ok(linker.finish(&coarse)?)
    })
}
