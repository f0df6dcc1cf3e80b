//! What is written down of a collapse, to be read from the last one back.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use halfedge::{HalfEdgeId, VertexId};
use mergetree::{BoundCodes, CollapseRecord, Colour, Cut, OctNormal, OpenPiece};

use crate::names::{MAX_VERTEX, NONE, from_option, to_option};

/// One collapse in the log, with what was found out about it on the way: its bounds, and where it is cut from its children.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LogEntry {
    /// Name of the removed vertex, and in the two highest bits what the left child begins.
    removed: u32,
    /// Name of the kept vertex, and in the two highest bits what the right child begins.
    kept: u32,
    half_edge: u32,
    reverse: u32,
    adjacent: [u32; 4],
    position: [f32; 3],
    pub normal: OctNormal,
    pub codes: [u16; 3],
    /// Nodes of the blocks that the left and the right child are in, as far as they reach down; 0 for no child.
    weights: [u8; 2],
    /// The rank, or [`NONE`].
    pub rank: u32,
}

const _: () = assert!(size_of::<LogEntry>() == 60);

/// How large the piece is that a child begins; in a spool beside the log, the left child's before the right one's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PieceSize {
    pub nodes: u32,
    pub blocks: u32,
}

impl From<OpenPiece> for PieceSize {
    fn from(piece: OpenPiece) -> Self {
        Self { nodes: piece.page_nodes, blocks: piece.page_blocks }
    }
}

/// The colour of a vertex, in a spool beside the log or beside a bucket.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct LoggedColour(u32);

impl From<Colour> for LoggedColour {
    fn from(colour: Colour) -> Self {
        Self(u32::from_le_bytes(colour))
    }
}

impl LoggedColour {
    pub fn colour(self) -> Colour {
        self.0.to_le_bytes()
    }
}

/// A child of a logged collapse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LoggedChild {
    /// Nodes of its block, as far as it reaches down.
    pub block_nodes: u8,
    pub cut: Cut,
}

const CUT_SHIFT: u32 = MAX_VERTEX.trailing_ones();

impl LogEntry {
    /// An entry for a record whose vertices' names are at most [`MAX_VERTEX`].
    pub fn new(
        record: &CollapseRecord,
        position: Vec3,
        normal: OctNormal,
        codes: BoundCodes,
        children: [Option<LoggedChild>; 2],
    ) -> Self {
        let cut = |child: Option<LoggedChild>| match child.map(|child| child.cut) {
            None | Some(Cut::None) => 0,
            Some(Cut::Block) => 1 << CUT_SHIFT,
            Some(Cut::Page) => 2 << CUT_SHIFT,
        };
        let [left, right] = children;
        Self {
            removed: record.removed.get() | cut(left),
            kept: record.kept.get() | cut(right),
            half_edge: record.half_edge.get(),
            reverse: from_option(record.reverse),
            adjacent: record.adjacent.map(from_option),
            position: position.to_array(),
            normal,
            codes: [codes.radius, codes.cone_sine, codes.deviation],
            weights: children.map(|child| child.map_or(0, |child| child.block_nodes)),
            rank: record.rank.unwrap_or(NONE),
        }
    }

    pub fn removed(&self) -> VertexId {
        VertexId::new(self.removed & MAX_VERTEX)
    }

    pub fn kept(&self) -> VertexId {
        VertexId::new(self.kept & MAX_VERTEX)
    }

    /// `None` in a damaged entry only.
    pub fn half_edge(&self) -> Option<HalfEdgeId> {
        to_option(self.half_edge)
    }

    pub fn reverse(&self) -> Option<HalfEdgeId> {
        to_option(self.reverse)
    }

    pub fn adjacent(&self) -> [Option<HalfEdgeId>; 4] {
        self.adjacent.map(to_option)
    }

    pub fn position(&self) -> [f32; 3] {
        self.position
    }

    /// The left and the right child; `Err` in a damaged entry only.
    pub fn children(&self) -> Result<[Option<LoggedChild>; 2], ()> {
        let child = |block_nodes: u8, bits: u32| {
            let cut = match bits >> CUT_SHIFT {
                0 => Cut::None,
                1 => Cut::Block,
                2 => Cut::Page,
                _ => return Err(()),
            };
            match (block_nodes, cut) {
                (0, Cut::None) => Ok(None),
                (0, _) => Err(()),
                _ => Ok(Some(LoggedChild { block_nodes, cut })),
            }
        };
        let [left, right] = self.weights;
        Ok([child(left, self.removed)?, child(right, self.kept)?])
    }
}

#[cfg(test)]
mod tests {
    use mergetree::StarBounds;

    use super::*;

    #[test]
    fn entries_give_back_what_they_were_made_of() {
        let h = |h: u32| Some(HalfEdgeId::new(h));
        let record = CollapseRecord {
            removed: VertexId::new(MAX_VERTEX),
            kept: VertexId::new(7),
            half_edge: HalfEdgeId::new(12),
            reverse: None,
            adjacent: [h(1), h(NONE - 1), None, None],
            star: StarBounds::default(),
            rank: None,
        };
        let child = |block_nodes, cut| Some(LoggedChild { block_nodes, cut });
        for left in [None, child(255, Cut::None), child(3, Cut::Block), child(1, Cut::Page)] {
            for right in [None, child(1, Cut::None), child(2, Cut::Block), child(9, Cut::Page)] {
                let codes = BoundCodes { radius: 1, cone_sine: 2, deviation: 3 };
                let normal = OctNormal([4, -5]);
                let entry = LogEntry::new(&record, Vec3::ONE, normal, codes, [left, right]);
                assert_eq!(entry.children(), Ok([left, right]));
                assert_eq!(entry.removed(), record.removed);
                assert_eq!(entry.kept(), record.kept);
                assert_eq!(entry.half_edge(), Some(record.half_edge));
                assert_eq!(entry.reverse(), None);
                assert_eq!(entry.adjacent(), record.adjacent);
            }
        }
        let bad = LogEntry { kept: 3 << CUT_SHIFT, ..Zeroable::zeroed() };
        assert_eq!(bad.children(), Err(()));
        let bad = LogEntry { removed: 1 << CUT_SHIFT, ..Zeroable::zeroed() };
        assert_eq!(bad.children(), Err(()));
    }
}
