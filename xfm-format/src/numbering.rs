//! Ids of nodes in a file: block and slot.

use mergetree::NodeId;

halfedge::define_id!(
    /// A block: a complete binary subtree of as many levels as the file has in each.
    BlockId,
    "b"
);

/// How node ids are made of block and slot: `id = block << levels | slot`.
///
/// Slots number a complete binary tree of `levels` levels from its root on, level by level: the children of slot `s` are
/// `2s + 1` and `2s + 2`. The last slot of the `2^levels` does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbering {
    levels: u32,
}

impl Numbering {
    /// The numbering with this many levels per block.
    ///
    /// # Panics
    /// When `levels` is not 1 to 5.
    pub fn new(levels: u32) -> Self {
        assert!((1..=5).contains(&levels), "blocks have 1 to 5 levels, not {levels}");
        Self { levels }
    }

    /// Levels per block.
    #[inline]
    pub const fn levels(self) -> u32 {
        self.levels
    }

    /// Nodes of a full block.
    #[inline]
    pub const fn slots(self) -> u32 {
        (1 << self.levels) - 1
    }

    /// First slot of the lowest level, whose children are other blocks.
    #[inline]
    pub const fn lowest_level(self) -> u32 {
        (1 << (self.levels - 1)) - 1
    }

    /// Mask of a full block.
    #[inline]
    pub(crate) const fn full_mask(self) -> u32 {
        (1 << self.slots()) - 1
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

    /// Where the node of a slot stands among the nodes of a block with this presence mask; `None` if it is not there.
    #[inline]
    pub const fn rank(mask: u32, slot: u32) -> Option<usize> {
        if slot < 32 && mask >> slot & 1 == 1 {
            Some((mask & ((1 << slot) - 1)).count_ones() as usize)
        } else {
            None
        }
    }
}

/// The slots present in a mask, in order.
#[inline]
pub(crate) fn slots_of(mut mask: u32) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let slot = mask.trailing_zeros();
        (mask != 0).then(|| {
            mask &= mask - 1;
            slot
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_made_of_block_and_slot_and_taken_apart_again() {
        for levels in 1..=5 {
            let numbering = Numbering::new(levels);
            assert_eq!(numbering.full_mask().count_ones(), numbering.slots());
            for block in [0, 1, 77] {
                for slot in 0..numbering.slots() {
                    let node = numbering.node(BlockId::new(block), slot);
                    assert_eq!(numbering.block(node), BlockId::new(block));
                    assert_eq!(numbering.slot(node), slot);
                }
            }
        }
    }

    #[test]
    fn the_rank_of_a_slot_counts_the_slots_before_it() {
        let mask = 0b1010_1101;
        let slots: Vec<_> = slots_of(mask).collect();
        assert_eq!(slots, [0, 2, 3, 5, 7]);
        for slot in 0..40 {
            assert_eq!(Numbering::rank(mask, slot), slots.iter().position(|&s| s == slot));
        }
    }
}
