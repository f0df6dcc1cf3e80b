//! What is told of each collapse, and what is left in the end.

use glam::Vec3;
use halfedge::{FaceId, HalfEdgeId, VertexId};

use mesh_io::Colour;

use crate::Repairs;

/// One half-edge collapse, in names that are unique among what is in the buffer, and used again for what comes later.
///
/// With `h: v→u` in the face `f0 = (h, a, b)` and its reverse `h'` in `f1 = (h', d, e)`: `w = rev(a)`, `x = rev(b)`,
/// `y = rev(d)`, `z = rev(e)`. The half-edges of face `f` are `3f`, `3f + 1` and `3f + 2`.
///
/// # Sources
/// DeCoro and Pajarola, *XFastMesh*, 2002, Figure 2 and §3.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collapsed {
    /// The vertex `v` that goes.
    pub removed: VertexId,
    /// The vertex `u` that stays, where it is.
    pub kept: VertexId,
    /// `h`.
    pub half_edge: HalfEdgeId,
    /// `h'`; `None` on a boundary.
    pub reverse: Option<HalfEdgeId>,
    /// `w, x, y, z`; `None` on a boundary.
    pub adjacent: [Option<HalfEdgeId>; 4],
    /// Where `v` is.
    pub position: Vec3,
    /// The normal of `v` in the input, of length one or zero.
    pub normal: Vec3,
    /// The colour of `v`, if vertices have colours.
    pub colour: Option<Colour>,
    /// Distance from `v` to the farthest corner of its triangles.
    pub radius: f32,
    /// Least cosine of the angle between the normal and that of a triangle around `v`, before or after.
    pub cone_cosine: f32,
    /// How far the surface around `u` is from the input after this at most: the sum of what each collapse moved it by,
    /// measured where it moves most.
    pub deviation: f32,
    /// One more than the largest rank of the collapses that removed a neighbour of `v` or `u`, or 0: a smaller number than its
    /// place among all collapses, and in their order wherever two of them met.
    pub rank: u32,
}

/// What is left after all collapses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CollapsedMesh {
    /// Its vertices.
    pub vertices: Vec<CollapsedVertex>,
    /// Its faces.
    pub faces: Vec<CollapsedFace>,
}

/// A vertex that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapsedVertex {
    /// Its name.
    pub name: VertexId,
    /// Where it is.
    pub position: Vec3,
    /// Its normal in the input, of length one or zero.
    pub normal: Vec3,
    /// Its colour, if vertices have colours.
    pub colour: Option<Colour>,
}

/// A face that is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollapsedFace {
    /// Its name.
    pub name: FaceId,
    /// The vertices that its half-edges `3·name`, `3·name + 1` and `3·name + 2` start from.
    pub corners: [VertexId; 3],
}

/// What came of collapsing a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CollapseReport {
    /// Triangles read.
    pub input_triangles: u64,
    /// CRC-32 of their coordinates, in the machine's byte order.
    pub input_crc: u32,
    /// What was wrong with them.
    pub repaired: Repairs,
    /// Most triangles the buffer held.
    pub peak_buffer_triangles: u64,
}

impl CollapseReport {
    /// All of it as numbers, to be written down.
    pub fn to_words(&self) -> [u64; 11] {
        let [a, b, c, d, e, f, g, h] = self.repaired.counts().map(|(_, count)| count);
        let Self { input_triangles, input_crc, peak_buffer_triangles, .. } = *self;
        [input_triangles, input_crc.into(), peak_buffer_triangles, a, b, c, d, e, f, g, h]
    }

    /// What [`to_words`](Self::to_words) was told of.
    pub fn from_words(words: [u64; 11]) -> Self {
        let [input_triangles, input_crc, peak_buffer_triangles, repaired @ ..] = words;
        Self {
            input_triangles,
            input_crc: input_crc as u32,
            repaired: Repairs::of(repaired),
            peak_buffer_triangles,
        }
    }
}
