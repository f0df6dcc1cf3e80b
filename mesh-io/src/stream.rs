//! The two ends of a triangle stream.

use std::ops::Range;

use crate::mesh::WHITE;
use crate::{Colour, Error, Frame, IndexedMesh, Triangle};

/// Hands out triangles batch by batch, in the order of the file.
pub trait TriangleSource {
    /// Appends at most `max` triangles to `out` and returns how many; zero means the end (or `max == 0`).
    ///
    /// Fewer than `max` is not yet the end. After an error the source is not to be read again.
    ///
    /// # Errors
    ///
    /// What the file has wrong, or the operating system refuses; see [`Error`].
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error>;

    /// The number of triangles from the first to the last, where it is known for certain before they are read.
    fn triangle_count(&self) -> Option<u64>;

    /// The number of triangles to expect, for progress and planning: what the file says, which may be wrong.
    fn triangle_hint(&self) -> Option<u64> {
        self.triangle_count()
    }

    /// Whether vertices have numbers: in PLY, OBJ and glTF they do, in STL there are no vertices.
    ///
    /// Numbers count from zero in the order of the file's vertices, and the same number is the same vertex from the
    /// first triangle to the last. Different numbers may lie at the same coordinates.
    fn has_vertex_numbers(&self) -> bool {
        false
    }

    /// As [`read`](TriangleSource::read), but appends the numbers of each triangle's three vertices instead of their
    /// positions. Without vertex numbers there is nothing to read.
    ///
    /// # Errors
    ///
    /// As [`read`](TriangleSource::read).
    fn read_numbers(&mut self, numbers: &mut Vec<[u64; 3]>, max: usize) -> Result<usize, Error> {
        let _no_vertices = (numbers, max);
        Ok(0)
    }

    /// [`read`](TriangleSource::read) and [`read_numbers`](TriangleSource::read_numbers) at the same time; without vertex
    /// numbers nothing is appended to `numbers`.
    ///
    /// # Errors
    ///
    /// As [`read`](TriangleSource::read).
    fn read_numbered(
        &mut self,
        out: &mut Vec<Triangle>,
        numbers: &mut Vec<[u64; 3]>,
        max: usize,
    ) -> Result<usize, Error> {
        if !self.has_vertex_numbers() {
            return self.read(out, max);
        }
        let start = numbers.len();
        let count = self.read_numbers(numbers, max)?;
        self.look_up(&numbers[start..], out);
        Ok(count)
    }

    /// Appends the triangles between these vertices, whose numbers [`read_numbers`](TriangleSource::read_numbers) has
    /// told: what was read once need not be read again to be seen again. Vertices that are not there lie at NaN, and
    /// sources without vertex numbers append nothing.
    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        let _no_vertices = (numbers, out);
    }

    /// Whether vertices have colours, as far as the beginning of the file tells. Only vertices with numbers have.
    fn has_colours(&self) -> bool {
        false
    }

    /// Appends the colours of the corners of the triangles between these vertices, as [`look_up`](TriangleSource::look_up)
    /// does their positions; without colours nothing.
    fn look_up_colours(&mut self, numbers: &[[u64; 3]], out: &mut Vec<[Colour; 3]>) {
        let _no_colours = (numbers, out);
    }

    /// The frame that the coordinates handed out are in; it does not change.
    fn frame(&self) -> Frame {
        Frame::default()
    }
}

/// Takes triangles batch by batch and makes a file of them.
///
/// Nothing is guaranteed to be in the file before [`finish`](TriangleSink::finish) has returned; a sink dropped before
/// that leaves no file behind.
pub trait TriangleSink {
    /// Takes these triangles.
    ///
    /// # Errors
    ///
    /// What the operating system refuses, or the format cannot hold; see [`Error`].
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error>;

    /// Completes the file: counts, remaining data, and its final name.
    ///
    /// # Errors
    ///
    /// As [`write`](TriangleSink::write); the file is then not there.
    fn finish(self: Box<Self>) -> Result<(), Error>;
}

impl<S: TriangleSource + ?Sized> TriangleSource for Box<S> {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        (**self).read(out, max)
    }

    fn triangle_count(&self) -> Option<u64> {
        (**self).triangle_count()
    }

    fn triangle_hint(&self) -> Option<u64> {
        (**self).triangle_hint()
    }

    fn has_vertex_numbers(&self) -> bool {
        (**self).has_vertex_numbers()
    }

    fn read_numbers(&mut self, numbers: &mut Vec<[u64; 3]>, max: usize) -> Result<usize, Error> {
        (**self).read_numbers(numbers, max)
    }

    fn read_numbered(
        &mut self,
        out: &mut Vec<Triangle>,
        numbers: &mut Vec<[u64; 3]>,
        max: usize,
    ) -> Result<usize, Error> {
        (**self).read_numbered(out, numbers, max)
    }

    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        (**self).look_up(numbers, out);
    }

    fn has_colours(&self) -> bool {
        (**self).has_colours()
    }

    fn look_up_colours(&mut self, numbers: &[[u64; 3]], out: &mut Vec<[Colour; 3]>) {
        (**self).look_up_colours(numbers, out);
    }

    fn frame(&self) -> Frame {
        (**self).frame()
    }
}

/// A mesh in memory as a stream.
///
/// ```
/// use mesh_io::{IndexedMesh, MeshSource, TriangleSource};
/// use glam::Vec3;
///
/// let mesh = IndexedMesh::from_soup(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
/// let mut source = MeshSource::new(mesh, "a triangle");
/// let mut out = Vec::new();
/// assert_eq!(source.read(&mut out, 10)?, 1);
/// assert_eq!(source.read(&mut out, 10)?, 0);
/// # Ok::<(), mesh_io::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct MeshSource {
    mesh: IndexedMesh,
    name: String,
    next: usize,
}

impl MeshSource {
    /// Streams the mesh's triangles in order; `name` is for messages.
    pub fn new(mesh: IndexedMesh, name: &str) -> Self {
        Self { mesh, name: name.to_owned(), next: 0 }
    }
}

impl MeshSource {
    /// The next triangles.
    fn advance(&mut self, max: usize) -> Range<usize> {
        let start = self.next;
        self.next = start.saturating_add(max).min(self.mesh.triangles.len());
        start..self.next
    }
}

impl TriangleSource for MeshSource {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let batch = self.advance(max);
        let count = batch.len();
        let positions = &self.mesh.positions;
        out.reserve(count);
        for triangle in &self.mesh.triangles[batch] {
            let mut corners = [glam::Vec3::ZERO; 3];
            for (corner, &v) in corners.iter_mut().zip(triangle) {
                *corner = *positions.get(v as usize).ok_or_else(|| Error::IndexOutOfRange {
                    name: self.name.clone(),
                    place: crate::Place::File,
                    index: i64::from(v),
                    num_vertices: positions.len() as u64,
                })?;
            }
            out.push(corners);
        }
        Ok(count)
    }

    fn triangle_count(&self) -> Option<u64> {
        Some(self.mesh.triangles.len() as u64)
    }

    fn has_vertex_numbers(&self) -> bool {
        true
    }

    fn read_numbers(&mut self, numbers: &mut Vec<[u64; 3]>, max: usize) -> Result<usize, Error> {
        let batch = self.advance(max);
        let count = batch.len();
        numbers.extend(self.mesh.triangles[batch].iter().map(|triangle| triangle.map(u64::from)));
        Ok(count)
    }

    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        let positions = &self.mesh.positions;
        let position = |v: u64| positions.get(v as usize).copied().unwrap_or(glam::Vec3::NAN);
        out.extend(numbers.iter().map(|triangle| triangle.map(position)));
    }

    fn has_colours(&self) -> bool {
        !self.mesh.colours.is_empty()
    }

    fn look_up_colours(&mut self, numbers: &[[u64; 3]], out: &mut Vec<[Colour; 3]>) {
        let colours = &self.mesh.colours;
        if !colours.is_empty() {
            let colour = |v: u64| colours.get(v as usize).copied().unwrap_or(WHITE);
            out.extend(numbers.iter().map(|triangle| triangle.map(colour)));
        }
    }
}
