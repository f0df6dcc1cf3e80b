//! A surface to measure: triangles whose indices and coordinates have been checked once.

use glam::DVec3;

/// Why two surfaces cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistanceError {
    /// The mesh has no triangles, so there is nothing to measure from or to.
    #[error("the mesh has no triangles, so it has no surface to measure")]
    Empty,
    /// Every triangle is degenerate: an average over the surface does not exist.
    #[error("all {triangles} triangles have zero area, so no average over the surface exists")]
    NoArea {
        /// How many triangles the mesh has.
        triangles: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} uses vertex {vertex}, but the mesh has {vertices} vertices")]
    IndexOutOfRange {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The index it holds.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A vertex that a triangle uses has a coordinate that is not a number, or infinite.
    #[error("vertex {vertex} of triangle {triangle} is not finite")]
    NotFinite {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The vertex, counted from 0.
        vertex: u32,
    },
    /// The observer asked to stop.
    #[error("interrupted")]
    Cancelled,
}

/// A triangle mesh taken as a set of points in space.
///
/// Only vertices that a triangle uses belong to the surface; others are ignored. Degenerate triangles (two or three
/// equal corners, or corners on one line) are segments or points and do belong to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) min: DVec3,
    pub(super) max: DVec3,
}

impl Surface {
    /// Takes vertices and triangles, having checked every index and every coordinate in use.
    ///
    /// # Errors
    ///
    /// [`DistanceError::Empty`] without triangles, [`DistanceError::IndexOutOfRange`] and
    /// [`DistanceError::NotFinite`] for the first triangle that is at fault.
    pub fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, DistanceError> {
        if triangles.is_empty() {
            return Err(DistanceError::Empty);
        }
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (triangle, corners) in triangles.iter().enumerate() {
            for &vertex in corners {
                let position = positions.get(vertex as usize).ok_or({
                    DistanceError::IndexOutOfRange { triangle, vertex, vertices: positions.len() }
                })?;
                if !position.is_finite() {
                    return Err(DistanceError::NotFinite { triangle, vertex });
                }
                min = min.min(*position);
                max = max.max(*position);
            }
        }
        Ok(Self { positions, triangles, min, max })
    }

    /// The number of triangles.
    pub fn num_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// The length of the bounding box's diagonal, over the vertices in use.
    ///
    /// # Units
    ///
    /// Model units.
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }
}
