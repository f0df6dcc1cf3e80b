//! A page in memory: some blocks and their nodes, one after another.

use mergetree::{Node, NodeId};

use crate::numbering::{BlockId, Numbering};

/// The blocks of one page, with the ids of the file's numbering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    pub(crate) first_block: u32,
    pub(crate) blocks: Vec<BlockEntry>,
    /// Nodes of all blocks, in order of their ids.
    pub(crate) nodes: Vec<Node>,
}

/// What a block is, besides its nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockEntry {
    pub mask: u32,
    pub is_leaf: bool,
    pub parent: Option<NodeId>,
    /// Where its nodes begin among those of the page.
    pub first_node: u32,
}

/// One block of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block<'a> {
    /// Its id.
    pub id: BlockId,
    /// Which slots hold a node: bit `s` for slot `s`.
    pub mask: u32,
    /// Whether no other block hangs under it.
    pub is_leaf: bool,
    /// The node it hangs under; `None` when its first node is a root.
    pub parent: Option<NodeId>,
    /// The nodes of its slots, in order, without gaps.
    pub nodes: &'a [Node],
}

impl<'a> Block<'a> {
    /// The node in a slot.
    #[inline]
    pub fn node(&self, slot: u32) -> Option<&'a Node> {
        self.nodes.get(Numbering::rank(self.mask, slot)?)
    }
}

impl Page {
    /// A page without blocks, to be read into.
    pub fn new() -> Self {
        Self::default()
    }

    /// A page without blocks, to be filled from this one on.
    pub fn starting_at(first_block: BlockId) -> Self {
        Self { first_block: first_block.get(), ..Self::default() }
    }

    /// Appends a block with the next number, of nodes in order of their slots.
    ///
    /// Their ids, and with them all links, are final: `left` and `right` say which children are in the block, in another
    /// one of the page, or in another page; `slot` means nothing. Bounds are those that
    /// [codes](crate::BoundCodes) stand for.
    pub fn push_block(&mut self, nodes: &[Node]) {
        let first_node = self.nodes.len() as u32;
        let mask = ((1u64 << nodes.len()) - 1) as u32;
        let parent = nodes.first().and_then(|node| node.parent);
        self.blocks.push(BlockEntry { mask, is_leaf: false, parent, first_node });
        self.nodes.extend_from_slice(nodes);
    }

    /// Removes all blocks, to be filled again from this one on.
    pub fn restart_at(&mut self, first_block: BlockId) {
        self.first_block = first_block.get();
        self.blocks.clear();
        self.nodes.clear();
    }

    /// Number of blocks.
    pub fn num_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The nodes of all blocks, in order of their ids.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// All blocks, in order of their ids.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = Block<'_>> {
        (0..self.blocks.len()).map(|index| self.at(index))
    }

    /// The block with this id, if it is in this page.
    pub fn block(&self, id: BlockId) -> Option<Block<'_>> {
        let index = id.get().checked_sub(self.first_block)? as usize;
        (index < self.blocks.len()).then(|| self.at(index))
    }

    /// Bytes that the page takes in memory.
    pub fn memory_bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<BlockEntry>() + self.nodes.capacity() * size_of::<Node>()
    }

    fn at(&self, index: usize) -> Block<'_> {
        let entry = self.blocks[index];
        let first = entry.first_node as usize;
        let count = entry.mask.count_ones() as usize;
        Block {
            id: BlockId::new(self.first_block + index as u32),
            mask: entry.mask,
            is_leaf: entry.is_leaf,
            parent: entry.parent,
            nodes: &self.nodes[first..first + count],
        }
    }
}
