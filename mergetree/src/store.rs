//! Where the front finds its nodes.

use crate::{BaseMesh, Colour, Node, NodeId, SlotId};

/// Gives the front the nodes of a forest, which may be in memory or not.
///
/// Once a node is resident it stays so at least as long as it has a [slot](Node::slot). The nodes of a forest in memory
/// ([`crate::Forest`]) all are; a pager keeps those that are wanted.
pub trait NodeStore {
    /// The coarsest mesh, always resident.
    fn base(&self) -> &BaseMesh;

    /// The node, if it is resident.
    fn node(&self, id: NodeId) -> Option<&Node>;

    /// The colour of the vertex that the split of a resident node brings back. It is asked for only where the vertices of the
    /// coarsest mesh have [colours](BaseMesh::colours).
    fn colour(&self, _id: NodeId) -> Option<Colour> {
        None
    }

    /// Asks for a node, the more urgently the higher `urgency` (the screen-space error in pixels). Returns whether it
    /// is resident now; if not, it may be in a later frame, or never when it cannot be read.
    fn request(&mut self, id: NodeId, urgency: f32) -> bool;

    /// Whether a node that is not resident never will be: its page is damaged. The front then goes on without it, and what
    /// is around it is refined all the same, as far as connectivity allows.
    fn is_lost(&self, _id: NodeId) -> bool {
        false
    }

    /// Notes where the front keeps a node that was split, or with `None` that it was collapsed.
    ///
    /// # Panics
    /// When the node is not resident.
    fn set_slot(&mut self, id: NodeId, slot: Option<SlotId>);
}
