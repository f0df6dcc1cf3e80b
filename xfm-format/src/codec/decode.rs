//! From the bytes of a page to its blocks, trusting none of them.

use std::io;

use mergetree::{BoundCodes, Node, NodeId};

use super::compact::{Coder, Model, Part, Reader, Symbols, Tables, skip_symbols};
use super::shape::{Kind, Preorder, Shape, Side};
use super::{
    FieldBytes, LINK_TABLES, PageContext, Reference, SHAPE_TABLES, colour_from_difference,
    shape_table,
};
use crate::column::{
    ColumnDecoder, Cursor, float_from_difference, short_from_difference, unzigzag,
};
use crate::error::{Defect, Place};
use crate::header::MoreAttribute;
use crate::numbering::BlockId;
use crate::page::Page;
use crate::sections::IndexEntry;

/// Decodes pages; holds what can be used again from one to the next.
pub(crate) struct PageDecoder {
    columns: ColumnDecoder,
    values: Vec<u64>,
    preorder: Preorder,
    references: Vec<Reference>,
    ids: Vec<NodeId>,
    /// Children that begin other blocks, in order.
    outside: Vec<Outside>,
    /// Per block whether it hangs under none of the page, as far as is known.
    is_top: Vec<bool>,
    /// What the fields of the last page took.
    pub bytes: FieldBytes,
    tables: Option<Tables>,
    model: Model,
}

/// A child that begins another block.
struct Outside {
    /// Its parent, among the nodes of the page.
    node: u32,
    side: Side,
    kind: Kind,
}

impl PageDecoder {
    pub fn new() -> io::Result<Self> {
        Ok(Self {
            columns: ColumnDecoder::new()?,
            values: Vec::new(),
            preorder: Preorder::default(),
            references: Vec::new(),
            ids: Vec::new(),
            outside: Vec::new(),
            is_top: Vec::new(),
            bytes: FieldBytes::default(),
            tables: None,
            model: Model::default(),
        })
    }

    /// Reads the page that the index describes into `page`; what is in it after an error means nothing.
    ///
    /// The numbers of blocks and nodes in `entry` have been checked against its length.
    pub fn decode(
        &mut self,
        bytes: &[u8],
        number: u64,
        entry: &IndexEntry,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let mut cursor = Cursor::new(bytes, Place::Page(number));
        let mut measured = FieldBytes::default();
        let mut rest = cursor.remaining();
        let mut measure = |field: &mut u64, cursor: &Cursor<'_>| {
            *field = (rest - cursor.remaining()) as u64;
            rest = cursor.remaining();
        };
        page.clear();
        page.blocks.reserve_exact(entry.blocks as usize);
        page.nodes.reserve_exact(entry.nodes as usize);
        page.first_block = entry.first_block as u32;
        if !context.rounding.is_exact() {
            return self.compact(cursor, entry, context, page);
        }
        self.shape(&mut cursor, entry, context, page)?;
        measure(&mut measured.shape, &cursor);
        self.links(&mut cursor, context, page)?;
        measure(&mut measured.links, &cursor);
        for axis in 0..3 {
            self.position(&mut cursor, axis, page)?;
        }
        measure(&mut measured.position, &cursor);
        for axis in 0..2 {
            self.normal(&mut cursor, axis, page)?;
        }
        measure(&mut measured.normal, &cursor);
        self.bound(&mut cursor, "radius", BoundCodes::MAX.into(), page, |node| &mut node.radius)?;
        measure(&mut measured.radius, &cursor);
        self.bound(&mut cursor, "cone sine", BoundCodes::ONE.into(), page, |node| {
            &mut node.cone_sine
        })?;
        measure(&mut measured.cone, &cursor);
        self.bound(&mut cursor, "deviation", BoundCodes::MAX.into(), page, |node| {
            &mut node.deviation
        })?;
        measure(&mut measured.deviation, &cursor);
        self.order(&mut cursor, context, page)?;
        measure(&mut measured.order, &cursor);
        for which in 0..4 {
            self.adjacent(&mut cursor, which, context, page)?;
        }
        measure(&mut measured.adjacent, &cursor);
        for &attribute in &context.more {
            let before = cursor.remaining();
            let bytes = match attribute {
                MoreAttribute::Colour => {
                    self.colour(&mut cursor, page)?;
                    &mut measured.colour
                }
                unknown => {
                    skip(&mut cursor, unknown, page.nodes.len())?;
                    &mut measured.other
                }
            };
            *bytes += (before - cursor.remaining()) as u64;
        }
        cursor.finish()?;
        self.bytes = measured;
        Ok(())
    }

    fn compact(
        &mut self,
        mut cursor: Cursor<'_>,
        entry: &IndexEntry,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let length = cursor.remaining();
        let tables = self.tables.take().unwrap_or_else(Tables::new);
        let mut reader = Reader::new(&mut cursor, tables)?;
        let coded = length - cursor.remaining();
        let in_page = |message: &'static str| cursor.defect(message);

        reader.tables(SHAPE_TABLES).map_err(in_page)?;
        self.values.clear();
        let mut symbols = reader.symbols();
        let mut last = 0;
        self.values.extend((0..entry.nodes).map(|_| {
            last = symbols.symbol(shape_table(last), 0);
            u64::from(last)
        }));
        symbols.end();
        reader.mark();
        self.place(&cursor, entry, context, page)?;
        reader.tables(LINK_TABLES).map_err(in_page)?;
        for table in 0..LINK_TABLES {
            let count = self.count_links(table);
            self.values.clear();
            let mut symbols = reader.symbols();
            self.values.extend((0..count).map(|_| symbols.value(table, 0)));
            symbols.end();
            self.links_of(table, context, page)?;
        }
        reader.mark();
        let mut part = Part {
            nodes: &mut page.nodes,
            ids: &self.ids,
            blocks: &page.blocks,
            first_block: page.first_block,
            references: &self.references,
            context,
        };
        self.model.page(&mut reader, &mut part).map_err(in_page)?;
        let (marks, mut tables) = reader.finish().map_err(in_page)?;
        self.bytes = FieldBytes::from_marks(&marks, coded);
        for &attribute in &context.more {
            let before = cursor.remaining();
            let bytes = match attribute {
                MoreAttribute::Colour => {
                    let mut reader = Reader::new(&mut cursor, tables)?;
                    let in_page = |message: &'static str| cursor.defect(message);
                    page.colours.reserve_exact(entry.nodes as usize);
                    self.model.colour(&mut reader, &mut page.colours).map_err(in_page)?;
                    (_, tables) = reader.finish().map_err(in_page)?;
                    &mut self.bytes.colour
                }
                unknown => {
                    skip(&mut cursor, unknown, entry.nodes as usize)?;
                    &mut self.bytes.other
                }
            };
            *bytes += (before - cursor.remaining()) as u64;
        }
        self.tables = Some(tables);
        cursor.finish()
    }

    fn read(
        &mut self,
        cursor: &mut Cursor<'_>,
        field: &str,
        count: usize,
        max_width: u32,
    ) -> Result<(), Defect> {
        self.columns.column(cursor, field, count, max_width, &mut self.values)
    }

    /// What hangs under every node; with it the blocks, and the links inside them.
    fn shape(
        &mut self,
        cursor: &mut Cursor<'_>,
        entry: &IndexEntry,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        self.read(cursor, "shape", entry.nodes as usize, 1)?;
        self.place(cursor, entry, context, page)
    }

    /// Gives all nodes their places by their shapes.
    fn place(
        &mut self,
        cursor: &Cursor<'_>,
        entry: &IndexEntry,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let numbering = context.numbering;
        page.nodes.resize(entry.nodes as usize, Node::BLANK);
        self.references.clear();
        self.ids.clear();
        self.outside.clear();
        self.preorder.restart();
        let nodes = &mut page.nodes[..];
        for (index, &code) in (0..).zip(&self.values) {
            let shape = Shape::from_code(code)
                .ok_or_else(|| cursor.defect(format!("a node has shape {code}")))?;
            let above = self.preorder.next();
            if above.is_none() {
                if page.blocks.len() == entry.blocks as usize {
                    break;
                }
                page.blocks.push(index);
            }
            let block = page.blocks.len() as u32 - 1;
            let slot = index - page.blocks[block as usize];
            if slot >= numbering.slots() {
                break;
            }
            let id = numbering.node(BlockId::new(page.first_block + block), slot);
            self.ids.push(id);
            match above {
                Some(above) => {
                    nodes[index as usize].parent = Some(self.ids[above.node as usize]);
                    *link(&mut nodes[above.node as usize], above.side) = Some(id);
                    self.references.push(Reference { node: above.node, is_parent: true });
                }
                // Where it is not in the page, which is seen later.
                None => self.references.push(Reference { node: index, is_parent: false }),
            }
            self.outside.extend(shape.outside().map(|(side, kind)| Outside {
                node: index,
                side,
                kind,
            }));
            self.preorder.step(index, shape);
        }
        if self.ids.len() < page.nodes.len()
            || self.preorder.next().is_some()
            || page.blocks.len() != entry.blocks as usize
        {
            let message = format!(
                "shapes of {} nodes do not make {} blocks of up to {}",
                entry.nodes,
                entry.blocks,
                numbering.slots()
            );
            return Err(cursor.defect(message));
        }
        Ok(())
    }

    /// The links between blocks, and where each node is predicted from.
    fn links(
        &mut self,
        cursor: &mut Cursor<'_>,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        const NAMES: [&str; LINK_TABLES] =
            ["child in the page", "child in another page", "node above"];
        for (which, name) in NAMES.into_iter().enumerate() {
            self.read(cursor, name, self.count_links(which), 8)?;
            self.links_of(which, context, page)?;
        }
        Ok(())
    }

    /// How many links of a kind there are.
    fn count_links(&self, which: usize) -> usize {
        let children = |wanted| self.outside.iter().filter(|child| child.kind == wanted).count();
        match which {
            0 => children(Kind::Block),
            1 => children(Kind::Page),
            _ => self.is_top.iter().filter(|&&is_top| is_top).count(),
        }
    }

    /// Takes in links of a kind: to children in the page, to children in other pages, to what is above tops.
    fn links_of(
        &mut self,
        which: usize,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        match which {
            0 => self.children_in_page(context, page),
            1 => self.children_in_other_pages(context, page),
            _ => self.above_tops(context, page),
        }
    }

    fn children_in_page(&mut self, context: &PageContext, page: &mut Page) -> Result<(), Defect> {
        let numbering = context.numbering;
        let num_blocks = page.blocks.len() as u32;
        self.is_top.clear();
        self.is_top.resize(page.blocks.len(), true);
        let children = self.outside.iter().filter(|child| child.kind == Kind::Block);
        for (child, &distance) in children.zip(&self.values) {
            let parent = self.ids[child.node as usize];
            let defect = || {
                let message = "names a child block that cannot be";
                Defect::new(Place::Node(parent.get().into()), message)
            };
            let block = u64::from(numbering.block(parent).get() - page.first_block)
                .checked_add(distance)
                .and_then(|block| block.checked_add(1))
                .filter(|&block| block < u64::from(num_blocks))
                .ok_or_else(defect)? as u32;
            if !std::mem::replace(&mut self.is_top[block as usize], false) {
                return Err(defect());
            }
            let first = page.blocks[block as usize] as usize;
            *link(&mut page.nodes[child.node as usize], child.side) = Some(self.ids[first]);
            page.nodes[first].parent = Some(parent);
            self.references[first] = Reference { node: child.node, is_parent: true };
        }
        Ok(())
    }

    fn children_in_other_pages(
        &mut self,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let children = self.outside.iter().filter(|child| child.kind == Kind::Page);
        let after = i64::from(page.first_block) + page.blocks.len() as i64;
        let mut expected = after;
        for (child, &code) in children.zip(&self.values) {
            let block = expected
                .checked_add(unzigzag(code))
                .filter(|&block| block >= after && (block as u64) < context.num_blocks)
                .ok_or_else(|| {
                    let parent = self.ids[child.node as usize];
                    let message = "names a child block that cannot be";
                    Defect::new(Place::Node(parent.get().into()), message)
                })?;
            expected = block + 1;
            *link(&mut page.nodes[child.node as usize], child.side) =
                Some(context.numbering.node(BlockId::new(block as u32), 0));
        }
        Ok(())
    }

    fn above_tops(&mut self, context: &PageContext, page: &mut Page) -> Result<(), Defect> {
        let numbering = context.numbering;
        let first_id = u64::from(numbering.node(BlockId::new(page.first_block), 0).get());
        let tops = page.blocks.iter().zip(&self.is_top).filter(|&(_, &is_top)| is_top);
        let mut last_top = 0;
        for ((&first, _), &distance) in tops.zip(&self.values) {
            self.references[first as usize].node = std::mem::replace(&mut last_top, first);
            if distance == 0 {
                continue;
            }
            let parent = first_id
                .checked_sub(distance)
                .map(|id| NodeId::new(id as u32))
                .filter(|&id| numbering.slot(id) < numbering.slots())
                .ok_or_else(|| {
                    let block = numbering.block(self.ids[first as usize]);
                    Defect::new(Place::Block(block.get().into()), "hangs under no node")
                })?;
            page.nodes[first as usize].parent = Some(parent);
        }
        Ok(())
    }

    fn position(
        &mut self,
        cursor: &mut Cursor<'_>,
        axis: usize,
        page: &mut Page,
    ) -> Result<(), Defect> {
        self.read(cursor, "position", page.nodes.len(), 4)?;
        let mut finite = true;
        for (index, (&value, reference)) in self.values.iter().zip(&self.references).enumerate() {
            let predicted = page.nodes[reference.node as usize].position[axis];
            let coordinate = float_from_difference(value, predicted);
            finite &= coordinate.is_finite();
            page.nodes[index].position[axis] = coordinate;
        }
        if finite { Ok(()) } else { Err(cursor.defect("a position is not finite")) }
    }

    fn normal(
        &mut self,
        cursor: &mut Cursor<'_>,
        axis: usize,
        page: &mut Page,
    ) -> Result<(), Defect> {
        self.read(cursor, "normal", page.nodes.len(), 2)?;
        for (index, (&value, reference)) in self.values.iter().zip(&self.references).enumerate() {
            let predicted = page.nodes[reference.node as usize].normal.0[axis];
            page.nodes[index].normal.0[axis] = short_from_difference(value, predicted);
        }
        Ok(())
    }

    fn bound(
        &mut self,
        cursor: &mut Cursor<'_>,
        field: &str,
        max: u64,
        page: &mut Page,
        get: impl Fn(&mut Node) -> &mut f32,
    ) -> Result<(), Defect> {
        self.read(cursor, field, page.nodes.len(), 2)?;
        let mut largest = 0;
        for (&code, node) in self.values.iter().zip(&mut page.nodes) {
            largest = largest.max(code);
            *get(node) = BoundCodes::decode(code as u16);
        }
        if largest > max {
            return Err(cursor.defect(format!("{field} is out of range (code {largest})")));
        }
        Ok(())
    }

    fn order(
        &mut self,
        cursor: &mut Cursor<'_>,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        self.read(cursor, "order", page.nodes.len(), 8)?;
        for (index, (&value, reference)) in self.values.iter().zip(&self.references).enumerate() {
            let above = if reference.is_parent {
                u64::from(page.nodes[reference.node as usize].order)
            } else {
                context.num_nodes
            };
            page.nodes[index].order = above
                .checked_sub(value)
                .and_then(|order| order.checked_sub(1))
                .ok_or_else(|| cursor.defect("an order is below zero"))?
                as u32;
        }
        Ok(())
    }

    fn adjacent(
        &mut self,
        cursor: &mut Cursor<'_>,
        which: usize,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        self.read(cursor, "adjacent half-edge", page.nodes.len(), 8)?;
        for ((node, &id), &code) in page.nodes.iter_mut().zip(&self.ids).zip(&self.values) {
            let Some(code) = code.checked_sub(1) else { continue };
            let own = context.names.of_node(id, 0);
            // What wraps around is beyond all half-edges.
            let name = u64::from(own.get()).wrapping_add_signed(unzigzag(code));
            let half_edge = context.half_edge(name).ok_or_else(|| {
                Defect::new(Place::Node(id.get().into()), "names a half-edge that cannot be")
            })?;
            node.adjacent[which] = Some(half_edge);
        }
        Ok(())
    }

    fn colour(&mut self, cursor: &mut Cursor<'_>, page: &mut Page) -> Result<(), Defect> {
        let count = page.nodes.len();
        page.colours.reserve_exact(count);
        page.colours.resize(count, [0; 4]);
        // Differences first, and when all are there, parents before children, what they are differences of.
        for component in 0..4 {
            self.read(cursor, "colour", count, 1)?;
            for (colour, &value) in page.colours.iter_mut().zip(&self.values) {
                colour[component] = unzigzag(value) as u8;
            }
        }
        for (index, reference) in self.references.iter().enumerate() {
            let at = reference.node as usize;
            let near = if at == index { [0; 4] } else { page.colours[at] };
            let difference = page.colours[index].map(|byte| byte as i8);
            page.colours[index] = colour_from_difference(difference, near);
        }
        Ok(())
    }
}

/// Reads over an attribute that this version does not know.
fn skip(cursor: &mut Cursor<'_>, attribute: MoreAttribute, num_nodes: usize) -> Result<(), Defect> {
    match attribute {
        MoreAttribute::Columns(components) => (0..components)
            .try_for_each(|_| ColumnDecoder::skip(cursor, "unknown attribute", num_nodes)),
        MoreAttribute::Symbols(_) | MoreAttribute::Colour => skip_symbols(cursor),
    }
}

fn link(node: &mut Node, side: Side) -> &mut Option<NodeId> {
    match side {
        Side::Left => &mut node.left,
        Side::Right => &mut node.right,
    }
}
