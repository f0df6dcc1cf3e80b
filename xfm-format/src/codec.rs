//! A page's bytes: what its columns are, and both directions.
//!
//! Blocks and their nodes are stored column by column. A node is predicted by its parent where that lies in the same page,
//! and otherwise by the last node of the page that had no parent there either.

mod compact;
mod decode;
mod encode;
mod shape;

use halfedge::HalfEdgeId;
use mergetree::{Colour, HalfEdgeNames};

pub(crate) use decode::PageDecoder;
pub(crate) use encode::{PageDefect, PageEncoder};

use crate::header::{Header, MoreAttribute};
use crate::numbering::Numbering;
use crate::rounding::Rounding;

/// What the bytes of a page depend on beyond the page.
#[derive(Clone, Debug)]
pub(crate) struct PageContext {
    pub numbering: Numbering,
    pub names: HalfEdgeNames,
    /// One more than the largest name of a half-edge.
    pub num_half_edges: u64,
    pub num_base_half_edges: u32,
    pub num_nodes: u64,
    pub num_blocks: u64,
    /// What pages have besides what all have, in its order.
    pub more: Vec<MoreAttribute>,
    /// Nothing is rounded where the encoding is the exact one.
    pub rounding: Rounding,
}

impl PageContext {
    /// For a header whose half-edges have names of 32 bits.
    pub fn new(header: &Header) -> Self {
        Self {
            numbering: header.numbering(),
            names: HalfEdgeNames::new(header.base_faces as usize),
            num_half_edges: header.num_half_edges(),
            num_base_half_edges: 3 * header.base_faces as u32,
            num_nodes: header.nodes,
            num_blocks: header.blocks,
            more: header.more_attributes().collect(),
            rounding: header.rounding,
        }
    }

    /// Whether nodes have colours.
    pub fn has_colour(&self) -> bool {
        self.more.contains(&MoreAttribute::Colour)
    }

    /// The half-edge of this name, if it is one that the file may have.
    #[inline]
    fn half_edge(&self, name: u64) -> Option<HalfEdgeId> {
        if name >= self.num_half_edges {
            return None;
        }
        let slots = self.numbering.slots();
        match (name as u32).checked_sub(self.num_base_half_edges) {
            Some(of_nodes) if (of_nodes / 6) & slots == slots => None,
            _ => Some(HalfEdgeId::new(name as u32)),
        }
    }
}

/// Tables for shapes in a compact page: one for each of these.
const SHAPE_TABLES: usize = 2;
/// And for links: to children in the page, to children in other pages, to what is above tops.
const LINK_TABLES: usize = 3;

/// The table of a shape after another one: whether that has a child beside it in its block.
fn shape_table(last: u32) -> usize {
    usize::from(last & 3 == 1 || last >> 2 == 1)
}

/// Where the value of a node is predicted from.
#[derive(Clone, Copy, Debug)]
struct Reference {
    /// The node among those of the page. The first node refers to itself, which stands for zeros.
    node: u32,
    /// Whether it is the parent.
    is_parent: bool,
}

/// Bytes of a file by what they hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct FieldBytes {
    /// Header with attribute table.
    pub header: u64,
    /// Coarsest mesh.
    pub base: u64,
    /// Root list.
    pub roots: u64,
    /// Page index.
    pub index: u64,
    /// What hangs under every node: nothing, a node of its block, another block.
    pub shape: u64,
    /// Links between blocks.
    pub links: u64,
    /// Positions of nodes.
    pub position: u64,
    /// Normals of nodes.
    pub normal: u64,
    /// Radii of bounding spheres.
    pub radius: u64,
    /// Normal cones.
    pub cone: u64,
    /// Deviations.
    pub deviation: u64,
    /// Order of the collapses.
    pub order: u64,
    /// The half-edges `w, x, y, z`.
    pub adjacent: u64,
    /// Colours of nodes.
    pub colour: u64,
    /// Attributes that this version reads over.
    pub other: u64,
}

impl FieldBytes {
    /// Every kind of field with its name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("header", self.header),
            ("base", self.base),
            ("roots", self.roots),
            ("index", self.index),
            ("shape", self.shape),
            ("links", self.links),
            ("position", self.position),
            ("normal", self.normal),
            ("radius", self.radius),
            ("cone", self.cone),
            ("deviation", self.deviation),
            ("order", self.order),
            ("adjacent", self.adjacent),
            ("colour", self.colour),
            ("other", self.other),
        ]
        .into_iter()
    }

    /// All together: the length of the file.
    pub fn total(&self) -> u64 {
        self.iter().map(|(_, bytes)| bytes).sum()
    }

    /// Of a compact page of so many bytes, from how many of them each field ends after.
    fn from_marks(marks: &[usize], length: usize) -> Self {
        let mut bytes = Self::default();
        let mut fields = [
            &mut bytes.shape,
            &mut bytes.links,
            &mut bytes.order,
            &mut bytes.adjacent,
            &mut bytes.normal,
            &mut bytes.position,
            &mut bytes.radius,
            &mut bytes.cone,
            &mut bytes.deviation,
        ];
        let mut last = 0;
        for (field, &mark) in fields.iter_mut().zip(marks) {
            **field = mark.saturating_sub(last) as u64;
            last = last.max(mark);
        }
        // Lengths, and states of the coder.
        bytes.shape += length.saturating_sub(last) as u64;
        bytes
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.header += other.header;
        self.base += other.base;
        self.roots += other.roots;
        self.index += other.index;
        self.shape += other.shape;
        self.links += other.links;
        self.position += other.position;
        self.normal += other.normal;
        self.radius += other.radius;
        self.cone += other.cone;
        self.deviation += other.deviation;
        self.order += other.order;
        self.adjacent += other.adjacent;
        self.colour += other.colour;
        self.other += other.other;
    }
}

/// What stands for a colour in columns and symbols: the differences to the one it is predicted by, those of red and blue less
/// that of green, because mostly all three change together. Each is taken as a signed byte.
#[inline]
pub(crate) fn colour_difference(colour: Colour, predicted: Colour) -> [i8; 4] {
    let [r, g, b, a] = std::array::from_fn(|i| colour[i].wrapping_sub(predicted[i]));
    [r.wrapping_sub(g), g, b.wrapping_sub(g), a].map(|byte| byte as i8)
}

/// The inverse of [`colour_difference`].
#[inline]
pub(crate) fn colour_from_difference(difference: [i8; 4], predicted: Colour) -> Colour {
    let [r, g, b, a] = difference.map(|byte| byte as u8);
    let moved = [r.wrapping_add(g), g, b.wrapping_add(g), a];
    std::array::from_fn(|i| predicted[i].wrapping_add(moved[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_colours_are_inverted() {
        let mut state = 1u32;
        for _ in 0..10_000 {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            let colour = state.to_le_bytes();
            let predicted = state.rotate_left(11).wrapping_mul(9).to_le_bytes();
            let difference = colour_difference(colour, predicted);
            assert_eq!(colour_from_difference(difference, predicted), colour);
        }
        assert_eq!(colour_difference([9, 8, 7, 255], [4, 3, 2, 255]), [0, 5, 0, 0]);
    }
}
