//! The ways in: a path or a reader, as a mesh or as a stream.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::frame::Framing;
use crate::{Error, Format, Frame, IndexedMesh, TriangleSource};

/// How to read a mesh.
#[derive(Clone, Copy, Default)]
#[non_exhaustive]
pub struct ReadOptions<'a> {
    /// The format; `None` (the default) goes by the file's extension, and by its content where that tells nothing.
    pub format: Option<Format>,
    /// Called now and then with the bytes of the file taken in so far (as they lie there, packed or not) and their total,
    /// where that is known. Default: not called.
    pub progress: Option<&'a dyn Fn(u64, Option<u64>)>,
}

impl std::fmt::Debug for ReadOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReadOptions")
            .field("format", &self.format)
            .field("progress", &self.progress.map(|_| "…"))
            .finish()
    }
}

impl<'a> ReadOptions<'a> {
    /// Reads the file as this format, whatever its name.
    #[must_use]
    pub fn with_format(mut self, format: Format) -> Self {
        self.format = Some(format);
        self
    }

    /// Reports progress to this function.
    #[must_use]
    pub fn with_progress(mut self, progress: &'a dyn Fn(u64, Option<u64>)) -> Self {
        self.progress = Some(progress);
        self
    }
}

/// Reads a whole mesh; the format goes by the extension, and by the content where that tells nothing.
///
/// STL corners with the same coordinate bits become one vertex; the other formats' vertices stay as they are. Coordinates
/// are rounded to `f32` where they are, see [`read_mesh_in_frame`].
///
/// # Errors
///
/// What is wrong with the file, with the place and the remedy; see [`Error`].
pub fn read_mesh(path: &Path) -> Result<IndexedMesh, Error> {
    read_mesh_with(path, &ReadOptions::default())
}

/// [`read_mesh`] with options.
///
/// # Errors
///
/// As [`read_mesh`].
pub fn read_mesh_with(path: &Path, options: &ReadOptions<'_>) -> Result<IndexedMesh, Error> {
    read_whole(path, options, Framing::Own).map(|(mesh, _)| mesh)
}

/// [`read_mesh_with`] that keeps the digits of coordinates far from zero: positions are in the [`Frame`] that comes with
/// the mesh, as those of a [`TriangleSource`] are.
///
/// # Errors
///
/// As [`read_mesh`].
pub fn read_mesh_in_frame(
    path: &Path,
    options: &ReadOptions<'_>,
) -> Result<(IndexedMesh, Frame), Error> {
    read_whole(path, options, Framing::Local)
}

fn read_whole(
    path: &Path,
    options: &ReadOptions<'_>,
    framing: Framing,
) -> Result<(IndexedMesh, Frame), Error> {
    let (file, name, length) = open(path)?;
    let reader = Progress { reader: file, done: 0, total: length, report: options.progress };
    let format = options.format.or_else(|| Format::from_path(path));
    dispatch::mesh(reader, length, format, &name, path.parent(), framing)
}

/// Reads a whole mesh from a reader; `name` is for messages.
///
/// ```
/// # #[cfg(feature = "ply")] {
/// use mesh_io::{Format, read_mesh_from};
/// let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
///            element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 9\n";
/// let error = read_mesh_from(ply.as_bytes(), Format::PlyAscii, "bad.ply").unwrap_err();
/// assert!(error.to_string().starts_with("bad.ply, line 11: vertex index 9 is out of range"));
/// # }
/// ```
///
/// # Errors
///
/// As [`read_mesh`]; a glTF that refers to other files cannot be read this way.
pub fn read_mesh_from(
    reader: impl Read + Send,
    format: Format,
    name: &str,
) -> Result<IndexedMesh, Error> {
    dispatch::mesh(reader, None, Some(format), name, None, Framing::Own).map(|(mesh, _)| mesh)
}

/// Opens a file as a stream of triangles.
///
/// Coordinates are in the source's [`frame`](TriangleSource::frame), which is the file's own unless they are doubles or
/// decimals far from zero. STL needs no memory beyond a buffer. Binary PLY leaves the vertices in the file, which is mapped into memory and must
/// not be shortened meanwhile; other PLY and OBJ keep the positions in memory; glTF the whole mesh.
///
/// # Errors
///
/// What is wrong with the beginning of the file; see [`Error`]. The rest shows while reading.
pub fn open_source(path: &Path) -> Result<Box<dyn TriangleSource + Send>, Error> {
    open_source_with(path, None)
}

/// [`open_source`] for a file of this format, whatever its name; `None` goes by the name.
///
/// # Errors
///
/// As [`open_source`].
pub fn open_source_with(
    path: &Path,
    format: Option<Format>,
) -> Result<Box<dyn TriangleSource + Send>, Error> {
    let (file, name, length) = open(path)?;
    let format = format.or_else(|| Format::from_path(path));
    dispatch::source(file, length, format, &name, Some(path))
}

/// A stream of triangles from a reader, a pipe for instance; `name` is for messages.
///
/// # Errors
///
/// As [`open_source`]; a glTF that refers to other files cannot be read this way.
pub fn source_from<'a>(
    reader: impl Read + Send + 'a,
    format: Format,
    name: &str,
) -> Result<Box<dyn TriangleSource + Send + 'a>, Error> {
    dispatch::source(reader, None, Some(format), name, None)
}

/// [`source_from`] for a reader whose content tells the format where `format` is `None`.
///
/// # Errors
///
/// As [`source_from`], and [`Error::UnknownFormat`].
pub fn source_from_with<'a>(
    reader: impl Read + Send + 'a,
    format: Option<Format>,
    name: &str,
) -> Result<Box<dyn TriangleSource + Send + 'a>, Error> {
    dispatch::source(reader, None, format, name, None)
}

/// The file, its name for messages, and its length if it is a regular one.
fn open(path: &Path) -> Result<(File, String, Option<u64>), Error> {
    let name = path.display().to_string();
    let failed = |error| Error::io(&name, "open", error);
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if metadata.is_dir() {
        return Err(failed(std::io::ErrorKind::IsADirectory.into()));
    }
    let length = metadata.is_file().then_some(metadata.len());
    Ok((file, name, length))
}

/// Reports how far a reader is.
struct Progress<'a, R> {
    reader: R,
    done: u64,
    total: Option<u64>,
    report: Option<&'a dyn Fn(u64, Option<u64>)>,
}

impl<R: Read> Read for Progress<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = self.reader.read(out)?;
        self.done += count as u64;
        if let Some(report) = self.report {
            report(self.done, self.total);
        }
        Ok(count)
    }
}

/// From bytes to the reader of their format.
#[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
mod dispatch {
    use super::*;
    use crate::codec::input::Input;
    use crate::codec::packing::Unpacked;
    use crate::format::Family;

    fn unpack<R: Read>(
        reader: R,
        length: Option<u64>,
        name: &str,
    ) -> Result<(Input<Unpacked<R>>, bool), Error> {
        let reader = Unpacked::new(reader, name)?;
        let plain = reader.is_plain();
        Ok((Input::new(reader, name, length.filter(|_| plain)), plain))
    }

    fn family<R: Read>(input: &mut Input<R>, format: Option<Format>) -> Result<Family, Error> {
        if input.fill(1)? == 0 {
            return Err(input.empty());
        }
        if let Some(format) = format {
            return Ok(format.family());
        }
        input.fill(Family::TELLING_BYTES)?;
        Family::from_content(input.window())
            .ok_or_else(|| Error::UnknownFormat { name: input.name().to_owned() })
    }

    pub(super) fn mesh<R: Read>(
        reader: R,
        length: Option<u64>,
        format: Option<Format>,
        name: &str,
        folder: Option<&Path>,
        framing: Framing,
    ) -> Result<(IndexedMesh, Frame), Error> {
        let (mut input, _) = unpack(reader, length, name)?;
        match family(&mut input, format)? {
            #[cfg(feature = "stl")]
            Family::Stl => crate::stl::read_mesh(input, framing),
            #[cfg(feature = "ply")]
            Family::Ply => crate::ply::read_mesh(input, framing),
            #[cfg(feature = "obj")]
            Family::Obj => crate::obj::read_mesh(input, framing),
            #[cfg(feature = "gltf")]
            Family::Gltf => {
                crate::gltf::read_mesh(input, folder).map(|mesh| (mesh, Frame::default()))
            }
            #[allow(unreachable_patterns)]
            family => {
                let _unused_without_some = (folder, framing);
                Err(family.disabled(name))
            }
        }
    }

    pub(super) fn source<'a, R: Read + Send + 'a>(
        reader: R,
        length: Option<u64>,
        format: Option<Format>,
        name: &str,
        path: Option<&Path>,
    ) -> Result<Box<dyn TriangleSource + Send + 'a>, Error> {
        let (mut input, plain) = unpack(reader, length, name)?;
        let framing = Framing::Local;
        match family(&mut input, format)? {
            #[cfg(feature = "stl")]
            Family::Stl => Ok(Box::new(crate::stl::StlReader::new(input, framing)?)),
            #[cfg(feature = "ply")]
            Family::Ply => {
                use crate::codec::indexed::IndexedSource;
                use crate::ply::{Origin, PlyReader};
                let regular = path.filter(|_| length.is_some());
                let Some(path) = regular else {
                    let reader = PlyReader::new(input, Origin::default(), framing)?;
                    return Ok(Box::new(IndexedSource::new(reader)));
                };
                // Boxed, so that a second pass over the file is of the same type as the first.
                let input = input.map_reader(|reader| Box::new(reader) as Box<dyn Read + Send>);
                let file = match plain {
                    true => Some(open(path)?.0),
                    false => None,
                };
                let again = path.to_path_buf();
                let reopen = Box::new(move || {
                    let (file, name, length) = open(&again)?;
                    let (input, _) = unpack(file, length, &name)?;
                    Ok(input.map_reader(|reader| Box::new(reader) as Box<dyn Read + Send>))
                });
                let origin = Origin { reopen: Some(reopen), file };
                Ok(Box::new(IndexedSource::new(PlyReader::new(input, origin, framing)?)))
            }
            #[cfg(feature = "obj")]
            Family::Obj => {
                let reader = crate::obj::ObjReader::new(input, framing)?;
                Ok(Box::new(crate::codec::indexed::IndexedSource::new(reader)))
            }
            #[cfg(feature = "gltf")]
            Family::Gltf => {
                let folder = path.and_then(Path::parent);
                let mesh = crate::gltf::read_mesh(input, folder)?;
                Ok(Box::new(crate::MeshSource::new(mesh, name)))
            }
            #[allow(unreachable_patterns)]
            family => {
                let _unused_without_ply = (plain, path, framing);
                Err(family.disabled(name))
            }
        }
    }
}

/// Without any format there is nothing to read.
#[cfg(not(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf")))]
mod dispatch {
    use super::*;

    fn disabled(format: Option<Format>, name: &str) -> Error {
        match format {
            Some(format) => format.family().disabled(name),
            None => Error::UnknownFormat { name: name.to_owned() },
        }
    }

    pub(super) fn mesh<R: Read>(
        _reader: R,
        _length: Option<u64>,
        format: Option<Format>,
        name: &str,
        _folder: Option<&Path>,
        _framing: Framing,
    ) -> Result<(IndexedMesh, Frame), Error> {
        Err(disabled(format, name))
    }

    pub(super) fn source<'a, R: Read + Send + 'a>(
        _reader: R,
        _length: Option<u64>,
        format: Option<Format>,
        name: &str,
        _path: Option<&Path>,
    ) -> Result<Box<dyn TriangleSource + Send + 'a>, Error> {
        Err(disabled(format, name))
    }
}
