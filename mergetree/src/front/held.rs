//! What keeps a node from being collapsed, so that it is not tried again before that has gone.

use crate::SlotId;
use crate::front::frontier::Frontier;

/// A vertex in a state that forbids a collapse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Holder {
    vertex: u32,
    upper: u32,
}

impl Holder {
    const NONE: Self = Self { vertex: u32::MAX, upper: 0 };

    /// A vertex that holds a node until it comes out of another split, or goes.
    pub(crate) fn new(frontier: &Frontier, vertex: u32) -> Self {
        Self { vertex, upper: frontier.get(vertex).upper }
    }
}

/// Per slot what held its node when a collapse was last tried.
#[derive(Clone, Debug, Default)]
pub(crate) struct Held {
    by: Vec<Holder>,
}

impl Held {
    pub(crate) fn set(&mut self, slot: SlotId, holder: Holder) {
        if self.by.len() <= slot.index() {
            self.by.resize(slot.index() + 1, Holder::NONE);
        }
        self.by[slot.index()] = holder;
    }

    pub(crate) fn clear(&mut self, slot: SlotId) {
        if let Some(holder) = self.by.get_mut(slot.index()) {
            *holder = Holder::NONE;
        }
    }

    /// Whether a node cannot be collapsed, because what held it does so still.
    #[inline]
    pub(crate) fn is_held(&self, slot: usize, frontier: &Frontier) -> bool {
        let Some(&Holder { vertex, upper }) = self.by.get(slot) else { return false };
        vertex != u32::MAX && frontier.get(vertex).upper == upper
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.by.capacity() * size_of::<Holder>()
    }
}
