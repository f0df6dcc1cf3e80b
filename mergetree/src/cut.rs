//! Where trees are cut into blocks and pages, decided from the leaves up.
//!
//! Both are connected pieces of a tree of limited size. Whoever goes through a tree with children before parents, in
//! memory or in a stream, needs no more of a subtree than the [`OpenPiece`] its top lies in.

/// How many nodes a block and a piece that lies in one page have at most.
///
/// # Sources
/// Kundu and Misra, *A linear tree partitioning algorithm*, SIAM Journal on Computing 6(1), 1977: where the piece of a
/// node becomes too large, the heaviest of its children's pieces are cut off. No partition into connected pieces of that
/// size has fewer; so there are as few pieces as can be, and as few blocks as can be where no piece ends. What is called
/// the page of a node here is the connected piece that lies in one page; a page of a file holds several
/// ([`PagePacker`](crate::PagePacker)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CutRule {
    /// Nodes per block, 1 to 255.
    pub block_nodes: u32,
    /// Nodes of a piece that lies in one page, at least 1. Its end is the end of a block too.
    pub page_nodes: u32,
}

/// What is known of the pieces that the top node of a subtree lies in, as far as they reach down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct OpenPiece {
    /// Nodes of its block.
    pub block_nodes: u8,
    /// Nodes of its page.
    pub page_nodes: u32,
    /// Blocks of its page: its own and those that end above it, whole.
    pub page_blocks: u32,
}

/// What a child begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cut {
    /// Nothing: it is in the block of its parent.
    #[default]
    None,
    /// A block in the page of its parent.
    Block,
    /// A page, and with it a block.
    Page,
}

impl CutRule {
    /// The pieces of a node whose children have these (`None`: no such child), and what its left and its right child
    /// begin. A child that is not there begins nothing.
    ///
    /// Where one child has to go it is the one with more nodes in its page, or block; the left one where both have as
    /// many.
    ///
    /// ```
    /// use mergetree::{Cut, CutRule, OpenPiece};
    ///
    /// let rule = CutRule { block_nodes: 3, page_nodes: 100 };
    /// let (leaf, _) = rule.join(None, None);
    /// assert_eq!(leaf, OpenPiece { block_nodes: 1, page_nodes: 1, page_blocks: 1 });
    /// let (inner, cuts) = rule.join(Some(leaf), Some(leaf));
    /// assert_eq!(inner, OpenPiece { block_nodes: 3, page_nodes: 3, page_blocks: 1 });
    /// assert_eq!(cuts, [Cut::None; 2]);
    /// let (top, cuts) = rule.join(Some(leaf), Some(inner));
    /// assert_eq!(top, OpenPiece { block_nodes: 2, page_nodes: 5, page_blocks: 2 });
    /// assert_eq!(cuts, [Cut::None, Cut::Block]);
    /// ```
    pub fn join(&self, left: Option<OpenPiece>, right: Option<OpenPiece>) -> (OpenPiece, [Cut; 2]) {
        let children = [left, right].map(Option::unwrap_or_default);
        let off_page = cut_off(children.map(|child| child.page_nodes), self.page_nodes);
        let within = |i: usize| if off_page[i] { OpenPiece::default() } else { children[i] };
        let within = [within(0), within(1)];
        let most = self.block_nodes.min(u8::MAX.into());
        let off_block = cut_off(within.map(|child| child.block_nodes.into()), most);
        let mut joined = OpenPiece { block_nodes: 1, page_nodes: 1, page_blocks: 1 };
        let mut cuts = [Cut::None; 2];
        for (i, child) in within.into_iter().enumerate() {
            joined.page_nodes += child.page_nodes;
            joined.page_blocks += child.page_blocks;
            if off_page[i] {
                cuts[i] = Cut::Page;
            } else if off_block[i] {
                cuts[i] = Cut::Block;
            } else {
                joined.block_nodes += child.block_nodes;
                // Its block is that of the node.
                joined.page_blocks -= u32::from(child.page_blocks > 0);
            }
        }
        (joined, cuts)
    }
}

/// Which of two pieces have to go, so that they and one node are no more than `most`.
fn cut_off(nodes: [u32; 2], most: u32) -> [bool; 2] {
    let [left, right] = nodes;
    let fits = |nodes: u32| nodes < most.max(1);
    if fits(left.saturating_add(right)) {
        [false, false]
    } else if fits(left.min(right)) {
        [left >= right, left < right]
    } else {
        // One of them may not be there at all.
        [left > 0, right > 0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A binary tree: per node, children first, its children.
    type Tree = Vec<[Option<usize>; 2]>;

    /// Trees of `n` nodes of every shape, the root last.
    fn trees(n: usize) -> Vec<Tree> {
        if n == 0 {
            return vec![Vec::new()];
        }
        let mut all = Vec::new();
        for on_the_left in 0..n {
            for left in trees(on_the_left) {
                for right in trees(n - 1 - on_the_left) {
                    let shift = |child: Option<usize>| child.map(|child| child + left.len());
                    let mut tree = left.clone();
                    tree.extend(right.iter().map(|children| children.map(shift)));
                    let top = tree.len();
                    tree.push([left.len().checked_sub(1), (!right.is_empty()).then(|| top - 1)]);
                    all.push(tree);
                }
            }
        }
        all
    }

    /// The size of every piece when the nodes of `cuts` are cut from their parents.
    fn pieces(tree: &Tree, is_cut: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut open = vec![1; tree.len()];
        let mut closed = Vec::new();
        for (node, children) in tree.iter().enumerate() {
            for &child in children.iter().flatten() {
                if is_cut(child) { closed.push(open[child]) } else { open[node] += open[child] }
            }
        }
        closed.extend(open.last());
        closed
    }

    fn least_pieces(tree: &Tree, most: u32) -> usize {
        (0u32..1 << (tree.len() - 1))
            .map(|cuts| pieces(tree, |node| cuts >> node & 1 == 1))
            .filter(|pieces| pieces.iter().all(|&nodes| nodes <= most))
            .map(|pieces| pieces.len())
            .min()
            .unwrap()
    }

    /// Applies the rule all over a tree: what every node begins, and the pieces of the root.
    fn cut(tree: &Tree, rule: CutRule) -> (Vec<Cut>, OpenPiece) {
        let mut open: Vec<OpenPiece> = Vec::new();
        let mut begins = vec![Cut::None; tree.len()];
        for children in tree {
            let [left, right] = children.map(|child| child.map(|child| open[child]));
            let (joined, cuts) = rule.join(left, right);
            for (child, cut) in children.iter().zip(cuts) {
                match child {
                    Some(child) => begins[*child] = cut,
                    None => assert_eq!(cut, Cut::None),
                }
            }
            open.push(joined);
        }
        (begins, *open.last().unwrap())
    }

    #[test]
    fn pieces_fit_and_are_as_few_as_can_be_for_every_small_tree() {
        for n in 1..=8 {
            for tree in trees(n) {
                for (block_nodes, page_nodes) in [(1, 9), (2, 4), (3, 5), (3, 9), (4, 2), (9, 3)] {
                    let (begins, root) = cut(&tree, CutRule { block_nodes, page_nodes });
                    let pages = pieces(&tree, |node| begins[node] == Cut::Page);
                    assert!(pages.iter().all(|&nodes| nodes <= page_nodes));
                    assert_eq!(pages.len(), least_pieces(&tree, page_nodes));
                    let blocks = pieces(&tree, |node| begins[node] != Cut::None);
                    assert!(blocks.iter().all(|&nodes| nodes <= block_nodes));
                    if pages.len() == 1 {
                        assert_eq!(blocks.len(), least_pieces(&tree, block_nodes));
                        assert_eq!(root.page_blocks as usize, blocks.len());
                    }
                    assert_eq!(Some(&root.page_nodes), pages.last());
                    assert_eq!(Some(&u32::from(root.block_nodes)), blocks.last());
                }
            }
        }
    }

    #[test]
    fn the_blocks_of_a_page_are_counted() {
        for tree in trees(8) {
            let rule = CutRule { block_nodes: 2, page_nodes: 5 };
            let (begins, root) = cut(&tree, rule);
            // The blocks that end in the root's page: reached from the root without a page between.
            let mut blocks = 1;
            let mut reach = vec![tree.len() - 1];
            while let Some(node) = reach.pop() {
                for &child in tree[node].iter().flatten() {
                    blocks += u32::from(begins[child] == Cut::Block);
                    if begins[child] != Cut::Page {
                        reach.push(child);
                    }
                }
            }
            assert_eq!(root.page_blocks, blocks);
        }
    }

    #[test]
    fn of_two_alike_the_left_one_goes_and_of_two_too_many_both() {
        let rule = CutRule { block_nodes: 15, page_nodes: 100 };
        let piece =
            |block_nodes, page_nodes| Some(OpenPiece { block_nodes, page_nodes, page_blocks: 3 });
        assert_eq!(rule.join(piece(8, 20), piece(8, 20)).1, [Cut::Block, Cut::None]);
        assert_eq!(rule.join(piece(7, 20), piece(8, 20)).1, [Cut::None, Cut::Block]);
        assert_eq!(rule.join(piece(15, 20), piece(15, 20)).1, [Cut::Block; 2]);
        assert_eq!(rule.join(piece(15, 20), None).1, [Cut::Block, Cut::None]);
        assert_eq!(rule.join(piece(2, 50), piece(2, 50)).1, [Cut::Page, Cut::None]);
        assert_eq!(rule.join(piece(2, 100), piece(15, 100)).1, [Cut::Page; 2]);
        let (joined, cuts) = rule.join(piece(2, 60), piece(15, 40));
        assert_eq!(cuts, [Cut::Page, Cut::Block]);
        assert_eq!(joined, OpenPiece { block_nodes: 1, page_nodes: 41, page_blocks: 4 });
    }
}
