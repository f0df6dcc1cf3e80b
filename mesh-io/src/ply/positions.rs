//! Vertex positions, in memory or where they lie in the file.

use std::fs::File;
use std::io;

use glam::{DVec3, Vec3};
use memmap2::Mmap;

use super::header::{Components, Element, Kind, Scalar, VertexPlaces};
use crate::frame::Framing;
use crate::mesh::WHITE;
use crate::{Colour, Frame, Triangle};

/// Where the coordinates are in a row of fixed size.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) stride: usize,
    axes: [(usize, Scalar); 3],
    colour: Option<Components<(usize, Scalar)>>,
    /// Where x, y and z lie side by side in single precision, which almost all files have.
    singles: Option<usize>,
    big: bool,
}

impl Layout {
    /// `None` if rows vary in size.
    pub(super) fn new(element: &Element, places: VertexPlaces, big: bool) -> Option<Self> {
        let stride = element.stride()?;
        let mut offsets = Vec::with_capacity(element.properties.len());
        let mut offset = 0;
        for property in &element.properties {
            let Kind::One(scalar) = property.kind else { return None };
            offsets.push((offset, scalar));
            offset += scalar.size();
        }
        let axes = places.axes.map(|axis| offsets[axis]);
        let colour = places.colour.map(|components| components.map(|place| offsets[place]));
        let first = axes[0].0;
        let expected = [0, 4, 8].map(|offset| (first + offset, Scalar::F32));
        let singles = (axes == expected).then_some(first);
        Some(Self { stride, axes, colour, singles, big })
    }

    /// The frame to hand positions out in, by the first row.
    pub(super) fn frame(&self, first_row: &[u8], framing: Framing) -> Frame {
        // Axes of a type that fits in single precision stay where they are.
        let wide = self.axes.map(|(_, scalar)| f64::from(u8::from(scalar.exceeds_single())));
        framing.choose(self.exact(first_row) * DVec3::from_array(wide))
    }

    fn exact(&self, row: &[u8]) -> DVec3 {
        DVec3::from_array(self.axes.map(|(offset, scalar)| match row.get(offset..) {
            Some(bytes) if bytes.len() >= scalar.size() => scalar.real(bytes, self.big),
            _ => f64::NAN,
        }))
    }

    /// The position in a row of at least `stride` bytes, in this frame.
    #[inline]
    pub(super) fn position(&self, row: &[u8], frame: &Frame) -> Vec3 {
        match self.singles.and_then(|first| single(row.get(first..)?, self.big)) {
            Some(position) => position,
            None => frame.from_file(self.exact(row)),
        }
    }
}

impl Layout {
    pub(super) fn has_colour(&self) -> bool {
        self.colour.is_some()
    }

    /// The colour in a row of at least `stride` bytes; white without colours.
    #[inline]
    pub(super) fn colour(&self, row: &[u8]) -> Colour {
        let Some(Components { rgb, alpha }) = self.colour else { return WHITE };
        let byte = |(offset, scalar): (usize, Scalar)| match (row.get(offset..), scalar) {
            (Some(&[byte, ..]), Scalar::U8) => byte,
            (Some(bytes), _) => scalar.colour_byte(scalar.real(bytes, self.big)),
            (None, _) => 255,
        };
        let [r, g, b] = rgb.map(byte);
        [r, g, b, alpha.map_or(255, byte)]
    }
}

/// A position in single precision at the start of `bytes`.
#[inline]
fn single(bytes: &[u8], big: bool) -> Option<Vec3> {
    let [x, y, z] = bytes.first_chunk::<12>()?.as_chunks().0 else { return None };
    let real = |&bytes: &[u8; 4]| match big {
        true => f32::from_be_bytes(bytes),
        false => f32::from_le_bytes(bytes),
    };
    Some(Vec3::new(real(x), real(y), real(z)))
}

/// Vertices in memory.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    /// As many, or none.
    pub(super) colours: Vec<Colour>,
}

/// Positions and colours by vertex.
pub(super) enum Positions {
    Memory(Vertices),
    Mapped(MappedPositions),
}

impl Positions {
    #[inline]
    pub(super) fn get(&self, vertex: u32) -> Vec3 {
        match self {
            Self::Memory(Vertices { positions, .. }) => {
                positions.get(vertex as usize).copied().unwrap_or(Vec3::NAN)
            }
            Self::Mapped(mapped) => mapped.get(vertex),
        }
    }

    /// Appends the positions of the triangles' corners.
    pub(super) fn look_up(&self, triangles: &[[u32; 3]], out: &mut Vec<Triangle>) {
        match self {
            Self::Memory(Vertices { positions, .. }) => {
                let position = |v: u32| positions.get(v as usize).copied().unwrap_or(Vec3::NAN);
                extend(out, triangles, position);
            }
            Self::Mapped(mapped) => mapped.look_up(triangles, out),
        }
    }

    pub(super) fn has_colours(&self) -> bool {
        match self {
            Self::Memory(vertices) => !vertices.colours.is_empty(),
            Self::Mapped(mapped) => mapped.count > 0 && mapped.layout.has_colour(),
        }
    }

    /// Appends the colours of the triangles' corners, if vertices have colours.
    pub(super) fn look_up_colours(&self, triangles: &[[u32; 3]], out: &mut Vec<[Colour; 3]>) {
        if !self.has_colours() {
            return;
        }
        match self {
            Self::Memory(Vertices { colours, .. }) => {
                let colour = |v: u32| colours.get(v as usize).copied().unwrap_or(WHITE);
                out.extend(triangles.iter().map(|triangle| triangle.map(colour)));
            }
            Self::Mapped(mapped) => {
                out.extend(triangles.iter().map(|triangle| triangle.map(|v| mapped.colour(v))));
            }
        }
    }

    pub(super) fn len(&self) -> u64 {
        match self {
            Self::Memory(vertices) => vertices.positions.len() as u64,
            Self::Mapped(mapped) => mapped.count,
        }
    }
}

#[inline]
fn extend(out: &mut Vec<Triangle>, triangles: &[[u32; 3]], position: impl Fn(u32) -> Vec3) {
    out.extend(triangles.iter().map(|&[a, b, c]| [position(a), position(b), position(c)]));
}

/// Positions read from the mapped file each time, which takes no memory that the system could not take back.
pub(super) struct MappedPositions {
    map: Mmap,
    start: usize,
    count: u64,
    layout: Layout,
    pub(super) frame: Frame,
}

impl MappedPositions {
    /// `count` rows from byte `start` on; `None` if the file is shorter than that.
    pub(super) fn new(
        file: &File,
        start: u64,
        count: u64,
        layout: Layout,
        framing: Framing,
    ) -> io::Result<Option<Self>> {
        // SAFETY: the map is only read, byte by byte, and any bytes are valid positions. What remains is that another
        // process shortens the file meanwhile, which ends this one with a bus error, as with every mapped file.
        #[allow(unsafe_code)]
        let map = unsafe { Mmap::map(file)? };
        let end =
            count.checked_mul(layout.stride as u64).and_then(|bytes| bytes.checked_add(start));
        let fits = end.is_some_and(|end| end <= map.len() as u64);
        let Some(start) = usize::try_from(start).ok().filter(|_| fits) else { return Ok(None) };
        let frame = match map.get(start..start + layout.stride) {
            Some(row) if count > 0 => layout.frame(row, framing),
            _ => Frame::default(),
        };
        Ok(Some(Self { map, start, count, layout, frame }))
    }

    /// The rows, and nothing after them.
    #[inline]
    fn rows(&self) -> &[u8] {
        let bytes = self.count as usize * self.layout.stride;
        self.map.get(self.start..self.start + bytes).unwrap_or(&[])
    }

    #[inline]
    fn get(&self, vertex: u32) -> Vec3 {
        let start = vertex as usize * self.layout.stride;
        match self.rows().get(start..start + self.layout.stride) {
            Some(row) => self.layout.position(row, &self.frame),
            None => Vec3::NAN,
        }
    }

    #[inline]
    fn colour(&self, vertex: u32) -> Colour {
        let start = vertex as usize * self.layout.stride;
        let row = self.rows().get(start..start + self.layout.stride);
        row.map_or(WHITE, |row| self.layout.colour(row))
    }

    fn look_up(&self, triangles: &[[u32; 3]], out: &mut Vec<Triangle>) {
        let Layout { stride, singles, big, .. } = self.layout;
        // One loop for each of the common layouts, without a question in it.
        let rows = self.rows();
        let single = |v: u32, first: usize, big: bool| {
            let start = v as usize * stride + first;
            rows.get(start..).and_then(|bytes| single(bytes, big)).unwrap_or(Vec3::NAN)
        };
        match (singles, big) {
            (Some(first), false) => extend(out, triangles, |v| single(v, first, false)),
            (Some(first), true) => extend(out, triangles, |v| single(v, first, true)),
            (None, _) => extend(out, triangles, |v| self.get(v)),
        }
    }

    /// Lets go of the pages touched so far; they come back from the system's cache when touched again.
    pub(super) fn relax(&self) {
        // SAFETY: the map is shared and read-only and backed by a file, so dropped pages are read again from it, with
        // the same content (established in `new`).
        #[cfg(unix)]
        #[allow(unsafe_code)]
        let advised = unsafe { self.map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
        // Advice that the system does not take costs memory it can reclaim, and nothing else.
        #[cfg(unix)]
        drop(advised);
    }
}
