//! Meshes as streams: where they come from and go to, as a command line names them.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use glam::Vec3;
use mesh_io::{Format, Frame, IndexedMesh, MeshSource, Triangle, TriangleSink, TriangleSource};
use tempfile::TempDir;

use crate::Error;
use crate::pipe::PipeReader;

/// Triangles handed to a sink at once.
const BATCH: usize = 1 << 14;

/// Whether a path stands for standard input or output.
pub fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// A mesh to be read.
#[derive(Debug, Clone)]
pub struct Input {
    path: PathBuf,
    format: Option<Format>,
    /// The bits of the largest absolute coordinate read so far.
    largest: Arc<AtomicU32>,
}

impl Input {
    /// `-` is standard input; the format is `format`, or what the extension says, or else what the content shows.
    pub fn new(path: &Path, format: Option<Format>) -> Self {
        Self { path: path.to_owned(), format, largest: Arc::default() }
    }

    /// Its name for messages.
    pub fn name(&self) -> String {
        if is_pipe(&self.path) {
            "standard input".to_owned()
        } else {
            self.path.display().to_string()
        }
    }

    /// Whether it can be read more than once.
    pub fn is_file(&self) -> bool {
        !is_pipe(&self.path) && self.path.metadata().is_ok_and(|metadata| metadata.is_file())
    }

    /// Opens it; again and again, if it is a file.
    ///
    /// # Errors
    ///
    /// What is wrong with its beginning.
    pub fn open(&self) -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
        let source = if self.is_file() {
            mesh_io::open_source_with(&self.path, self.format)?
        } else if is_pipe(&self.path) {
            self.open_pipe(io::stdin())?
        } else {
            let name = self.name();
            let opened = File::open(&self.path).map_err(|source| mesh_io::Error::Io {
                name,
                action: "open",
                source,
            })?;
            self.open_pipe(opened)?
        };
        Ok(Box::new(MeasuredSource { source, largest: Arc::clone(&self.largest) }))
    }

    fn open_pipe(
        &self,
        pipe: impl io::Read + Send + 'static,
    ) -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
        let failed = |source| mesh_io::Error::Io { name: self.name(), action: "read", source };
        let format = self.format.or_else(|| Format::from_path(&self.path));
        mesh_io::source_from_with(PipeReader::new(pipe).map_err(failed)?, format, &self.name())
    }

    /// The largest absolute coordinate read so far, in the frame it was read in.
    pub fn largest(&self) -> f32 {
        f32::from_bits(self.largest.load(Ordering::Relaxed))
    }
}

/// How far apart the numbers near `x` are in single precision.
pub fn step_at(x: f32) -> f64 {
    f64::from(x.abs().next_up()) - f64::from(x.abs())
}

/// The largest absolute coordinate of triangles; infinities and numbers that are none do not count.
pub fn largest_coordinate(triangles: &[Triangle]) -> f32 {
    let finite = |x: f32| if x < f32::INFINITY { x } else { 0.0 };
    let largest = |most: Vec3, t: &Triangle| most.max(t[0].abs()).max(t[1].abs()).max(t[2].abs());
    let largest = triangles.iter().fold(Vec3::ZERO, largest).max_element();
    if largest < f32::INFINITY {
        return largest;
    }
    triangles.as_flattened().iter().flat_map(|p| p.abs().to_array()).map(finite).fold(0.0, f32::max)
}

/// A source whose coordinates are looked at.
struct MeasuredSource {
    source: Box<dyn TriangleSource + Send>,
    largest: Arc<AtomicU32>,
}

impl MeasuredSource {
    fn measure(&self, triangles: &[Triangle]) {
        // The bits of numbers that are not negative are in the order of the numbers.
        self.largest.fetch_max(largest_coordinate(triangles).to_bits(), Ordering::Relaxed);
    }
}

impl TriangleSource for MeasuredSource {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, mesh_io::Error> {
        let before = out.len();
        let count = self.source.read(out, max)?;
        self.measure(&out[before..]);
        Ok(count)
    }

    fn triangle_count(&self) -> Option<u64> {
        self.source.triangle_count()
    }

    fn triangle_hint(&self) -> Option<u64> {
        self.source.triangle_hint()
    }

    fn has_vertex_numbers(&self) -> bool {
        self.source.has_vertex_numbers()
    }

    fn read_numbered(
        &mut self,
        out: &mut Vec<Triangle>,
        numbers: &mut Vec<[u64; 3]>,
        max: usize,
    ) -> Result<usize, mesh_io::Error> {
        let before = out.len();
        let count = self.source.read_numbered(out, numbers, max)?;
        self.measure(&out[before..]);
        Ok(count)
    }

    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        self.source.look_up(numbers, out);
    }

    fn frame(&self) -> Frame {
        self.source.frame()
    }
}

/// A mesh to be written.
#[derive(Debug, Clone)]
pub struct Output {
    path: PathBuf,
    /// What it is written as.
    pub format: Format,
    /// Whether nobody reads standard output any more.
    reader_left: Arc<AtomicBool>,
}

impl Output {
    /// `-` is standard output; the format is `format` or what the extension says.
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
            None if is_pipe(path) => return Err(Error::NoOutputFormat),
            None => {
                return Err(
                    mesh_io::Error::UnknownFormat { name: path.display().to_string() }.into()
                );
            }
        };
        Ok(Self { path: path.to_owned(), format, reader_left: Arc::default() })
    }

    /// Whether it is standard output.
    pub fn is_pipe(&self) -> bool {
        is_pipe(&self.path)
    }

    /// Its name for messages.
    pub fn name(&self) -> String {
        if self.is_pipe() { "standard output".to_owned() } else { self.path.display().to_string() }
    }

    /// A sink for triangles in a frame.
    ///
    /// # Errors
    ///
    /// What the system refuses.
    pub fn create(&self, frame: Frame) -> Result<Box<dyn TriangleSink + Send>, mesh_io::Error> {
        if self.is_pipe() {
            let sink = mesh_io::sink_to_in(io::stdout(), self.format, frame)?;
            let reader_left = Arc::clone(&self.reader_left);
            return Ok(Box::new(PipeSink { sink, reader_left }));
        }
        mesh_io::create_sink_in(&self.path, Some(self.format), frame)
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
        let folder =
            tempfile::Builder::new().prefix("xfm-").tempdir_in(scratch).map_err(|source| {
                mesh_io::Error::Io { name, action: "make a scratch folder there", source }
            })?;
        let file = folder.path().join("mesh");
        let sink = mesh_io::create_sink_in(&file, Some(self.format), frame)?;
        let reader_left = Arc::clone(&self.reader_left);
        Ok(Box::new(WaitingSink { sink, file, _folder: folder, reader_left }))
    }

    /// Writes a whole mesh whose positions are in a frame.
    ///
    /// # Errors
    ///
    /// What the system refuses.
    pub fn write(&self, mesh: &IndexedMesh, frame: Frame) -> Result<(), mesh_io::Error> {
        if frame == Frame::default() {
            return match self.is_pipe() {
                true => {
                    note(mesh_io::write_mesh_to(io::stdout(), self.format, mesh), &self.reader_left)
                }
                false => mesh_io::write_mesh_as(&self.path, Some(self.format), mesh),
            };
        }
        // Only sinks write in other frames.
        let mut sink = self.create(frame)?;
        let mut source = MeshSource::new(mesh.clone(), &self.name());
        let mut batch = Vec::new();
        while source.read(&mut batch, BATCH)? > 0 {
            sink.write(&batch)?;
            batch.clear();
        }
        sink.finish()
    }

    /// Whether nobody reads standard output any more: whoever did has seen what they wanted.
    pub fn has_no_reader(&self) -> bool {
        self.reader_left.load(Ordering::Relaxed)
    }
}

/// Notes that the reader has left, if that is the error.
fn note(
    result: Result<(), mesh_io::Error>,
    reader_left: &AtomicBool,
) -> Result<(), mesh_io::Error> {
    if let Err(mesh_io::Error::Io { source, .. }) = &result
        && source.kind() == io::ErrorKind::BrokenPipe
    {
        reader_left.store(true, Ordering::Relaxed);
    }
    result
}

/// A sink to standard output that notes when the reader has left.
struct PipeSink<'a> {
    sink: Box<dyn TriangleSink + Send + 'a>,
    reader_left: Arc<AtomicBool>,
}

impl TriangleSink for PipeSink<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
        note(self.sink.write(triangles), &self.reader_left)
    }

    fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
        note(self.sink.finish(), &self.reader_left)
    }
}

/// A sink to a file that is copied to standard output at the end.
struct WaitingSink {
    sink: Box<dyn TriangleSink + Send>,
    file: PathBuf,
    /// Removed with the file when this is dropped.
    _folder: TempDir,
    reader_left: Arc<AtomicBool>,
}

impl TriangleSink for WaitingSink {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
        self.sink.write(triangles)
    }

    fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
        self.sink.finish()?;
        let copied = File::open(&self.file)
            .and_then(|mut file| io::copy(&mut file, &mut io::stdout()))
            .and_then(|_| io::Write::flush(&mut io::stdout()));
        let failed =
            |source| mesh_io::Error::Io { name: "output".to_owned(), action: "write", source };
        note(copied.map_err(failed), &self.reader_left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_coordinate_is_the_largest_finite_one() {
        let triangle = |x: f32| [Vec3::new(1.0, -2.0, x), Vec3::ZERO, Vec3::ONE];
        assert_eq!(largest_coordinate(&[triangle(0.0), triangle(-7.0)]), 7.0);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(largest_coordinate(&[triangle(odd), triangle(3.0)]), 3.0);
        }
        assert_eq!(largest_coordinate(&[]), 0.0);
    }

    #[test]
    fn steps_double_with_the_size() {
        assert_eq!(step_at(1_000_000.0), 0.0625);
        assert_eq!(step_at(-4_000_000.0), 0.25);
    }
}
