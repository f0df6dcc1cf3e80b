//! Writing a forest in memory to a file.

use std::path::Path;

use glam::Vec3;
use halfedge::HalfEdgeId;
use mergetree::{Forest, HalfEdgeName, HalfEdgeNames, Node, NodeId, RankError};
use rayon::prelude::*;

use crate::error::Error;
use crate::file_writer::{BATCH_PAGES, FileWriter, Totals, WriteOptions, WriteReport};
use crate::header::Encoding;
use crate::layout::{CutSizes, Layout, NotAForest, PageSpan};
use crate::numbering::{BlockId, Numbering};
use crate::page::Page;
use crate::rounding::Rounding;

/// Writes a forest to `path`, by way of a [`FileWriter`].
///
/// Nodes get new ids, see [`Numbering`]: trees are cut into blocks and pages by [`mergetree::CutRule`]. Radius, cone and
/// deviation are rounded up, and raised where they do not enclose those of the children. Where the encoding is
/// [`Encoding::Compact`], positions and normals are [rounded](crate::Rounding) first, and orders become
/// [ranks](mergetree::ranks()). The bytes of the file depend on
/// nothing but `forest` and `options`.
///
/// # Complexity
/// Time and memory linear in the number of nodes; about 35 bytes of memory per node besides the forest.
///
/// # Errors
/// [`Error::Option`]; [`Error::InvalidForest`] and [`Error::InvalidBase`] when the forest is not one;
/// [`Error::Io`] when the disk refuses.
pub fn write(
    forest: &Forest,
    path: impl AsRef<Path>,
    options: &WriteOptions,
) -> Result<WriteReport, Error> {
    let path = path.as_ref();
    options.check()?;
    let options = &WriteOptions {
        position_error: options.position_error.in_units(bounds(forest)),
        ..options.clone()
    };
    let rounding = options.rounding()?;
    let numbering = Numbering::new(options.levels);
    let invalid =
        |NotAForest { node, message }| Error::InvalidForest { file: path.into(), node, message };
    let num_colours = if forest.base.colours.is_empty() { 0 } else { forest.nodes.len() };
    if forest.colours.len() != num_colours {
        let message = "is one of a forest with colours for some vertices only";
        return Err(invalid(NotAForest { node: forest.nodes.len().saturating_sub(1), message }));
    }
    let sizes = CutSizes {
        piece_nodes: options.piece_nodes() as u32,
        page_nodes: options.page_nodes() as u32,
    };
    let layout = Layout::new(forest, numbering, sizes, rounding).map_err(invalid)?;
    let mut base = forest.base.clone();
    for (number, vertex) in base.vertices.iter_mut().enumerate() {
        // What is not finite is refused later.
        if vertex.position.is_finite() {
            vertex.position = rounding.position(vertex.position).ok_or_else(|| {
                let message = format!("vertex {number} is too far from zero for the error allowed");
                Error::InvalidBase { file: path.into(), message }
            })?;
        }
        vertex.normal = rounding.normal(vertex.normal);
    }
    let ranks = match options.encoding {
        Encoding::Exact => None,
        Encoding::Compact => Some(mergetree::ranks(forest).map_err(|error| match error {
            RankError::Misfit(id) => {
                invalid(NotAForest { node: id.index(), message: "does not fit the mesh around it" })
            }
            other => Error::InvalidBase { file: path.into(), message: other.to_string() },
        })?),
    };
    for root in base.vertices.iter_mut().filter_map(|vertex| vertex.root.as_mut()) {
        *root = layout.new_id[root.index()];
    }
    let mut writer = FileWriter::create(path, options, &totals(forest, &layout, rounding), &base)?;
    let renamer = Renamer { forest, layout: &layout, names: base.names(), rounding, ranks };
    for batch in layout.pages.chunks(BATCH_PAGES) {
        let pages: Result<Vec<Page>, NotAForest> =
            batch.par_iter().map(|span| renamer.page(span)).collect();
        writer.write_pages(&pages.map_err(invalid)?)?;
    }
    writer.finish()
}

fn totals(forest: &Forest, layout: &Layout, rounding: Rounding) -> Totals {
    // Rounding keeps what is least and largest.
    let bounds = bounds(forest).map(|corner| rounding.position(corner).unwrap_or(corner));
    Totals {
        nodes: forest.nodes.len() as u64,
        blocks: layout.starts.len() as u64 - 1,
        pages: layout.pages.len() as u64,
        input_triangles: forest.num_input_faces() as u64,
        tree_depth: forest.depth() as u64,
        bounds,
    }
}

fn bounds(forest: &Forest) -> [Vec3; 2] {
    let of_base = forest.base.vertices.iter().map(|vertex| vertex.position);
    let positions = of_base.chain(forest.nodes.iter().map(|node| node.position));
    let bounds = positions.fold(None, |bounds: Option<[Vec3; 2]>, p| {
        Some(bounds.map_or([p; 2], |[min, max]| [min.min(p), max.max(p)]))
    });
    bounds.unwrap_or_default()
}

/// Takes nodes out of a forest into the file's numbering.
struct Renamer<'a> {
    forest: &'a Forest,
    layout: &'a Layout,
    names: HalfEdgeNames,
    rounding: Rounding,
    /// What stands for orders, where they are not written themselves.
    ranks: Option<Vec<u32>>,
}

impl Renamer<'_> {
    fn page(&self, span: &PageSpan) -> Result<Page, NotAForest> {
        let starts = &self.layout.starts[span.first_block as usize..][..=span.num_blocks as usize];
        let mut page = Page::starting_at(BlockId::new(span.first_block));
        page.blocks.reserve_exact(span.num_blocks as usize);
        let num_nodes = (starts[starts.len() - 1] - starts[0]) as usize;
        page.nodes.reserve_exact(num_nodes);
        page.colours.reserve_exact(if self.forest.colours.is_empty() { 0 } else { num_nodes });
        for block in starts.windows(2) {
            page.blocks.push(page.nodes.len() as u32);
            for &id in &self.layout.order[block[0] as usize..block[1] as usize] {
                page.nodes.push(self.node(id)?);
                page.colours.extend(self.forest.colours.get(id.index()));
            }
        }
        Ok(page)
    }

    fn node(&self, id: NodeId) -> Result<Node, NotAForest> {
        let node = &self.forest.nodes[id.index()];
        let rename = |link: Option<NodeId>| link.map(|id| self.layout.new_id[id.index()]);
        let mut renamed = Node {
            left: rename(node.left),
            right: rename(node.right),
            parent: rename(node.parent),
            slot: None,
            ..*node
        };
        for half_edge in renamed.adjacent.iter_mut().flatten() {
            let message = "an adjacent half-edge that is not there";
            *half_edge =
                self.half_edge(*half_edge).ok_or(NotAForest { node: id.index(), message })?;
        }
        // The layout has seen that there is one.
        renamed.position = self.rounding.position(node.position).unwrap_or(node.position);
        renamed.normal = self.rounding.normal(node.normal);
        if let Some(ranks) = &self.ranks {
            renamed.order = ranks[id.index()];
        }
        self.layout.codes[id.index()].store(&mut renamed);
        Ok(renamed)
    }

    fn half_edge(&self, h: HalfEdgeId) -> Option<HalfEdgeId> {
        match self.names.resolve(h) {
            HalfEdgeName::Base(_) => Some(h),
            HalfEdgeName::Node(node, k) => {
                self.layout.new_id.get(node.index()).map(|&node| self.names.of_node(node, k))
            }
        }
    }
}
