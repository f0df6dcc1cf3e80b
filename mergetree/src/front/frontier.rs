//! The nodes below the front: for every vertex of the active mesh its next split.

use crate::front::{has_bit, set_bit};
use crate::measure::BoundsTable;
use crate::{NodeBounds, NodeId, NodeStore, SlotId};

/// The order of a node that is not resident, above that of any other.
pub(crate) const UNKNOWN: u32 = u32::MAX;

/// What the front remembers of a vertex of the active mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cluster {
    /// The next split of this vertex; `None` if it stands for itself alone.
    pub(crate) top: Option<NodeId>,
    /// Order of `top`: 0 if there is none, [`UNKNOWN`] while it was never resident since it came up.
    pub(crate) lower: u32,
    /// Order of the split that this vertex came out of last: that of the parent of `top`; `u32::MAX` if none.
    pub(crate) upper: u32,
    /// Where that split is.
    pub(crate) parent: Option<SlotId>,
    /// The node that was not resident when the next split was last tried.
    pub(crate) blocked_by: Option<NodeId>,
}

impl Cluster {
    /// Of a vertex that is not there.
    const NONE: Self =
        Self { top: None, lower: 0, upper: u32::MAX, parent: None, blocked_by: None };
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Frontier {
    clusters: Vec<Cluster>,
    /// Bounds of each vertex's next split; those of its parent while it has not been resident.
    bounds: BoundsTable,
    /// A bit per vertex: whether it has a next split.
    present: Vec<u8>,
    /// A bit per vertex: whether the bounds are those of the parent.
    absent: Vec<u8>,
}

impl Frontier {
    pub(crate) fn new(store: &impl NodeStore) -> Self {
        let mut frontier = Self::default();
        for (v, vertex) in (0..).zip(&store.base().vertices) {
            frontier.set(store, v, vertex.root, u32::MAX, None, &NodeBounds::UNBOUNDED);
        }
        frontier
    }

    /// Notes the next split of a vertex. `parent_bounds` stand for its own while it is not resident.
    pub(crate) fn set(
        &mut self,
        store: &impl NodeStore,
        v: u32,
        top: Option<NodeId>,
        upper: u32,
        parent: Option<SlotId>,
        parent_bounds: &NodeBounds,
    ) {
        let node = top.and_then(|top| store.node(top));
        let lower = match (top, node) {
            (None, _) => 0,
            (Some(_), None) => UNKNOWN,
            (Some(_), Some(node)) => node.order,
        };
        self.insert(v, Cluster { top, lower, upper, parent, blocked_by: None });
        let absent = top.is_some() && node.is_none();
        match node {
            Some(node) => self.bounds.set(v as usize, &node.into()),
            None if absent => self.bounds.set(v as usize, parent_bounds),
            None => {}
        }
        set_bit(&mut self.present, v as usize, top.is_some());
        set_bit(&mut self.absent, v as usize, absent);
    }

    /// Notes that a node is the next split of a vertex again.
    pub(crate) fn restore(
        &mut self,
        v: u32,
        top: NodeId,
        bounds: &NodeBounds,
        upper: u32,
        parent: Option<SlotId>,
    ) {
        let lower = bounds.order;
        self.insert(v, Cluster { top: Some(top), lower, upper, parent, blocked_by: None });
        self.bounds.set(v as usize, bounds);
        set_bit(&mut self.present, v as usize, true);
        set_bit(&mut self.absent, v as usize, false);
    }

    /// Notes that a vertex went.
    pub(crate) fn remove(&mut self, v: u32) {
        self.insert(v, Cluster::NONE);
        set_bit(&mut self.present, v as usize, false);
        set_bit(&mut self.absent, v as usize, false);
    }

    fn insert(&mut self, v: u32, cluster: Cluster) {
        if self.clusters.len() <= v as usize {
            self.clusters.resize(v as usize + 1, Cluster::NONE);
        }
        self.clusters[v as usize] = cluster;
    }

    /// Goes without the next split of a vertex, which can never be made, until its parent is split anew.
    pub(crate) fn give_up(&mut self, v: u32) {
        let cluster = &mut self.clusters[v as usize];
        *cluster = Cluster { top: None, lower: 0, blocked_by: None, ..*cluster };
        set_bit(&mut self.present, v as usize, false);
        set_bit(&mut self.absent, v as usize, false);
    }

    /// Looks whether a next split that was not resident is now, and takes its bounds if so.
    pub(crate) fn look_again(&mut self, store: &impl NodeStore, v: u32) -> bool {
        let cluster = &mut self.clusters[v as usize];
        let Some(node) = cluster.top.and_then(|top| store.node(top)) else { return false };
        cluster.lower = node.order;
        self.bounds.set(v as usize, &node.into());
        set_bit(&mut self.absent, v as usize, false);
        true
    }

    /// Notes what the next split of a vertex waits for, so that it is not tried again before that has come: what it forces
    /// to be split on the way would be collapsed and split again in every frame.
    pub(crate) fn set_blocked(&mut self, v: u32, by: Option<NodeId>) {
        self.clusters[v as usize].blocked_by = by;
    }

    /// The node that the next split of a vertex waits for: itself, or one it depends on.
    pub(crate) fn waits_for(&self, v: u32) -> Option<NodeId> {
        let cluster = self.get(v);
        if self.is_absent(v) { cluster.top } else { cluster.blocked_by }
    }

    #[inline]
    pub(crate) fn get(&self, v: u32) -> &Cluster {
        &self.clusters[v as usize]
    }

    /// Whether a node is the next split of a vertex.
    #[inline]
    pub(crate) fn is_next(&self, v: u32, id: NodeId) -> bool {
        self.clusters.get(v as usize).is_some_and(|cluster| cluster.top == Some(id))
    }

    pub(crate) fn len(&self) -> usize {
        self.clusters.len()
    }

    /// Bounds of a vertex's next split, or of its parent.
    #[inline]
    pub(crate) fn bounds(&self, v: u32) -> NodeBounds {
        self.bounds.get(v as usize)
    }

    /// Whether a vertex's next split has not been resident since it came up.
    #[inline]
    pub(crate) fn is_absent(&self, v: u32) -> bool {
        has_bit(&self.absent, v as usize)
    }

    /// The bounds, and the bits of those that mean something.
    pub(crate) fn table(&self) -> (&BoundsTable, &[u8]) {
        (&self.bounds, &self.present)
    }

    /// The bounds, and the bits of those that stand for a node that is not resident.
    pub(crate) fn absent_table(&self) -> (&BoundsTable, &[u8]) {
        (&self.bounds, &self.absent)
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.clusters.capacity() * size_of::<Cluster>()
            + self.bounds.memory_bytes()
            + self.present.capacity()
            + self.absent.capacity()
    }
}
