//! Writing STL.

use std::io::{self, Write};

use glam::Vec3;

use super::{HEADER_BYTES, RECORD_BYTES};
use crate::codec::output::{BoxedOutput, Pen, patchable};
use crate::codec::text::{write_direction, write_point};
use crate::{Error, Frame, IndexedSource, Triangle, TriangleSink};

/// Must not begin with "solid", or else readers take the file for text.
const TITLE: &[u8] = b"binary STL written by mesh-io";

/// The solid's name in text; every reader wants some name, or none at all in both places.
const NAME: &str = "mesh";

fn header(count: u32) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    header[..TITLE.len()].copy_from_slice(TITLE);
    header[HEADER_BYTES - 4..].copy_from_slice(&count.to_le_bytes());
    header
}

/// The unit normal by the right-hand rule; zero where the triangle has none.
fn normal([a, b, c]: &Triangle) -> Vec3 {
    // In double precision, so that neither tiny nor huge triangles lose it.
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    if normal.is_finite() { normal } else { Vec3::ZERO }
}

fn put_record(out: &mut Vec<u8>, triangle: &Triangle, frame: &Frame) {
    let corners = triangle.map(|corner| frame.to_single(corner));
    let mut record = [0; RECORD_BYTES];
    let vectors = [normal(triangle), corners[0], corners[1], corners[2]];
    for (bytes, vector) in record.as_chunks_mut::<12>().0.iter_mut().zip(vectors) {
        for (bytes, coordinate) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(vector.to_array()) {
            *bytes = coordinate.to_le_bytes();
        }
    }
    out.extend_from_slice(&record);
}

fn put_facet(out: &mut Vec<u8>, triangle: &Triangle, frame: &Frame) -> io::Result<()> {
    out.extend_from_slice(b"facet normal ");
    write_direction(out, normal(triangle))?;
    out.extend_from_slice(b"\n outer loop\n");
    for &corner in triangle {
        out.extend_from_slice(b"  vertex ");
        write_point(out, corner, frame)?;
        out.push(b'\n');
    }
    out.extend_from_slice(b" endloop\nendfacet\n");
    Ok(())
}

fn too_many(name: &str) -> Error {
    Error::TooLarge { name: name.to_owned(), what: "triangles", limit: u64::from(u32::MAX) }
}

/// The whole mesh, in binary or as text.
pub(crate) fn write_mesh<W: Write>(
    pen: &mut Pen<W>,
    mesh: &mut dyn IndexedSource,
    ascii: bool,
    frame: Frame,
) -> Result<(), Error> {
    if ascii {
        pen.put(|out| writeln!(out, "solid {NAME}"))?;
    } else {
        let count = u32::try_from(mesh.num_triangles()).map_err(|_| too_many(pen.name()))?;
        pen.bytes(&header(count))?;
    }
    mesh.each_corners(&mut |triangles| {
        triangles.iter().try_for_each(|corners| {
            pen.put(|out| {
                if ascii {
                    put_facet(out, corners, &frame)
                } else {
                    put_record(out, corners, &frame);
                    Ok(())
                }
            })
        })
    })?;
    if ascii {
        pen.put(|out| writeln!(out, "endsolid {NAME}"))?;
    }
    pen.flush()
}

/// A stream of text.
pub(crate) struct AsciiSink<'a> {
    pen: Pen<BoxedOutput<'a>>,
    frame: Frame,
}

impl<'a> AsciiSink<'a> {
    pub(crate) fn new(output: BoxedOutput<'a>, name: &str, frame: Frame) -> Result<Self, Error> {
        let mut pen = Pen::new(output, name);
        pen.put(|out| writeln!(out, "solid {NAME}"))?;
        Ok(Self { pen, frame })
    }
}

impl TriangleSink for AsciiSink<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
        let frame = &self.frame;
        triangles
            .iter()
            .try_for_each(|triangle| self.pen.put(|out| put_facet(out, triangle, frame)))
    }

    fn finish(mut self: Box<Self>) -> Result<(), Error> {
        self.pen.put(|out| writeln!(out, "endsolid {NAME}"))?;
        self.pen.commit()
    }
}

/// A binary stream whose count is put in at the end.
pub(crate) struct BinarySink<'a> {
    pen: Pen<BoxedOutput<'a>>,
    frame: Frame,
    count: u64,
}

impl<'a> BinarySink<'a> {
    pub(crate) fn new(output: BoxedOutput<'a>, name: &str, frame: Frame) -> Result<Self, Error> {
        let mut pen = Pen::new(patchable(output), name);
        pen.bytes(&header(0))?;
        Ok(Self { pen, frame, count: 0 })
    }
}

impl TriangleSink for BinarySink<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
        self.count += triangles.len() as u64;
        if self.count > u64::from(u32::MAX) {
            return Err(too_many(self.pen.name()));
        }
        triangles.iter().try_for_each(|triangle| {
            self.pen.put(|out| {
                put_record(out, triangle, &self.frame);
                Ok(())
            })
        })
    }

    fn finish(mut self: Box<Self>) -> Result<(), Error> {
        let count = u32::try_from(self.count).map_err(|_| too_many(self.pen.name()))?;
        self.pen.patch(0, &header(count))?;
        self.pen.commit()
    }
}
