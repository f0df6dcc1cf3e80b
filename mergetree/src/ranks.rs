//! Orders as small numbers: equal where it makes no difference which collapse came first.

use halfedge::{BuildError, HalfEdgeId, HalfEdgeMesh};

use crate::front::{ActiveMesh, FrontVertex};
use crate::{Forest, HalfEdgeName, NodeId, SlotId};

/// Why the ranks of a forest cannot be found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RankError {
    /// The coarsest mesh is no manifold.
    #[error(transparent)]
    Base(#[from] BuildError),
    /// What a node says of its surroundings does not fit the mesh of those of higher order.
    #[error("node {0} does not fit the mesh around it")]
    Misfit(NodeId),
}

/// Numbers that can stand for the [orders](crate::Node::order) of the nodes of a forest: as few different ones as possible,
/// small, and yet such that every front is the same.
///
/// A split touches the vertex that it divides and all neighbours of that. The rank of a node is one less than the least
/// rank that touched its vertex before. So ranks of two nodes are in the order of their collapses wherever these met: a
/// child's is smaller than its parent's, a node's smaller than that of those it names half-edges of, and of two splits at
/// neighbouring vertices, which [`Dependencies::Order`](crate::Dependencies::Order) compares, the later one has the smaller
/// rank. Of others it may be anything. The least is 0.
///
/// Returns a rank for each node, in the order of [`Forest::nodes`].
///
/// # Complexity
/// Time: one split for every node and the degree of its vertex. Memory: the finest mesh, and 8 bytes per node.
///
/// # Errors
/// [`RankError`], when the forest does not refine.
pub fn ranks(forest: &Forest) -> Result<Vec<u32>, RankError> {
    let base = &forest.base;
    let connectivity = HalfEdgeMesh::from_triangles(base.vertices.len(), &base.faces)?;
    let mut mesh = ActiveMesh::new(base, &connectivity);
    let names = base.names();
    let mut by_order: Vec<NodeId> = (0..forest.nodes.len()).map(NodeId::from_index).collect();
    by_order.sort_by_key(|id| std::cmp::Reverse(forest.nodes[id.index()].order));
    let mut slots: Vec<Option<SlotId>> = vec![None; forest.nodes.len()];
    // Per vertex of the mesh how many splits deep it was touched last; per node how deep its split is.
    let mut touched = vec![0u32; base.vertices.len() + forest.nodes.len()];
    let mut depths = vec![0u32; forest.nodes.len()];
    let mut deepest = 0;
    for (slot, &id) in (0..).map(SlotId::new).zip(&by_order) {
        let node = &forest.nodes[id.index()];
        let misfit = || RankError::Misfit(id);
        let mut adjacent = [None; 4];
        for (active, name) in adjacent.iter_mut().zip(node.adjacent) {
            let Some(name) = name else { continue };
            *active = Some(match names.resolve(name) {
                HalfEdgeName::Base(h) => HalfEdgeId::new(h),
                HalfEdgeName::Node(owner, k) => {
                    let owner = slots.get(owner.index()).copied().flatten().ok_or_else(misfit)?;
                    mesh.half_edge_of(owner, k)
                }
            });
        }
        let [w, x, _, _] = adjacent;
        let out = x.or_else(|| w.map(|w| w.next())).ok_or_else(misfit)?;
        let kept = mesh.start(out);
        let depth = touched[kept as usize] + 1;
        mesh.for_each_neighbour(out, |r| {
            touched[r as usize] = touched[r as usize].max(depth);
        });
        let vertex = FrontVertex { position: node.position, normal: node.normal, level: 0 };
        let divided = mesh.split(slot, adjacent, vertex).map_err(|_| misfit())?;
        if divided != kept {
            return Err(misfit());
        }
        touched[kept as usize] = depth;
        touched[mesh.vertex_of(slot) as usize] = depth;
        slots[id.index()] = Some(slot);
        depths[id.index()] = depth;
        deepest = deepest.max(depth);
    }
    Ok(depths.into_iter().map(|depth| deepest - depth).collect())
}
