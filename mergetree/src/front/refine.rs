//! Split with forced splits, and collapse.

use crate::front::mesh::Misfit;
use crate::front::{Cluster, Dependencies, Front, FrontVertex, Slot, slot_of};
use crate::{Node, NodeId, NodeStore, SlotId};

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
        let mut pending = std::mem::take(&mut self.pending);
        pending.clear();
        pending.push((id, 0));
        self.just_split.clear();
        let result = self.split_pending(store, &mut pending, urgency);
        self.pending = pending;
        result
    }

    /// `pending` holds nodes with the least order they may have; whatever a node waits for has a higher one than it,
    /// so this ends.
    fn split_pending(
        &mut self,
        store: &mut impl NodeStore,
        pending: &mut Vec<(NodeId, u32)>,
        urgency: f32,
    ) -> Result<(), SplitBlocked> {
        while let Some(&(id, least_order)) = pending.last() {
            if store.node(id).is_none() && !store.request(id, urgency) {
                return Err(SplitBlocked::NotResident(id));
            }
            let node = *store.node(id).ok_or(SplitBlocked::NotResident(id))?;
            if node.slot.is_some() {
                pending.pop();
                continue;
            }
            if node.order < least_order || node.order == u32::MAX {
                return Err(SplitBlocked::Damaged(id));
            }
            match self.missing(store, id, &node, urgency)? {
                Some(first) => pending.push((first, node.order + 1)),
                None => {
                    self.split_now(store, id, &node)?;
                    pending.pop();
                }
            }
        }
        Ok(())
    }

    /// A node that has to be split before this one, if there is one.
    fn missing(
        &self,
        store: &mut impl NodeStore,
        id: NodeId,
        node: &Node,
        urgency: f32,
    ) -> Result<Option<NodeId>, SplitBlocked> {
        if let Some(parent) = node.parent
            && slot_of(store, parent).is_none()
        {
            return Ok(Some(parent));
        }
        let adjacent = match self.active_half_edges(store, node) {
            Ok(adjacent) => adjacent,
            Err(owner) => return Ok(Some(owner)),
        };
        let [w, x, _, _] = adjacent;
        // A half-edge out of the vertex that is divided.
        let out = x.or_else(|| w.map(|w| w.next())).ok_or(SplitBlocked::Damaged(id))?;
        if self.clusters[self.mesh.start(out) as usize].top != Some(id) {
            return Err(SplitBlocked::Damaged(id));
        }
        if self.dependencies == Dependencies::Links {
            return Ok(None);
        }
        let mut coarser = None;
        let mut absent = None;
        self.mesh.for_each_neighbour(out, |r| {
            if let Some(top) = self.clusters[r as usize].top {
                match store.node(top) {
                    Some(other) if other.order > node.order => coarser = Some(top),
                    Some(_) => {}
                    None => absent = Some(top),
                }
            }
        });
        if coarser.is_some() {
            return Ok(coarser);
        }
        match absent {
            None => Ok(None),
            // Its order is not known: it has to be looked at. If it is there now, all are looked at again.
            Some(top) if store.request(top, urgency) => self.missing(store, id, node, urgency),
            Some(top) => Err(SplitBlocked::NotResident(top)),
        }
    }

    fn split_now(
        &mut self,
        store: &mut impl NodeStore,
        id: NodeId,
        node: &Node,
    ) -> Result<(), SplitBlocked> {
        let damaged = SplitBlocked::Damaged(id);
        let adjacent = self.active_half_edges(store, node).map_err(|_| damaged)?;
        let parent = node.parent.and_then(|parent| slot_of(store, parent));
        let level = parent.map_or(0, |slot| self.slots[slot.index()].level) + 1;
        let slot =
            self.free.last().copied().unwrap_or_else(|| SlotId::from_index(self.slots.len()));
        let vertex = FrontVertex { position: node.position, normal: node.normal, level };
        let kept = self.mesh.split(slot, adjacent, vertex).map_err(|Misfit| damaged)?;

        let entry = Slot { node: Some(id), level, num_split_children: 0 };
        if self.free.pop().is_some() {
            self.slots[slot.index()] = entry;
        } else {
            self.slots.push(entry);
        }
        let removed = self.mesh.vertex_of(slot) as usize;
        if self.clusters.len() <= removed {
            self.clusters.resize(removed + 1, Cluster { top: None, upper: u32::MAX });
        }
        if !self.colours.is_empty() {
            self.colours.resize(self.mesh.vertices.len(), [u8::MAX; 4]);
            self.colours[removed] = store.colour(id).unwrap_or([u8::MAX; 4]);
        }
        self.clusters[removed] = Cluster { top: node.left, upper: node.order };
        self.clusters[kept as usize] = Cluster { top: node.right, upper: node.order };
        if let Some(parent) = parent {
            self.slots[parent.index()].num_split_children += 1;
        }
        self.num_split += 1;
        self.just_split.push(id);
        store.set_slot(id, Some(slot));
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
        if self.slots[slot.index()].num_split_children > 0 {
            return Err(CollapseBlocked::ChildSplit(id));
        }
        let finer = CollapseBlocked::FinerFace(id);
        let adjacent = self.active_half_edges(store, &node).map_err(|_| finer)?;
        if !self.mesh.can_collapse(slot, adjacent) {
            return Err(finer);
        }
        if self.dependencies == Dependencies::Order && !self.neighbours_are_as_coarse(slot, &node) {
            return Err(CollapseBlocked::OtherOrder(id));
        }
        let kept = self.mesh.collapse(slot, adjacent).map_err(|Misfit| finer)? as usize;
        let parent = node.parent.and_then(|p| store.node(p));
        self.clusters[kept] =
            Cluster { top: Some(id), upper: parent.map_or(u32::MAX, |p| p.order) };
        if let Some(parent) = parent.and_then(|p| p.slot) {
            self.slots[parent.index()].num_split_children -= 1;
        }
        self.free_slot(store, id, slot);
        Ok(())
    }

    fn free_slot(&mut self, store: &mut impl NodeStore, id: NodeId, slot: SlotId) {
        self.slots[slot.index()] = Slot { node: None, level: 0, num_split_children: 0 };
        self.free.push(slot);
        self.num_split -= 1;
        store.set_slot(id, None);
    }

    /// Whether every neighbour of both vertices came out of a split that was collapsed after this one.
    fn neighbours_are_as_coarse(&self, slot: SlotId, node: &Node) -> bool {
        let mut allowed = true;
        // h leaves the vertex that goes, a the one that stays.
        for k in [0, 1] {
            self.mesh.for_each_neighbour(self.mesh.half_edge_of(slot, k), |r| {
                allowed &= self.clusters[r as usize].upper >= node.order;
            });
        }
        allowed
    }
}
