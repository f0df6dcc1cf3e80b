//! Writing OBJ.

use std::io::{self, Write};

use glam::Vec3;

use crate::codec::output::{BoxedOutput, Pen};
use crate::codec::text::write_point;
use crate::codec::weld::Welder;
use crate::{Colour, Error, Frame, IndexedSource, Triangle, TriangleSink};

const TITLE: &[u8] = b"# written by mesh-io\n";

fn put_vertex(
    out: &mut Vec<u8>,
    position: Vec3,
    colour: Option<Colour>,
    frame: &Frame,
) -> io::Result<()> {
    out.extend_from_slice(b"v ");
    write_point(out, position, frame)?;
    // The format has no alpha here.
    for byte in colour.into_iter().flat_map(|[r, g, b, _]| [r, g, b]) {
        write!(out, " {}", f32::from(byte) / 255.0)?;
    }
    out.push(b'\n');
    Ok(())
}

fn put_face(out: &mut Vec<u8>, triangle: [u32; 3]) -> io::Result<()> {
    let [a, b, c] = triangle.map(|v| u64::from(v) + 1);
    writeln!(out, "f {a} {b} {c}")
}

/// The whole mesh.
pub(crate) fn write_mesh<W: Write>(
    pen: &mut Pen<W>,
    mesh: &mut dyn IndexedSource,
    frame: Frame,
) -> Result<(), Error> {
    pen.bytes(TITLE)?;
    mesh.each_vertex(&mut |positions, colours| {
        let mut colours = colours.iter().copied();
        positions
            .iter()
            .try_for_each(|&p| pen.put(|out| put_vertex(out, p, colours.next(), &frame)))
    })?;
    mesh.each_triangle(&mut |triangles| {
        triangles.iter().try_for_each(|&t| pen.put(|out| put_face(out, t)))
    })?;
    pen.flush()
}

/// A stream of triangles, welded; each vertex stands before the first face that uses it.
pub(crate) struct ObjSink<'a> {
    pen: Pen<BoxedOutput<'a>>,
    frame: Frame,
    welder: Welder,
}

impl<'a> ObjSink<'a> {
    pub(crate) fn new(
        output: BoxedOutput<'a>,
        name: &str,
        frame: Frame,
        welder: Welder,
    ) -> Result<Self, Error> {
        let mut pen = Pen::new(output, name);
        pen.bytes(TITLE)?;
        Ok(Self { pen, frame, welder })
    }
}

impl TriangleSink for ObjSink<'_> {
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
                    self.pen.put(|out| put_vertex(out, position, None, &self.frame))?;
                }
                *index = vertex;
            }
            self.pen.put(|out| put_face(out, face))?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.pen.commit()
    }
}
