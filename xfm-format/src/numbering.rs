//! Ids of nodes in a file: block and slot.

use mergetree::NodeId;

halfedge::define_id!(
    /// A block: a few nodes that hang together.
    BlockId,
    "b"
);

/// How node ids are made of block and slot: `id = block << levels | slot`.
///
/// A block is a connected piece of a tree of at most 2^levels − 1 nodes, as many as a complete binary tree of so many levels
/// has. Its slots number the nodes from 0 on without gaps: each node before the part of the block below its left child, and
/// that before the part below its right child. So the last of the 2^levels slots does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbering {
    levels: u32,
}

impl Numbering {
    /// The numbering with blocks of up to 2^levels − 1 nodes.
    ///
    /// # Panics
    /// When `levels` is not 1 to 5.
    pub fn new(levels: u32) -> Self {
        assert!((1..=5).contains(&levels), "blocks have 1 to 5 levels, not {levels}");
        Self { levels }
    }

    /// Bits of an id that are the slot.
    #[inline]
    pub const fn levels(self) -> u32 {
        self.levels
    }

    /// Nodes of a full block.
    #[inline]
    pub const fn slots(self) -> u32 {
        (1 << self.levels) - 1
    }

    /// The block of a node.
    #[inline]
    pub const fn block(self, node: NodeId) -> BlockId {
        BlockId::new(node.get() >> self.levels)
    }

    /// The slot of a node in its block.
    #[inline]
    pub const fn slot(self, node: NodeId) -> u32 {
        node.get() & self.slots()
    }

    /// The node in a slot of a block.
    #[inline]
    pub const fn node(self, block: BlockId, slot: u32) -> NodeId {
        NodeId::new(block.get() << self.levels | slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_made_of_block_and_slot_and_taken_apart_again() {
        for levels in 1..=5 {
            let numbering = Numbering::new(levels);
            for block in [0, 1, 77] {
                for slot in 0..numbering.slots() {
                    let node = numbering.node(BlockId::new(block), slot);
                    assert_eq!(numbering.block(node), BlockId::new(block));
                    assert_eq!(numbering.slot(node), slot);
                }
            }
        }
    }
}
