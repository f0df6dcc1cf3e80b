//! The two ends of a triangle stream.

use crate::{Error, Frame, IndexedMesh, Triangle};

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

    /// Whether [`read_numbered`](TriangleSource::read_numbered) tells the vertices' numbers: in PLY, OBJ and glTF, but
    /// not in STL, which has no vertices.
    fn has_vertex_numbers(&self) -> bool {
        false
    }

    /// As [`read`](TriangleSource::read), and appends the numbers of each triangle's three vertices to `numbers`.
    ///
    /// Numbers count from zero in the order of the file's vertices, and the same number is the same vertex from the
    /// first triangle to the last. Different numbers may lie at the same coordinates. Where
    /// [`has_vertex_numbers`](TriangleSource::has_vertex_numbers) says no, nothing is appended to `numbers`.
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
        let _no_vertices = numbers;
        self.read(out, max)
    }

    /// Appends the triangles between these vertices, whose numbers
    /// [`read_numbered`](TriangleSource::read_numbered) has told: what was read once need not be read again to be seen
    /// again. Vertices that are not there lie at NaN, and sources without vertex numbers append nothing.
    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        let _no_vertices = (numbers, out);
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
    /// Appends the corners of the next triangles and says which those are.
    fn advance(
        &mut self,
        out: &mut Vec<Triangle>,
        max: usize,
    ) -> Result<std::ops::Range<usize>, Error> {
        let positions = &self.mesh.positions;
        let stop = self.next.saturating_add(max).min(self.mesh.triangles.len());
        let batch = &self.mesh.triangles[self.next..stop];
        out.reserve(batch.len());
        for triangle in batch {
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
        let batch = self.next..stop;
        self.next = stop;
        Ok(batch)
    }
}

impl TriangleSource for MeshSource {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        self.advance(out, max).map(|batch| batch.len())
    }

    fn triangle_count(&self) -> Option<u64> {
        Some(self.mesh.triangles.len() as u64)
    }

    fn has_vertex_numbers(&self) -> bool {
        true
    }

    fn read_numbered(
        &mut self,
        out: &mut Vec<Triangle>,
        numbers: &mut Vec<[u64; 3]>,
        max: usize,
    ) -> Result<usize, Error> {
        let batch = self.advance(out, max)?;
        let count = batch.len();
        numbers.extend(self.mesh.triangles[batch].iter().map(|triangle| triangle.map(u64::from)));
        Ok(count)
    }

    fn look_up(&mut self, numbers: &[[u64; 3]], out: &mut Vec<Triangle>) {
        let positions = &self.mesh.positions;
        let position = |v: u64| positions.get(v as usize).copied().unwrap_or(glam::Vec3::NAN);
        out.extend(numbers.iter().map(|triangle| triangle.map(position)));
    }
}
