//! Vertex positions, in memory or where they lie in the file.

use std::fs::File;
use std::io;

use glam::Vec3;
use memmap2::Mmap;

use super::header::{Element, Kind, Scalar};

/// Where the coordinates are in a row of fixed size.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) stride: usize,
    axes: [(usize, Scalar); 3],
    big: bool,
}

impl Layout {
    /// `None` if rows vary in size.
    pub(super) fn new(element: &Element, axes: [usize; 3], big: bool) -> Option<Self> {
        let stride = element.stride()?;
        let mut offsets = Vec::with_capacity(element.properties.len());
        let mut offset = 0;
        for property in &element.properties {
            let Kind::One(scalar) = property.kind else { return None };
            offsets.push((offset, scalar));
            offset += scalar.size();
        }
        Some(Self { stride, axes: axes.map(|axis| offsets[axis]), big })
    }

    /// The position in a row of at least `stride` bytes.
    #[inline]
    pub(super) fn position(&self, row: &[u8]) -> Vec3 {
        let [x, y, z] =
            self.axes.map(|(offset, scalar)| match row.get(offset..offset + scalar.size()) {
                Some(bytes) => scalar.real(bytes, self.big),
                None => f32::NAN,
            });
        Vec3::new(x, y, z)
    }
}

/// Positions by vertex.
pub(super) enum Positions {
    Memory(Vec<Vec3>),
    Mapped(MappedPositions),
}

impl Positions {
    #[inline]
    pub(super) fn get(&self, vertex: u32) -> Vec3 {
        match self {
            Self::Memory(positions) => positions.get(vertex as usize).copied().unwrap_or(Vec3::NAN),
            Self::Mapped(mapped) => mapped.get(vertex),
        }
    }

    pub(super) fn len(&self) -> u64 {
        match self {
            Self::Memory(positions) => positions.len() as u64,
            Self::Mapped(mapped) => mapped.count,
        }
    }
}

/// Positions read from the mapped file each time, which takes no memory that the system could not take back.
pub(super) struct MappedPositions {
    map: Mmap,
    start: usize,
    count: u64,
    layout: Layout,
}

impl MappedPositions {
    /// `count` rows from byte `start` on; `None` if the file is shorter than that.
    pub(super) fn new(
        file: &File,
        start: u64,
        count: u64,
        layout: Layout,
    ) -> io::Result<Option<Self>> {
        // SAFETY: the map is only read, byte by byte, and any bytes are valid positions. What remains is that another
        // process shortens the file meanwhile, which ends this one with a bus error, as with every mapped file.
        #[allow(unsafe_code)]
        let map = unsafe { Mmap::map(file)? };
        let end =
            count.checked_mul(layout.stride as u64).and_then(|bytes| bytes.checked_add(start));
        let fits = end.is_some_and(|end| end <= map.len() as u64);
        match usize::try_from(start) {
            Ok(start) if fits => Ok(Some(Self { map, start, count, layout })),
            _ => Ok(None),
        }
    }

    #[inline]
    fn get(&self, vertex: u32) -> Vec3 {
        let start = self.start + vertex as usize * self.layout.stride;
        match self.map.get(start..start + self.layout.stride) {
            Some(row) => self.layout.position(row),
            None => Vec3::NAN,
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
