//! What outlives a run, so that a later one can go on.
//!
//! The log has a name then, `NAME.log`, and is locked. Beside it lies a checkpoint, `NAME.state`: where in the log everything
//! is, with checksums, what the linker knew besides, and what the input was. While collapses come it also holds the linker's
//! table and what the one who collapses needs; the log's chunks are never overwritten, so that it stays good while the log
//! grows. Once the log is whole it holds the coarsest mesh instead. Without a checkpoint a log is a remainder of no use, and
//! goes with the run.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use halfedge::FaceId;
use mergetree::{BaseMesh, BaseVertex, Colour, OctNormal};
use scratch::{
    CheckpointError, CheckpointReader, CheckpointWriter, SavedChunk, SavedSpool, Scratch, Spool,
    Store,
};
use xfm_format::WriteOptions;

use crate::coarse::{Coarse, CoarseRoot};
use crate::link::{Counts, Linked, Top};
use crate::log::{LogEntry, LoggedColour, PieceSize};
use crate::names::NameBounds;
use crate::{Error, StateProblem};

/// Where a run leaves what a later one can go on from, and what it is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keep {
    /// Begins the names of the files in the scratch folder; a name itself, without a folder.
    pub name: String,
    /// What the collapses are made of, and how: a later run goes on only where it says the same. The files' names, lengths
    /// and times, the options, the version of the program.
    pub identity: Vec<u8>,
}

impl Keep {
    pub(crate) fn log_name(&self) -> String {
        format!("{}.log", self.name)
    }

    fn state_name(&self) -> String {
        format!("{}.state", self.name)
    }

    /// Whether an earlier run has left something to go on from.
    pub fn is_there(&self, scratch: &Scratch) -> bool {
        scratch.folder().join(self.state_name()).exists()
    }

    /// Removes what an earlier run has left.
    ///
    /// # Errors
    /// When it is there and cannot be removed, or is in use by another run.
    pub fn remove(&self, scratch: &Scratch) -> Result<(), Error> {
        match scratch.kept_file::<u32>(&self.log_name()) {
            Err(error) if error.source.kind() != io::ErrorKind::NotFound => Err(error.into()),
            _ => self.remove_own(scratch),
        }
    }

    /// Removes what this run has left.
    fn remove_own(&self, scratch: &Scratch) -> Result<(), Error> {
        // Without the checkpoint the log is of no use, but not the other way round.
        CheckpointWriter::remove(scratch, &self.state_name())?;
        Ok(scratch.remove(&self.log_name())?)
    }

    /// That the checkpoint has a problem.
    pub(crate) fn fail(&self, scratch: &Scratch, problem: impl Into<StateProblem>) -> Error {
        let file: PathBuf = scratch.folder().join(self.state_name());
        Error::State { file, problem: problem.into() }
    }
}

/// The files of a run. They go with it, unless there is a checkpoint.
#[derive(Debug)]
pub(crate) struct Kept {
    scratch: Scratch,
    keep: Keep,
    is_of_use: Arc<AtomicBool>,
}

/// A checkpoint that is being written.
#[derive(Debug)]
pub(crate) struct Draft {
    pub writer: CheckpointWriter,
    is_of_use: Arc<AtomicBool>,
}

impl Draft {
    pub fn finish(self) -> Result<(), Error> {
        self.writer.finish()?;
        self.is_of_use.store(true, Ordering::Relaxed);
        Ok(())
    }
}

/// What is known of a log, whole or not.
pub(crate) struct Known<'a> {
    pub write: &'a WriteOptions,
    pub names: NameBounds,
    pub counts: &'a Counts,
    pub store: &'a mut Store,
    pub log: &'a mut Spool<LogEntry>,
    pub sizes: &'a mut Spool<PieceSize>,
    pub colours: Option<&'a mut Spool<LoggedColour>>,
}

impl Kept {
    /// For a log that is being written.
    pub fn new(scratch: &Scratch, keep: &Keep) -> Self {
        let is_of_use = Arc::new(AtomicBool::new(false));
        Self { scratch: scratch.clone(), keep: keep.clone(), is_of_use }
    }

    /// For one that an earlier run has left.
    fn earlier(scratch: &Scratch, keep: &Keep) -> Self {
        let kept = Self::new(scratch, keep);
        kept.is_of_use.store(true, Ordering::Relaxed);
        kept
    }

    /// Removes the files, after the last of them was of use.
    pub fn remove(self) -> Result<(), Error> {
        self.keep.remove_own(&self.scratch)
    }

    fn begin(&self, known: Known<'_>, is_whole: bool) -> Result<Draft, Error> {
        let Known { write, names, counts, store, log, sizes, colours } = known;
        let (log, sizes) = (log.save(store)?, sizes.save(store)?);
        let colours = colours.map(|colours| colours.save(store)).transpose()?;
        store.sync()?;
        let mut writer = CheckpointWriter::create(&self.scratch, &self.keep.state_name())?;
        writer.put("identity", &self.keep.identity)?;
        writer.put("file", format!("{write:?}").as_bytes())?;
        let fixed = Fixed {
            nodes: counts.nodes,
            blocks: counts.blocks,
            pieces: counts.pieces,
            faces: counts.faces,
            min: counts.min.to_array(),
            max: counts.max.to_array(),
            vertex_names: names.vertices,
            face_names: names.faces,
            chunk_bytes: store.chunk_bytes() as u32,
            num_chunks: store.num_file_chunks(),
            is_whole: is_whole.into(),
            has_colours: colours.is_some().into(),
        };
        writer.put("counts", &[fixed])?;
        writer.put("log", &log.chunks)?;
        writer.put("sizes", &sizes.chunks)?;
        if let Some(colours) = colours {
            writer.put("colours", &colours.chunks)?;
        }
        Ok(Draft { writer, is_of_use: Arc::clone(&self.is_of_use) })
    }

    /// Begins a checkpoint while collapses come. What the one who collapses needs is still to be added.
    pub fn checkpoint(&self, known: Known<'_>, tops: &[Top]) -> Result<Draft, Error> {
        let mut draft = self.begin(known, false)?;
        let end = tops.iter().rposition(|top| top.piece().is_some()).map_or(0, |last| last + 1);
        draft.writer.put("tops", &tops[..end])?;
        Ok(draft)
    }

    /// Writes down that the log is whole.
    pub fn save(&mut self, linked: &mut Linked) -> Result<(), Error> {
        let Linked { write, names, counts, store, log, sizes, colours, coarse, notes, .. } = linked;
        let colours = colours.as_mut();
        let known = Known { write, names: *names, counts, store, log, sizes, colours };
        let mut draft = self.begin(known, true)?;
        let saved = |v: &BaseVertex| SavedVertex { position: v.position.into(), normal: v.normal };
        let vertices: Vec<_> = coarse.base.vertices.iter().map(saved).collect();
        let face_names: Vec<u32> = coarse.face_names.iter().map(|name| name.get()).collect();
        let out = &mut draft.writer;
        out.put("vertices", &vertices)?;
        out.put("vertex colours", &coarse.base.colours)?;
        out.put("faces", &coarse.base.faces)?;
        out.put("face names", &face_names)?;
        out.put("roots", &coarse.roots)?;
        out.put("notes", notes)?;
        draft.finish()
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if !self.is_of_use.load(Ordering::Relaxed) {
            // There is nobody to tell, and what failed before is told already.
            self.keep.remove_own(&self.scratch).ok();
        }
    }
}

/// All of a checkpoint that has always the same size.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Fixed {
    nodes: u64,
    blocks: u64,
    pieces: u64,
    faces: u64,
    min: [f32; 3],
    max: [f32; 3],
    vertex_names: u32,
    face_names: u32,
    chunk_bytes: u32,
    num_chunks: u32,
    is_whole: u32,
    has_colours: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct SavedVertex {
    position: [f32; 3],
    normal: OctNormal,
}

/// What an earlier run has left, as far as it has been read.
pub(crate) struct Earlier {
    pub reader: CheckpointReader,
    pub is_whole: bool,
    pub names: NameBounds,
    pub counts: Counts,
    pub chunk_bytes: usize,
    num_chunks: u32,
    log: SavedSpool,
    sizes: SavedSpool,
    pub colours: Option<SavedSpool>,
}

/// A log with what belongs to it.
pub(crate) struct Opened {
    pub store: Store,
    pub log: Spool<LogEntry>,
    pub sizes: Spool<PieceSize>,
    pub colours: Option<Spool<LoggedColour>>,
    pub kept: Kept,
}

impl Earlier {
    /// What there is in this folder, if it is about the same.
    pub fn open(
        scratch: &Scratch,
        keep: &Keep,
        write: &WriteOptions,
    ) -> Result<Option<Self>, Error> {
        let fail = |error: CheckpointError| keep.fail(scratch, error);
        match CheckpointReader::open(scratch, &keep.state_name()).map_err(fail)? {
            Some(reader) => Self::read(reader, keep, write).map(Some).map_err(fail),
            None => Ok(None),
        }
    }

    fn read(
        mut reader: CheckpointReader,
        keep: &Keep,
        write: &WriteOptions,
    ) -> Result<Self, CheckpointError> {
        let (mut identity, mut file) = (Vec::<u8>::new(), Vec::<u8>::new());
        reader.take("identity", 1 << 20, &mut identity)?;
        reader.take("file", 1 << 20, &mut file)?;
        if identity != keep.identity || file != format!("{write:?}").as_bytes() {
            return Err(CheckpointError::Other);
        }
        let fixed = reader.take_one::<Fixed>("counts")?;
        let (mut log, mut sizes) = (SavedSpool::default(), SavedSpool::default());
        reader.take("log", fixed.num_chunks.into(), &mut log.chunks)?;
        reader.take("sizes", fixed.num_chunks.into(), &mut sizes.chunks)?;
        let mut colours = None;
        if fixed.has_colours == 1 {
            let chunks = &mut colours.insert(SavedSpool::default()).chunks;
            reader.take("colours", fixed.num_chunks.into(), chunks)?;
        }
        let records = |spool: &SavedSpool| -> u64 {
            spool.chunks.iter().map(|chunk: &SavedChunk| u64::from(chunk.records)).sum()
        };
        let sound = fixed.is_whole <= 1
            && fixed.has_colours <= 1
            && colours.as_ref().is_none_or(|colours| records(colours) == fixed.nodes)
            && (1 << 10..=1 << 20).contains(&fixed.chunk_bytes)
            && records(&log) == fixed.nodes
            && (fixed.is_whole == 1 || records(&sizes) == fixed.pieces)
            && fixed.pieces <= fixed.blocks
            && fixed.blocks <= u32::MAX.into()
            && fixed.nodes <= u32::MAX.into()
            && fixed.faces <= 2 * fixed.nodes;
        if !sound {
            return Err(CheckpointError::Damaged("counts"));
        }
        Ok(Self {
            reader,
            is_whole: fixed.is_whole == 1,
            names: NameBounds { vertices: fixed.vertex_names, faces: fixed.face_names },
            counts: Counts {
                nodes: fixed.nodes,
                blocks: fixed.blocks,
                pieces: fixed.pieces,
                faces: fixed.faces,
                min: fixed.min.into(),
                max: fixed.max.into(),
            },
            chunk_bytes: fixed.chunk_bytes as usize,
            num_chunks: fixed.num_chunks,
            log,
            sizes,
            colours,
        })
    }

    /// Opens the log, and cuts off what was written after the checkpoint.
    pub fn open_log(&self, scratch: &Scratch, keep: &Keep) -> Result<Opened, Error> {
        let open = || -> Result<_, scratch::Error> {
            let name = keep.log_name();
            let store = Store::open_kept(scratch, &name, self.chunk_bytes, self.num_chunks)?;
            let log = Spool::restore(&store, &self.log)?;
            let sizes = Spool::restore(&store, &self.sizes)?;
            let colours = self.colours.as_ref();
            let colours = colours.map(|saved| Spool::restore(&store, saved)).transpose()?;
            Ok((store, log, sizes, colours))
        };
        let (store, log, sizes, colours) =
            open().map_err(|error| log_error(error, scratch, keep))?;
        Ok(Opened { store, log, sizes, colours, kept: Kept::earlier(scratch, keep) })
    }

    /// The rest of what is known of a log that is whole.
    fn read_coarse(mut self) -> Result<(Coarse, Vec<u8>), CheckpointError> {
        let reader = &mut self.reader;
        let most = u64::from(u32::MAX);
        let (mut vertices, mut notes) = (Vec::<SavedVertex>::new(), Vec::new());
        let (mut faces, mut face_names) = (Vec::<[u32; 3]>::new(), Vec::<u32>::new());
        let mut roots = Vec::<CoarseRoot>::new();
        reader.take("vertices", most, &mut vertices)?;
        let mut colours = Vec::<Colour>::new();
        reader.take("vertex colours", vertices.len() as u64, &mut colours)?;
        reader.take("faces", most, &mut faces)?;
        reader.take("face names", faces.len() as u64, &mut face_names)?;
        reader.take("roots", vertices.len() as u64, &mut roots)?;
        reader.take("notes", 1 << 20, &mut notes)?;
        self.reader.finish()?;
        let num_colours = if self.colours.is_some() { vertices.len() } else { 0 };
        let sound = face_names.len() == faces.len()
            && colours.len() == num_colours
            && face_names.iter().all(|&name| name < self.names.faces)
            && faces.iter().flatten().all(|&v| (v as usize) < vertices.len())
            && roots.iter().all(|root| {
                root.name < self.names.vertices
                    && (root.vertex as usize) < vertices.len()
                    && root.size.nodes > 0
            });
        if !sound {
            return Err(CheckpointError::Damaged("coarsest mesh"));
        }
        let vertex = |v: SavedVertex| BaseVertex {
            position: Vec3::from_array(v.position),
            normal: v.normal,
            root: None,
        };
        let coarse = Coarse {
            base: BaseMesh { vertices: vertices.into_iter().map(vertex).collect(), faces, colours },
            face_names: face_names.into_iter().map(FaceId::new).collect(),
            roots,
        };
        Ok((coarse, notes))
    }
}

/// That a log is not what a checkpoint says is a problem of the checkpoint.
pub(crate) fn log_error(error: scratch::Error, scratch: &Scratch, keep: &Keep) -> Error {
    use io::ErrorKind::{InvalidData, NotFound};
    match error.source.kind() {
        NotFound | InvalidData => keep.fail(scratch, StateProblem::Damaged("the log beside it")),
        _ => error.into(),
    }
}

impl Linked {
    /// What an earlier run has left in this folder; `None` where there is nothing, or a log that is not whole, which
    /// [`Linker::resume`](crate::Linker::resume) goes on with.
    ///
    /// # Errors
    /// [`Error::State`] when it is damaged, or about something else than `keep` and `write` say; [`Error::Scratch`] when the
    /// log cannot be read, or is in use.
    pub fn resume(
        scratch: &Scratch,
        keep: &Keep,
        write: &WriteOptions,
    ) -> Result<Option<Self>, Error> {
        let earlier = Earlier::open(scratch, keep, write)?.filter(|earlier| earlier.is_whole);
        let Some(earlier) = earlier else { return Ok(None) };
        let (names, counts) = (earlier.names, earlier.counts);
        let Opened { store, log, sizes, colours, kept } = earlier.open_log(scratch, keep)?;
        let (coarse, notes) = earlier.read_coarse().map_err(|error| keep.fail(scratch, error))?;
        Ok(Some(Self {
            scratch: scratch.clone(),
            write: write.clone(),
            names,
            store,
            log,
            sizes,
            colours,
            counts,
            coarse,
            notes,
            kept: Some(kept),
        }))
    }
}
