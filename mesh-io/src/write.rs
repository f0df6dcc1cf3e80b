//! The ways out: a path or a writer, from a mesh or from a stream.

use std::io::Write;
use std::path::Path;

use crate::{Error, Format, Frame, IndexedMesh, IndexedSource, Place, TriangleSink};

/// Writes a whole mesh; the format goes by the extension, and `.gz` or `.zst` after it packs the file.
///
/// The file is written beside its target under a temporary name and renamed at the end, so there is a whole file or
/// none, and an older one of that name stays until then. Devices and named pipes are written to directly.
///
/// # Errors
///
/// What the operating system refuses, or the format cannot hold; no file is left behind then.
pub fn write_mesh(path: &Path, mesh: &IndexedMesh) -> Result<(), Error> {
    write_mesh_as(path, None, mesh)
}

/// [`write_mesh`] in this format, whatever the file's name; `None` goes by the name.
///
/// # Errors
///
/// As [`write_mesh`].
pub fn write_mesh_as(path: &Path, format: Option<Format>, mesh: &IndexedMesh) -> Result<(), Error> {
    write_indexed(path, format, &mut checked(mesh, &path.display().to_string())?, Frame::default())
}

/// [`write_mesh_as`] for a mesh that need not be in memory and is in a frame: the frame's origin is added in `f64` to what is
/// written, and where the frame needs it coordinates are written as doubles, if the format has them (see
/// [`Format::holds_doubles`]); otherwise they are rounded to `f32`.
///
/// # Errors
///
/// As [`write_mesh`], and those of the mesh.
pub fn write_indexed(
    path: &Path,
    format: Option<Format>,
    mesh: &mut dyn IndexedSource,
    frame: Frame,
) -> Result<(), Error> {
    let name = path.display().to_string();
    dispatch::file(path, &name, named(path, format, &name)?, mesh, frame)
}

/// Writes a whole mesh to a writer, not packed.
///
/// # Errors
///
/// As [`write_mesh`], except that some of it may have been written.
pub fn write_mesh_to(
    mut writer: impl Write,
    format: Format,
    mesh: &IndexedMesh,
) -> Result<(), Error> {
    write_indexed_to(&mut writer, format, &mut checked(mesh, "output")?, Frame::default())
}

/// [`write_indexed`] to a writer, not packed.
///
/// # Errors
///
/// As [`write_indexed`], except that some of it may have been written.
pub fn write_indexed_to(
    mut writer: impl Write,
    format: Format,
    mesh: &mut dyn IndexedSource,
    frame: Frame,
) -> Result<(), Error> {
    dispatch::mesh(&mut writer, "output", format, mesh, frame)
}

/// Creates a file that takes triangles as they come; the format goes by the extension, and `.gz` or `.zst` packs it.
///
/// The file appears under its name when the sink is finished, as with [`write_mesh`]. STL is written as it comes; PLY and
/// OBJ weld corners with the same coordinate bits, glTF too but only after it has gathered everything in memory.
///
/// # Complexity
///
/// PLY and OBJ remember the last quarter to half million vertices for welding (16 MB at most); a vertex that comes back
/// after more others than that becomes a second one. The faces of a PLY wait in a scratch file beside the target.
///
/// # Errors
///
/// What the operating system refuses.
pub fn create_sink(path: &Path) -> Result<Box<dyn TriangleSink + Send>, Error> {
    create_sink_as(path, None)
}

/// [`create_sink`] in this format, whatever the file's name; `None` goes by the name.
///
/// # Errors
///
/// As [`create_sink`].
pub fn create_sink_as(
    path: &Path,
    format: Option<Format>,
) -> Result<Box<dyn TriangleSink + Send>, Error> {
    create_sink_in(path, format, Frame::default())
}

/// [`create_sink_as`] for triangles in a frame: the frame's origin is added in `f64` to what is written, and where the
/// frame needs it coordinates are written as doubles, if the format has them (see [`Format::holds_doubles`]); otherwise
/// they are rounded to `f32`.
///
/// # Errors
///
/// As [`create_sink`].
pub fn create_sink_in(
    path: &Path,
    format: Option<Format>,
    frame: Frame,
) -> Result<Box<dyn TriangleSink + Send>, Error> {
    let name = path.display().to_string();
    dispatch::file_sink(path, &name, named(path, format, &name)?, frame)
}

/// A sink that writes to a pipe.
///
/// Text STL and OBJ flow as they come. Binary STL and PLY have their counts in front, so they wait (in memory, beyond some
/// MiB in a scratch file) until the sink is finished; readers other than this crate's need those counts right.
///
/// # Errors
///
/// What the operating system refuses.
pub fn sink_to<'a>(
    writer: impl Write + Send + 'a,
    format: Format,
) -> Result<Box<dyn TriangleSink + Send + 'a>, Error> {
    sink_to_in(writer, format, Frame::default())
}

/// [`sink_to`] for triangles in a frame, as [`create_sink_in`].
///
/// # Errors
///
/// What the operating system refuses.
pub fn sink_to_in<'a>(
    writer: impl Write + Send + 'a,
    format: Format,
    frame: Frame,
) -> Result<Box<dyn TriangleSink + Send + 'a>, Error> {
    dispatch::stream_sink(writer, "output", format, frame)
}

/// The mesh, if its triangles name vertices that are there.
fn checked<'a>(mesh: &'a IndexedMesh, name: &str) -> Result<&'a IndexedMesh, Error> {
    let [vertices, colours] = [mesh.positions.len(), mesh.colours.len()];
    if colours != 0 && colours != vertices {
        return Err(Error::Malformed {
            name: name.to_owned(),
            place: Place::File,
            problem: format!("{colours} colours for {vertices} vertices"),
            remedy: "give every vertex a colour, or none",
        });
    }
    match mesh.first_bad_index() {
        None => Ok(mesh),
        Some((_, index)) => Err(Error::IndexOutOfRange {
            name: name.to_owned(),
            place: Place::File,
            index: i64::from(index),
            num_vertices: mesh.positions.len() as u64,
        }),
    }
}

fn named(path: &Path, format: Option<Format>, name: &str) -> Result<Format, Error> {
    format
        .or_else(|| Format::from_path(path))
        .ok_or_else(|| Error::UnknownFormat { name: name.to_owned() })
}

/// From a format to its writer.
#[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
mod dispatch {
    use super::*;
    use crate::codec::output::{BoxedOutput, Pen, Stream, WholeFile};

    /// Vertices in a generation of the welding table; see [`crate::codec::weld::Welder`].
    #[cfg(any(feature = "ply", feature = "obj"))]
    const GENERATION: usize = 1 << 18;

    pub(super) fn file(
        path: &Path,
        name: &str,
        format: Format,
        whole: &mut dyn IndexedSource,
        frame: Frame,
    ) -> Result<(), Error> {
        let mut file = WholeFile::create(path)?;
        mesh(&mut file, name, format, whole, frame)?;
        file.commit().map_err(|error| Error::io(name, "write", error))
    }

    pub(super) fn mesh(
        writer: &mut dyn Write,
        name: &str,
        format: Format,
        mesh: &mut dyn IndexedSource,
        frame: Frame,
    ) -> Result<(), Error> {
        let mut pen = Pen::new(&mut *writer, name);
        match format {
            #[cfg(feature = "stl")]
            Format::StlBinary => crate::stl::write_mesh(&mut pen, mesh, false, frame)?,
            #[cfg(feature = "stl")]
            Format::StlAscii => crate::stl::write_mesh(&mut pen, mesh, true, frame)?,
            #[cfg(feature = "ply")]
            Format::PlyAscii | Format::PlyBinaryLittle | Format::PlyBinaryBig => {
                let colours = mesh.has_colours();
                let rows = crate::ply::Rows { encoding: ply_encoding(format), frame, colours };
                crate::ply::write_mesh(&mut pen, mesh, rows)?;
            }
            #[cfg(feature = "obj")]
            Format::Obj => crate::obj::write_mesh(&mut pen, mesh, frame)?,
            #[cfg(feature = "gltf")]
            Format::Gltf => {
                let container = crate::gltf::Container::Json;
                crate::gltf::write_mesh(&mut pen, mesh, container, frame)?;
            }
            #[cfg(feature = "gltf")]
            Format::Glb => {
                let container = crate::gltf::Container::Binary;
                crate::gltf::write_mesh(&mut pen, mesh, container, frame)?;
            }
            #[allow(unreachable_patterns)]
            _ => return Err(format.family().disabled(name)),
        }
        pen.flush()?;
        writer.flush().map_err(|error| Error::io(name, "write", error))
    }

    #[cfg(feature = "ply")]
    fn ply_encoding(format: Format) -> crate::ply::Encoding {
        match format {
            Format::PlyAscii => crate::ply::Encoding::Ascii,
            Format::PlyBinaryBig => crate::ply::Encoding::Big,
            _ => crate::ply::Encoding::Little,
        }
    }

    pub(super) fn file_sink(
        path: &Path,
        name: &str,
        format: Format,
        frame: Frame,
    ) -> Result<Box<dyn TriangleSink + Send>, Error> {
        sink(Box::new(WholeFile::create(path)?), name, format, frame)
    }

    pub(super) fn stream_sink<'a>(
        writer: impl Write + Send + 'a,
        name: &str,
        format: Format,
        frame: Frame,
    ) -> Result<Box<dyn TriangleSink + Send + 'a>, Error> {
        sink(Box::new(Stream(writer)), name, format, frame)
    }

    fn sink<'a>(
        output: BoxedOutput<'a>,
        name: &str,
        format: Format,
        frame: Frame,
    ) -> Result<Box<dyn TriangleSink + Send + 'a>, Error> {
        #[cfg(any(feature = "ply", feature = "obj"))]
        let welder = crate::codec::weld::Welder::with_generation(GENERATION);
        match format {
            #[cfg(feature = "stl")]
            Format::StlBinary => Ok(Box::new(crate::stl::BinarySink::new(output, name, frame)?)),
            #[cfg(feature = "stl")]
            Format::StlAscii => Ok(Box::new(crate::stl::AsciiSink::new(output, name, frame)?)),
            #[cfg(feature = "ply")]
            Format::PlyAscii | Format::PlyBinaryLittle | Format::PlyBinaryBig => {
                let colours = false;
                let rows = crate::ply::Rows { encoding: ply_encoding(format), frame, colours };
                Ok(Box::new(crate::ply::PlySink::new(output, name, rows, welder)?))
            }
            #[cfg(feature = "obj")]
            Format::Obj => Ok(Box::new(crate::obj::ObjSink::new(output, name, frame, welder)?)),
            #[cfg(feature = "gltf")]
            Format::Gltf => {
                let container = crate::gltf::Container::Json;
                Ok(Box::new(crate::gltf::GltfSink::new(output, name, frame, container)))
            }
            #[cfg(feature = "gltf")]
            Format::Glb => {
                let container = crate::gltf::Container::Binary;
                Ok(Box::new(crate::gltf::GltfSink::new(output, name, frame, container)))
            }
            #[allow(unreachable_patterns)]
            _ => {
                drop((output, frame));
                Err(format.family().disabled(name))
            }
        }
    }
}

/// Without any format there is nothing to write.
#[cfg(not(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf")))]
mod dispatch {
    use super::*;

    pub(super) fn file(
        _path: &Path,
        name: &str,
        format: Format,
        _mesh: &mut dyn IndexedSource,
        _frame: Frame,
    ) -> Result<(), Error> {
        Err(format.family().disabled(name))
    }

    pub(super) fn mesh(
        _writer: &mut dyn Write,
        name: &str,
        format: Format,
        _mesh: &mut dyn IndexedSource,
        _frame: Frame,
    ) -> Result<(), Error> {
        Err(format.family().disabled(name))
    }

    pub(super) fn file_sink(
        _path: &Path,
        name: &str,
        format: Format,
        _frame: Frame,
    ) -> Result<Box<dyn TriangleSink + Send>, Error> {
        Err(format.family().disabled(name))
    }

    pub(super) fn stream_sink<'a>(
        _writer: impl Write + Send + 'a,
        name: &str,
        format: Format,
        _frame: Frame,
    ) -> Result<Box<dyn TriangleSink + Send + 'a>, Error> {
        Err(format.family().disabled(name))
    }
}
