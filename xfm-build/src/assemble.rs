//! A bucket's nodes, put in their places.

use mergetree::{BoundCodes, Colour, Node, NodeId, PackedPage};
use scratch::{Piece, Spool, Store};
use xfm_format::{BlockId, Numbering, Page};

use crate::Error;
use crate::bucket::{Above, Bucket, Placed, Side};
use crate::log::LoggedColour;
use crate::names::{NONE, to_option};

/// The nodes of a bucket, page by page, in order of their ids.
#[derive(Debug, Default)]
pub(crate) struct Assembled {
    first_block: u32,
    pages: Vec<PackedPage>,
    /// Per block where its nodes begin, in the order in which the blocks of a page came; [`NONE`] until its first one has
    /// come.
    starts: Vec<u32>,
    /// Per block the number of its nodes.
    sizes: Vec<u8>,
    nodes: Vec<Node>,
    /// Of each node, or none.
    colours: Vec<Colour>,
}

/// Colours of a spool, the first one first.
struct Front {
    spool: Spool<LoggedColour>,
    piece: Piece<LoggedColour>,
    at: usize,
}

impl Front {
    fn next(&mut self, store: &mut Store) -> Result<Option<Colour>, scratch::Error> {
        if self.at == self.piece.items().len() {
            self.spool.take_first(store, &mut self.piece)?;
            self.at = 0;
        }
        let colour = self.piece.items().get(self.at).map(|colour| colour.colour());
        self.at += usize::from(colour.is_some());
        Ok(colour)
    }
}

/// How far a page is while nodes come.
#[derive(Clone, Copy, Debug)]
struct Cursor {
    /// Blocks to come.
    blocks: u32,
    next_node: u32,
    end_node: u32,
}

/// Stands in a place that no node has come for.
const VACANT: Node = Node { order: NONE, ..Node::BLANK };

/// Takes nodes as they come, in the order of the log's end: parents before children.
struct Assembler<'a> {
    numbering: Numbering,
    into: &'a mut Assembled,
    /// Per page.
    cursors: Vec<Cursor>,
    /// Per block.
    page_of: Vec<u32>,
    placed: u64,
}

impl Assembled {
    /// Puts all of a bucket in its places, in memory that is used again from one bucket to the next.
    pub fn fill(
        &mut self,
        store: &mut Store,
        bucket: Bucket,
        numbering: Numbering,
    ) -> Result<(), Error> {
        let Bucket { nodes: mut spool, colours, first_block, pages, num_nodes, num_blocks } =
            bucket;
        self.first_block = first_block;
        self.pages = pages;
        self.starts.clear();
        self.starts.resize(num_blocks as usize, NONE);
        self.sizes.clear();
        self.sizes.resize(num_blocks as usize, 0);
        self.nodes.clear();
        self.nodes.resize(num_nodes as usize, VACANT);
        let has_colours = !colours.is_empty();
        self.colours.clear();
        self.colours.resize(if has_colours { num_nodes as usize } else { 0 }, [0; 4]);
        let mut colours = Front { spool: colours, piece: Piece::default(), at: 0 };
        let mut assembler = Assembler::new(self, numbering);
        let mut piece = Piece::default();
        while spool.take_first(store, &mut piece)? {
            for placed in piece.items() {
                let damaged = |what| Error::Damaged { order: placed.order.into(), what };
                let place = assembler.take(placed).map_err(damaged)?;
                if let (Some(place), true) = (place, has_colours) {
                    let colour = colours.next(store)?;
                    assembler.into.colours[place] =
                        colour.ok_or_else(|| damaged("a node without a colour"))?;
                }
            }
        }
        piece.clear(store);
        colours.piece.clear(store);
        if assembler.placed != u64::from(num_nodes) {
            return Err(Error::Damaged { order: 0, what: "nodes that did not come" });
        }
        Ok(())
    }

    /// Number of nodes.
    pub fn num_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Makes pages of all that is there, a few at a time.
    pub fn each_pages(
        &self,
        pages: &mut Vec<Page>,
        mut act: impl FnMut(&[Page]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for packed in self.pages.chunks(PAGES_AT_ONCE) {
            pages.resize_with(packed.len().max(pages.len()), Page::new);
            for (page, packed) in pages.iter_mut().zip(packed) {
                page.restart_at(BlockId::new(packed.first_block));
                let first = (packed.first_block - self.first_block) as usize;
                let blocks = first..first + packed.blocks as usize;
                for (&start, &size) in self.starts[blocks.clone()].iter().zip(&self.sizes[blocks]) {
                    let nodes = start as usize..start as usize + usize::from(size);
                    let colours = self.colours.get(nodes.clone()).unwrap_or_default();
                    page.push_coloured_block(&self.nodes[nodes], colours);
                }
            }
            act(&pages[..packed.len()])?;
        }
        Ok(())
    }
}

/// Pages that are handed on at once; what the plan of the memory counts with.
pub(crate) const PAGES_AT_ONCE: usize = 64;

impl<'a> Assembler<'a> {
    fn new(into: &'a mut Assembled, numbering: Numbering) -> Self {
        let mut cursors = Vec::with_capacity(into.pages.len());
        let mut page_of = Vec::with_capacity(into.starts.len());
        let mut node = 0;
        for page in &into.pages {
            page_of.extend((0..page.blocks).map(|_| cursors.len() as u32));
            let end_node = node + page.nodes;
            cursors.push(Cursor { blocks: page.blocks, next_node: node, end_node });
            node = end_node;
        }
        Self { numbering, into, cursors, page_of, placed: 0 }
    }

    /// The place of a node, if it is one and not a link.
    fn take(&mut self, placed: &Placed) -> Result<Option<usize>, &'static str> {
        let id = NodeId::new(placed.id);
        let above = placed.above.unpack().ok_or("a node under nothing")?;
        if placed.is_link() {
            self.link(id, above)?;
            return Ok(None);
        }
        let slot = self.numbering.slot(id);
        if slot == 0 {
            self.begin_block(id, placed)?;
        }
        let place = self.place(id).ok_or("a node before its block")?;
        let [left, right] = placed.inside.map(u32::from);
        let child = |nodes: u32, id: u32| (nodes > 0).then(|| NodeId::new(id));
        let [radius, cone_sine, deviation] = placed.codes.map(BoundCodes::decode);
        let node = &mut self.into.nodes[place];
        if node.order != NONE {
            return Err("two nodes in one place");
        }
        *node = Node {
            position: placed.position.into(),
            normal: placed.normal,
            radius,
            cone_sine,
            deviation,
            order: placed.order,
            adjacent: placed.adjacent.map(to_option),
            left: child(left, placed.id + 1),
            right: child(right, placed.id + 1 + left),
            parent: match above {
                Above::Root(_) => None,
                Above::Node(parent, _) => Some(parent),
            },
            slot: None,
        };
        self.placed += 1;
        if slot == 0 {
            self.link(id, above)?;
        }
        Ok(Some(place))
    }

    /// The first node of a block says how many there are.
    fn begin_block(&mut self, id: NodeId, placed: &Placed) -> Result<(), &'static str> {
        let block = self.index(id).ok_or("a node in another's bucket")?;
        let page = self.page_of.get(block).ok_or("a node in another's bucket")?;
        let cursor = &mut self.cursors[*page as usize];
        let nodes = 1 + placed.inside.iter().copied().map(u32::from).sum::<u32>();
        let end = cursor.next_node + nodes;
        if self.into.starts[block] != NONE || cursor.blocks == 0 || end > cursor.end_node {
            return Err("a block that its page has no room for");
        }
        self.into.starts[block] = cursor.next_node;
        self.into.sizes[block] = u8::try_from(nodes).map_err(|_| "a block that is too large")?;
        cursor.blocks -= 1;
        cursor.next_node = end;
        if (cursor.blocks == 0) != (end == cursor.end_node) {
            return Err("a page with other blocks than were counted");
        }
        Ok(())
    }

    /// Tells a node of its child that begins a block, where the node is in this bucket.
    fn link(&mut self, child: NodeId, above: Above) -> Result<(), &'static str> {
        let Above::Node(parent, side) = above else { return Ok(()) };
        if self.index(parent).is_none_or(|block| block >= self.into.starts.len()) {
            return Ok(());
        }
        let place = self.place(parent).ok_or("a child before its parent")?;
        let node = &mut self.into.nodes[place];
        let link = match side {
            Side::Left => &mut node.left,
            Side::Right => &mut node.right,
        };
        if node.order == NONE || link.is_some() {
            return Err("a child too many");
        }
        *link = Some(child);
        Ok(())
    }

    /// The place of a node's block among those of the bucket.
    fn index(&self, id: NodeId) -> Option<usize> {
        let block = self.numbering.block(id).get();
        block.checked_sub(self.into.first_block).map(|block| block as usize)
    }

    /// The place of a node among those of the bucket, if its block has begun.
    fn place(&self, id: NodeId) -> Option<usize> {
        let block = self.index(id)?;
        let (&start, &size) = (self.into.starts.get(block)?, self.into.sizes.get(block)?);
        let slot = self.numbering.slot(id);
        let place = start.checked_add(slot).filter(|_| slot < u32::from(size))? as usize;
        (place < self.into.nodes.len()).then_some(place)
    }
}
