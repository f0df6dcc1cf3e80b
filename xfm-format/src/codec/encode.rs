//! From a page to its bytes.

use std::io;

use mergetree::{BoundCodes, Node, NodeId};

use super::compact::{Coder, Model, Part, Symbols, Writer};
use super::shape::{Kind, Preorder, Shape, Side};
use super::{
    FieldBytes, LINK_TABLES, PageContext, Reference, SHAPE_TABLES, colour_difference, shape_table,
};
use crate::column::{ColumnEncoder, float_difference, short_difference, zigzag};
use crate::header::MAX_EXPANSION;
use crate::numbering::BlockId;
use crate::page::{Block, Page};

/// Encodes pages; holds what can be used again from one to the next.
pub(crate) struct PageEncoder {
    columns: ColumnEncoder,
    values: Vec<u64>,
    shapes: Vec<Shape>,
    preorder: Preorder,
    references: Vec<Reference>,
    /// Per block whether it hangs under none of the page.
    is_top: Vec<bool>,
    compact: Option<Box<Compact>>,
}

/// What encoding a page compactly takes.
struct Compact {
    writer: Writer,
    model: Model,
    page: Page,
    ids: Vec<NodeId>,
}

/// Why a page cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PageDefect {
    pub node: NodeId,
    pub message: &'static str,
}

impl PageEncoder {
    pub fn new() -> io::Result<Self> {
        Ok(Self {
            columns: ColumnEncoder::new()?,
            values: Vec::new(),
            shapes: Vec::new(),
            preorder: Preorder::default(),
            references: Vec::new(),
            is_top: Vec::new(),
            compact: None,
        })
    }

    /// The bytes of a page, once it is found to be one.
    pub fn encode(
        &mut self,
        page: &Page,
        context: &PageContext,
    ) -> Result<(Vec<u8>, FieldBytes), PageDefect> {
        self.arrange(page, context)?;
        check_numbers(page, context, &self.references)?;
        let num_colours = if context.has_colour() { page.nodes.len() } else { 0 };
        if page.colours.len() != num_colours {
            let node = context.numbering.node(page.first_block(), 0);
            let message = "begins a page with colours for more or fewer nodes than it has";
            return Err(PageDefect { node, message });
        }
        if !context.rounding.is_exact() {
            return self.compact(page, context);
        }
        self.columns.plain = false;
        let encoded = self.encode_once(page, context);
        // A page that shrinks beyond belief would be refused by the reader.
        if memory_of(page) <= encoded.0.len() as u64 * MAX_EXPANSION {
            return Ok(encoded);
        }
        self.columns.plain = true;
        Ok(self.encode_once(page, context))
    }

    fn compact(
        &mut self,
        page: &Page,
        context: &PageContext,
    ) -> Result<(Vec<u8>, FieldBytes), PageDefect> {
        let mut compact = self.compact.take().unwrap_or_else(|| {
            Box::new(Compact {
                writer: Writer::new(),
                model: Model::default(),
                page: Page::new(),
                ids: Vec::new(),
            })
        });
        let Compact { writer, model, page: copy, ids } = &mut *compact;
        writer.restart();
        copy.clone_from(page);
        ids.clear();
        for block in page.blocks() {
            let slots = 0..block.nodes.len() as u32;
            ids.extend(slots.map(|slot| context.numbering.node(block.id, slot)));
        }
        let mut coded = writer.tables(SHAPE_TABLES);
        let mut last = 0;
        for shape in &self.shapes {
            let code = shape.code() as u32;
            writer.symbols().symbol(shape_table(last), code);
            last = code;
        }
        writer.mark();
        coded = coded.and_then(|()| writer.tables(LINK_TABLES));
        for table in 0..LINK_TABLES {
            self.links_of(table, page, context);
            for &value in &self.values {
                writer.symbols().value(table, value);
            }
        }
        writer.mark();
        let mut part = Part {
            nodes: &mut copy.nodes,
            ids,
            blocks: &copy.blocks,
            first_block: copy.first_block,
            references: &self.references,
            context,
        };
        coded = coded.and_then(|()| model.page(writer, &mut part));
        let node = context.numbering.node(page.first_block(), 0);
        coded.map_err(|message| PageDefect { node, message })?;
        let least = memory_of(page).div_ceil(MAX_EXPANSION) as usize;
        let mut out = Vec::new();
        let marks = writer.finish(least, &mut out);
        let mut bytes = FieldBytes::from_marks(&marks, out.len());
        if context.has_colour() {
            let before = out.len();
            writer.restart();
            let coded = model.colour(writer, &mut copy.colours);
            coded.map_err(|message| PageDefect { node, message })?;
            writer.finish(0, &mut out);
            bytes.colour = (out.len() - before) as u64;
        }
        self.compact = Some(compact);
        Ok((out, bytes))
    }

    fn encode_once(&mut self, page: &Page, context: &PageContext) -> (Vec<u8>, FieldBytes) {
        let mut out = Vec::with_capacity(page.nodes.len() * 32 + 64);
        let mut bytes = FieldBytes::default();
        let mut measured = 0;
        let mut measure = |field: &mut u64, out: &Vec<u8>| {
            *field = (out.len() - measured) as u64;
            measured = out.len();
        };
        self.shape(&mut out);
        measure(&mut bytes.shape, &out);
        self.links(page, context, &mut out);
        measure(&mut bytes.links, &out);
        for axis in 0..3 {
            self.predicted(page, &mut out, 0.0, |node| node.position[axis], float_difference);
        }
        measure(&mut bytes.position, &out);
        for axis in 0..2 {
            self.predicted(page, &mut out, 0, |node| node.normal.0[axis], short_difference);
        }
        measure(&mut bytes.normal, &out);
        self.bound(page, &mut out, |node| node.radius);
        measure(&mut bytes.radius, &out);
        self.bound(page, &mut out, |node| node.cone_sine);
        measure(&mut bytes.cone, &out);
        self.bound(page, &mut out, |node| node.deviation);
        measure(&mut bytes.deviation, &out);
        self.order(page, context, &mut out);
        measure(&mut bytes.order, &out);
        for which in 0..4 {
            self.adjacent(page, context, which, &mut out);
        }
        measure(&mut bytes.adjacent, &out);
        if context.has_colour() {
            self.colour(page, &mut out);
            measure(&mut bytes.colour, &out);
        }
        (out, bytes)
    }

    /// Finds shapes, references and tops, and that every link inside the page is returned.
    fn arrange(&mut self, page: &Page, context: &PageContext) -> Result<(), PageDefect> {
        let numbering = context.numbering;
        let blocks = page.first_block..page.first_block + page.blocks.len() as u32;
        self.shapes.clear();
        self.references.clear();
        self.is_top.clear();
        self.preorder.restart();
        let (mut last_top, mut num_below, mut num_named) = (0, 0, 0);
        for block in page.blocks() {
            let begin = self.references.len() as u32;
            let first = defect_at(numbering.node(block.id, 0));
            if block.nodes.is_empty() || block.nodes.len() > numbering.slots() as usize {
                return Err(first("begins a block of no or too many nodes"));
            }
            for ((slot, index), node) in (0..).zip(begin..).zip(block.nodes) {
                let id = numbering.node(block.id, slot);
                let defect = defect_at(id);
                let kind = |child: Option<NodeId>| {
                    let Some(child) = child else { return Ok(Kind::None) };
                    let number = numbering.block(child).get();
                    if number == block.id.get() {
                        return Ok(Kind::Inside);
                    }
                    if number < block.id.get()
                        || u64::from(number) >= context.num_blocks
                        || numbering.slot(child) != 0
                    {
                        return Err(defect("has a child that cannot be"));
                    }
                    Ok(if blocks.contains(&number) { Kind::Block } else { Kind::Page })
                };
                let shape = Shape([kind(node.left)?, kind(node.right)?]);
                num_named += shape.outside().filter(|(_, kind)| *kind == Kind::Block).count();
                let above = self.preorder.next();
                if above.is_none() != (slot == 0) {
                    return Err(defect("is not in the place that its block's links give it"));
                }
                let parent = match above {
                    Some(above) => {
                        let parent = &page.nodes[above.node as usize];
                        let child =
                            if above.side == Side::Left { parent.left } else { parent.right };
                        if child != Some(id)
                            || node.parent != Some(numbering.node(block.id, above.node - begin))
                        {
                            return Err(defect(
                                "is not in the place that its block's links give it",
                            ));
                        }
                        Some(above.node)
                    }
                    None => parent_in_page(page, context, &block)?,
                };
                if slot == 0 {
                    self.is_top.push(parent.is_none());
                    num_below += usize::from(parent.is_some());
                }
                self.references.push(match parent {
                    Some(node) => Reference { node, is_parent: true },
                    None => Reference {
                        node: std::mem::replace(&mut last_top, index),
                        is_parent: false,
                    },
                });
                self.shapes.push(shape);
                self.preorder.step(index, shape);
            }
            if self.preorder.next().is_some() {
                return Err(first("begins a block that lacks a child inside it"));
            }
        }
        // Each that hangs under a node of the page is named by it; so these are all, or one is named and hangs elsewhere.
        if num_below != num_named {
            let id = numbering.node(BlockId::new(page.first_block), 0);
            return Err(defect_at(id)("begins a page with a child that does not know its parent"));
        }
        Ok(())
    }

    fn column(&mut self, out: &mut Vec<u8>, values: impl Iterator<Item = u64>) {
        self.values.clear();
        self.values.extend(values);
        self.columns.column(out, &self.values);
    }

    fn shape(&mut self, out: &mut Vec<u8>) {
        self.values.clear();
        self.values.extend(self.shapes.iter().map(|shape| shape.code()));
        self.columns.column(out, &self.values);
    }

    fn links(&mut self, page: &Page, context: &PageContext, out: &mut Vec<u8>) {
        for which in 0..LINK_TABLES {
            self.links_of(which, page, context);
            self.columns.column(out, &self.values);
        }
    }

    /// The values of one kind of links: to children in the page, to children in other pages, to what is above tops.
    fn links_of(&mut self, which: usize, page: &Page, context: &PageContext) {
        let numbering = context.numbering;
        let shapes = &self.shapes;
        let children = |wanted: Kind| {
            let nodes =
                page.blocks().flat_map(|block| block.nodes.iter().map(move |n| (block.id, n)));
            nodes.zip(shapes).flat_map(move |((block, node), shape)| {
                shape.outside().filter(move |&(_, kind)| kind == wanted).filter_map(
                    move |(side, _)| {
                        let child = if side == Side::Left { node.left } else { node.right };
                        Some((block, numbering.block(child?)))
                    },
                )
            })
        };
        self.values.clear();
        match which {
            0 => self.values.extend(
                children(Kind::Block)
                    .map(|(block, child)| u64::from(child.get() - block.get() - 1)),
            ),
            1 => {
                let mut expected = i64::from(page.first_block) + page.blocks.len() as i64;
                self.values.extend(children(Kind::Page).map(|(_, child)| {
                    let child = i64::from(child.get());
                    zigzag(child - std::mem::replace(&mut expected, child + 1))
                }));
            }
            _ => {
                let first_id = u64::from(numbering.node(page.first_block(), 0).get());
                let tops = page.blocks().zip(&self.is_top).filter(|&(_, &is_top)| is_top);
                self.values.extend(tops.map(|(block, _)| {
                    block.parent().map_or(0, |parent| first_id - u64::from(parent.get()))
                }));
            }
        }
    }

    fn predicted<T: Copy>(
        &mut self,
        page: &Page,
        out: &mut Vec<u8>,
        zero: T,
        get: impl Fn(&Node) -> T,
        difference: impl Fn(T, T) -> u64,
    ) {
        self.values.clear();
        for (index, (node, reference)) in page.nodes.iter().zip(&self.references).enumerate() {
            let at = reference.node as usize;
            let predicted = if at == index { zero } else { get(&page.nodes[at]) };
            self.values.push(difference(get(node), predicted));
        }
        self.columns.column(out, &self.values);
    }

    fn colour(&mut self, page: &Page, out: &mut Vec<u8>) {
        for component in 0..4 {
            self.values.clear();
            self.values.extend(self.references.iter().enumerate().map(|(index, reference)| {
                let at = reference.node as usize;
                let near = if at == index { [0; 4] } else { page.colours[at] };
                zigzag(colour_difference(page.colours[index], near)[component].into())
            }));
            self.columns.column(out, &self.values);
        }
    }

    fn bound(&mut self, page: &Page, out: &mut Vec<u8>, get: impl Fn(&Node) -> f32) {
        let code = |node: &Node| u64::from(BoundCodes::exact(get(node)).unwrap_or(BoundCodes::MAX));
        self.column(out, page.nodes.iter().map(code));
    }

    fn order(&mut self, page: &Page, context: &PageContext, out: &mut Vec<u8>) {
        self.values.clear();
        for (node, reference) in page.nodes.iter().zip(&self.references) {
            let above = order_above(page, context, *reference);
            self.values.push(above - 1 - u64::from(node.order));
        }
        self.columns.column(out, &self.values);
    }

    fn adjacent(&mut self, page: &Page, context: &PageContext, which: usize, out: &mut Vec<u8>) {
        self.values.clear();
        for block in page.blocks() {
            for (slot, node) in (0..).zip(block.nodes) {
                let own = context.names.of_node(context.numbering.node(block.id, slot), 0);
                self.values.push(
                    node.adjacent[which]
                        .map_or(0, |h| 1 + zigzag(i64::from(h.get()) - i64::from(own.get()))),
                );
            }
        }
        self.columns.column(out, &self.values);
    }
}

/// Bytes that a page's nodes take in memory.
fn memory_of(page: &Page) -> u64 {
    (size_of_val(&page.nodes[..]) + size_of_val(&page.colours[..])) as u64
}

fn defect_at(node: NodeId) -> impl Fn(&'static str) -> PageDefect + Copy {
    move |message| PageDefect { node, message }
}

/// The order that a node's must be below.
fn order_above(page: &Page, context: &PageContext, reference: Reference) -> u64 {
    if reference.is_parent {
        page.nodes[reference.node as usize].order.into()
    } else if context.rounding.is_exact() {
        context.num_nodes
    } else {
        u64::MAX
    }
}

/// The node that a block hangs under, among those of the page, where it names the block as its child; `None` if it is not
/// in the page.
fn parent_in_page(
    page: &Page,
    context: &PageContext,
    block: &Block<'_>,
) -> Result<Option<u32>, PageDefect> {
    let numbering = context.numbering;
    let id = numbering.node(block.id, 0);
    let defect = defect_at(id);
    let Some(parent) = block.parent() else { return Ok(None) };
    let above = numbering.block(parent);
    if above >= block.id {
        return Err(defect("hangs under a block that does not come before its own"));
    }
    let slot = numbering.slot(parent);
    let Some(index) = above.get().checked_sub(page.first_block) else {
        return if slot < numbering.slots() {
            Ok(None)
        } else {
            Err(defect("hangs under a node that cannot be"))
        };
    };
    let names_it = page
        .block(above)
        .and_then(|above| above.node(slot))
        .is_some_and(|parent| parent.children().any(|child| child == id));
    if !names_it {
        return Err(defect("hangs under a node that does not know it"));
    }
    Ok(Some(page.blocks[index as usize] + slot))
}

/// That all numbers are such as can be written.
fn check_numbers(
    page: &Page,
    context: &PageContext,
    references: &[Reference],
) -> Result<(), PageDefect> {
    let ids = page.blocks().flat_map(|block| {
        let slots = 0..block.nodes.len() as u32;
        slots.map(move |slot| context.numbering.node(block.id, slot))
    });
    for ((id, node), reference) in ids.zip(&page.nodes).zip(references) {
        let defect = defect_at(id);
        if !node.position.is_finite() {
            return Err(defect("a position that is not finite"));
        }
        if !context.rounding.is_rounded(node.position, node.normal) {
            return Err(defect("a position or normal that was not rounded"));
        }
        let bounds = [node.radius, node.cone_sine, node.deviation];
        if bounds.iter().any(|&bound| BoundCodes::exact(bound).is_none()) || node.cone_sine > 1.0 {
            return Err(defect("a radius, cone or deviation that no code stands for"));
        }
        if !context.rounding.has_bounds(node) {
            return Err(defect("a radius, cone or deviation that was not rounded"));
        }
        if node.order == u32::MAX || u64::from(node.order) >= order_above(page, context, *reference)
        {
            return Err(defect("an order that is not below its parent's and the number of nodes"));
        }
        for half_edge in node.adjacent.into_iter().flatten() {
            if context.half_edge(half_edge.get().into()).is_none() {
                return Err(defect("an adjacent half-edge that cannot be"));
            }
        }
    }
    Ok(())
}
