//! A page in memory: some blocks and their nodes, one after another.

use mergetree::{Colour, Node, NodeId};

use crate::numbering::BlockId;

/// The blocks of one page, with the ids of the file's numbering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    pub(crate) first_block: u32,
    /// Per block where its nodes begin.
    pub(crate) blocks: Vec<u32>,
    /// Nodes of all blocks, in order of their ids.
    pub(crate) nodes: Vec<Node>,
    /// Their colours; empty where there are none.
    pub(crate) colours: Vec<Colour>,
}

/// One block of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block<'a> {
    /// Its id.
    pub id: BlockId,
    /// Its nodes, in order of their slots.
    pub nodes: &'a [Node],
    /// Their colours; empty where there are none.
    pub colours: &'a [Colour],
}

impl<'a> Block<'a> {
    /// The node in a slot.
    #[inline]
    pub fn node(&self, slot: u32) -> Option<&'a Node> {
        self.nodes.get(slot as usize)
    }

    /// The node it hangs under; `None` when its first node is a root.
    pub fn parent(&self) -> Option<NodeId> {
        self.nodes.first().and_then(|node| node.parent)
    }
}

impl Page {
    /// A page without blocks, to be read into.
    pub fn new() -> Self {
        Self::default()
    }

    /// A page without blocks, to be filled from this block on.
    pub fn starting_at(first_block: BlockId) -> Self {
        Self { first_block: first_block.get(), ..Self::default() }
    }

    /// Removes all blocks, so that the page can be filled again from this block on.
    pub fn restart_at(&mut self, first_block: BlockId) {
        self.first_block = first_block.get();
        self.clear();
    }

    /// Removes all blocks.
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
        self.nodes.clear();
        self.colours.clear();
    }

    /// Appends a block with the next number, of nodes in order of their slots.
    ///
    /// Their ids, and with them all links, are final: `parent`, `left`, `right` and `adjacent` are in the file's numbering;
    /// [`slot`](Node::slot) means nothing. Radius, cone sine and deviation are numbers that
    /// [codes](mergetree::BoundCodes) stand for.
    pub fn push_block(&mut self, nodes: &[Node]) {
        self.blocks.push(self.nodes.len() as u32);
        self.nodes.extend_from_slice(nodes);
    }

    /// The same with the colours of the nodes, as many. Either all blocks of a file have colours, or none.
    pub fn push_coloured_block(&mut self, nodes: &[Node], colours: &[Colour]) {
        self.push_block(nodes);
        self.colours.extend_from_slice(colours);
    }

    /// The number of its first block, or of the first one to come.
    pub fn first_block(&self) -> BlockId {
        BlockId::new(self.first_block)
    }

    /// Number of blocks.
    pub fn num_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The nodes of all blocks, in order of their ids.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The colours of all nodes, in the same order; empty where there are none.
    pub fn colours(&self) -> &[Colour] {
        &self.colours
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
        self.blocks.capacity() * size_of::<u32>()
            + self.nodes.capacity() * size_of::<Node>()
            + self.colours.capacity() * size_of::<Colour>()
    }

    fn at(&self, index: usize) -> Block<'_> {
        let start = self.blocks[index] as usize;
        let end = self.blocks.get(index + 1).map_or(self.nodes.len(), |&next| next as usize);
        Block {
            id: BlockId::new(self.first_block + index as u32),
            nodes: &self.nodes[start..end],
            colours: self.colours.get(start..end).unwrap_or_default(),
        }
    }
}
