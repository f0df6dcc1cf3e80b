//! Whether a file is what it should be: every checksum, link, bound and count.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;
use halfedge::HalfEdgeMesh;
use mergetree::{HalfEdgeName, Node, NodeId};

use crate::bounds::{cone_holds, enclosing_angle, enclosing_radius};
use crate::error::{Error, Place};
use crate::header::Encoding;
use crate::numbering::{BlockId, Numbering};
use crate::page::{Block, Page};
use crate::reader::XfmFile;

/// Something wrong in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Problem {
    /// Where.
    pub place: Place,
    /// What.
    pub message: String,
}

/// What is wrong in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Report {
    /// The problems found, the first [`Report::MAX_ERRORS`] of them.
    pub errors: Vec<Problem>,
    /// How many more there are.
    pub more: usize,
}

impl Report {
    /// So many problems are described; the rest is counted.
    pub const MAX_ERRORS: usize = 1000;

    /// Whether nothing is wrong.
    pub fn is_ok(&self) -> bool {
        self.errors.is_empty()
    }

    fn add(&mut self, place: Place, message: impl Into<String>) {
        if self.errors.len() < Self::MAX_ERRORS {
            self.errors.push(Problem { place, message: message.into() });
        } else {
            self.more += 1;
        }
    }
}

/// How far verification has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Progress {
    /// Pages done, of both passes.
    pub done: usize,
    /// Pages to be done.
    pub total: usize,
}

/// Checks everything about a file that could be opened.
///
/// Finds any page with a wrong checksum, every link that leads nowhere or is not returned, nodes that no root leads to or
/// that hang in two places, children that come after their parent in the order of collapses or lie outside its bounds,
/// half-edges named that are not there or not of a later collapse, a coarsest mesh that is no manifold, and counts that are
/// not the header's. What hangs below a page that cannot be read is not held against it.
///
/// # Complexity
/// Reads every page twice. Memory: 8 bytes per node, 8 per block, and one node per block that hangs under another one
/// and is yet to come.
pub fn verify(file: &XfmFile, mut on_progress: impl FnMut(Progress)) -> Report {
    let mut verifier = Verifier::new(file);
    verifier.base();
    let pages = file.num_pages();
    for pass in [Pass::Trees, Pass::HalfEdges] {
        let mut page = Page::new();
        let mut reader = match file.page_reader() {
            Ok(reader) => reader,
            Err(why) => {
                verifier.report.add(Place::File, why.to_string());
                return verifier.report;
            }
        };
        for number in 0..pages {
            let read = file.read_page_into(number, &mut reader, &mut page);
            match (pass, read) {
                (Pass::Trees, Ok(())) => verifier.page(&page),
                (Pass::Trees, Err(why)) => verifier.unreadable(number, &why),
                (Pass::HalfEdges, Ok(())) => verifier.half_edges(&page),
                // Said in the first pass.
                (Pass::HalfEdges, Err(_)) => {}
            }
            let before = if pass == Pass::Trees { 0 } else { pages };
            on_progress(Progress { done: before + number + 1, total: 2 * pages });
        }
        if pass == Pass::Trees {
            verifier.trees_end();
        }
    }
    verifier.report
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    Trees,
    HalfEdges,
}

/// What a block must be that another one names as its child.
struct Expected {
    parent: NodeId,
    node: Node,
    depth: u64,
}

/// What is remembered of a block.
#[derive(Clone, Copy)]
struct KnownBlock {
    /// Where its nodes begin among the orders.
    start: u32,
    /// How many there are; 0 where the page cannot be read.
    nodes: u32,
}

impl KnownBlock {
    fn is_readable(&self) -> bool {
        self.nodes > 0
    }
}

struct Verifier<'a> {
    file: &'a XfmFile,
    numbering: Numbering,
    report: Report,
    blocks: Vec<KnownBlock>,
    /// Order of every node; the bit above says whether it has a second face.
    orders: Vec<u64>,
    /// Empty where several nodes may have the same order.
    order_seen: Vec<u64>,
    expected: BTreeMap<BlockId, Expected>,
    roots: BTreeSet<NodeId>,
    unreadable_pages: usize,
    depth: u64,
    /// Of the nodes of a block.
    depths: Vec<u64>,
    triangles: u64,
    bounds: Option<[Vec3; 2]>,
}

const SECOND_FACE: u64 = 1 << 32;

impl<'a> Verifier<'a> {
    fn new(file: &'a XfmFile) -> Self {
        let header = file.header();
        let seen = match header.encoding {
            Encoding::Exact => header.nodes.div_ceil(64) as usize,
            Encoding::Compact => 0,
        };
        Self {
            file,
            numbering: file.numbering(),
            report: Report::default(),
            blocks: Vec::with_capacity(file.num_blocks()),
            orders: Vec::with_capacity(header.nodes as usize),
            order_seen: vec![0; seen],
            expected: BTreeMap::new(),
            roots: file.base().roots().collect(),
            unreadable_pages: 0,
            depth: 0,
            depths: Vec::new(),
            triangles: header.base_faces,
            bounds: None,
        }
    }

    fn base(&mut self) {
        let base = self.file.base();
        if let Err(why) = HalfEdgeMesh::from_triangles(base.vertices.len(), &base.faces) {
            self.report.add(Place::Base, why.to_string());
        }
        if self.roots.len() != base.roots().count() {
            self.report.add(Place::Roots, "two vertices have the same tree");
        }
        for vertex in &base.vertices {
            self.include(vertex.position);
        }
    }

    fn include(&mut self, p: Vec3) {
        self.bounds = Some(self.bounds.map_or([p; 2], |[min, max]| [min.min(p), max.max(p)]));
    }

    fn unreadable(&mut self, number: usize, why: &Error) {
        let (place, message) = match why {
            Error::Invalid { place, message, .. } => (*place, message.clone()),
            other => (Place::Page(number as u64), other.to_string()),
        };
        self.report.add(place, message);
        self.unreadable_pages += 1;
        let (blocks, nodes) = self.file.page_counts(number).unwrap_or_default();
        for _ in 0..blocks {
            self.blocks.push(KnownBlock { start: self.orders.len() as u32, nodes: 0 });
        }
        self.orders.extend(std::iter::repeat_n(0, nodes));
    }

    fn page(&mut self, page: &Page) {
        for block in page.blocks() {
            let (start, nodes) = (self.orders.len() as u32, block.nodes.len() as u32);
            self.blocks.push(KnownBlock { start, nodes });
            let above = self.link(&block);
            // Parents stand before their children.
            self.depths.clear();
            for (slot, node) in (0..).zip(block.nodes) {
                let parent = node.parent.filter(|_| slot > 0);
                let parent = parent.map(|parent| self.numbering.slot(parent) as usize);
                let depth = 1 + parent.map_or(above, |slot| self.depths[slot]);
                self.depths.push(depth);
                self.node(&block, slot, node, depth);
            }
        }
    }

    /// Checks that a block hangs where it says it does; returns how many levels are above it.
    fn link(&mut self, block: &Block<'_>) -> u64 {
        let place = Place::Block(block.id.get().into());
        let Some(parent) = block.parent() else {
            if !self.roots.remove(&self.numbering.node(block.id, 0)) {
                self.report.add(place, "has no parent and is not in the root list");
            }
            if self.expected.remove(&block.id).is_some() {
                self.report.add(place, "is named as a child and has no parent");
            }
            return 0;
        };
        match self.expected.remove(&block.id) {
            Some(expected) if expected.parent == parent => {
                self.enclosed(
                    Place::Node(self.numbering.node(block.id, 0).get().into()),
                    &expected.node,
                    &block.nodes[0],
                );
                return expected.depth;
            }
            Some(expected) => {
                let message =
                    format!("hangs under node {parent}, but node {} names it", expected.parent);
                self.report.add(place, message);
            }
            None => {
                let parent_block = self.blocks.get(self.numbering.block(parent).index());
                if parent_block.is_some_and(KnownBlock::is_readable) {
                    let message = format!("hangs under node {parent}, which does not name it");
                    self.report.add(place, message);
                }
            }
        }
        0
    }

    fn node(&mut self, block: &Block<'_>, slot: u32, node: &Node, depth: u64) {
        let id = self.numbering.node(block.id, slot);
        let place = Place::Node(id.get().into());
        self.depth = self.depth.max(depth);
        self.triangles += node.num_faces() as u64;
        self.include(node.position);
        let second_face = if node.has_second_face() { SECOND_FACE } else { 0 };
        self.orders.push(u64::from(node.order) | second_face);
        // Ranks stand for orders otherwise.
        if let Some(word) = self.order_seen.get_mut(node.order as usize / 64) {
            if *word >> (node.order % 64) & 1 == 1 {
                self.report.add(place, format!("has order {}, as another node", node.order));
            }
            *word |= 1 << (node.order % 64);
        }
        if !node.has_second_face() && node.adjacent[3].is_some() {
            self.report.add(place, "has a half-edge z and no y");
        }
        for child in node.children() {
            let child_block = self.numbering.block(child);
            if child_block == block.id {
                if let Some(child_node) = block.node(self.numbering.slot(child)) {
                    self.enclosed(Place::Node(child.get().into()), node, child_node);
                }
            } else {
                let expected = Expected { parent: id, node: *node, depth };
                if let Some(other) = self.expected.insert(child_block, expected) {
                    let message = format!("is a child of node {} and of node {id}", other.parent);
                    self.report.add(Place::Block(child_block.get().into()), message);
                }
            }
        }
    }

    /// Checks the order and the bounds of a child against its parent's.
    fn enclosed(&mut self, place: Place, parent: &Node, child: &Node) {
        if child.order >= parent.order {
            let message = format!("has order {}, its parent {}", child.order, parent.order);
            self.report.add(place, message);
        }
        if enclosing_radius(parent.position, child.position, child.radius)
            > f64::from(parent.radius)
        {
            self.report.add(place, "has a sphere that reaches outside its parent's");
        }
        if child.deviation > parent.deviation {
            self.report.add(place, "has a larger deviation than its parent");
        }
        if !cone_holds(
            parent.cone_sine,
            enclosing_angle(parent.normal, child.normal, child.cone_sine),
        ) {
            self.report.add(place, "has a cone that reaches outside its parent's");
        }
    }

    /// What can be said once all pages were seen.
    fn trees_end(&mut self) {
        // A child's number is larger than its parent's, so what is still expected lies in pages that cannot be read.
        self.expected.clear();
        for root in std::mem::take(&mut self.roots) {
            if self
                .blocks
                .get(self.numbering.block(root).index())
                .is_some_and(KnownBlock::is_readable)
            {
                self.report.add(Place::Roots, format!("node {root} is no root"));
            }
        }
        if self.unreadable_pages > 0 {
            return;
        }
        let header = self.file.header();
        for (name, stated, found) in [
            ("input triangles", header.input_triangles, self.triangles),
            ("levels of the deepest tree", header.tree_depth, self.depth),
        ] {
            if stated != found {
                self.report.add(Place::Header, format!("says {stated} {name}, there are {found}"));
            }
        }
        let [min, max] = self.bounds.unwrap_or_default();
        if header.bounds != [min, max] {
            self.report.add(Place::Header, "the bounding box is not that of the vertices");
        }
    }

    fn half_edges(&mut self, page: &Page) {
        let names = self.file.base().names();
        for block in page.blocks() {
            for (slot, node) in (0..).zip(block.nodes) {
                let id = self.numbering.node(block.id, slot);
                for (name, adjacent) in ["w", "x", "y", "z"].into_iter().zip(node.adjacent) {
                    let Some(HalfEdgeName::Node(target, k)) = adjacent.map(|h| names.resolve(h))
                    else {
                        continue;
                    };
                    if let Err(message) = self.target(target, k, node.order) {
                        self.report.add(Place::Node(id.get().into()), format!("{name} {message}"));
                    }
                }
            }
        }
    }

    /// That a half-edge named by a node is there, and comes with a split that goes before the node's.
    fn target(&self, target: NodeId, k: u32, order: u32) -> Result<(), String> {
        let slot = self.numbering.slot(target);
        let stored = match self.blocks.get(self.numbering.block(target).index()) {
            Some(block) if !block.is_readable() => return Ok(()),
            Some(block) if slot < block.nodes => {
                self.orders.get((block.start + slot) as usize).copied()
            }
            _ => None,
        };
        let Some(stored) = stored else {
            return Err(format!("names a half-edge of node {target}, which is not there"));
        };
        if k >= 3 && stored & SECOND_FACE == 0 {
            return Err(format!(
                "names a half-edge of the second face of node {target}, which has one"
            ));
        }
        if stored & !SECOND_FACE <= u64::from(order) {
            return Err(format!("names a half-edge of node {target}, which was collapsed before"));
        }
        Ok(())
    }
}
