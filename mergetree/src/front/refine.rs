//! Split with forced splits, and collapse.

use halfedge::HalfEdgeId;

use crate::front::frontier::UNKNOWN;
use crate::front::mesh::Misfit;
use crate::front::{Dependencies, Front, FrontVertex, Slot, slot_of};
use crate::{HalfEdgeName, Node, NodeBounds, NodeId, NodeStore, SlotId};

/// Why a node was not split. What was split on the way stays split; the mesh is whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplitBlocked {
    /// This node, itself or one it depends on, is not resident; it was requested.
    #[error("node {0} is not resident")]
    NotResident(NodeId),
    /// What the node says of its surroundings contradicts the mesh: the file it comes from is damaged or hostile.
    #[error("node {0} does not fit the mesh around it")]
    Damaged(NodeId),
}

impl SplitBlocked {
    /// Whether there is no use in trying again.
    pub(crate) fn is_for_good(self, store: &impl NodeStore) -> bool {
        match self {
            Self::NotResident(id) => store.is_lost(id),
            Self::Damaged(_) => true,
        }
    }
}

/// Why a node was not collapsed. Nothing was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CollapseBlocked {
    /// The node is not split.
    #[error("node {0} is not split")]
    NotSplit(NodeId),
    /// A child is split.
    #[error("a child of node {0} is split")]
    ChildSplit(NodeId),
    /// A finer face sits between the node's faces and their outer neighbours.
    #[error("the faces around node {0} are finer")]
    FinerFace(NodeId),
    /// A neighbouring vertex is not in the state it had when the collapse was made.
    #[error("the vertices around node {0} are in another state")]
    OtherOrder(NodeId),
}

/// A node that waits to be split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pending {
    id: NodeId,
    /// The least order it may have: whatever a node waits for has a higher one than it, so waiting ends.
    least_order: u32,
    /// The vertex it divides, where that is known.
    vertex: Option<u32>,
}

/// The surroundings of a vertex that is to be divided.
struct Ring {
    /// The half-edges that the node names, as far as they are there.
    adjacent: [Option<HalfEdgeId>; 4],
    /// A neighbour whose next split has a higher order, or one that is not known.
    coarser: Option<u32>,
}

/// What has to happen before a node can be split.
enum Missing {
    Split(Pending),
    Nothing([Option<HalfEdgeId>; 4]),
}

impl Front {
    /// Splits a node, and before it all that it depends on: its ancestors, the nodes that own the faces around it, and
    /// with [`Dependencies::Order`] the neighbours that are too coarse (first paper, §4.1, forced splits).
    ///
    /// Nodes that are missing are requested with `urgency`. Splitting a node that is split does nothing.
    ///
    /// # Complexity
    /// Time linear in the valences of the vertices divided.
    ///
    /// # Errors
    /// See [`SplitBlocked`].
    pub fn split(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
        urgency: f32,
    ) -> Result<(), SplitBlocked> {
        self.split_at(store, id, None, urgency, usize::MAX)
    }

    /// The same for a node whose vertex is known; it ends early, with some of what the node depends on split, when there
    /// are so many triangles.
    pub(crate) fn split_at(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
        vertex: Option<u32>,
        urgency: f32,
        max_triangles: usize,
    ) -> Result<(), SplitBlocked> {
        let mut pending = std::mem::take(&mut self.pending);
        pending.clear();
        pending.push(Pending { id, least_order: 0, vertex });
        self.just_split.clear();
        let result = self.split_pending(store, &mut pending, urgency, max_triangles);
        if let Err(blocked) = result
            && blocked.is_for_good(store)
        {
            // The vertex that this happened at does without, so that others need not wait for it.
            let at = pending.iter().rev().find_map(|pending| pending.vertex);
            if let Some(vertex) = at.filter(|&v| (v as usize) < self.frontier.len()) {
                self.frontier.give_up(vertex);
            }
        }
        self.pending = pending;
        result
    }

    fn split_pending(
        &mut self,
        store: &mut impl NodeStore,
        pending: &mut Vec<Pending>,
        urgency: f32,
        max_triangles: usize,
    ) -> Result<(), SplitBlocked> {
        while let Some(&Pending { id, least_order, vertex }) = pending.last() {
            if store.node(id).is_none() && !store.request(id, urgency) {
                return Err(SplitBlocked::NotResident(id));
            }
            let node = *store.node(id).ok_or(SplitBlocked::NotResident(id))?;
            if node.slot.is_some() {
                pending.pop();
                continue;
            }
            if node.order < least_order || node.order == UNKNOWN {
                return Err(SplitBlocked::Damaged(id));
            }
            let vertex = match vertex {
                Some(vertex) => Ok(vertex),
                None => self.vertex_of(store, id, &node),
            };
            let missing = match vertex {
                Err(parent) => Missing::Split(Pending {
                    id: parent,
                    least_order: node.order + 1,
                    vertex: None,
                }),
                Ok(vertex) => match self.missing(store, id, vertex, &node, urgency)? {
                    Missing::Nothing(adjacent) => {
                        self.split_now(store, id, vertex, &node, adjacent)?;
                        pending.pop();
                        if self.num_triangles() >= max_triangles {
                            break;
                        }
                        continue;
                    }
                    missing => missing,
                },
            };
            if let Missing::Split(first) = missing {
                // Only a node that hangs in two places is split where it was to be split first.
                if slot_of(store, first.id).is_some() {
                    return Err(SplitBlocked::Damaged(id));
                }
                pending.push(first);
            }
        }
        Ok(())
    }

    /// The vertex whose next split this node is, if its parent is split; else the parent.
    fn vertex_of(&self, store: &impl NodeStore, id: NodeId, node: &Node) -> Result<u32, NodeId> {
        let Some(parent) = node.parent else {
            let at = self.roots.partition_point(|&(root, _)| root < id);
            return Ok(self.roots.get(at).map_or(u32::MAX, |&(_, v)| v));
        };
        let Some(parent_node) = store.node(parent) else { return Err(parent) };
        let slot = parent_node.slot.ok_or(parent)?;
        Ok(if parent_node.left == Some(id) {
            self.mesh.vertex_of(slot)
        } else {
            self.mesh.kept(slot)
        })
    }

    /// A node that has to be split before this one, if there is one; else the half-edges around it.
    fn missing(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
        vertex: u32,
        node: &Node,
        urgency: f32,
    ) -> Result<Missing, SplitBlocked> {
        let damaged = SplitBlocked::Damaged(id);
        let is_next =
            (vertex as usize) < self.frontier.len() && self.frontier.get(vertex).top == Some(id);
        if !is_next {
            return Err(damaged);
        }
        let least_order = node.order + 1;
        loop {
            let ring = self.look_around(vertex, node).ok_or(damaged)?;
            for (name, found) in node.adjacent.iter().zip(ring.adjacent) {
                let (Some(name), None) = (name, found) else { continue };
                // The face is there, but not here; or it never goes.
                let HalfEdgeName::Node(owner, _) = self.names.resolve(*name) else {
                    return Err(damaged);
                };
                if slot_of(store, owner).is_some() {
                    return Err(damaged);
                }
                return Ok(Missing::Split(Pending { id: owner, least_order, vertex: None }));
            }
            let Some(coarser) = ring.coarser else { return Ok(Missing::Nothing(ring.adjacent)) };
            let cluster = *self.frontier.get(coarser);
            let top = cluster.top.ok_or(damaged)?;
            if cluster.lower != UNKNOWN {
                return Ok(Missing::Split(Pending { id: top, least_order, vertex: Some(coarser) }));
            }
            if store.is_lost(top) {
                self.frontier.give_up(coarser);
                continue;
            }
            // Its order is not known: it has to be looked at.
            if store.node(top).is_none() && !store.request(top, urgency)
                || !self.frontier.look_again(store, coarser)
            {
                return Err(SplitBlocked::NotResident(top));
            }
            if self.frontier.get(coarser).lower == UNKNOWN {
                return Err(SplitBlocked::Damaged(top));
            }
        }
    }

    /// Walks around a vertex to find what a node says of it. `None` for a vertex without faces.
    fn look_around(&self, vertex: u32, node: &Node) -> Option<Ring> {
        let names = node.adjacent.map(|name| name.map(|name| self.names.resolve(name)));
        let mut ring = Ring { adjacent: [None; 4], coarser: None };
        let order = match self.dependencies {
            Dependencies::Order => node.order,
            Dependencies::Links => UNKNOWN,
        };
        // `x` and `z` lead out of the vertex, `w` and `y` into it.
        let look = |ring: &mut Ring, h: HalfEdgeId, [first, second]: [usize; 2]| {
            let at = self.mesh.slot_of_half_edge(h);
            for which in [first, second] {
                if names[which].is_some_and(|name| self.is_named(h, at, name)) {
                    ring.adjacent[which] = Some(h);
                }
            }
        };
        let meet = |ring: &mut Ring, neighbour: u32| {
            if self.frontier.get(neighbour).lower > order {
                ring.coarser = Some(neighbour);
            }
        };
        let face = |ring: &mut Ring, g: HalfEdgeId| {
            look(ring, g, [1, 3]);
            look(ring, g.prev(), [0, 2]);
            meet(ring, self.mesh.end(g));
        };
        let first = self.mesh.out(vertex)?;
        let mut g = first;
        loop {
            face(&mut ring, g);
            match self.mesh.reverse(g.prev()) {
                Some(turned) if turned == first => return Some(ring),
                Some(turned) => g = turned,
                None => break,
            }
        }
        // A boundary was met: the other way round, too.
        meet(&mut ring, self.mesh.start(g.prev()));
        g = first;
        while let Some(r) = self.mesh.reverse(g) {
            g = r.next();
            face(&mut ring, g);
        }
        Some(ring)
    }

    /// Whether a half-edge of the active mesh, the one `at` this place in a slot, has this name.
    #[inline]
    fn is_named(&self, h: HalfEdgeId, at: Option<(SlotId, u32)>, name: HalfEdgeName) -> bool {
        match (at, name) {
            (None, HalfEdgeName::Base(base)) => h.get() == base,
            (Some((slot, k)), HalfEdgeName::Node(owner, owned)) => {
                k == owned && self.slots[slot.index()].node == Some(owner)
            }
            _ => false,
        }
    }

    fn split_now(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
        kept: u32,
        node: &Node,
        adjacent: [Option<HalfEdgeId>; 4],
    ) -> Result<(), SplitBlocked> {
        let parent = self.frontier.get(kept).parent;
        let level = parent.map_or(0, |slot| self.slots[slot.index()].level) + 1;
        let slot =
            self.free.last().copied().unwrap_or_else(|| SlotId::from_index(self.slots.len()));
        let vertex = FrontVertex { position: node.position, normal: node.normal, level };
        self.mesh
            .split(slot, kept, adjacent, vertex)
            .map_err(|Misfit| SplitBlocked::Damaged(id))?;

        let entry = Slot { node: Some(id), parent, level, num_split_children: 0 };
        if self.free.pop().is_some() {
            self.slots[slot.index()] = entry;
        } else {
            self.slots.push(entry);
        }
        let bounds = self.frontier.bounds(kept);
        let bounds = if self.frontier.is_absent(kept) { NodeBounds::from(node) } else { bounds };
        self.bounds.set(slot.index(), &bounds);
        self.set_leaf(slot, true);
        self.held.clear(slot);
        let removed = self.mesh.vertex_of(slot);
        for (v, top) in [(removed, node.left), (kept, node.right)] {
            self.frontier.set(store, v, top, node.order, Some(slot), &bounds);
        }
        if !self.colours.is_empty() {
            self.colours.resize(self.mesh.vertices.len(), [u8::MAX; 4]);
            self.colours[removed as usize] = store.colour(id).unwrap_or([u8::MAX; 4]);
        }
        if let Some(parent) = parent {
            self.slots[parent.index()].num_split_children += 1;
            self.set_leaf(parent, false);
        }
        self.num_split += 1;
        self.just_split.push(slot);
        store.set_slot(id, Some(slot));
        self.morphs.begin(&mut self.mesh, slot);
        Ok(())
    }

    /// Collapses a split node.
    ///
    /// # Complexity
    /// Time linear in the valences of both vertices.
    ///
    /// # Errors
    /// See [`CollapseBlocked`].
    pub fn collapse(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
    ) -> Result<(), CollapseBlocked> {
        let Some((node, slot)) = store.node(id).and_then(|n| Some((*n, n.slot?))) else {
            return Err(CollapseBlocked::NotSplit(id));
        };
        let adjacent = self.can_collapse(slot, id, &node)?;
        self.collapse_now(store, slot, id, adjacent)
    }

    /// Whether a node may be collapsed; if not, what keeps it from it is noted.
    pub(crate) fn can_collapse(
        &mut self,
        slot: SlotId,
        id: NodeId,
        node: &Node,
    ) -> Result<[Option<HalfEdgeId>; 4], CollapseBlocked> {
        self.look_at_collapse(slot, id, node).map_err(|(blocked, holder)| {
            if let Some(vertex) = holder {
                self.held.set(slot, vertex, &self.frontier, &self.slots);
            }
            blocked
        })
    }

    /// The half-edges around a node, if it may be collapsed: no finer face sits between its faces and their outer
    /// neighbours, and no neighbour forbids it. Otherwise a vertex that has to change first, if it is one.
    pub(crate) fn look_at_collapse(
        &self,
        slot: SlotId,
        id: NodeId,
        node: &Node,
    ) -> Result<[Option<HalfEdgeId>; 4], (CollapseBlocked, Option<u32>)> {
        if self.slots[slot.index()].num_split_children > 0 {
            return Err((CollapseBlocked::ChildSplit(id), None));
        }
        let [h, a, b, h1, d, e] = [0, 1, 2, 3, 4, 5].map(|k| self.mesh.half_edge_of(slot, k));
        let second = node.has_second_face();
        let mut adjacent = [a, b, d, e].map(|inner| self.mesh.reverse(inner));
        if !second {
            // Its second face was never there.
            adjacent[2..].fill(None);
        }
        let across = self.mesh.reverse(h);
        let mut finer = (across != second.then_some(h1)).then_some(across);
        for (outer, name) in adjacent.into_iter().zip(node.adjacent) {
            let name = name.map(|name| self.names.resolve(name));
            let same = match (outer, name) {
                (None, None) => true,
                (Some(outer), Some(name)) => {
                    self.is_named(outer, self.mesh.slot_of_half_edge(outer), name)
                }
                _ => false,
            };
            if !same {
                finer = Some(outer);
            }
        }
        if let Some(face) = finer {
            let slot = face.and_then(|h| self.mesh.slot_of_half_edge(h));
            let holder = slot.map(|(slot, _)| self.mesh.vertex_of(slot));
            return Err((CollapseBlocked::FinerFace(id), holder));
        }
        if self.dependencies == Dependencies::Order
            && let Some(finer) = self.finer_neighbour(slot, node.order)
        {
            return Err((CollapseBlocked::OtherOrder(id), Some(finer)));
        }
        Ok(adjacent)
    }

    pub(crate) fn collapse_now(
        &mut self,
        store: &mut impl NodeStore,
        slot: SlotId,
        id: NodeId,
        adjacent: [Option<HalfEdgeId>; 4],
    ) -> Result<(), CollapseBlocked> {
        let kept =
            self.mesh.collapse(slot, adjacent).map_err(|Misfit| CollapseBlocked::FinerFace(id))?;
        self.morphs.end(slot);
        let parent = self.slots[slot.index()].parent;
        let upper = parent.map_or(u32::MAX, |parent| self.bounds.order(parent.index()));
        let bounds = self.bounds.get(slot.index());
        self.frontier.restore(kept, id, &bounds, upper, parent);
        self.frontier.remove(self.mesh.vertex_of(slot));
        if let Some(parent) = parent {
            let entry = &mut self.slots[parent.index()];
            entry.num_split_children -= 1;
            let is_leaf = entry.num_split_children == 0;
            self.set_leaf(parent, is_leaf);
        }
        self.slots[slot.index()] = Slot::FREE;
        self.set_leaf(slot, false);
        self.held.clear(slot);
        self.free.push(slot);
        self.num_split -= 1;
        store.set_slot(id, None);
        Ok(())
    }

    /// A neighbour of either vertex that came out of a split that has to be collapsed before this one.
    fn finer_neighbour(&self, slot: SlotId, order: u32) -> Option<u32> {
        let mut finer = None;
        // h leaves the vertex that goes, a the one that stays.
        for k in [0, 1] {
            self.mesh.for_each_neighbour(self.mesh.half_edge_of(slot, k), |r| {
                if self.frontier.get(r).upper < order {
                    finer = Some(r);
                }
            });
        }
        finer
    }
}
