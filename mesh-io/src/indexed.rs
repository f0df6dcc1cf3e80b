//! Meshes that are handed out vertex by vertex and triangle by triangle, so that they need not be in memory to be written.

use glam::Vec3;

use crate::{Colour, Error, IndexedMesh, Triangle};

/// Takes items batch by batch, and may refuse.
pub type Take<'a, T> = dyn FnMut(&[T]) -> Result<(), Error> + 'a;

/// Takes positions batch by batch, with as many colours where the mesh has them and otherwise none, and may refuse.
pub type TakeVertices<'a> = dyn FnMut(&[Vec3], &[Colour]) -> Result<(), Error> + 'a;

/// A mesh of shared vertices, in memory or not: what [`write_indexed`](crate::write_indexed) writes.
///
/// Each part is handed out whole, in order, and the same however often it is asked for. An error of `take` ends the handing
/// out, and is returned.
pub trait IndexedSource {
    /// Number of vertices.
    fn num_vertices(&self) -> u64;

    /// Number of triangles.
    fn num_triangles(&self) -> u64;

    /// Hands out all positions.
    ///
    /// # Errors
    ///
    /// Those of `take`, and what keeps the mesh from being read.
    fn each_position(&mut self, take: &mut Take<'_, Vec3>) -> Result<(), Error>;

    /// Whether the vertices have colours.
    fn has_colours(&self) -> bool {
        false
    }

    /// Hands out all positions, with their colours if the vertices have some.
    ///
    /// # Errors
    ///
    /// As [`each_position`](IndexedSource::each_position).
    fn each_vertex(&mut self, take: &mut TakeVertices<'_>) -> Result<(), Error> {
        self.each_position(&mut |positions| take(positions, &[]))
    }

    /// Hands out all triangles by their vertices, counter-clockwise seen from the front; these are below the number of
    /// vertices.
    ///
    /// # Errors
    ///
    /// As [`each_position`](IndexedSource::each_position).
    fn each_triangle(&mut self, take: &mut Take<'_, [u32; 3]>) -> Result<(), Error>;

    /// Hands out the same triangles by the positions of their corners.
    ///
    /// # Errors
    ///
    /// As [`each_position`](IndexedSource::each_position).
    fn each_corners(&mut self, take: &mut Take<'_, Triangle>) -> Result<(), Error>;
}

/// Items handed out at once.
const BATCH: usize = 1 << 14;

/// # Panics
///
/// [`each_corners`](IndexedSource::each_corners) when an index is out of range.
impl IndexedSource for &IndexedMesh {
    fn num_vertices(&self) -> u64 {
        self.positions.len() as u64
    }

    fn num_triangles(&self) -> u64 {
        self.triangles.len() as u64
    }

    fn each_position(&mut self, take: &mut Take<'_, Vec3>) -> Result<(), Error> {
        self.positions.chunks(BATCH).try_for_each(take)
    }

    fn has_colours(&self) -> bool {
        !self.colours.is_empty()
    }

    fn each_vertex(&mut self, take: &mut TakeVertices<'_>) -> Result<(), Error> {
        let mut colours = self.colours.chunks(BATCH);
        self.positions.chunks(BATCH).try_for_each(|p| take(p, colours.next().unwrap_or_default()))
    }

    fn each_triangle(&mut self, take: &mut Take<'_, [u32; 3]>) -> Result<(), Error> {
        self.triangles.chunks(BATCH).try_for_each(take)
    }

    fn each_corners(&mut self, take: &mut Take<'_, Triangle>) -> Result<(), Error> {
        let mut batch = Vec::with_capacity(BATCH.min(self.triangles.len()));
        for triangles in self.triangles.chunks(BATCH) {
            batch.clear();
            batch.extend(triangles.iter().map(|t| t.map(|v| self.positions[v as usize])));
            take(&batch)?;
        }
        Ok(())
    }
}
