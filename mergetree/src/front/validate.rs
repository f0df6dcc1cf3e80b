//! The invariants of a front, checked one by one.

use halfedge::{FaceId, HalfEdgeId};

use crate::front::frontier::UNKNOWN;
use crate::front::{Dependencies, Front, has_bit, slot_of};
use crate::{NodeBounds, NodeId, NodeStore, SlotId};

/// The first invariant found broken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrontInvalid {
    /// A node is split and its parent is not, or is not resident.
    #[error("node {0} is split and its parent is not")]
    Orphan(NodeId),
    /// Node and slot do not name each other, or a slot's count of split children is wrong.
    #[error("slot and node {0} do not match")]
    Slot(NodeId),
    /// A half-edge's reverse does not point back or does not run between the same vertices.
    #[error("the reverse of half-edge {0} does not match it")]
    Reverse(HalfEdgeId),
    /// A face names a vertex twice.
    #[error("face {0} names a vertex twice")]
    DegenerateFace(FaceId),
    /// The faces around a vertex do not form one fan, or a vertex of a split node has none.
    #[error("the faces around vertex {0} do not form one fan")]
    Fan(u32),
    /// A stored count is wrong.
    #[error("the front counts {stored} {what}, there are {found}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// Number stored.
        stored: usize,
        /// Number found.
        found: usize,
    },
    /// The active mesh has another topology than the coarsest one.
    #[error("the Euler number is {found}, that of the coarsest mesh is {expected}")]
    Euler {
        /// That of the coarsest mesh.
        expected: i64,
        /// That of the active mesh.
        found: i64,
    },
    /// A vertex's next split is not the unsplit node it should be.
    #[error("vertex {0} names a wrong node")]
    Cluster(u32),
    /// What is noted for testing a slot is not what its node says.
    #[error("the bounds noted for slot {0} are not those of its node")]
    Leaf(u32),
    /// A node is noted as held back by a neighbour and is not.
    #[error("node {0} is noted as held by a neighbour and is not")]
    Held(NodeId),
    /// With [`Dependencies::Order`], two neighbours are in states that never stood side by side in the build.
    #[error("vertices {0} and {1} are neighbours of levels too far apart")]
    Order(u32, u32),
}

impl Front {
    /// Checks every invariant.
    ///
    /// # Complexity
    /// Time and memory linear in the size of the active mesh.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, store: &impl NodeStore) -> Result<(), FrontInvalid> {
        self.validate_nodes(store)?;
        self.validate_faces()?;
        self.validate_clusters(store)?;
        self.validate_leaves(store)
    }

    fn validate_nodes(&self, store: &impl NodeStore) -> Result<(), FrontInvalid> {
        let mut num_split = 0;
        for (index, slot) in self.slots.iter().enumerate() {
            let Some(id) = slot.node else { continue };
            num_split += 1;
            let node = store.node(id).ok_or(FrontInvalid::Slot(id))?;
            let is_split = |id: NodeId| super::slot_of(store, id).is_some();
            if node.parent.is_some_and(|parent| !is_split(parent)) {
                return Err(FrontInvalid::Orphan(id));
            }
            let children = node.children().filter(|&child| is_split(child)).count();
            if node.slot.map(|s| s.index()) != Some(index)
                || children != usize::from(slot.num_split_children)
            {
                return Err(FrontInvalid::Slot(id));
            }
        }
        if num_split != self.num_split || num_split + self.free.len() != self.slots.len() {
            return Err(FrontInvalid::Count {
                what: "split nodes",
                stored: self.num_split,
                found: num_split,
            });
        }
        Ok(())
    }

    fn validate_faces(&self) -> Result<(), FrontInvalid> {
        let mesh = &self.mesh;
        let faces =
            || (0..mesh.triangles.len()).map(FaceId::from_index).filter(|&f| mesh.has_face(f));
        let mut degree = vec![0usize; mesh.vertices.len()];
        let mut first = vec![None; mesh.vertices.len()];
        for f in faces() {
            let [a, b, c] = mesh.triangles[f.index()];
            if a == b || b == c || c == a {
                return Err(FrontInvalid::DegenerateFace(f));
            }
            for h in f.half_edges() {
                let v = mesh.start(h) as usize;
                let out = mesh.out(v as u32);
                if !out
                    .is_some_and(|out| mesh.start(out) as usize == v && mesh.has_face(out.face()))
                {
                    return Err(FrontInvalid::Fan(v as u32));
                }
                degree[v] += 1;
                if first[v].is_none() || mesh.reverse(h).is_none() {
                    first[v] = Some(h);
                }
                let matches = mesh.reverse(h).is_none_or(|r| {
                    mesh.reverse(r) == Some(h)
                        && mesh.has_face(r.face())
                        && mesh.start(r) == mesh.end(h)
                        && mesh.end(r) == mesh.start(h)
                });
                if !matches {
                    return Err(FrontInvalid::Reverse(h));
                }
            }
        }
        for (v, (&degree, &first)) in degree.iter().zip(&first).enumerate() {
            let Some(first) = first else { continue };
            let mut walked = 1;
            let mut h = first;
            while let Some(turned) = mesh.reverse(h.prev())
                && turned != first
                && walked <= degree
            {
                h = turned;
                walked += 1;
            }
            if walked != degree {
                return Err(FrontInvalid::Fan(v as u32));
            }
        }
        let found = faces().count();
        if found != self.num_triangles() {
            let stored = self.num_triangles();
            return Err(FrontInvalid::Count { what: "faces", stored, found });
        }
        let (expected, found) = (self.euler, mesh.euler());
        if found != expected {
            return Err(FrontInvalid::Euler { expected, found });
        }
        Ok(())
    }

    fn validate_clusters(&self, store: &impl NodeStore) -> Result<(), FrontInvalid> {
        let live_slot = |v: u32| {
            let base = store.base().vertices.len() as u32;
            v < base || self.slots[(v - base) as usize].node.is_some()
        };
        let (_, present) = self.frontier.table();
        for v in 0..self.frontier.len() as u32 {
            let cluster = self.frontier.get(v);
            if cluster.top.is_some() != has_bit(present, v as usize)
                || !live_slot(v) && cluster.top.is_some()
            {
                return Err(FrontInvalid::Cluster(v));
            }
            if !live_slot(v) {
                continue;
            }
            if let Some(node) = cluster.top.and_then(|top| store.node(top)) {
                let upper = node.parent.and_then(|p| store.node(p)).map_or(u32::MAX, |p| p.order);
                let parent = node.parent.and_then(|p| slot_of(store, p));
                let bounds_are_its = self.frontier.is_absent(v)
                    || self.frontier.bounds(v) == NodeBounds::from(node)
                        && cluster.lower == node.order;
                if node.slot.is_some()
                    || upper != cluster.upper
                    || parent != cluster.parent
                    || !bounds_are_its
                {
                    return Err(FrontInvalid::Cluster(v));
                }
            }
        }
        if self.dependencies == Dependencies::Order {
            // Of a node that was never resident no more is known than that its order is below that of its parent.
            let lower = |v: u32| match self.frontier.get(v).lower {
                UNKNOWN => 0,
                lower => lower,
            };
            for &[a, b, c] in self.mesh.triangles.iter().filter(|&&t| t != [0; 3]) {
                for (s, t) in [(a, b), (b, c), (c, a)] {
                    if lower(s) > self.frontier.get(t).upper
                        || lower(t) > self.frontier.get(s).upper
                    {
                        return Err(FrontInvalid::Order(s, t));
                    }
                }
            }
        }
        Ok(())
    }

    /// What a scan reads of split nodes: bounds and leaves. What is noted as held cannot be collapsed.
    fn validate_leaves(&self, store: &impl NodeStore) -> Result<(), FrontInvalid> {
        for (index, slot) in self.slots.iter().enumerate() {
            let is_leaf = slot.node.is_some() && slot.num_split_children == 0;
            if has_bit(&self.leaves, index) != is_leaf {
                return Err(FrontInvalid::Leaf(index as u32));
            }
            let Some(id) = slot.node else { continue };
            let node = store.node(id).ok_or(FrontInvalid::Slot(id))?;
            if self.bounds.get(index) != NodeBounds::from(node) {
                return Err(FrontInvalid::Leaf(index as u32));
            }
            let slot = SlotId::from_index(index);
            if is_leaf
                && self.held.is_held(index, &self.frontier, &self.slots)
                && self.look_at_collapse(slot, id, node).is_ok()
            {
                return Err(FrontInvalid::Held(id));
            }
        }
        Ok(())
    }
}
