//! Nodes of the merge-tree forest and their names.

use glam::{Vec2, Vec3};
use halfedge::HalfEdgeId;

halfedge::define_id!(
    /// A node of the forest: one half-edge collapse, one vertex that a split brings back.
    NodeId,
    "n"
);
halfedge::define_id!(
    /// The place a split node has in the active mesh; given by the front, meaningless elsewhere.
    SlotId,
    "s"
);

/// A unit vector in 32 bits: the octahedron unfolded onto a square of two signed 16-bit fractions.
///
/// The angular error is below 0.005 degrees.
///
/// # Sources
/// Meyer, Süßmuth, Sußner, Stamminger and Greiner, *On Floating-Point Normal Vectors*, 2010.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct OctNormal(pub [i16; 2]);

impl OctNormal {
    /// Encodes a direction of any length; a vector without direction becomes +z.
    pub fn new(direction: Vec3) -> Self {
        let sum = direction.abs().element_sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return Self([0, 0]);
        }
        let n = direction / sum;
        let mut e = n.truncate();
        if n.z < 0.0 {
            e = (1.0 - Vec2::new(n.y, n.x).abs()) * e.map(|c| 1.0f32.copysign(c));
        }
        Self((e * 32767.0).round().to_array().map(|c| c as i16))
    }

    /// The unit vector.
    #[inline]
    pub fn to_vec3(self) -> Vec3 {
        let [x, y] = self.0.map(|c| (f32::from(c) / 32767.0).max(-1.0));
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
    }
}

/// Colour of a vertex: red, green, blue and alpha, 255 for one, as the input has them (its colour space is not looked at).
pub type Colour = [u8; 4];

/// One node of the forest, as it lies in memory: what a split needs and what a view test needs, in one cache line.
///
/// # Units
/// Lengths are the model's.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Node {
    /// Position of the vertex `v` that the split brings back; centre of the bounding sphere.
    pub position: Vec3,
    /// Radius of a sphere that holds all that this node or one below it can change.
    pub radius: f32,
    /// Normal of `v`; axis of the normal cone.
    pub normal: OctNormal,
    /// Sine of the half-angle of a cone that holds the normals of all those triangles; 1 for a right angle and more.
    pub cone_sine: f32,
    /// How far the surface lies from the input at most while this node is not split, as measured during the build.
    pub deviation: f32,
    /// Index of the collapse in the global sequence; children have a smaller one than their parent.
    pub order: u32,
    /// The half-edges `w, x, y, z` around the two faces, by their [names](HalfEdgeNames); `None` on a boundary. Without
    /// `y` the node has one face only.
    pub adjacent: [Option<HalfEdgeId>; 4],
    /// The last collapse into `v` before this one.
    pub left: Option<NodeId>,
    /// The last collapse into the vertex `u` that stayed, before this one.
    pub right: Option<NodeId>,
    /// The next collapse of `u`; `None` for a root.
    pub parent: Option<NodeId>,
    /// Where the front keeps the vertex and faces of this node; `None` while it is not split.
    pub slot: Option<SlotId>,
}

const _: () = assert!(size_of::<Node>() == 64);

impl Node {
    /// A node of nothing: what memory for nodes holds before they are there.
    pub const BLANK: Self = Self {
        position: Vec3::ZERO,
        radius: 0.0,
        normal: OctNormal([0, 0]),
        cone_sine: 0.0,
        deviation: 0.0,
        order: 0,
        adjacent: [None; 4],
        left: None,
        right: None,
        parent: None,
        slot: None,
    };

    /// Number of faces the split brings back: two, or one on a boundary.
    #[inline]
    pub fn num_faces(&self) -> usize {
        if self.has_second_face() { 2 } else { 1 }
    }

    /// Whether the split brings back the face `f1` of the reverse half-edge.
    ///
    /// An inner vertex has a face beyond each of its edges, so a second face never lacks its `y`.
    #[inline]
    pub fn has_second_face(&self) -> bool {
        self.adjacent[2].is_some()
    }

    /// The children that exist, left before right.
    #[inline]
    pub fn children(&self) -> impl Iterator<Item = NodeId> + use<> {
        [self.left, self.right].into_iter().flatten()
    }
}

/// How half-edges are named across a forest: first those of the coarsest mesh, `3f + i`; then six for every node, the
/// half-edges `h, a, b` of its first face and `h', d, e` of its second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HalfEdgeNames {
    num_base: u32,
}

/// What a half-edge's name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HalfEdgeName {
    /// A half-edge of the coarsest mesh.
    Base(u32),
    /// Half-edge 0 to 5 of a node.
    Node(NodeId, u32),
}

impl HalfEdgeNames {
    /// The names in a forest whose coarsest mesh has this many faces.
    ///
    /// # Panics
    /// When three times the number does not fit 32 bits.
    pub fn new(num_base_faces: usize) -> Self {
        Self { num_base: u32::try_from(3 * num_base_faces).expect("coarsest mesh too large") }
    }

    /// The largest node id whose half-edges still have names of 32 bits.
    pub fn max_node(self) -> NodeId {
        NodeId::new((u32::MAX - 7 - self.num_base) / 6)
    }

    /// Name of half-edge `k` (0 to 5) of a node.
    #[inline]
    pub fn of_node(self, node: NodeId, k: u32) -> HalfEdgeId {
        HalfEdgeId::new(self.num_base + 6 * node.get() + k)
    }

    /// What a name stands for.
    #[inline]
    pub fn resolve(self, h: HalfEdgeId) -> HalfEdgeName {
        match h.get().checked_sub(self.num_base) {
            None => HalfEdgeName::Base(h.get()),
            Some(k) => HalfEdgeName::Node(NodeId::new(k / 6), k % 6),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn octahedral_normals_are_precise_all_around() {
        let n = 60;
        for i in 0..=n {
            for j in 0..2 * n {
                let (theta, phi) = (
                    std::f32::consts::PI * i as f32 / n as f32,
                    std::f32::consts::PI * j as f32 / n as f32,
                );
                let v = vec3(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let back = OctNormal::new(v).to_vec3();
                assert!(v.distance(back) < 7e-5, "{v} {back}");
            }
        }
        assert_eq!(OctNormal::new(Vec3::ZERO).to_vec3(), Vec3::Z);
        assert_eq!(OctNormal::new(Vec3::NAN).to_vec3(), Vec3::Z);
    }

    #[test]
    fn names_resolve_to_what_they_were_made_of() {
        let names = HalfEdgeNames::new(4);
        assert_eq!(names.resolve(HalfEdgeId::new(11)), HalfEdgeName::Base(11));
        for k in 0..6 {
            let name = names.of_node(NodeId::new(5), k);
            assert_eq!(names.resolve(name), HalfEdgeName::Node(NodeId::new(5), k));
        }
        names.of_node(names.max_node(), 5);
    }
}
