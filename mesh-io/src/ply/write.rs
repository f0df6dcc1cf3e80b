//! Writing PLY: vertices, then faces, with the counts in front of both.

use std::io::{Read, Seek, SeekFrom, Write};

use glam::Vec3;
use tempfile::SpooledTempFile;

use crate::codec::output::{BoxedOutput, Pen, patchable, spool};
use crate::codec::text::write_point;
use crate::codec::weld::Welder;
use crate::mesh::WHITE;
use crate::{Colour, Error, Frame, IndexedSource, Triangle, TriangleSink};

/// How the rows are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    Little,
    Big,
}

impl Encoding {
    fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::Little => "binary_little_endian",
            Self::Big => "binary_big_endian",
        }
    }
}

/// How the rows are written, and in which frame the vertices come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows {
    pub(crate) encoding: Encoding,
    pub(crate) frame: Frame,
    /// Whether vertices have colours.
    pub(crate) colours: bool,
}

impl Rows {
    fn put_vertex(
        &self,
        out: &mut Vec<u8>,
        position: Vec3,
        [r, g, b, a]: Colour,
    ) -> std::io::Result<()> {
        let double = self.frame.double;
        let wide = || self.frame.to_file(position).to_array();
        let single = position.to_array();
        match self.encoding {
            Encoding::Ascii => {
                write_point(out, position, &self.frame)?;
                if self.colours {
                    write!(out, " {r} {g} {b} {a}")?;
                }
                out.push(b'\n');
                return Ok(());
            }
            Encoding::Little if double => out.extend(wide().map(f64::to_le_bytes).as_flattened()),
            Encoding::Little => out.extend(single.map(f32::to_le_bytes).as_flattened()),
            Encoding::Big if double => out.extend(wide().map(f64::to_be_bytes).as_flattened()),
            Encoding::Big => out.extend(single.map(f32::to_be_bytes).as_flattened()),
        }
        if self.colours {
            out.extend([r, g, b, a]);
        }
        Ok(())
    }

    fn put_face(&self, out: &mut Vec<u8>, face: [u32; 3]) -> std::io::Result<()> {
        let [a, b, c] = face;
        match self.encoding {
            Encoding::Ascii => return writeln!(out, "3 {a} {b} {c}"),
            Encoding::Little => put_list(out, face.map(u32::to_le_bytes)),
            Encoding::Big => put_list(out, face.map(u32::to_be_bytes)),
        }
        Ok(())
    }
}

fn put_list(out: &mut Vec<u8>, corners: [[u8; 4]; 3]) {
    let mut row = [3; 13];
    row[1..].copy_from_slice(corners.as_flattened());
    out.extend_from_slice(&row);
}

/// Digits of the largest 64-bit count.
const COUNT_DIGITS: usize = 20;

/// The header; always of the same length for the same rows, whatever the counts, so that it can be replaced.
fn header(rows: Rows, num_vertices: u64, num_faces: u64) -> String {
    // Every reader takes `int`; only more vertices than that need the other type.
    let index = if num_vertices > i32::MAX as u64 { "uint" } else { "int" };
    let counts = format!("{num_vertices}{num_faces}{index}");
    let padding = " ".repeat((2 * COUNT_DIGITS + "uint".len()).saturating_sub(counts.len()));
    let colour = match rows.colours {
        true => {
            "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n"
        }
        false => "",
    };
    let real = if rows.frame.double { "double" } else { "float" };
    format!(
        "ply\nformat {} 1.0\ncomment written by mesh-io{padding}\n\
         element vertex {num_vertices}\nproperty {real} x\nproperty {real} y\nproperty {real} z\n{colour}\
         element face {num_faces}\nproperty list uchar {index} vertex_indices\nend_header\n",
        rows.encoding.name()
    )
}

/// The whole mesh.
pub(crate) fn write_mesh<W: Write>(
    pen: &mut Pen<W>,
    mesh: &mut dyn IndexedSource,
    rows: Rows,
) -> Result<(), Error> {
    let header = header(rows, mesh.num_vertices(), mesh.num_triangles());
    pen.bytes(header.as_bytes())?;
    mesh.each_vertex(&mut |positions, colours| {
        let mut colours = colours.iter();
        positions.iter().try_for_each(|&p| {
            let colour = colours.next().copied().unwrap_or(WHITE);
            pen.put(|out| rows.put_vertex(out, p, colour))
        })
    })?;
    mesh.each_triangle(&mut |triangles| {
        triangles.iter().try_for_each(|&t| pen.put(|out| rows.put_face(out, t)))
    })?;
    pen.flush()
}

/// A stream of triangles, welded; the faces wait in a scratch file until all vertices are written.
pub(crate) struct PlySink<'a> {
    pen: Pen<BoxedOutput<'a>>,
    faces: Pen<SpooledTempFile>,
    welder: Welder,
    rows: Rows,
    num_faces: u64,
}

impl<'a> PlySink<'a> {
    pub(crate) fn new(
        output: BoxedOutput<'a>,
        name: &str,
        rows: Rows,
        welder: Welder,
    ) -> Result<Self, Error> {
        let mut pen = Pen::new(patchable(output), name);
        let faces = Pen::new(spool(pen.scratch()), name);
        pen.bytes(header(rows, 0, 0).as_bytes())?;
        Ok(Self { pen, faces, welder, rows, num_faces: 0 })
    }
}

impl TriangleSink for PlySink<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
        for triangle in triangles {
            let mut face = [0; 3];
            for (index, &position) in face.iter_mut().zip(triangle) {
                let Some((vertex, new)) = self.welder.weld(position) else {
                    return Err(Error::TooLarge {
                        name: self.pen.name().to_owned(),
                        what: "vertices",
                        limit: self.welder.num_vertices(),
                    });
                };
                if new {
                    self.pen.put(|out| self.rows.put_vertex(out, position, WHITE))?;
                }
                *index = vertex;
            }
            self.faces.put(|out| self.rows.put_face(out, face))?;
        }
        self.num_faces += triangles.len() as u64;
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), Error> {
        self.faces.flush()?;
        let name = self.pen.name().to_owned();
        let failed = |error| Error::io(&name, "copy the faces of", error);
        let mut faces = self.faces.into_writer();
        faces.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut chunk = vec![0; 1 << 16];
        loop {
            match faces.read(&mut chunk).map_err(failed)? {
                0 => break,
                count => self.pen.bytes(&chunk[..count])?,
            }
        }
        let header = header(self.rows, self.welder.num_vertices(), self.num_faces);
        self.pen.patch(0, header.as_bytes())?;
        self.pen.commit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_keeps_its_length() {
        let rows = Rows { encoding: Encoding::Big, frame: Frame::default(), colours: true };
        let length = header(rows, 0, 0).len();
        for count in [1, 99, 1 << 31, 1 << 40, u64::MAX] {
            assert_eq!(header(rows, count, count).len(), length);
        }
    }
}
