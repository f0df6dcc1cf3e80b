//! Writing a forest to a file: whole or not at all.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use glam::Vec3;
use halfedge::HalfEdgeId;
use mergetree::{BaseMesh, Forest, HalfEdgeName, HalfEdgeNames, Node, NodeId};
use rayon::prelude::*;

use crate::bounds::BoundCodes;
use crate::codec::{FieldBytes, PageContext, PageEncoder};
use crate::error::Error;
use crate::file_writer::{WriteOptions, WriteReport};
use crate::header::{Header, Section, VERSION, standard_attributes};
use crate::layout::{Layout, NotAForest, PageSpan};
use crate::numbering::Numbering;
use crate::page::{BlockEntry, Page};
use crate::sections::{IndexEntry, Tag, encode_base, encode_index, encode_roots};
use crate::temporary::TemporaryFile;

/// Pages that are encoded at once, in parallel.
const BATCH_PAGES: usize = 64;

/// Writes a forest to `path`, by way of a temporary file in the same folder that is renamed when it is whole and on the
/// disk. A file that was there before is replaced. Nothing is left after an error.
///
/// Nodes get new ids, see [`Numbering`]. Radius, cone and deviation are rounded up, and raised where they do not enclose
/// those of the children. The bytes of the file depend on nothing but `forest` and `options`.
///
/// # Complexity
/// Time and memory linear in the number of nodes; about 18 bytes of memory per node besides the forest.
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
    check_options(options)?;
    check_base(&forest.base)
        .map_err(|message| Error::InvalidBase { file: path.into(), message })?;
    let numbering = Numbering::new(options.levels);
    let invalid =
        |NotAForest { node, message }| Error::InvalidForest { file: path.into(), node, message };
    check_orders(forest).map_err(invalid)?;
    let layout = Layout::new(forest, numbering, options.page_nodes).map_err(invalid)?;
    let codes = bound_codes(forest, &layout).map_err(invalid)?;
    let io = |source| Error::Io { file: path.into(), action: "write", source };
    let mut file = TemporaryFile::create(path).map_err(io)?;
    let report = Writer { forest, layout: &layout, codes: &codes, options }
        .write_to(file.file())
        .map_err(|failure| match failure {
        Failure::Io(source) => io(source),
        Failure::Forest(not) => invalid(not),
    })?;
    file.persist().map_err(io)?;
    Ok(report)
}

fn check_options(options: &WriteOptions) -> Result<(), Error> {
    for (name, value, min, max) in [
        ("levels per block", u64::from(options.levels), 1, 5),
        ("nodes per page", options.page_nodes as u64, 64, 65536),
    ] {
        if !(min..=max).contains(&value) {
            return Err(Error::Option { name, value, min, max });
        }
    }
    Ok(())
}

fn check_base(base: &BaseMesh) -> Result<(), String> {
    if let Some(vertex) = base.vertices.iter().position(|v| !v.position.is_finite()) {
        return Err(format!("the position of vertex {vertex} is not finite"));
    }
    let outside = |face: &[u32; 3]| face.iter().any(|&v| v as usize >= base.vertices.len());
    if let Some(face) = base.faces.iter().position(outside) {
        return Err(format!("face {face} names a vertex that is not there"));
    }
    Ok(())
}

/// That the orders of all nodes are 0, 1, 2, …, each once, and those of children below their parents'.
fn check_orders(forest: &Forest) -> Result<(), NotAForest> {
    let mut seen = vec![false; forest.nodes.len()];
    for (index, node) in forest.nodes.iter().enumerate() {
        let fail = |message| Err(NotAForest { node: index, message });
        match seen.get_mut(node.order as usize) {
            None => return fail("an order beyond the number of nodes"),
            Some(true) => return fail("an order that another node has"),
            Some(seen) => *seen = true,
        }
        let above = node.parent.and_then(|parent| forest.nodes.get(parent.index()));
        if above.is_some_and(|parent| parent.order <= node.order) {
            return fail("an order not below its parent's");
        }
    }
    Ok(())
}

/// Bounds of all nodes of the forest, from the leaves up.
fn bound_codes(forest: &Forest, layout: &Layout) -> Result<Vec<BoundCodes>, NotAForest> {
    let mut codes = vec![BoundCodes::default(); forest.nodes.len()];
    for &id in layout.order.iter().rev() {
        let node = &forest.nodes[id.index()];
        let fail = |message| NotAForest { node: id.index(), message };
        if !node.position.is_finite() {
            return Err(fail("a position that is not finite"));
        }
        let children =
            node.children().map(|child| codes[child.index()].of(&forest.nodes[child.index()]));
        codes[id.index()] = BoundCodes::enclosing(node, children)
            .ok_or_else(|| fail("a radius, cone or deviation that is not finite"))?;
    }
    Ok(codes)
}

enum Failure {
    Io(io::Error),
    Forest(NotAForest),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

struct Writer<'a> {
    forest: &'a Forest,
    layout: &'a Layout,
    codes: &'a [BoundCodes],
    options: &'a WriteOptions,
}

impl Writer<'_> {
    fn write_to(&self, file: &mut File) -> Result<WriteReport, Failure> {
        let base = self.base_in_file_numbering();
        let mut header = self.header(&base);
        let mut bytes = FieldBytes::default();
        let mut at = header.encoded_len() as u64;
        bytes.header = at;
        file.seek(SeekFrom::Start(at))?;
        let mut section = |file: &mut File, tag: Tag, content: &[u8]| -> io::Result<Section> {
            file.write_all(content)?;
            let section =
                Section { offset: at, length: content.len() as u64, crc: tag.checksum(content) };
            at += section.length;
            Ok(section)
        };
        header.base = section(file, Tag::Base, &encode_base(&base)?)?;
        header.root_list = section(file, Tag::Roots, &encode_roots(&base, self.layout.numbering)?)?;
        bytes.base = header.base.length;
        bytes.roots = header.root_list.length;
        let entries = self.write_pages(file, &header, at, &mut bytes)?;
        let end = entries.last().map_or(at, |last| last.offset + u64::from(last.length));
        header.page_data = Section { offset: at, length: end - at, crc: 0 };
        at = end;
        let index = encode_index(&entries);
        file.write_all(&index)?;
        header.index =
            Section { offset: at, length: index.len() as u64, crc: Tag::Index.checksum(&index) };
        bytes.index = header.index.length;
        header.file_len = at + header.index.length;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&header.encode())?;
        Ok(WriteReport {
            file_bytes: header.file_len,
            blocks: header.blocks,
            pages: header.pages,
            fill: header.fill(),
            tree_depth: header.tree_depth,
            bytes,
        })
    }

    fn header(&self, base: &BaseMesh) -> Header {
        let nodes = &self.forest.nodes;
        let positions =
            || base.vertices.iter().map(|v| v.position).chain(nodes.iter().map(|n| n.position));
        let bounds = positions().fold(None, |bounds: Option<[Vec3; 2]>, p| {
            Some(bounds.map_or([p; 2], |[min, max]| [min.min(p), max.max(p)]))
        });
        Header {
            version: VERSION,
            features: 0,
            encoding: self.options.encoding,
            levels: self.options.levels,
            input_triangles: self.forest.num_input_faces() as u64,
            nodes: nodes.len() as u64,
            blocks: self.layout.blocks.len() as u64,
            pages: self.layout.pages.len() as u64,
            base_vertices: base.vertices.len() as u64,
            base_faces: base.faces.len() as u64,
            roots: base.roots().count() as u64,
            tree_depth: self.layout.depth,
            bounds: bounds.unwrap_or_default(),
            attributes: standard_attributes(),
            base: Section::default(),
            root_list: Section::default(),
            page_data: Section::default(),
            index: Section::default(),
            file_len: 0,
        }
    }

    fn base_in_file_numbering(&self) -> BaseMesh {
        let mut base = self.forest.base.clone();
        for root in base.vertices.iter_mut().filter_map(|vertex| vertex.root.as_mut()) {
            *root = self.layout.new_id[root.index()];
        }
        base
    }

    fn write_pages(
        &self,
        file: &mut File,
        header: &Header,
        mut at: u64,
        bytes: &mut FieldBytes,
    ) -> Result<Vec<IndexEntry>, Failure> {
        let context = PageContext::new(header);
        let mut entries = Vec::with_capacity(self.layout.pages.len());
        for batch in self.layout.pages.chunks(BATCH_PAGES) {
            let encoded: Vec<_> = batch
                .par_iter()
                .map_init(PageEncoder::new, |encoder, span| {
                    let encoder = encoder
                        .as_mut()
                        .map_err(|why| io::Error::new(why.kind(), why.to_string()))?;
                    let page = self.page(span, context.names)?;
                    Ok::<_, Failure>(encoder.encode(&page, &context))
                })
                .collect();
            for (span, encoded) in batch.iter().zip(encoded) {
                let (page, field_bytes) = encoded?;
                bytes.add(&field_bytes);
                file.write_all(&page)?;
                let number = entries.len() as u64;
                entries.push(IndexEntry {
                    first_block: span.blocks.start as u64,
                    offset: at,
                    length: u32::try_from(page.len()).map_err(io::Error::other)?,
                    blocks: span.blocks.len() as u32,
                    nodes: span.nodes.len() as u32,
                    crc: Tag::Page(number).checksum(&page),
                });
                at += page.len() as u64;
            }
        }
        Ok(entries)
    }

    /// A page in the file's numbering.
    fn page(&self, span: &PageSpan, names: HalfEdgeNames) -> Result<Page, NotAForest> {
        let mut page = Page {
            first_block: span.blocks.start as u32,
            blocks: Vec::with_capacity(span.blocks.len()),
            nodes: Vec::with_capacity(span.nodes.len()),
        };
        let layout = self.layout;
        for block in &layout.blocks[span.blocks.clone()] {
            let first_node = page.nodes.len();
            let count = block.mask.count_ones() as usize;
            let mut is_leaf = true;
            for &id in &layout.order[block.first_node as usize..][..count] {
                let node = self.node(id, names)?;
                let in_lowest_level =
                    |id: NodeId| layout.numbering.slot(id) >= layout.numbering.lowest_level();
                is_leaf &=
                    node.children().next().is_none() || !in_lowest_level(layout.new_id[id.index()]);
                page.nodes.push(node);
            }
            page.blocks.push(BlockEntry {
                mask: block.mask,
                is_leaf,
                parent: page.nodes[first_node].parent,
                first_node: first_node as u32,
            });
        }
        Ok(page)
    }

    fn node(&self, id: NodeId, names: HalfEdgeNames) -> Result<Node, NotAForest> {
        let new_id = &self.layout.new_id;
        let node = &self.forest.nodes[id.index()];
        let rename = |link: Option<NodeId>| link.map(|id| new_id[id.index()]);
        let mut adjacent = [None; 4];
        for (new, old) in adjacent.iter_mut().zip(node.adjacent) {
            *new = old.map(|h| rename_half_edge(h, names, new_id)).transpose().map_err(|()| {
                NotAForest { node: id.index(), message: "an adjacent half-edge that is not there" }
            })?;
        }
        let mut renamed = Node {
            adjacent,
            left: rename(node.left),
            right: rename(node.right),
            parent: rename(node.parent),
            slot: None,
            ..*node
        };
        self.codes[id.index()].store(&mut renamed);
        Ok(renamed)
    }
}

impl From<NotAForest> for Failure {
    fn from(not: NotAForest) -> Self {
        Self::Forest(not)
    }
}

fn rename_half_edge(
    h: HalfEdgeId,
    names: HalfEdgeNames,
    new_id: &[NodeId],
) -> Result<HalfEdgeId, ()> {
    match names.resolve(h) {
        HalfEdgeName::Base(_) => Ok(h),
        HalfEdgeName::Node(node, k) => {
            new_id.get(node.index()).map(|&node| names.of_node(node, k)).ok_or(())
        }
    }
}
