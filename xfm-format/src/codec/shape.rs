//! What hangs under the nodes of a page, and how blocks follow from it.

/// What a child is to its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// There is none.
    None,
    /// A node of the same block.
    Inside,
    /// The first node of another block of the page.
    Block,
    /// The first node of a block of another page.
    Page,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

/// Both children of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape(pub [Kind; 2]);

impl Shape {
    pub fn code(self) -> u64 {
        let [left, right] = self.0.map(|kind| kind as u64);
        left | right << 2
    }

    pub fn from_code(code: u64) -> Option<Self> {
        const KINDS: [Kind; 4] = [Kind::None, Kind::Inside, Kind::Block, Kind::Page];
        (code < 16).then(|| Self([KINDS[code as usize & 3], KINDS[code as usize >> 2]]))
    }

    /// The children that begin other blocks, left before right.
    pub fn outside(self) -> impl Iterator<Item = (Side, Kind)> {
        [Side::Left, Side::Right]
            .into_iter()
            .zip(self.0)
            .filter(|(_, kind)| matches!(kind, Kind::Block | Kind::Page))
    }
}

/// Where a node hangs in its block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Above {
    /// Its parent, among the nodes of the page.
    pub node: u32,
    pub side: Side,
}

/// Goes through the nodes of a page in order and says where each one hangs: blocks are in preorder, so that the children
/// inside a block say it all.
#[derive(Debug, Default)]
pub(super) struct Preorder {
    /// Nodes whose right child is to come, the next one last.
    waiting: Vec<u32>,
    next: Option<Above>,
}

impl Preorder {
    pub fn restart(&mut self) {
        self.waiting.clear();
        self.next = None;
    }

    /// Where the next node hangs; `None` if it begins a block.
    pub fn next(&self) -> Option<Above> {
        self.next
    }

    /// Goes on past the next node.
    #[inline]
    pub fn step(&mut self, node: u32, shape: Shape) {
        let [left, right] = shape.0.map(|kind| kind == Kind::Inside);
        self.next = match (left, right) {
            (true, _) => {
                if right {
                    self.waiting.push(node);
                }
                Some(Above { node, side: Side::Left })
            }
            (false, true) => Some(Above { node, side: Side::Right }),
            (false, false) => self.waiting.pop().map(|node| Above { node, side: Side::Right }),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_sixteen_codes() {
        for code in 0..16 {
            assert_eq!(Shape::from_code(code).map(Shape::code), Some(code));
        }
        assert_eq!(Shape::from_code(16), None);
        let outside: Vec<_> = Shape([Kind::Page, Kind::Block]).outside().collect();
        assert_eq!(outside, [(Side::Left, Kind::Page), (Side::Right, Kind::Block)]);
        assert_eq!(Shape([Kind::None, Kind::Inside]).outside().count(), 0);
    }

    #[test]
    fn preorder_leads_from_node_to_node() {
        use Kind::{Block, Inside, None as Nothing};
        // A root with two children, of which the left one has a right child; then a block of one node.
        let shapes = [
            [Inside, Inside],
            [Block, Inside],
            [Nothing, Nothing],
            [Nothing, Block],
            [Nothing, Nothing],
        ];
        let mut preorder = Preorder::default();
        let mut found = Vec::new();
        for (node, shape) in (0..).zip(shapes) {
            found.push(preorder.next().map(|above| (above.node, above.side)));
            preorder.step(node, Shape(shape));
        }
        let expected =
            [None, Some((0, Side::Left)), Some((1, Side::Right)), Some((0, Side::Right)), None];
        assert_eq!(found, expected);
        assert_eq!(preorder.next(), None);
    }
}
