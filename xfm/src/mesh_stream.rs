//! Meshes as streams: where they come from and go to, as a command line names them.

use std::fs::File;
use std::io::{self, IsTerminal, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::SystemTime;

use glam::Vec3;
use mesh_io::{
    Format, Frame, IndexedSource, Take, TakeVertices, Triangle, TriangleSink, TriangleSource,
};
use tempfile::NamedTempFile;

use crate::pipe::PipeReader;
use crate::{Error, interrupt, mapped, text, writable};

/// Whether a path stands for standard input or output.
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Where scratch files go best for an output: beside it if that is a file, else where the system has them.
pub fn scratch_beside(output: &Path) -> PathBuf {
    let is_file = !is_pipe(output) && output.metadata().map_or(true, |m| m.is_file());
    match output.parent() {
        _ if !is_file => std::env::temp_dir(),
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The folder for scratch files that was named, or else the one that is best.
///
/// # Errors
///
/// [`Error::NoScratchFolder`] if the one that was named is not there, [`Error::Scratch`] if it takes no files.
pub fn scratch_folder(
    named: Option<&Path>,
    best: impl FnOnce() -> PathBuf,
) -> Result<PathBuf, Error> {
    match named {
        Some(folder) if !folder.is_dir() => {
            Err(Error::NoScratchFolder { folder: folder.to_owned() })
        }
        Some(folder) => {
            writable::check_scratch(folder)?;
            Ok(folder.to_owned())
        }
        None => Ok(best()),
    }
}

/// A mesh to be read.
#[derive(Debug, Clone)]
pub struct Input {
    path: PathBuf,
    format: Option<Format>,
    /// Length and time of the file when it was opened first.
    first: OnceLock<(u64, Option<SystemTime>)>,
}

impl Input {
    /// `-` is standard input; the format is `format`, or what the extension says, or else what the content shows.
    pub fn new(path: &Path, format: Option<Format>) -> Self {
        Self { path: path.to_owned(), format, first: OnceLock::new() }
    }

    /// Whether it is standard input.
    pub fn is_pipe(&self) -> bool {
        is_pipe(&self.path)
    }

    /// Its name for messages.
    pub fn name(&self) -> String {
        if self.is_pipe() { "standard input".to_owned() } else { self.path.display().to_string() }
    }

    /// Whether it can be read more than once.
    pub fn is_file(&self) -> bool {
        !self.is_pipe() && self.path.metadata().is_ok_and(|metadata| metadata.is_file())
    }

    /// Opens it; again and again, if it is a file.
    ///
    /// # Errors
    ///
    /// What is wrong with its beginning.
    pub fn open(&self) -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
        if self.is_file() {
            mapped::reading(&self.path);
            self.check_unchanged()?;
            mesh_io::open_source_with(&self.path, self.format)
        } else {
            self.source_from(self.pipe()?)
        }
    }

    /// That the file is what it was when it was opened first.
    fn check_unchanged(&self) -> Result<(), mesh_io::Error> {
        // What is not there is told by whoever opens it.
        let Ok(metadata) = self.path.metadata() else { return Ok(()) };
        let now = (metadata.len(), metadata.modified().ok());
        if *self.first.get_or_init(|| now) == now {
            return Ok(());
        }
        Err(mesh_io::Error::Malformed {
            name: self.name(),
            place: mesh_io::Place::File,
            problem: "it changed between two readings".to_owned(),
            remedy: "wait until nothing writes to it any more",
        })
    }

    /// Keeps what comes through a pipe in a scratch file without a name, so that it can be read more than once.
    ///
    /// # Errors
    ///
    /// What the system refuses.
    pub fn keep(&self, scratch: &Path) -> Result<Kept<'_>, Error> {
        let failed = |source| Error::Scratch { folder: scratch.to_owned(), source };
        let mut pipe = self.pipe()?;
        let mut file = tempfile::tempfile_in(scratch).map_err(failed)?;
        io::copy(&mut pipe, &mut file).map_err(failed)?;
        Ok(Kept { input: self, file })
    }

    fn pipe(&self) -> Result<PipeReader, mesh_io::Error> {
        let pipe = if self.is_pipe() {
            PipeReader::new(io::stdin())
        } else {
            // A named pipe keeps waiting until somebody writes to it.
            interrupt::freely(|| File::open(&self.path)).and_then(PipeReader::new)
        };
        pipe.map_err(|source| mesh_io::Error::Io { name: self.name(), action: "open", source })
    }

    fn source_from(
        &self,
        reader: impl io::Read + Send + 'static,
    ) -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
        let format = self.format.or_else(|| Format::from_path(&self.path));
        mesh_io::source_from_with(reader, format, &self.name())
    }
}

/// What came through a pipe.
#[derive(Debug)]
pub struct Kept<'a> {
    input: &'a Input,
    file: File,
}

impl Kept<'_> {
    /// Opens it once more, which ends the reading before.
    ///
    /// # Errors
    ///
    /// What is wrong with its beginning.
    pub fn open(&mut self) -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
        let file = self.file.seek(SeekFrom::Start(0)).and_then(|_| self.file.try_clone());
        let name = self.input.name();
        let failed = |source| mesh_io::Error::Io { name, action: "read", source };
        self.input.source_from(file.map_err(failed)?)
    }
}

/// A mesh to be written.
#[derive(Debug, Clone)]
pub struct Output {
    path: PathBuf,
    /// What it is written as.
    pub format: Format,
    written: Arc<Written>,
}

/// What is known of the triangles written.
#[derive(Debug, Default)]
struct Written {
    /// The bits of the largest absolute coordinate on each axis.
    farthest: [AtomicU32; 3],
    /// Whether nobody reads the output any more.
    reader_left: AtomicBool,
}

impl Output {
    /// `-` is standard output; the format is `format` or what the extension says, on standard output binary PLY.
    ///
    /// # Errors
    ///
    /// An output that could not be written anyway: so that this is not found out after the work.
    pub fn new(path: &Path, format: Option<Format>) -> Result<Self, Error> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if folder.is_some_and(|folder| !folder.is_dir()) {
            return Err(Error::NoFolder { file: path.to_owned() });
        }
        if path.is_dir() {
            return Err(Error::IsAFolder { file: path.to_owned() });
        }
        let format = match format.or_else(|| Format::from_path(path)) {
            Some(format) => format,
            None if is_pipe(path) && io::stdout().is_terminal() => {
                return Err(Error::NoOutputFormat);
            }
            None if is_pipe(path) => Format::PlyBinaryLittle,
            None => {
                return Err(
                    mesh_io::Error::UnknownFormat { name: path.display().to_string() }.into()
                );
            }
        };
        if !is_pipe(path) {
            writable::check(path)?;
        }
        Ok(Self { path: path.to_owned(), format, written: Arc::default() })
    }

    /// Whether it is standard output.
    pub fn is_pipe(&self) -> bool {
        is_pipe(&self.path)
    }

    /// Its name for messages.
    pub fn name(&self) -> String {
        if self.is_pipe() { "standard output".to_owned() } else { self.path.display().to_string() }
    }

    /// Where scratch files go best: beside the output if that is a file, else where the system has them.
    pub fn scratch_folder(&self) -> PathBuf {
        scratch_beside(&self.path)
    }

    /// A sink for triangles in a frame.
    ///
    /// # Errors
    ///
    /// What the system refuses.
    pub fn create(&self, frame: Frame) -> Result<Box<dyn TriangleSink + Send>, mesh_io::Error> {
        let sink = match self.is_pipe() {
            true => mesh_io::sink_to_in(io::stdout(), self.format, frame)?,
            false => mesh_io::create_sink_in(&self.path, Some(self.format), frame)?,
        };
        Ok(Box::new(WatchedSink { sink, written: Arc::clone(&self.written) }))
    }

    /// A sink that writes nothing before it is finished, so that it may be dropped for another one. A pipe's waits in
    /// a file in the folder `scratch`.
    ///
    /// # Errors
    ///
    /// What the system refuses.
    pub fn create_whole(
        &self,
        frame: Frame,
        scratch: &Path,
    ) -> Result<Box<dyn TriangleSink + Send>, mesh_io::Error> {
        if !self.is_pipe() {
            return self.create(frame);
        }
        let name = scratch.display().to_string();
        let failed =
            |source| mesh_io::Error::Io { name, action: "make a scratch file there", source };
        let file = NamedTempFile::with_prefix_in("xfm-", scratch).map_err(failed)?;
        let sink = mesh_io::create_sink_in(file.path(), Some(self.format), frame)?;
        let sink = Box::new(WaitingSink { sink, file });
        Ok(Box::new(WatchedSink { sink, written: Arc::clone(&self.written) }))
    }

    /// Writes a whole mesh whose positions are in a frame, its vertices as they are.
    ///
    /// # Errors
    ///
    /// What the system refuses, those of the mesh, and Ctrl-C.
    pub fn write(&self, mesh: &mut dyn IndexedSource, frame: Frame) -> Result<(), mesh_io::Error> {
        let mut mesh = WatchedMesh { mesh, written: &self.written };
        let written = match self.is_pipe() {
            true => mesh_io::write_indexed_to(io::stdout(), self.format, &mut mesh, frame),
            false => mesh_io::write_indexed(&self.path, Some(self.format), &mut mesh, frame),
        };
        self.written.note_end(written)
    }

    /// Whether nobody reads the output any more: whoever did has seen what they wanted.
    pub fn has_no_reader(&self) -> bool {
        self.written.reader_left.load(Ordering::Relaxed)
    }

    /// What is lost, and the remedy, where the format cannot hold what the frame needs.
    pub fn rounding(&self, frame: Frame) -> Option<String> {
        (frame.double && !self.format.holds_doubles()).then(|| {
            format!(
                "{}: its coordinates are rounded to steps of {}, because the format {} holds single precision only; ply and obj keep the input's digits",
                self.name(),
                text::number(self.step(frame), 3),
                self.format.name()
            )
        })
    }

    /// Whether the format has colours of vertices.
    pub fn holds_colours(&self) -> bool {
        self.format.holds_colours()
    }

    /// What is lost, and the remedy, where vertices have colours and the format has none.
    pub fn colourless(&self, has_colours: bool) -> Option<String> {
        (has_colours && !self.holds_colours()).then(|| {
            format!(
                "{}: the colours are left out, because the format {} holds none; ply, obj and gltf keep them",
                self.name(),
                self.format.name()
            )
        })
    }

    /// How far apart neighbouring coordinates may lie, at most, in what was written in a frame.
    pub fn step(&self, frame: Frame) -> f64 {
        // Where the file holds single precision, it is that about the file's own origin.
        let is_rounded = frame.double && !self.format.holds_doubles();
        let origin = if is_rounded { frame.origin.abs().to_array() } else { [0.0; 3] };
        let steps = self.written.farthest.iter().zip(origin).map(|(farthest, origin)| {
            let farthest = f64::from(f32::from_bits(farthest.load(Ordering::Relaxed)));
            step_at((origin + farthest) as f32)
        });
        steps.fold(0.0, f64::max)
    }
}

/// How far apart the numbers near `x` are in single precision.
fn step_at(x: f32) -> f64 {
    f64::from(x.abs().next_up()) - f64::from(x.abs())
}

impl Written {
    fn note_positions(&self, positions: &[Vec3]) {
        let farthest = positions.iter().fold(Vec3::ZERO, |far, position| far.max(position.abs()));
        for (axis, farthest) in self.farthest.iter().zip(farthest.to_array()) {
            // The bits of numbers that are not negative are in the order of the numbers.
            axis.fetch_max(farthest.to_bits(), Ordering::Relaxed);
        }
    }

    /// Notes that the reader has left, if that is the error.
    fn note_end(&self, result: Result<(), mesh_io::Error>) -> Result<(), mesh_io::Error> {
        if let Err(mesh_io::Error::Io { source, .. }) = &result
            && source.kind() == io::ErrorKind::BrokenPipe
        {
            self.reader_left.store(true, Ordering::Relaxed);
        }
        result
    }
}

/// A mesh of which is noted what is handed out, until Ctrl-C.
struct WatchedMesh<'a> {
    mesh: &'a mut dyn IndexedSource,
    written: &'a Written,
}

/// Ends the writing after Ctrl-C.
fn go_on() -> Result<(), mesh_io::Error> {
    let (name, action) = ("the mesh".to_owned(), "write all of");
    interrupt::check().map_err(|error| mesh_io::Error::Io {
        name,
        action,
        source: io::Error::other(error),
    })
}

impl IndexedSource for WatchedMesh<'_> {
    fn num_vertices(&self) -> u64 {
        self.mesh.num_vertices()
    }

    fn num_triangles(&self) -> u64 {
        self.mesh.num_triangles()
    }

    fn each_position(&mut self, take: &mut Take<'_, Vec3>) -> Result<(), mesh_io::Error> {
        self.mesh.each_position(&mut |positions| {
            go_on()?;
            self.written.note_positions(positions);
            take(positions)
        })
    }

    fn has_colours(&self) -> bool {
        self.mesh.has_colours()
    }

    fn each_vertex(&mut self, take: &mut TakeVertices<'_>) -> Result<(), mesh_io::Error> {
        self.mesh.each_vertex(&mut |positions, colours| {
            go_on()?;
            self.written.note_positions(positions);
            take(positions, colours)
        })
    }

    fn each_triangle(&mut self, take: &mut Take<'_, [u32; 3]>) -> Result<(), mesh_io::Error> {
        self.mesh.each_triangle(&mut |triangles| {
            go_on()?;
            take(triangles)
        })
    }

    fn each_corners(&mut self, take: &mut Take<'_, Triangle>) -> Result<(), mesh_io::Error> {
        self.mesh.each_corners(&mut |triangles| {
            go_on()?;
            self.written.note_positions(triangles.as_flattened());
            take(triangles)
        })
    }
}

/// A sink that notes what goes through.
struct WatchedSink {
    sink: Box<dyn TriangleSink + Send>,
    written: Arc<Written>,
}

impl TriangleSink for WatchedSink {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
        self.written.note_positions(triangles.as_flattened());
        self.written.note_end(self.sink.write(triangles))
    }

    fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
        self.written.note_end(self.sink.finish())
    }
}

/// A sink to a file that is copied to standard output at the end.
struct WaitingSink {
    sink: Box<dyn TriangleSink + Send>,
    /// What the sink replaces; removed when this is dropped.
    file: NamedTempFile,
}

impl TriangleSink for WaitingSink {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
        self.sink.write(triangles)
    }

    fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
        let Self { sink, file } = *self;
        sink.finish()?;
        let whole = File::open(file.path());
        // Without a name, nothing is left of it even if the copying is broken off.
        drop(file);
        let copied = whole.and_then(|mut whole| {
            interrupt::freely(|| io::copy(&mut whole, &mut io::stdout().lock()))
        });
        let name = "standard output".to_owned();
        match copied {
            Ok(_) => Ok(()),
            Err(source) => Err(mesh_io::Error::Io { name, action: "write", source }),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn the_step_is_that_of_the_farthest_coordinate_as_it_is_stored() {
        let output = |name: &str| {
            let output = Output::new(name.as_ref(), None).expect("a format and a folder");
            output.written.note_positions(&[Vec3::new(1.0, -3.0, 0.5), Vec3::ZERO]);
            output
        };
        let near = Frame::default();
        assert_eq!(output("a.stl").step(near), f64::from(f32::EPSILON) * 2.0);
        let far = Frame { origin: DVec3::new(0.0, -1e6, 0.0), double: true };
        assert_eq!(output("a.ply").step(far), f64::from(f32::EPSILON) * 2.0);
        assert_eq!(output("a.stl").step(far), 0.0625);
    }

    #[test]
    fn scratch_files_go_beside_files_only() {
        let folder = |name: &str| Output::new(name.as_ref(), Some(Format::Obj)).expect(name);
        assert_eq!(folder("a.obj").scratch_folder(), Path::new("."));
        assert_eq!(folder("-").scratch_folder(), std::env::temp_dir());
        #[cfg(unix)]
        assert_eq!(folder("/dev/null").scratch_folder(), std::env::temp_dir());
    }
}
