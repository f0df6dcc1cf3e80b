//! Where nodes go, against a slow and obvious way to say it.

mod common;

use std::collections::{BTreeMap, BTreeSet};

use common::{collapse, sheet, torus};
use mergetree::{DraftPlace, Forest, NodeId, PagePacker};
use proptest::prelude::*;
use xfm_format::{WriteOptions, XfmFile, write};

/// Nodes by their orders, and those that are cut from their parents.
struct Naive<'a> {
    forest: &'a Forest,
    by_order: Vec<NodeId>,
    new_piece: BTreeSet<NodeId>,
    new_block: BTreeSet<NodeId>,
}

impl<'a> Naive<'a> {
    fn new(forest: &'a Forest, block_nodes: usize, piece_nodes: usize) -> Self {
        let mut by_order: Vec<NodeId> = (0..forest.nodes.len()).map(NodeId::from_index).collect();
        by_order.sort_by_key(|id| forest.nodes[id.index()].order);
        let mut naive =
            Self { forest, by_order, new_piece: BTreeSet::new(), new_block: BTreeSet::new() };
        naive.new_piece = naive.cut(BTreeSet::new(), piece_nodes);
        naive.new_block = naive.cut(naive.new_piece.clone(), block_nodes);
        let roots = naive.roots();
        naive.new_piece.extend(&roots);
        naive.new_block.extend(&roots);
        naive
    }

    /// From the last collapse on.
    fn roots(&self) -> Vec<NodeId> {
        let is_root = |id: &NodeId| self.forest.nodes[id.index()].parent.is_none();
        self.by_order.iter().rev().copied().filter(is_root).collect()
    }

    fn children(&self, id: NodeId) -> impl Iterator<Item = NodeId> + use<> {
        self.forest.nodes[id.index()].children()
    }

    /// Nodes from this one down to where it is cut.
    fn size(&self, id: NodeId, cut: &BTreeSet<NodeId>) -> usize {
        let below = self.children(id).filter(|child| !cut.contains(child));
        1 + below.map(|child| self.size(child, cut)).sum::<usize>()
    }

    /// Cuts so that no piece has more than `most` nodes.
    fn cut(&self, mut cut: BTreeSet<NodeId>, most: usize) -> BTreeSet<NodeId> {
        for &id in &self.by_order {
            while self.size(id, &cut) > most {
                let open = self.children(id).filter(|child| !cut.contains(child));
                // The first of those with most nodes.
                let sizes: Vec<_> = open.map(|child| (self.size(child, &cut), child)).collect();
                let most = sizes.iter().map(|&(size, _)| size).max().unwrap();
                cut.insert(sizes.iter().find(|&&(size, _)| size == most).unwrap().1);
            }
        }
        cut
    }

    /// The topmost node of the piece.
    fn top(&self, mut id: NodeId) -> NodeId {
        while !self.new_piece.contains(&id) {
            id = self.forest.nodes[id.index()].parent.unwrap();
        }
        id
    }

    /// Per page in order, per block in order, the orders of its nodes in order of their slots.
    fn pages(&self, page_nodes: usize) -> Vec<Vec<Vec<u32>>> {
        let mut blocks: BTreeMap<NodeId, Vec<NodeId>> = BTreeMap::new();
        // In descending order.
        for &id in self.by_order.iter().rev().filter(|id| self.new_block.contains(id)) {
            blocks.entry(self.top(id)).or_default().push(id);
        }
        let mut packer = PagePacker::new(page_nodes as u32);
        let mut places: BTreeMap<NodeId, DraftPlace> = BTreeMap::new();
        let mut place = |piece: NodeId, above: Option<NodeId>| {
            let above = above.map(|above| places[&self.top(above)].draft);
            let nodes = self.size(piece, &self.new_piece) as u32;
            let place = packer.place(above, nodes, blocks[&piece].len() as u32);
            places.insert(piece, place);
        };
        self.roots().into_iter().for_each(|root| place(root, None));
        for &id in self.by_order.iter().rev() {
            let children: Vec<NodeId> = self.children(id).collect();
            for child in children.into_iter().rev().filter(|child| self.new_piece.contains(child)) {
                place(child, Some(id));
            }
        }
        let packed = packer.finish();
        let mut pages: Vec<BTreeMap<u32, Vec<u32>>> = vec![BTreeMap::new(); packed.pages.len()];
        for (piece, place) in places {
            let (page, first) = packed.block(place).unwrap();
            for (number, &block) in (first..).zip(&blocks[&piece]) {
                let mut nodes = Vec::new();
                self.preorder(block, &mut nodes);
                pages[page as usize].insert(number, nodes);
            }
        }
        pages.into_iter().map(|page| page.into_values().collect()).collect()
    }

    fn preorder(&self, id: NodeId, nodes: &mut Vec<u32>) {
        nodes.push(self.forest.nodes[id.index()].order);
        for child in self.children(id).filter(|child| !self.new_block.contains(child)) {
            self.preorder(child, nodes);
        }
    }
}

fn check(
    forest: &Forest,
    levels: u32,
    piece_nodes: usize,
    page_nodes: usize,
) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = Some(page_nodes);
    options.piece_nodes = Some(piece_nodes);
    write(forest, &path, &options).unwrap();
    let file = XfmFile::open(&path).unwrap();
    let pages: Vec<Vec<Vec<u32>>> = (0..file.num_pages())
        .map(|number| {
            let page = file.read_page(number).unwrap();
            let orders =
                |block: xfm_format::Block<'_>| block.nodes.iter().map(|node| node.order).collect();
            page.blocks().map(orders).collect()
        })
        .collect();
    let naive = Naive::new(forest, (1 << levels) - 1, piece_nodes);
    prop_assert_eq!(pages, naive.pages(page_nodes));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn nodes_go_where_the_rule_says(
        open in any::<bool>(),
        size in 3u32..24,
        tries in 0usize..4000,
        seed in any::<u64>(),
        levels in 1u32..=5,
        piece_nodes in 1usize..120,
        page_nodes in 64usize..200,
    ) {
        let soup = if open { sheet(size) } else { torus(size) };
        check(&collapse(&soup, tries, seed), levels, piece_nodes.min(page_nodes), page_nodes)?;
    }
}
