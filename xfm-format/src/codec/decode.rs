//! From the bytes of a page to its blocks, trusting none of them.

use std::io;

use halfedge::HalfEdgeId;
use mergetree::{HalfEdgeName, Node};

use super::{FieldBytes, PageContext, Reference};
use crate::bounds;
use crate::column::{
    ColumnDecoder, Cursor, float_from_difference, short_from_difference, unzigzag,
};
use crate::error::{Defect, Place};
use crate::numbering::{BlockId, Numbering, slots_of};
use crate::page::{BlockEntry, Page};
use crate::sections::IndexEntry;

/// Decodes pages; holds what can be used again from one to the next.
pub(crate) struct PageDecoder {
    columns: ColumnDecoder,
    values: Vec<u64>,
    references: Vec<Reference>,
    /// Name of half-edge 0 of every node.
    own: Vec<u32>,
    /// What the fields of the last page took.
    pub bytes: FieldBytes,
}

impl PageDecoder {
    pub fn new() -> io::Result<Self> {
        Ok(Self {
            columns: ColumnDecoder::new()?,
            values: Vec::new(),
            references: Vec::new(),
            own: Vec::new(),
            bytes: FieldBytes::default(),
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
        page.blocks.clear();
        page.nodes.clear();
        page.blocks.reserve_exact(entry.blocks as usize);
        page.nodes.reserve_exact(entry.nodes as usize);
        page.first_block = entry.first_block as u32;
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
        self.bound(&mut cursor, "radius", bounds::MAX_CODE, page, |node| &mut node.radius)?;
        measure(&mut measured.radius, &cursor);
        self.bound(&mut cursor, "cone sine", bounds::ONE_CODE, page, |node| &mut node.cone_sine)?;
        measure(&mut measured.cone, &cursor);
        self.bound(&mut cursor, "deviation", bounds::MAX_CODE, page, |node| &mut node.deviation)?;
        measure(&mut measured.deviation, &cursor);
        self.order(&mut cursor, context, page)?;
        measure(&mut measured.order, &cursor);
        for which in 0..4 {
            self.adjacent(&mut cursor, which, context, page)?;
        }
        measure(&mut measured.adjacent, &cursor);
        for _ in 0..context.unknown_components {
            ColumnDecoder::skip(&mut cursor, "unknown attribute", page.nodes.len())?;
        }
        measure(&mut measured.other, &cursor);
        cursor.finish()?;
        self.bytes = measured;
        Ok(())
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

    fn shape(
        &mut self,
        cursor: &mut Cursor<'_>,
        entry: &IndexEntry,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let numbering = context.numbering;
        self.read(cursor, "presence mask", entry.blocks as usize, 4)?;
        let mut first_node = 0;
        for (index, &value) in self.values.iter().enumerate() {
            let defect = |message: &str| {
                Defect::new(Place::Block(entry.first_block + index as u64), message)
            };
            let mask = value as u32 & numbering.full_mask();
            let flag = value >> numbering.slots();
            if flag > 1 {
                return Err(defect("presence mask has bits beyond the block"));
            }
            if !slots_of(mask).all(|slot| slot == 0 || mask >> ((slot - 1) / 2) & 1 == 1)
                || mask & 1 == 0
            {
                return Err(defect("presence mask lacks the parent of a node"));
            }
            page.blocks.push(BlockEntry { mask, is_leaf: flag == 1, parent: None, first_node });
            first_node += mask.count_ones();
            if first_node > entry.nodes {
                break;
            }
        }
        if first_node != entry.nodes {
            let message = format!("presence masks have {first_node} nodes, not {}", entry.nodes);
            return Err(cursor.defect(message));
        }
        page.nodes.resize(entry.nodes as usize, Node::BLANK);
        Ok(())
    }

    fn links(
        &mut self,
        cursor: &mut Cursor<'_>,
        context: &PageContext,
        page: &mut Page,
    ) -> Result<(), Defect> {
        let numbering = context.numbering;
        let (slots, lowest) = (numbering.slots(), numbering.lowest_level());
        let first_block = page.first_block;
        self.read(cursor, "distance to parent", page.blocks.len(), 8)?;
        let distances = std::mem::take(&mut self.values);
        let num_parents = distances.iter().filter(|&&distance| distance != 0).count();
        self.read(cursor, "slot of parent", num_parents, 1)?;
        let mut parent_slots = self.values.iter();
        for (index, &distance) in distances.iter().enumerate() {
            let id = first_block + index as u32;
            let defect = |message: &str| Defect::new(Place::Block(id.into()), message);
            if distance == 0 {
                continue;
            }
            let slot = parent_slots.next().map_or(u64::MAX, |&slot| slot + u64::from(lowest));
            if distance > u64::from(id) || slot >= u64::from(slots) {
                return Err(defect("hangs under no node"));
            }
            let parent = numbering.node(BlockId::new(id - distance as u32), slot as u32);
            page.blocks[index].parent = Some(parent);
        }
        self.values = distances;

        let num_children: u32 = page
            .blocks
            .iter()
            .filter(|block| !block.is_leaf)
            .map(|block| 2 * (block.mask >> lowest).count_ones())
            .sum();
        self.read(cursor, "child", num_children as usize, 8)?;
        let mut children = self.values.iter();
        let mut expected = i64::from(first_block) + 1;
        let mut last_top = 0;
        self.references.clear();
        self.own.clear();
        for index in 0..page.blocks.len() {
            let block = page.blocks[index];
            let id = BlockId::new(first_block + index as u32);
            let defect = |message: &str| Defect::new(Place::Block(id.get().into()), message);
            let first = block.first_node;
            let mut has_child_block = false;
            for (rank, slot) in slots_of(block.mask).enumerate() {
                let parent = if slot > 0 {
                    let rank = Numbering::rank(block.mask, (slot - 1) / 2);
                    rank.map(|rank| first + rank as u32)
                } else {
                    match block.parent.filter(|&p| numbering.block(p).get() >= first_block) {
                        Some(parent) => {
                            let above =
                                page.blocks[(numbering.block(parent).get() - first_block) as usize];
                            let rank = Numbering::rank(above.mask, numbering.slot(parent))
                                .ok_or_else(|| defect("hangs under a node that is not there"))?;
                            Some(above.first_node + rank as u32)
                        }
                        None => None,
                    }
                };
                self.references.push(match parent {
                    Some(node) => Reference { node, is_parent: true },
                    None => {
                        let node = std::mem::replace(&mut last_top, first);
                        Reference { node, is_parent: false }
                    }
                });
                self.own.push(context.names.of_node(numbering.node(id, slot), 0).get());
                let node = &mut page.nodes[first as usize + rank];
                node.parent = match slot {
                    0 => block.parent,
                    slot => Some(numbering.node(id, (slot - 1) / 2)),
                };
                if slot < lowest {
                    let child =
                        |slot| Numbering::rank(block.mask, slot).map(|_| numbering.node(id, slot));
                    [node.left, node.right] = [child(2 * slot + 1), child(2 * slot + 2)];
                } else if !block.is_leaf {
                    for link in [&mut node.left, &mut node.right] {
                        let code = children.next().copied().unwrap_or(0);
                        if code == 0 {
                            continue;
                        }
                        let child = expected.checked_add(unzigzag(code - 1));
                        let child = child
                            .filter(|&child| {
                                child > i64::from(id.get()) && (child as u64) < context.num_blocks
                            })
                            .ok_or_else(|| defect("names a child block that cannot be"))?;
                        expected = child + 1;
                        *link = Some(numbering.node(BlockId::new(child as u32), 0));
                        has_child_block = true;
                    }
                }
            }
            if has_child_block == block.is_leaf {
                return Err(defect("is no leaf and has no child block"));
            }
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
            *get(node) = bounds::decode(code as u16);
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
        for ((node, &own), &code) in page.nodes.iter_mut().zip(&self.own).zip(&self.values) {
            let Some(code) = code.checked_sub(1) else { continue };
            let name = u64::from(own).wrapping_add_signed(unzigzag(code));
            // What wraps around is beyond all half-edges.
            let half_edge = context.half_edge(name).ok_or_else(|| {
                let place = match context.names.resolve(HalfEdgeId::new(own)) {
                    HalfEdgeName::Node(id, _) => Place::Node(id.get().into()),
                    HalfEdgeName::Base(_) => Place::Base,
                };
                Defect::new(place, "names a half-edge that cannot be")
            })?;
            node.adjacent[which] = Some(half_edge);
        }
        Ok(())
    }
}
