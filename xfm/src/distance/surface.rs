//! A surface to measure: triangles whose indices and coordinates have been checked once.

use std::fmt;

use glam::DVec3;

/// Why two surfaces cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistanceError {
    /// The mesh has no triangles, so there is nothing to measure from or to.
    #[error(
        "the mesh has no triangles, so there is no surface to measure; check that it is the file you meant"
    )]
    Empty,
    /// Every triangle is degenerate: an average over the surface does not exist.
    #[error(
        "all {triangles} triangles of {side} have zero area, so no average over its surface exists; check how it was exported"
    )]
    NoArea {
        /// Which of the two surfaces.
        side: Side,
        /// How many triangles the mesh has.
        triangles: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} uses vertex {vertex}, but there are {vertices} vertices; export the mesh again"
    )]
    IndexOutOfRange {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The index it holds.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A vertex that a triangle uses has a coordinate that is not a number, or infinite.
    #[error(
        "vertex {vertex} of triangle {triangle} is not finite; remove that triangle or export the mesh again"
    )]
    NotFinite {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The vertex, counted from 0.
        vertex: u32,
    },
    /// There are more triangles than the search can number.
    #[error("{triangles} triangles are more than can be measured at once; split the mesh")]
    TooLarge {
        /// How many triangles the mesh has.
        triangles: usize,
    },
    /// The observer asked to stop.
    #[error("interrupted")]
    Cancelled,
}

/// One of the two surfaces of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The first.
    A,
    /// The second.
    B,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::A => "the first mesh",
            Self::B => "the second mesh",
        })
    }
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
    /// [`DistanceError::Empty`] without triangles, [`DistanceError::TooLarge`] with 2³² − 1 of them or more,
    /// [`DistanceError::IndexOutOfRange`] and
    /// [`DistanceError::NotFinite`] for the first triangle that is at fault.
    pub fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, DistanceError> {
        if triangles.is_empty() {
            return Err(DistanceError::Empty);
        }
        if triangles.len() >= u32::MAX as usize {
            return Err(DistanceError::TooLarge { triangles: triangles.len() });
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
