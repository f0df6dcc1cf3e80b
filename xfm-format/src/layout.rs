//! Cutting trees into blocks and gathering blocks into pages.

use std::collections::VecDeque;

use mergetree::{Forest, NodeId};

use crate::numbering::{BlockId, Numbering, slots_of};

/// Where every node of a forest goes.
///
/// A page begins with one block and takes the blocks below it breadth-first while they fit; those left over begin later
/// pages, depth-first. Where a subtree ends before its page is full, the next one follows in the same page. So a path from
/// a root down passes few pages, and pages are full.
#[derive(Debug)]
pub(crate) struct Layout {
    pub numbering: Numbering,
    pub blocks: Vec<LayoutBlock>,
    pub pages: Vec<PageSpan>,
    /// The nodes, as indices into the forest's, in order of their ids in the file.
    pub order: Vec<NodeId>,
    /// The id that a node of the forest gets in the file.
    pub new_id: Vec<NodeId>,
    /// Levels of the deepest tree.
    pub depth: u64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LayoutBlock {
    pub mask: u32,
    /// Where its nodes begin in [`Layout::order`].
    pub first_node: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct PageSpan {
    pub blocks: std::ops::Range<usize>,
    pub nodes: std::ops::Range<usize>,
}

/// Why a forest cannot be laid out.
#[derive(Debug)]
pub(crate) struct NotAForest {
    pub node: usize,
    pub message: &'static str,
}

/// A block yet to be placed: its first node and how many levels are above it.
#[derive(Clone, Copy)]
struct Pending {
    root: NodeId,
    above: u64,
}

impl Layout {
    /// Lays out a forest in pages of about `page_nodes` nodes.
    ///
    /// # Complexity
    /// Time and memory linear in the number of nodes.
    pub fn new(
        forest: &Forest,
        numbering: Numbering,
        page_nodes: usize,
    ) -> Result<Self, NotAForest> {
        let max_node = forest.base.names().max_node();
        let mut new_id: Vec<Option<NodeId>> = vec![None; forest.nodes.len()];
        let mut layout = Self {
            numbering,
            blocks: Vec::new(),
            pages: Vec::new(),
            order: Vec::with_capacity(forest.nodes.len()),
            new_id: Vec::new(),
            depth: 0,
        };
        // To be placed, the next one last.
        let mut pending: Vec<Pending> =
            forest.base.roots().map(|root| Pending { root, above: 0 }).collect();
        for &Pending { root, .. } in &pending {
            let node = forest.nodes.get(root.index());
            let node =
                node.ok_or(NotAForest { node: root.index(), message: "a root that is not there" })?;
            if node.parent.is_some() {
                return Err(NotAForest { node: root.index(), message: "a root that has a parent" });
            }
        }
        pending.reverse();
        let mut queue = VecDeque::new();
        let mut block = Vec::new();
        while !pending.is_empty() {
            let (first_block, first_node) = (layout.blocks.len(), layout.order.len());
            'page: while let Some(next) = pending.pop() {
                queue.push_back(next);
                while let Some(next) = queue.pop_front() {
                    let mask = collect_block(forest, numbering, next.root, &mut block)?;
                    let count = layout.order.len() - first_node;
                    if count > 0 && count + mask.count_ones() as usize > page_nodes {
                        queue.push_front(next);
                        pending.extend(queue.drain(..).rev());
                        break 'page;
                    }
                    layout.place(forest, next, mask, &block, &mut new_id, max_node)?;
                    for &(slot, id) in &block {
                        if slot >= numbering.lowest_level() {
                            let above = next.above + u64::from(numbering.levels());
                            let children = forest.nodes[id.index()].children();
                            queue.extend(children.map(|root| Pending { root, above }));
                        }
                    }
                }
            }
            layout.pages.push(PageSpan {
                blocks: first_block..layout.blocks.len(),
                nodes: first_node..layout.order.len(),
            });
        }
        layout.new_id = Vec::with_capacity(new_id.len());
        for (node, id) in new_id.into_iter().enumerate() {
            layout.new_id.push(id.ok_or(NotAForest { node, message: "hangs under no root" })?);
        }
        Ok(layout)
    }

    fn place(
        &mut self,
        forest: &Forest,
        pending: Pending,
        mask: u32,
        block: &[(u32, NodeId)],
        new_id: &mut [Option<NodeId>],
        max_node: NodeId,
    ) -> Result<(), NotAForest> {
        let node = pending.root.index();
        let too_many = NotAForest { node, message: "has no id of 32 bits left; use fewer levels" };
        let end = (self.blocks.len() as u64 + 1) << self.numbering.levels();
        if end > u64::from(max_node.get()) {
            return Err(too_many);
        }
        let id = BlockId::from_index(self.blocks.len());
        self.blocks.push(LayoutBlock { mask, first_node: self.order.len() as u32 });
        for &(slot, node) in block {
            let place = &mut new_id[node.index()];
            if place.is_some() {
                return Err(NotAForest { node: node.index(), message: "hangs in two places" });
            }
            *place = Some(self.numbering.node(id, slot));
            self.order.push(node);
            let level = u64::from((slot + 1).ilog2()) + 1;
            self.depth = self.depth.max(pending.above + level);
            for child in forest.nodes[node.index()].children() {
                if forest.nodes.get(child.index()).is_none_or(|c| c.parent != Some(node)) {
                    return Err(NotAForest {
                        node: node.index(),
                        message: "a child that does not know it",
                    });
                }
            }
        }
        Ok(())
    }
}

/// The nodes of the block that begins with `root`, with their slots and in their order; returns the presence mask.
fn collect_block(
    forest: &Forest,
    numbering: Numbering,
    root: NodeId,
    block: &mut Vec<(u32, NodeId)>,
) -> Result<u32, NotAForest> {
    let mut slots = [None; 32];
    slots[0] = Some(root);
    let mut mask = 1;
    for slot in 0..numbering.lowest_level() {
        let Some(id) = slots[slot as usize] else { continue };
        let node = &forest.nodes[id.index()];
        for (child, below) in [(node.left, 2 * slot + 1), (node.right, 2 * slot + 2)] {
            let Some(child) = child else { continue };
            if child.index() >= forest.nodes.len() {
                return Err(NotAForest { node: id.index(), message: "a child that is not there" });
            }
            slots[below as usize] = Some(child);
            mask |= 1 << below;
        }
    }
    block.clear();
    block.extend(slots_of(mask).filter_map(|slot| Some((slot, slots[slot as usize]?))));
    Ok(mask)
}
