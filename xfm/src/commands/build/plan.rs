//! In core or streaming, and whether there is room for it: all that is decided before the work.

use std::path::{Path, PathBuf};

use mesh_io::Packing;
use scratch::Scratch;
use serde::Serialize;
use xfm_build::MeshOptions;

use crate::Error;
use crate::mesh_stream::Input;

/// Memory without which nothing can be promised.
const LEAST_MEMORY: u64 = 64 << 20;
/// Bytes of a text file per triangle, where it does not say how many there are: few, so that rather too many are expected.
const TEXT_BYTES_PER_TRIANGLE: u64 = 24;
/// Of the file for each triangle; files are smaller, mostly.
const FILE_BYTES_PER_TRIANGLE: u64 = 16;
/// Of scratch files for each triangle: 60 for every collapse, which takes two triangles away.
const SCRATCH_BYTES_PER_TRIANGLE: u64 = 30;

/// How a file is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Mode {
    /// The whole mesh is in memory.
    #[serde(rename = "in-core")]
    InCore,
    /// The mesh flows through a buffer; scratch files hold the rest.
    #[serde(rename = "streaming")]
    Streaming,
}

impl Mode {
    fn new(mode: xfm_build::Mode) -> Self {
        match mode {
            xfm_build::Mode::InCore => Self::InCore,
            _ => Self::Streaming,
        }
    }

    fn of_build(self) -> xfm_build::Mode {
        match self {
            Self::InCore => xfm_build::Mode::InCore,
            Self::Streaming => xfm_build::Mode::Streaming,
        }
    }

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::InCore => "in-core",
            Self::Streaming => "streaming",
        }
    }
}

/// What was decided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// How the file is built.
    pub mode: Mode,
    /// Triangles that are expected; `None` where nothing tells.
    pub expected_triangles: Option<u64>,
    /// Anonymous memory that may be taken, in bytes.
    pub memory: u64,
    /// The folder for scratch files.
    pub scratch: PathBuf,
    /// Whether a run that is broken off leaves there what a later one can go on from.
    pub keeps: bool,
    /// Whether vertices have colours.
    pub colours: bool,
}

impl Plan {
    /// In core where all of the triangles that are expected fit the memory, and streaming where they do not or nobody
    /// knows, unless it is `forced`.
    pub fn new(
        expected_triangles: Option<u64>,
        memory: u64,
        forced: Option<Mode>,
        scratch: PathBuf,
    ) -> Self {
        let mut options = MeshOptions::default();
        options.memory_bytes = memory;
        options.expected_triangles = expected_triangles;
        options.mode = forced.map(Mode::of_build);
        let mode = Mode::new(options.plan().mode);
        Self { mode, expected_triangles, memory, scratch, keeps: false, colours: false }
    }

    /// The same for vertices with colours or without.
    pub fn with_colours(self, colours: bool, forced: Option<Mode>) -> Self {
        let mut options = Self { colours, ..self.clone() }.options();
        options.mode = forced.map(Mode::of_build);
        Self { mode: Mode::new(options.plan().mode), colours, ..self }
    }

    /// Makes sure that the disks have room for the file and for what is written on the way to it.
    ///
    /// # Errors
    ///
    /// [`Error::NoRoom`] where they have not, as far as the system tells and the input says how large it is.
    pub fn check_room(&self, output: &Path) -> Result<(), Error> {
        let Some(triangles) = self.expected_triangles else { return Ok(()) };
        // Of a node, of which there is one for two triangles.
        let colour_bytes = if self.colours { 2 } else { 0 };
        let triangles_bytes = triangles.saturating_mul(SCRATCH_BYTES_PER_TRIANGLE + colour_bytes);
        let beside = match output.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let file = triangles.saturating_mul(FILE_BYTES_PER_TRIANGLE + colour_bytes);
        // What the memory holds besides need not lie on the disk, but what it will hold is not known yet.
        let on_disk = match self.mode {
            // The log, and all of what is made of it.
            _ if self.keeps => {
                triangles_bytes.saturating_mul(2).saturating_add(self.options().checkpoint_bytes())
            }
            Mode::InCore => 0,
            Mode::Streaming => triangles_bytes,
        };
        if beside == self.scratch {
            return require(beside, file.saturating_add(on_disk), "--scratch");
        }
        require(beside, file, "another output")?;
        require(&self.scratch, on_disk, "--scratch")
    }

    /// Makes sure that there is memory at all, and that a mesh that is to be in memory fits there, as far as it is known how
    /// large it is.
    ///
    /// # Errors
    ///
    /// [`Error::LittleMemory`] and [`Error::MemoryTooSmall`].
    pub fn check_memory(&self, input: &Path) -> Result<(), Error> {
        if self.memory < LEAST_MEMORY {
            let (file, memory) = (input.to_owned(), self.memory);
            return Err(Error::LittleMemory { file, needed: LEAST_MEMORY, memory });
        }
        let (Mode::InCore, Some(triangles)) = (self.mode, self.expected_triangles) else {
            return Ok(());
        };
        let (needed, memory) = (self.options().in_core_bytes(triangles), self.memory);
        if needed > memory {
            return Err(Error::MemoryTooSmall {
                file: input.to_owned(),
                triangles,
                needed,
                memory,
            });
        }
        Ok(())
    }

    /// The same for the one who builds.
    pub fn options(&self) -> MeshOptions {
        let mut options = MeshOptions::default();
        options.memory_bytes = self.memory;
        options.expected_triangles = self.expected_triangles;
        options.mode = Some(self.mode.of_build());
        options.colours = self.colours;
        options
    }
}

fn require(folder: &Path, needed: u64, remedy: &'static str) -> Result<(), Error> {
    match Scratch::new(folder).free_bytes() {
        Some(free) if free < needed => {
            Err(Error::NoRoom { folder: folder.to_owned(), needed, free, remedy })
        }
        _ => Ok(()),
    }
}

/// The triangles to expect of an input: what it says itself, or else no fewer than its length allows.
///
/// # Errors
///
/// What is wrong with the beginning of a file.
pub fn expected_triangles(input: &Input, path: &Path) -> Result<Option<u64>, Error> {
    if !input.is_file() {
        return Ok(None);
    }
    let source = input.open()?;
    let known = source.triangle_count().or_else(|| source.triangle_hint());
    Ok(known.or_else(|| match Packing::from_path(path) {
        Packing::None => Some(path.metadata().ok()?.len() / TEXT_BYTES_PER_TRIANGLE),
        _ => None,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(expected: Option<u64>, memory: u64, forced: Option<Mode>) -> Mode {
        Plan::new(expected, memory, forced, ".".into()).mode
    }

    #[test]
    fn what_fits_is_built_in_core_and_what_may_not_streams() {
        assert_eq!(mode(Some(1_000_000), 1 << 30, None), Mode::InCore);
        assert_eq!(mode(Some(100_000_000), 1 << 30, None), Mode::Streaming);
        assert_eq!(mode(Some(100_000_000), 1 << 40, None), Mode::InCore);
        assert_eq!(mode(Some(u64::MAX), u64::MAX - 1, None), Mode::Streaming);
        assert_eq!(mode(None, 1 << 40, None), Mode::Streaming, "nobody knows");
        assert_eq!(mode(Some(10), 1 << 30, Some(Mode::Streaming)), Mode::Streaming);
        assert_eq!(mode(None, 1 << 30, Some(Mode::InCore)), Mode::InCore);
    }

    #[test]
    fn room_is_asked_for_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out.xfm");
        let plan = |expected| Plan::new(Some(expected), 1 << 30, None, folder.path().to_owned());
        plan(1000).check_room(&output).unwrap();
        if cfg!(unix) {
            let message = plan(u64::MAX / 64).check_room(&output).unwrap_err().to_string();
            assert!(message.contains("are free") && message.contains("--scratch"), "{message}");
            let mut elsewhere = plan(u64::MAX / 64);
            elsewhere.scratch = std::env::temp_dir();
            let message = elsewhere.check_room(&output).unwrap_err().to_string();
            assert!(message.contains("another output"), "{message}");
            // Room for what is kept too, even of a mesh that is in memory.
            let free = Scratch::new(folder.path()).free_bytes().unwrap();
            let mut kept = plan(free / 50);
            kept.memory = u64::MAX / 2;
            kept.mode = Mode::InCore;
            kept.check_room(&output).unwrap();
            kept.keeps = true;
            assert!(kept.check_room(&output).is_err());
        }
    }
}
