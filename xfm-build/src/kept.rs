//! A log that outlives the run which wrote it, so that a later one can go on.
//!
//! The log has a name then, `NAME.log`. Once it is whole and on the disk, `NAME.state` is written beside it: where in it
//! everything is, with checksums, what the linker knew besides, and what the input was. So there is such a file only where a
//! later run can go on; without it a log is a remainder of no use, and goes with the run.
//!
//! A run that is broken off while it links leaves nothing. That could be had too: the state would hold the linker's table as
//! well, and what the one who collapses needs to go on; the log's chunks are never overwritten, so that a state stays good
//! while the log grows.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use halfedge::FaceId;
use mergetree::{BaseMesh, BaseVertex, Colour, OctNormal};
use scratch::{SavedChunk, SavedSpool, Scratch, Spool, Store};
use xfm_format::WriteOptions;

use crate::coarse::{Coarse, CoarseRoot};
use crate::link::{Counts, Linked};
use crate::log::{LoggedColour, PageSize};
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

    fn state_path(&self, scratch: &Scratch) -> PathBuf {
        scratch.folder().join(format!("{}.state", self.name))
    }

    /// Removes what an earlier run has left.
    ///
    /// # Errors
    /// When it is there and cannot be removed.
    pub fn remove(&self, scratch: &Scratch) -> Result<(), Error> {
        // Without the state the log is of no use, but not the other way round.
        for path in [self.state_path(scratch), scratch.folder().join(self.log_name())] {
            match fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(scratch.failed(error).into());
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The files of a run. They go with it, unless the log is whole.
#[derive(Debug)]
pub(crate) struct Kept {
    scratch: Scratch,
    keep: Keep,
    is_whole: bool,
}

impl Kept {
    /// For a log that is being written.
    pub fn new(scratch: &Scratch, keep: &Keep) -> Self {
        Self { scratch: scratch.clone(), keep: keep.clone(), is_whole: false }
    }

    /// Removes the files, after the last of them was of use.
    pub fn remove(mut self) -> Result<(), Error> {
        self.is_whole = true;
        self.keep.remove(&self.scratch)
    }

    /// Writes down that the log is whole.
    pub fn save(&mut self, linked: &mut Linked) -> Result<(), Error> {
        let log = linked.log.save(&mut linked.store)?;
        let sizes = linked.sizes.save(&mut linked.store)?;
        linked.store.sync()?;
        let colours = match &mut linked.colours {
            Some(colours) => colours.save(&mut linked.store)?,
            None => SavedSpool::default(),
        };
        linked.store.sync()?;
        let bytes = encode(&self.keep.identity, linked, [&log, &sizes, &colours]);
        let path = self.keep.state_path(&self.scratch);
        write_whole(&path, &bytes)
            .map_err(|error| Error::State { file: path, problem: error.into() })?;
        self.is_whole = true;
        Ok(())
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if !self.is_whole {
            // There is nobody to tell, and what failed before is told already.
            self.keep.remove(&self.scratch).ok();
        }
    }
}

fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = tempfile::NamedTempFile::new_in(path.parent().unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

impl Linked {
    /// What an earlier run has left in this folder; `None` where there is nothing.
    ///
    /// # Errors
    /// [`Error::State`] when it is damaged, or about something else than `keep` and `write` say; [`Error::Scratch`] when the
    /// log is not there.
    pub fn resume(
        scratch: &Scratch,
        keep: &Keep,
        write: &WriteOptions,
    ) -> Result<Option<Self>, Error> {
        let file = keep.state_path(scratch);
        let bytes = match fs::read(&file) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::State { file, problem: error.into() }),
        };
        let fail = |problem| Error::State { file: file.clone(), problem };
        let state = decode(&bytes).ok_or_else(|| fail(StateProblem::Damaged))?;
        let Fixed { levels, page_nodes, .. } = state.fixed;
        if state.identity != keep.identity
            || (levels, u64::from(page_nodes)) != (write.levels, write.page_nodes as u64)
        {
            return Err(fail(StateProblem::Other));
        }
        let chunk_bytes = state.fixed.chunk_bytes as usize;
        let store =
            Store::open_kept(scratch, &keep.log_name(), chunk_bytes, state.fixed.num_chunks)?;
        let (log, sizes) =
            (Spool::restore(&store, &state.log)?, Spool::restore(&store, &state.sizes)?);
        let colours = match state.coarse.base.colours.is_empty() {
            true => None,
            false => Some(Spool::restore(&store, &state.colours)?),
        };
        if log.len() != state.fixed.nodes
            || colours
                .as_ref()
                .is_some_and(|colours: &Spool<LoggedColour>| colours.len() != log.len())
        {
            return Err(fail(StateProblem::Damaged));
        }
        Ok(Some(Self {
            scratch: scratch.clone(),
            write: write.clone(),
            names: NameBounds { vertices: state.fixed.vertex_names, faces: state.fixed.face_names },
            store,
            log,
            sizes,
            colours,
            counts: state.fixed.counts(),
            coarse: state.coarse,
            kept: Some(Kept { scratch: scratch.clone(), keep: keep.clone(), is_whole: true }),
        }))
    }
}

const MAGIC: [u8; 8] = *b"XFMLINK2";

/// All of a state that has always the same size.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Fixed {
    nodes: u64,
    blocks: u64,
    pages: u64,
    faces: u64,
    min: [f32; 3],
    max: [f32; 3],
    levels: u32,
    page_nodes: u32,
    vertex_names: u32,
    face_names: u32,
    chunk_bytes: u32,
    num_chunks: u32,
}

impl Fixed {
    fn counts(&self) -> Counts {
        Counts {
            nodes: self.nodes,
            blocks: self.blocks,
            pages: self.pages,
            faces: self.faces,
            min: self.min.into(),
            max: self.max.into(),
        }
    }
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct SavedVertex {
    position: [f32; 3],
    normal: OctNormal,
}

struct State {
    identity: Vec<u8>,
    fixed: Fixed,
    log: SavedSpool,
    sizes: SavedSpool,
    colours: SavedSpool,
    coarse: Coarse,
}

/// The parts one after another, each with its length before; the checksum of all at the end. In the machine's own byte order:
/// what lies in the log is too.
fn encode(identity: &[u8], linked: &Linked, spools: [&SavedSpool; 3]) -> Vec<u8> {
    let Linked { counts, coarse, names, store, write, .. } = linked;
    let fixed = Fixed {
        nodes: counts.nodes,
        blocks: counts.blocks,
        pages: counts.pages,
        faces: counts.faces,
        min: counts.min.to_array(),
        max: counts.max.to_array(),
        levels: write.levels,
        page_nodes: write.page_nodes as u32,
        vertex_names: names.vertices,
        face_names: names.faces,
        chunk_bytes: store.chunk_bytes() as u32,
        num_chunks: store.num_file_chunks(),
    };
    let saved = |v: &BaseVertex| SavedVertex { position: v.position.into(), normal: v.normal };
    let vertices: Vec<_> = coarse.base.vertices.iter().map(saved).collect();
    let face_names: Vec<u32> = coarse.face_names.iter().map(|name| name.get()).collect();
    let mut bytes = MAGIC.to_vec();
    let mut part = |content: &[u8]| {
        bytes.extend((content.len() as u64).to_ne_bytes());
        bytes.extend_from_slice(content);
    };
    part(identity);
    part(bytemuck::bytes_of(&fixed));
    for spool in spools {
        part(bytemuck::cast_slice(&spool.chunks));
    }
    part(bytemuck::cast_slice(&vertices));
    part(bytemuck::cast_slice(&coarse.base.colours));
    part(bytemuck::cast_slice(&coarse.base.faces));
    part(bytemuck::cast_slice(&face_names));
    part(bytemuck::cast_slice(&coarse.roots));
    part(bytemuck::cast_slice(&coarse.root_pages));
    let crc = crc32fast::hash(&bytes);
    bytes.extend(crc.to_ne_bytes());
    bytes
}

fn decode(bytes: &[u8]) -> Option<State> {
    let (content, crc) = bytes.split_last_chunk::<4>()?;
    if crc32fast::hash(content) != u32::from_ne_bytes(*crc) {
        return None;
    }
    let mut parts = Parts(content.strip_prefix(&MAGIC)?);
    let identity = parts.next()?.to_vec();
    let [fixed] = parts.items::<Fixed>()?.try_into().ok()?;
    let log = SavedSpool { chunks: parts.items::<SavedChunk>()? };
    let sizes = SavedSpool { chunks: parts.items::<SavedChunk>()? };
    let saved_colours = SavedSpool { chunks: parts.items::<SavedChunk>()? };
    let vertices = parts.items::<SavedVertex>()?;
    let colours = parts.items::<Colour>()?;
    let faces = parts.items::<[u32; 3]>()?;
    let face_names = parts.items::<u32>()?;
    let roots = parts.items::<CoarseRoot>()?;
    let root_pages = parts.items::<PageSize>()?;
    let sound = parts.0.is_empty()
        && (colours.is_empty() || colours.len() == vertices.len())
        && face_names.len() == faces.len()
        && face_names.iter().all(|&name| name < fixed.face_names)
        && faces.iter().flatten().all(|&v| (v as usize) < vertices.len())
        && roots.iter().all(|root| {
            root.name < fixed.vertex_names
                && (root.vertex as usize) < vertices.len()
                && (root.page as usize) < root_pages.len()
        })
        && (1 << 10..=1 << 20).contains(&fixed.chunk_bytes);
    let vertex = |v: SavedVertex| BaseVertex {
        position: Vec3::from_array(v.position),
        normal: v.normal,
        root: None,
    };
    sound.then(|| State {
        identity,
        fixed,
        log,
        sizes,
        colours: saved_colours,
        coarse: Coarse {
            base: BaseMesh { vertices: vertices.into_iter().map(vertex).collect(), faces, colours },
            face_names: face_names.into_iter().map(FaceId::new).collect(),
            roots,
            root_pages,
        },
    })
}

/// The parts that are still to be read.
struct Parts<'a>(&'a [u8]);

impl<'a> Parts<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let (len, rest) = self.0.split_first_chunk::<8>()?;
        let len = usize::try_from(u64::from_ne_bytes(*len)).ok()?;
        let (content, rest) = rest.split_at_checked(len)?;
        self.0 = rest;
        Some(content)
    }

    fn items<T: Pod>(&mut self) -> Option<Vec<T>> {
        let content = self.next()?;
        if content.len() % size_of::<T>() != 0 {
            return None;
        }
        Some(content.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }
}
