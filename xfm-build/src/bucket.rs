//! Nodes that have their place in the file, gathered by ranges of pages.

use bytemuck::{Pod, Zeroable};
use mergetree::{NodeId, OctNormal, PackedPage};
use scratch::{Error, Spool, Store};
use xfm_format::Numbering;

use crate::log::LoggedColour;
use crate::names::NONE;

/// A node with its final ids, or a link to a node of another bucket.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Placed {
    /// Its id.
    pub id: u32,
    pub above: PackedAbove,
    pub order: u32,
    pub position: [f32; 3],
    pub normal: OctNormal,
    pub codes: [u16; 3],
    /// How many nodes of its block hang on its left and on its right.
    pub inside: [u8; 2],
    pub adjacent: [u32; 4],
}

const _: () = assert!(size_of::<Placed>() == 52);

impl Placed {
    /// Says to the bucket of a parent that it has a child in another one.
    pub fn link(id: NodeId, above: Above) -> Self {
        Self {
            id: id.get(),
            above: above.pack(),
            order: NONE,
            position: [0.0; 3],
            normal: OctNormal::default(),
            codes: [0; 3],
            inside: [0; 2],
            adjacent: [NONE; 4],
        }
    }

    /// Whether it is a link only.
    pub fn is_link(&self) -> bool {
        self.order == NONE
    }
}

/// Which child of a node a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

/// What a node hangs under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Above {
    /// It is the root of the tree with this number.
    Root(u32),
    Node(NodeId, Side),
}

/// [`Above`] in 32 bits: two for what it is, and the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct PackedAbove(u32);

const TAG_SHIFT: u32 = 30;

impl Above {
    /// # Panics
    /// When the number does not fit 30 bits: ids of nodes always do, of which there are six half-edges each.
    #[inline]
    pub fn pack(self) -> PackedAbove {
        let (tag, number) = match self {
            Self::Root(number) => (2, number),
            Self::Node(node, Side::Left) => (0, node.get()),
            Self::Node(node, Side::Right) => (1, node.get()),
        };
        assert!(number >> TAG_SHIFT == 0, "{number} is too large");
        PackedAbove(tag << TAG_SHIFT | number)
    }
}

impl PackedAbove {
    /// Stands for nothing.
    pub const NOTHING: Self = Self(u32::MAX);

    /// `None` in a damaged file only.
    #[inline]
    pub fn unpack(self) -> Option<Above> {
        let number = self.0 & ((1 << TAG_SHIFT) - 1);
        match self.0 >> TAG_SHIFT {
            0 => Some(Above::Node(NodeId::new(number), Side::Left)),
            1 => Some(Above::Node(NodeId::new(number), Side::Right)),
            2 => Some(Above::Root(number)),
            _ => None,
        }
    }
}

/// Pages with consecutive numbers, and the nodes in them.
#[derive(Debug)]
pub(crate) struct Bucket {
    pub nodes: Spool<Placed>,
    /// Of each node, links left out; empty where there are none.
    pub colours: Spool<LoggedColour>,
    pub first_block: u32,
    pub pages: Vec<PackedPage>,
    pub num_nodes: u32,
    pub num_blocks: u32,
}

/// All pages.
#[derive(Debug)]
pub(crate) struct Buckets {
    pub all: Vec<Bucket>,
    numbering: Numbering,
    /// The first page of each.
    first_pages: Vec<u32>,
}

impl Buckets {
    /// For these pages; a bucket has at most so many nodes, and at least one page.
    pub fn new(store: &Store, numbering: Numbering, pages: &[PackedPage], max_nodes: u32) -> Self {
        let mut buckets = Self { all: Vec::new(), numbering, first_pages: Vec::new() };
        for (number, page) in (0..).zip(pages) {
            let fits = |bucket: &Bucket| bucket.num_nodes.saturating_add(page.nodes) <= max_nodes;
            if !buckets.all.last().is_some_and(fits) {
                buckets.first_pages.push(number);
                buckets.all.push(Bucket {
                    nodes: Spool::new(store),
                    colours: Spool::new(store),
                    first_block: page.first_block,
                    pages: Vec::new(),
                    num_nodes: 0,
                    num_blocks: 0,
                });
            }
            if let Some(bucket) = buckets.all.last_mut() {
                bucket.pages.push(*page);
                bucket.num_nodes += page.nodes;
                bucket.num_blocks += page.blocks;
            }
        }
        buckets
    }

    /// The bucket that a page is in.
    pub fn of_page(&self, page: u32) -> u32 {
        self.first_pages.partition_point(|&first| first <= page).saturating_sub(1) as u32
    }

    pub fn numbering(&self) -> Numbering {
        self.numbering
    }

    /// Puts a node, or a link, into a bucket.
    #[inline]
    pub fn push(&mut self, store: &mut Store, bucket: u32, placed: &Placed) -> Result<(), Error> {
        self.all[bucket as usize].nodes.push(store, placed)
    }

    /// Puts the colour of a node into its bucket.
    #[inline]
    pub fn push_colour(
        &mut self,
        store: &mut Store,
        bucket: u32,
        colour: LoggedColour,
    ) -> Result<(), Error> {
        self.all[bucket as usize].colours.push(store, &colour)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_node_hangs_under_fits_32_bits() {
        for number in [0, 1, (1 << 30) - 1] {
            let node = NodeId::new(number);
            for above in
                [Above::Root(number), Above::Node(node, Side::Left), Above::Node(node, Side::Right)]
            {
                assert_eq!(above.pack().unpack(), Some(above));
            }
        }
        assert_eq!(PackedAbove(u32::MAX).unpack(), None);
    }
}
