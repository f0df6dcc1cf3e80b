//! The collapse record, the one currency of everything multiresolution.

use halfedge::{Collapse, HalfEdgeId, VertexId};

/// One half-edge collapse, in the numbering of the input mesh. Its index in the sequence is its order.
///
/// With `h: v→u` in the face `f0 = (h, a, b)` and its reverse `h'` in `f1 = (h', d, e)`: `w = rev(a)`, `x = rev(b)`,
/// `y = rev(d)`, `z = rev(e)`.
///
/// # Sources
/// DeCoro and Pajarola, *XFastMesh*, 2002, Figure 2 and §3.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapseRecord {
    /// The vertex `v` that goes.
    pub removed: VertexId,
    /// The vertex `u` that stays.
    pub kept: VertexId,
    /// `h`; its face is `f0`.
    pub half_edge: HalfEdgeId,
    /// `h'`; its face is `f1`. `None` on a boundary.
    pub reverse: Option<HalfEdgeId>,
    /// `w, x, y, z`; `None` on a boundary.
    pub adjacent: [Option<HalfEdgeId>; 4],
    /// Bounds of what this collapse changes by itself.
    pub star: StarBounds,
    /// A smaller number that can stand for the order; see [`ranks`](crate::ranks()). `None` where nobody has kept account.
    pub rank: Option<u32>,
}

/// Bounds of the triangles around a vertex when it is removed, without what was removed before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StarBounds {
    /// Distance from `v` to the farthest corner.
    pub radius: f32,
    /// Largest angle between the normal of `v` and that of a triangle before or after, in radians.
    pub cone_angle: f32,
    /// How far the surface is from the input after this collapse, all earlier ones included: the sum of what each moved
    /// it by, measured where it moves most. Nearly always an upper bound.
    pub deviation: f32,
}

impl StarBounds {
    /// Sine of the cone's half-angle; 1 for a right angle and more.
    pub fn cone_sine(&self) -> f32 {
        let angle = self.cone_angle;
        if angle >= std::f32::consts::FRAC_PI_2 {
            1.0
        } else {
            // A little more, so that rounding never leaves a triangle outside.
            (angle.sin() + f32::EPSILON).min(1.0)
        }
    }
}

impl CollapseRecord {
    /// The record of a collapse, without rank.
    pub fn new(collapse: &Collapse, star: StarBounds) -> Self {
        Self {
            removed: collapse.removed,
            kept: collapse.kept,
            half_edge: collapse.half_edge,
            reverse: collapse.reverse,
            adjacent: collapse.adjacent,
            star,
            rank: None,
        }
    }
}
