//! What keeps a node from being collapsed, so that it is not tried again before that has gone.

use crate::front::Slot;
use crate::front::frontier::Frontier;
use crate::{NodeId, SlotId};

/// A vertex that forbids a collapse as long as it is one that a certain split made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Holder {
    vertex: u32,
    origin: NodeId,
}

/// Per slot what held its node when a collapse was last tried.
#[derive(Clone, Debug, Default)]
pub(crate) struct Held {
    by: Vec<Option<Holder>>,
}

impl Held {
    /// Notes that a vertex holds the node of a slot, until it comes out of another split, or goes.
    pub(crate) fn set(&mut self, slot: SlotId, vertex: u32, frontier: &Frontier, slots: &[Slot]) {
        if self.by.len() <= slot.index() {
            self.by.resize(slot.index() + 1, None);
        }
        let holder = origin(vertex, frontier, slots).map(|origin| Holder { vertex, origin });
        self.by[slot.index()] = holder;
    }

    pub(crate) fn clear(&mut self, slot: SlotId) {
        if let Some(holder) = self.by.get_mut(slot.index()) {
            *holder = None;
        }
    }

    /// Whether a node cannot be collapsed, because what held it does so still.
    #[inline]
    pub(crate) fn is_held(&self, slot: usize, frontier: &Frontier, slots: &[Slot]) -> bool {
        let holder = self.by.get(slot).copied().flatten();
        holder.is_some_and(|Holder { vertex, origin: made_by }| {
            origin(vertex, frontier, slots) == Some(made_by)
        })
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.by.capacity() * size_of::<Option<Holder>>()
    }
}

/// The split that a vertex came out of last.
#[inline]
fn origin(vertex: u32, frontier: &Frontier, slots: &[Slot]) -> Option<NodeId> {
    slots[frontier.get(vertex).parent?.index()].node
}
