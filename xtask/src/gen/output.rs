//! Binary STL and PLY, written as they are generated.

use std::io::{self, Write};

use super::{Generator, Triangle, rings};
use crate::Error;

/// Bytes of one triangle in a binary STL.
const STL_TRIANGLE: usize = 50;

/// Writes a binary STL.
///
/// # Errors
/// [`Error::Write`] when the output fails, or when there are more triangles than STL can count.
pub fn write_stl(generator: &Generator, out: &mut dyn Write) -> Result<u64, Error> {
    let count = generator.num_triangles();
    let stated = u32::try_from(count).map_err(|_| {
        Error::Unsupported(format!("{count} triangles do not fit into a binary STL"))
    })?;
    // Must not start with "solid", which announces text.
    let mut header = [0; 80];
    header[..31].copy_from_slice(b"binary STL by cargo xtask gen  ");
    out.write_all(&header)?;
    out.write_all(&stated.to_le_bytes())?;
    let mut bytes = Vec::new();
    generator.triangles(&mut |chunk| {
        bytes.resize(chunk.len() * STL_TRIANGLE, 0);
        for (record, triangle) in bytes.chunks_exact_mut(STL_TRIANGLE).zip(chunk) {
            write_record(record, triangle);
        }
        out.write_all(&bytes)
    })?;
    out.flush()?;
    Ok(count)
}

#[inline]
fn write_record(record: &mut [u8], triangle: &Triangle) {
    let corners = [normal(triangle), triangle[0], triangle[1], triangle[2]];
    let (numbers, _attribute) = record.as_chunks_mut::<4>();
    for (bytes, value) in numbers.iter_mut().zip(corners.as_flattened()) {
        *bytes = value.to_le_bytes();
    }
}

/// The unit normal, zero for a triangle without area.
fn normal([a, b, c]: &Triangle) -> [f32; 3] {
    let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|c| c / length) } else { [0.0; 3] }
}

/// Writes a binary little-endian PLY with shared vertices, in the order of the strips.
///
/// # Errors
/// [`Error::Unsupported`] for a shape without numbered vertices or a shuffled order;
/// [`Error::Write`] when the output fails.
pub fn write_ply(generator: &Generator, out: &mut dyn Write) -> Result<u64, Error> {
    let Some(surface) = generator.rings() else {
        return Err(Error::Unsupported(
            "an isosurface is generated as triangles without shared vertices; write it as .stl"
                .into(),
        ));
    };
    if generator.options.shuffle {
        return Err(Error::Unsupported("a shuffled mesh can be written as .stl only".into()));
    }
    let count = generator.num_triangles();
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment cargo xtask gen\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {count}\nproperty list uchar int vertex_indices\nend_header\n",
        surface.num_vertices()
    )?;
    let (mut positions, mut bytes) = (Vec::new(), Vec::new());
    for ring in 0..surface.num_rings() {
        positions.clear();
        surface.positions(ring, 0..surface.ring_len(ring), &mut positions);
        bytes.clear();
        bytes.extend(positions.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
        out.write_all(&bytes)?;
    }
    rings::faces(surface, &generator.options, &mut |face| {
        let mut record = [3; 13];
        for (bytes, vertex) in record[1..].as_chunks_mut::<4>().0.iter_mut().zip(face) {
            // At most 2·10⁸ vertices, by the bound on triangles.
            *bytes = (vertex as i32).to_le_bytes();
        }
        out.write_all(&record)
    })?;
    out.flush()?;
    Ok(count)
}

/// A writer's end of a pipe that was closed by its reader is no error worth a message of its own.
pub fn is_closed_pipe(error: &Error) -> bool {
    matches!(error, Error::Write(source) if source.kind() == io::ErrorKind::BrokenPipe)
}
