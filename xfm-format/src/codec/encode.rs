//! From a page to its bytes.

use std::io;

use mergetree::{Node, NodeId};

use super::{FieldBytes, PageContext, Reference};
use crate::bounds;
use crate::column::{ColumnEncoder, float_difference, short_difference, zigzag};
use crate::header::MAX_EXPANSION;
use crate::numbering::{Numbering, slots_of};
use crate::page::Page;

/// Encodes pages; holds what can be used again from one to the next.
pub(crate) struct PageEncoder {
    columns: ColumnEncoder,
    values: Vec<u64>,
    references: Vec<Reference>,
}

impl PageEncoder {
    pub fn new() -> io::Result<Self> {
        Ok(Self { columns: ColumnEncoder::new()?, values: Vec::new(), references: Vec::new() })
    }

    /// The bytes of a page whose bounds are already those that their codes stand for.
    pub fn encode(&mut self, page: &Page, context: &PageContext) -> (Vec<u8>, FieldBytes) {
        self.columns.plain = false;
        let encoded = self.encode_once(page, context);
        // A page that shrinks beyond belief would be refused by the reader.
        if (page.nodes.len() * size_of::<Node>()) as u64 <= encoded.0.len() as u64 * MAX_EXPANSION {
            return encoded;
        }
        self.columns.plain = true;
        self.encode_once(page, context)
    }

    fn encode_once(&mut self, page: &Page, context: &PageContext) -> (Vec<u8>, FieldBytes) {
        let mut out = Vec::with_capacity(page.nodes.len() * 32 + 64);
        let mut bytes = FieldBytes::default();
        self.find_references(page, context.numbering);
        self.shape(page, context.numbering, &mut out);
        let mut measured = 0;
        let mut measure = |field: &mut u64, out: &Vec<u8>| {
            *field = (out.len() - measured) as u64;
            measured = out.len();
        };
        measure(&mut bytes.shape, &out);
        self.links(page, context.numbering, &mut out);
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
        (out, bytes)
    }

    fn find_references(&mut self, page: &Page, numbering: Numbering) {
        self.references.clear();
        let mut last_top = 0;
        for block in page.blocks() {
            let first = self.references.len() as u32;
            for slot in slots_of(block.mask) {
                let parent = if slot > 0 {
                    Numbering::rank(block.mask, (slot - 1) / 2).map(|rank| first + rank as u32)
                } else {
                    block.parent.and_then(|parent| node_in_page(page, numbering, parent))
                };
                self.references.push(match parent {
                    Some(node) => Reference { node, is_parent: true },
                    None => Reference {
                        node: std::mem::replace(&mut last_top, first),
                        is_parent: false,
                    },
                });
            }
        }
    }

    fn column(&mut self, out: &mut Vec<u8>, values: impl Iterator<Item = u64>) {
        self.values.clear();
        self.values.extend(values);
        self.columns.column(out, &self.values);
    }

    fn shape(&mut self, page: &Page, numbering: Numbering, out: &mut Vec<u8>) {
        self.column(
            out,
            page.blocks()
                .map(|block| u64::from(block.mask) | u64::from(block.is_leaf) << numbering.slots()),
        );
    }

    fn links(&mut self, page: &Page, numbering: Numbering, out: &mut Vec<u8>) {
        let distance = |id: u32, parent: NodeId| u64::from(id - numbering.block(parent).get());
        self.column(
            out,
            page.blocks()
                .map(|block| block.parent.map_or(0, |parent| distance(block.id.get(), parent))),
        );
        self.column(
            out,
            page.blocks().filter_map(|block| {
                Some(u64::from(numbering.slot(block.parent?) - numbering.lowest_level()))
            }),
        );
        let mut expected = i64::from(page.first_block) + 1;
        let children = page.blocks().filter(|block| !block.is_leaf).flat_map(|block| {
            slots_of(block.mask)
                .filter(|&slot| slot >= numbering.lowest_level())
                .filter_map(move |slot| block.node(slot))
                .flat_map(|node| [node.left, node.right])
        });
        self.values.clear();
        for child in children {
            self.values.push(child.map_or(0, |child| {
                let child = i64::from(numbering.block(child).get());
                1 + zigzag(child - std::mem::replace(&mut expected, child + 1))
            }));
        }
        self.columns.column(out, &self.values);
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

    fn bound(&mut self, page: &Page, out: &mut Vec<u8>, get: impl Fn(&Node) -> f32) {
        let code = |node: &Node| bounds::exact_code(get(node)).map_or(bounds::MAX_CODE, u64::from);
        self.column(out, page.nodes.iter().map(code));
    }

    fn order(&mut self, page: &Page, context: &PageContext, out: &mut Vec<u8>) {
        self.values.clear();
        for (node, reference) in page.nodes.iter().zip(&self.references) {
            let above = if reference.is_parent {
                u64::from(page.nodes[reference.node as usize].order)
            } else {
                context.num_nodes
            };
            self.values.push(above - 1 - u64::from(node.order));
        }
        self.columns.column(out, &self.values);
    }

    fn adjacent(&mut self, page: &Page, context: &PageContext, which: usize, out: &mut Vec<u8>) {
        self.values.clear();
        for block in page.blocks() {
            for (slot, node) in slots_of(block.mask).zip(block.nodes) {
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

fn node_in_page(page: &Page, numbering: Numbering, id: NodeId) -> Option<u32> {
    let index = numbering.block(id).get().checked_sub(page.first_block)?;
    let block = page.blocks.get(index as usize)?;
    Some(block.first_node + Numbering::rank(block.mask, numbering.slot(id))? as u32)
}
