//! A page's bytes: what its columns are, and both directions.
//!
//! Blocks and their nodes are stored column by column. A node is predicted by its parent where that lies in the same page,
//! and otherwise by the last node of the page that had no parent there either.

mod compact;
mod decode;
mod encode;
mod shape;

use halfedge::HalfEdgeId;
use mergetree::HalfEdgeNames;

pub(crate) use decode::PageDecoder;
pub(crate) use encode::{PageDefect, PageEncoder};

use crate::header::Header;
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
    /// Numbers per node of attributes that this version reads over.
    pub unknown_components: usize,
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
            unknown_components: header
                .attributes
                .iter()
                .skip(crate::header::standard_attributes().len())
                .map(|attribute| usize::from(attribute.components))
                .sum(),
            rounding: header.rounding,
        }
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
        self.other += other.other;
    }
}
