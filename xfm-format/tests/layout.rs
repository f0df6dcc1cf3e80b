//! Where nodes go, against a slow and obvious way to say it.

mod common;

use std::collections::{BTreeMap, BTreeSet};

use common::{collapse, sheet, torus};
use mergetree::{Forest, NodeId};
use proptest::prelude::*;
use xfm_format::{WriteOptions, XfmFile, write};

/// Nodes by their orders, and those that are cut from their parents.
struct Naive<'a> {
    forest: &'a Forest,
    by_order: Vec<NodeId>,
    new_page: BTreeSet<NodeId>,
    new_block: BTreeSet<NodeId>,
}

impl<'a> Naive<'a> {
    fn new(forest: &'a Forest, block_nodes: usize, page_nodes: usize) -> Self {
        let mut by_order: Vec<NodeId> = (0..forest.nodes.len()).map(NodeId::from_index).collect();
        by_order.sort_by_key(|id| forest.nodes[id.index()].order);
        let mut naive =
            Self { forest, by_order, new_page: BTreeSet::new(), new_block: BTreeSet::new() };
        naive.new_page = naive.cut(BTreeSet::new(), page_nodes);
        naive.new_block = naive.cut(naive.new_page.clone(), block_nodes);
        // Roots share pages while they fit, one after the other.
        let mut used = None;
        let by_order = naive.by_order.clone();
        for &root in by_order.iter().rev() {
            if forest.nodes[root.index()].parent.is_some() {
                continue;
            }
            naive.new_block.insert(root);
            let size = naive.size(root, &naive.new_page);
            used = used.map(|used| used + size).filter(|&used| used <= page_nodes);
            if used.is_none() {
                naive.new_page.insert(root);
                used = Some(size);
            }
        }
        naive
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
    fn top(&self, mut id: NodeId, cut: &BTreeSet<NodeId>) -> NodeId {
        while !cut.contains(&id) {
            match self.forest.nodes[id.index()].parent {
                Some(parent) => id = parent,
                // A root that shares the page of the one collapsed next.
                None => {
                    let after = self.by_order.iter().skip_while(|&&other| other != id).skip(1);
                    let is_root = |id: &&NodeId| self.forest.nodes[id.index()].parent.is_none();
                    id = *after.into_iter().find(is_root).unwrap();
                }
            }
        }
        id
    }

    /// Per page in order, per block in order, the orders of its nodes in order of their slots.
    fn pages(&self) -> Vec<Vec<Vec<u32>>> {
        let order = |id: NodeId| self.forest.nodes[id.index()].order;
        let mut pages: BTreeMap<u32, BTreeMap<u32, Vec<u32>>> = BTreeMap::new();
        for &first in &self.new_block {
            let mut nodes = Vec::new();
            self.preorder(first, &mut nodes);
            let page = pages.entry(order(self.top(first, &self.new_page))).or_default();
            page.insert(order(first), nodes);
        }
        pages.into_values().rev().map(|page| page.into_values().rev().collect()).collect()
    }

    fn preorder(&self, id: NodeId, nodes: &mut Vec<u32>) {
        nodes.push(self.forest.nodes[id.index()].order);
        for child in self.children(id).filter(|child| !self.new_block.contains(child)) {
            self.preorder(child, nodes);
        }
    }
}

fn check(forest: &Forest, levels: u32, page_nodes: usize) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = page_nodes;
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
    prop_assert_eq!(pages, Naive::new(forest, (1 << levels) - 1, page_nodes).pages());
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
        page_nodes in 64usize..200,
    ) {
        let soup = if open { sheet(size) } else { torus(size) };
        check(&collapse(&soup, tries, seed), levels, page_nodes)?;
    }
}
