//! Orders as small numbers: equal where it makes no difference which collapse came first.

use halfedge::{BuildError, Collapse, HalfEdgeId, HalfEdgeMesh};

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

/// Numbers that can stand for the [orders](crate::Node::order) of the nodes of a forest: few different ones, small, and yet
/// such that fronts stay what they are.
///
/// A collapse touches the vertex that it removes and the neighbours of that. Its rank is one more than the largest of those
/// that touched the vertex that it removes or the one that it keeps before, or 0 where there is none. So ranks are in the
/// order of the collapses wherever that matters: a child's is smaller than its parent's, a node's smaller than that of those
/// it names half-edges of, and of two collapses of which one changes triangles around a vertex of the other the later one
/// has the larger rank. Then a front under [`Dependencies::Order`](crate::Dependencies::Order) has no triangle that it could
/// not have with orders.
///
/// Returns a rank for each node, in the order of [`Forest::nodes`].
///
/// # Complexity
/// Time: one split for every node and the degree of its vertex. Memory: the finest mesh, and 40 bytes per node.
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
    // What each split touched, from the last collapse to the first.
    let mut rings: Vec<u32> = Vec::with_capacity(6 * forest.nodes.len());
    let mut splits: Vec<Split> = Vec::with_capacity(forest.nodes.len());
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
        let vertex = FrontVertex { position: node.position, normal: node.normal, level: 0 };
        let [w, x, _, _] = adjacent;
        let kept = x.map(|x| mesh.start(x)).or_else(|| w.map(|w| mesh.end(w)));
        let kept = kept.ok_or_else(misfit)?;
        mesh.split(slot, kept, adjacent, vertex).map_err(|_| misfit())?;
        mesh.for_each_neighbour(mesh.half_edge_of(slot, 0), |r| rings.push(r));
        splits.push(Split { kept, removed: mesh.vertex_of(slot), ring_end: rings.len() });
        slots[id.index()] = Some(slot);
    }
    // Per vertex one more than the rank that touched it last.
    let mut touched = vec![0u32; base.vertices.len() + forest.nodes.len()];
    let mut ranks = vec![0u32; forest.nodes.len()];
    for (index, (split, id)) in splits.iter().zip(&by_order).enumerate().rev() {
        let rank = touched[split.removed as usize].max(touched[split.kept as usize]);
        let ring_start = index.checked_sub(1).map_or(0, |before| splits[before].ring_end);
        for &r in &rings[ring_start..split.ring_end] {
            touched[r as usize] = touched[r as usize].max(rank + 1);
        }
        ranks[id.index()] = rank;
    }
    Ok(ranks)
}

/// A split as it was done.
struct Split {
    kept: u32,
    removed: u32,
    /// Where the neighbours of the vertex that came end.
    ring_end: usize,
}

/// Keeps account of the ranks of collapses while they are done; see [`ranks`].
#[derive(Clone, Debug, Default)]
pub struct RankAccount {
    /// Per vertex one more than the rank that touched it last.
    touched: Vec<u32>,
}

impl RankAccount {
    /// The rank of the collapse that is to be done next.
    ///
    /// # Complexity
    /// Linear in the valence of the vertex that is removed.
    pub fn next(&mut self, mesh: &HalfEdgeMesh, collapse: &Collapse) -> u32 {
        self.touched.resize(mesh.vertex_capacity().max(self.touched.len()), 0);
        let [v, u] = [collapse.removed.index(), collapse.kept.index()];
        let rank = self.touched[v].max(self.touched[u]);
        for r in mesh.one_ring(collapse.removed) {
            let touched = &mut self.touched[r.index()];
            *touched = (*touched).max(rank + 1);
        }
        rank
    }
}
