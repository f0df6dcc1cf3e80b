//! Formats with shared vertices, as a stream of triangles.

use std::ops::Range;

use crate::{Colour, Error, Frame, Triangle, TriangleSource};

/// A reader that has the positions at hand while it goes through the faces.
pub(crate) trait IndexedReader {
    /// Appends about `max` triangles with valid indices (a polygon may add some more); zero means the end.
    fn read_indices(&mut self, out: &mut Vec<[u32; 3]>, max: usize) -> Result<usize, Error>;

    /// Appends the corners' positions of these triangles; NaN for vertices that are not there.
    fn look_up(&self, triangles: &[[u32; 3]], out: &mut Vec<Triangle>);

    /// Whether vertices have colours.
    fn has_colours(&self) -> bool;

    /// Appends the corners' colours of these triangles; white for vertices that are not there. Nothing without colours.
    fn look_up_colours(&self, triangles: &[[u32; 3]], out: &mut Vec<[Colour; 3]>);

    /// As [`TriangleSource::triangle_count`].
    fn triangle_count(&self) -> Option<u64>;

    /// As [`TriangleSource::triangle_hint`].
    fn triangle_hint(&self) -> Option<u64>;

    /// As [`TriangleSource::frame`].
    fn frame(&self) -> Frame;

    /// Called now and then; gives memory back that the system can do without.
    fn relax(&mut self) {}
}

/// Triangles between two calls of [`IndexedReader::relax`].
const RELAX_EVERY: usize = 1 << 20;

/// Looks up the corners of an [`IndexedReader`]'s triangles.
pub(crate) struct IndexedSource<I> {
    reader: I,
    pending: Vec<[u32; 3]>,
    next: usize,
    looked_up: Vec<[u32; 3]>,
    since_relaxed: usize,
}

impl<I: IndexedReader> IndexedSource<I> {
    pub(crate) fn new(reader: I) -> Self {
        Self { reader, pending: Vec::new(), next: 0, looked_up: Vec::new(), since_relaxed: 0 }
    }

    /// The next triangles, which are in `pending`.
    fn advance(&mut self, max: usize) -> Result<Range<usize>, Error> {
        if self.next == self.pending.len() && max > 0 {
            self.pending.clear();
            self.next = 0;
            self.reader.read_indices(&mut self.pending, max)?;
        }
        let start = self.next;
        self.next = start.saturating_add(max).min(self.pending.len());
        Ok(start..self.next)
    }

    fn relax_after(&mut self, triangles: usize) {
        self.since_relaxed += triangles;
        if self.since_relaxed >= RELAX_EVERY {
            self.since_relaxed = 0;
            self.reader.relax();
        }
    }
}

impl<I: IndexedReader> TriangleSource for IndexedSource<I> {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let batch = self.advance(max)?;
        let count = batch.len();
        self.reader.look_up(&self.pending[batch], out);
        self.relax_after(count);
        Ok(count)
    }

    fn triangle_count(&self) -> Option<u64> {
        self.reader.triangle_count()
    }

    fn triangle_hint(&self) -> Option<u64> {
        self.reader.triangle_hint()
    }

    fn frame(&self) -> Frame {
        self.reader.frame()
    }

    fn has_vertex_numbers(&self) -> bool {
        true
    }

    fn read_numbers(&mut self, numbers: &mut Vec<[u64; 3]>, max: usize) -> Result<usize, Error> {
        let batch = self.advance(max)?;
        let count = batch.len();
        numbers.extend(self.pending[batch].iter().map(|triangle| triangle.map(u64::from)));
        Ok(count)
    }

    fn has_colours(&self) -> bool {
        self.reader.has_colours()
    }

    fn look_up_colours(&mut self, numbers: &[[u64; 3]], out: &mut Vec<[Colour; 3]>) {
        let narrow = |v: u64| u32::try_from(v).unwrap_or(u32::MAX);
        for part in numbers.chunks(1024) {
            self.looked_up.clear();
            self.looked_up.extend(part.iter().map(|triangle| triangle.map(narrow)));
            self.reader.look_up_colours(&self.looked_up, out);
        }
    }

    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        let narrow = |v: u64| u32::try_from(v).unwrap_or(u32::MAX);
        for part in numbers.chunks(1024) {
            self.looked_up.clear();
            self.looked_up.extend(part.iter().map(|triangle| triangle.map(narrow)));
            self.reader.look_up(&self.looked_up, out);
        }
        self.relax_after(numbers.len());
    }
}
