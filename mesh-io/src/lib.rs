//! Triangle streams and in-core meshes: STL, PLY, OBJ and glTF/GLB in and out.
//!
//! Two traits are the reason for this crate: [`TriangleSource`] hands out the triangles of a file or a pipe batch by
//! batch, [`TriangleSink`] takes them. [`IndexedMesh`] is the whole mesh in memory, [`IndexedSource`] one that need not be.
//!
//! ```
//! # #[cfg(all(feature = "obj", feature = "stl"))] {
//! use mesh_io::{Format, read_mesh_from, sink_to, source_from};
//!
//! let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
//! let mesh = read_mesh_from(obj.as_bytes(), Format::Obj, "square.obj")?;
//! assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
//!
//! // The same as a stream, from one format to another.
//! let mut source = source_from(obj.as_bytes(), Format::Obj, "square.obj")?;
//! let mut stl = Vec::new();
//! let mut sink = sink_to(&mut stl, Format::StlBinary)?;
//! let mut batch = Vec::new();
//! while source.read(&mut batch, 1024)? > 0 {
//!     sink.write(&batch)?;
//!     batch.clear();
//! }
//! sink.finish()?;
//! assert_eq!(stl.len(), 84 + 2 * 50);
//! # }
//! # Ok::<(), mesh_io::Error>(())
//! ```
//!
//! # Conventions
//!
//! - Coordinates are in the file's own frame and unit; no axis is swapped and no winding is changed (a glTF node that
//!   mirrors turns its triangles round, as that format demands).
//! - Coordinates that `f32` would crush (doubles and decimals far from zero) are streamed about a local origin and
//!   written back about it; see [`Frame`]. [`read_mesh`] leaves them where they are.
//! - Decimal numbers are rounded to the nearest `f32`; written ones are the shortest that read back to the same bits.
//! - Non-finite coordinates pass through; degenerate triangles too. Faces with fewer than three corners have no area and
//!   are left out.
//! - Vertices of PLY, OBJ and glTF may have colours ([`Colour`]); they are rounded to eight bits a component, and nothing else
//!   is done to them. OBJ has no alpha; STL has no colours, and neither have the textures and materials of the others.
//! - Polygons become triangles: a fan from the first corner where the polygon is convex, ear clipping otherwise.
//! - STL has no vertices of its own: [`read_mesh`] welds corners whose coordinates have the same bits (−0 equals +0).
//!   Indexed formats keep their vertices as they are, used or not.
//! - Input packed with gzip or Zstandard is unpacked on the fly, whatever its name; output is packed when its name ends
//!   in `.gz` or `.zst`.
//! - A file that is written appears whole or not at all.
//! - No count or size in a file is believed: memory grows with the bytes that are really there, in what is unpacked. It takes at
//!   most 2 MiB and 128 times as many bytes; a glTF, whose nodes may show a mesh many times, 1024 times as many.
//!
//! Every format is one cargo feature (`stl`, `ply`, `obj`, `gltf`), and so is each packing (`gz`, `zst`); all are on by
//! default. Without any, the traits and [`IndexedMesh`] remain.

mod error;
mod format;
mod frame;
mod indexed;
mod mesh;
mod read;
mod stream;
mod write;

// Shared by the formats; with some of them left out, some of it is not needed.
#[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
#[cfg_attr(
    not(all(feature = "stl", feature = "ply", feature = "obj", feature = "gltf")),
    allow(dead_code)
)]
mod codec;

#[cfg(feature = "gltf")]
mod gltf;
#[cfg(feature = "obj")]
mod obj;
#[cfg(feature = "ply")]
mod ply;
#[cfg(feature = "stl")]
mod stl;

pub use error::{Error, Place};
pub use format::{Format, Packing};
pub use frame::Frame;
pub use indexed::{IndexedSource, Take, TakeVertices};
pub use mesh::{Colour, IndexedMesh, Triangle};
pub use read::{
    ReadOptions, open_source, open_source_with, read_mesh, read_mesh_from, read_mesh_in_frame,
    read_mesh_with, source_from, source_from_with,
};
pub use stream::{MeshSource, TriangleSink, TriangleSource};
pub use write::{
    create_sink, create_sink_as, create_sink_in, sink_to, sink_to_in, write_indexed,
    write_indexed_to, write_mesh, write_mesh_as, write_mesh_to,
};
