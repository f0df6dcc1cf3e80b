//! Backwards: from the last collapse to the first every node gets its page, block and slot, and every half-edge its name.

use bytemuck::Pod;
use halfedge::HalfEdgeId;
use mergetree::{Cut, HalfEdgeNames, NodeId, PackedPages};
use scratch::{Piece, Spool, Store, StoreOptions};
use xfm_format::{Encoding, Numbering, Totals, WriteOptions};

use crate::bucket::{Above, Buckets, PackedAbove, Placed, Side};
use crate::coarse::Coarse;
use crate::kept::Kept;
use crate::link::Linked;
use crate::log::{LogEntry, LoggedChild, LoggedColour, PieceSize};
use crate::names::NONE;
use crate::pack::{Packer, pack};
use crate::plan::{NumberLoad, NumberPlan};
use crate::progress::{Observer, Stage};
use crate::{Error, RecordProblem};

/// How nodes are numbered, and written after.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NumberOptions {
    /// Memory that may be taken from now on, with what is held of the log, in bytes. Default 256 MiB.
    pub memory_bytes: u64,
}

impl Default for NumberOptions {
    fn default() -> Self {
        Self { memory_bytes: 256 << 20 }
    }
}

/// What a vertex, seen from the end, waits for: the next collapse into it is this node.
#[derive(Clone, Copy, Debug)]
struct Expected {
    above: PackedAbove,
    /// The id of the node; [`NONE`] when it begins a block, of which the number is not known yet.
    id: u32,
    /// Which of the open pieces it is in; [`NONE`] when nothing is waited for.
    piece: u32,
    /// Levels of the tree down to the node.
    depth: u32,
}

const NOTHING: Expected = Expected { above: PackedAbove::NOTHING, id: NONE, piece: NONE, depth: 0 };

/// A piece of a tree of which nodes are still to come.
#[derive(Clone, Copy, Debug)]
struct OpenPiece {
    /// The number of the next block of it that begins.
    next_block: u32,
    /// Blocks and nodes to come.
    blocks: u32,
    nodes: u32,
    bucket: u32,
    /// Before its first block the bucket of the node that it hangs under, if there is one.
    above: u32,
    /// What pieces below it are placed under.
    draft: u32,
}

/// Where a node goes.
struct At {
    id: NodeId,
    piece: u32,
    /// Whether it is the last one of its piece.
    is_last: bool,
    bucket: u32,
    draft: u32,
    depth: u32,
}

/// Gives numbers, the last collapse first.
#[derive(Debug)]
struct Numberer<'a> {
    numbering: Numbering,
    names: HalfEdgeNames,
    max_node: u32,
    /// By name of a vertex.
    vertices: Vec<Expected>,
    /// By name of a face: the final name of the half-edge that is its first one in the file, plus the corner that is that
    /// half-edge; [`NONE`] for a face that no collapse so far, and not the coarsest mesh, has.
    faces: Vec<u32>,
    open: Vec<OpenPiece>,
    closed: Vec<u32>,
    packer: Packer,
    packed: &'a PackedPages,
    buckets: Buckets,
    sizes: Back<PieceSize>,
    /// Where vertices have some.
    colours: Option<Back<LoggedColour>>,
    coarse: &'a mut Coarse,
    /// Whether ranks are written for orders.
    has_ranks: bool,
    depth: u32,
}

/// Records of a spool, the last one first.
#[derive(Debug)]
struct Back<T> {
    spool: Spool<T>,
    piece: Piece<T>,
    left: usize,
}

impl<T: Pod> Back<T> {
    fn new(spool: Spool<T>) -> Self {
        Self { spool, piece: Piece::default(), left: 0 }
    }

    fn next(&mut self, store: &mut Store) -> Result<Option<T>, scratch::Error> {
        if self.left == 0 {
            self.spool.take_last(store, &mut self.piece)?;
            self.left = self.piece.items().len();
        }
        self.left = match self.left.checked_sub(1) {
            Some(left) => left,
            None => return Ok(None),
        };
        Ok(self.piece.items().get(self.left).copied())
    }
}

impl Numberer<'_> {
    /// Places the roots' pieces, and names the faces of the coarsest mesh.
    fn begin(&mut self) -> Result<(), Error> {
        for number in 0..self.coarse.roots.len() {
            let root = self.coarse.roots[number];
            let above = Above::Root(number as u32).pack();
            let piece = self.open_piece(0, None, root.size)?;
            let expected = Expected { above, id: NONE, piece, depth: 1 };
            match self.vertices.get_mut(root.name as usize) {
                Some(place) => *place = expected,
                None => return Err(damaged(0, "a root without a name")),
            }
        }
        for (index, name) in self.coarse.face_names.iter().enumerate() {
            match self.faces.get_mut(name.index()) {
                Some(face) => *face = 3 * index as u32,
                None => return Err(damaged(0, "a face without a name")),
            }
        }
        Ok(())
    }

    /// Gives the node of a collapse its id, and says where its children go.
    fn place(&mut self, stores: &mut Stores, order: u64, entry: &LogEntry) -> Result<(), Error> {
        let wrong = |problem| Error::Record { order, problem };
        let [removed, kept] = [entry.removed().index(), entry.kept().index()];
        let expected = match self.vertices.get(kept) {
            Some(expected) if expected.piece != NONE => *expected,
            _ => return Err(damaged(order, "a node that nothing waits for")),
        };
        let at = self.locate(stores, order, &expected)?;
        let children = entry.children().map_err(|()| damaged(order, "children that cannot be"))?;
        let inside = children.map(|child| match child {
            Some(LoggedChild { block_nodes, cut: Cut::None }) => block_nodes,
            _ => 0,
        });
        let last_slot =
            self.numbering.slot(at.id) + inside.iter().copied().map(u32::from).sum::<u32>();
        if last_slot >= self.numbering.slots() {
            return Err(damaged(order, "a block that is too large"));
        }
        let half_edge =
            entry.half_edge().ok_or_else(|| damaged(order, "a collapse of no half-edge"))?;
        let mut adjacent = [NONE; 4];
        for (name, half_edge) in adjacent.iter_mut().zip(entry.adjacent()) {
            if let Some(half_edge) = half_edge {
                let found = self.resolve(half_edge);
                *name = found.ok_or_else(|| wrong(RecordProblem::LostHalfEdge(half_edge.get())))?;
            }
        }
        let placed = Placed {
            id: at.id.get(),
            above: expected.above,
            order: if self.has_ranks && entry.rank != NONE { entry.rank } else { order as u32 },
            position: entry.position(),
            normal: entry.normal,
            codes: entry.codes,
            inside,
            adjacent,
        };
        self.buckets.push(stores.buckets(), at.bucket, &placed)?;
        if let Some(colours) = &mut self.colours {
            let colour = colours.next(stores.log())?;
            let colour = colour.ok_or_else(|| damaged(order, "a node without a colour"))?;
            self.buckets.push_colour(stores.buckets(), at.bucket, colour)?;
        }
        for (half_edge, k) in [(Some(half_edge), 0), (entry.reverse(), 3)] {
            let Some(half_edge) = half_edge else { continue };
            let name = self.names.of_node(at.id, k).get() + half_edge.corner();
            match self.faces.get_mut(half_edge.face().index()) {
                Some(face) => *face = name,
                None => return Err(wrong(RecordProblem::Name)),
            }
        }
        // The sizes of pieces come back in the order opposite to that in which they went.
        let id = at.id.get();
        let right_id = id + 1 + u32::from(inside[0]);
        let [left, right] = children;
        let right = self.expect(stores, order, &at, right, (right_id, Side::Right))?;
        let left = self.expect(stores, order, &at, left, (id + 1, Side::Left))?;
        self.vertices[kept] = right;
        match self.vertices.get_mut(removed) {
            Some(place) if place.piece == NONE => *place = left,
            _ => return Err(damaged(order, "a vertex that is removed twice")),
        }
        self.depth = self.depth.max(at.depth);
        Ok(())
    }

    /// Where a node goes that was waited for.
    fn locate(
        &mut self,
        stores: &mut Stores,
        order: u64,
        expected: &Expected,
    ) -> Result<At, Error> {
        let number = expected.piece;
        let Some(piece) = self.open.get_mut(number as usize) else {
            return Err(damaged(order, "a piece that is not open"));
        };
        let mut id = expected.id;
        if id == NONE {
            piece.blocks = match piece.blocks.checked_sub(1) {
                Some(blocks) => blocks,
                None => return Err(damaged(order, "a piece with more blocks than were counted")),
            };
            if piece.next_block > self.max_node >> self.numbering.levels() {
                return Err(damaged(order, "more blocks than were counted"));
            }
            id = piece.next_block << self.numbering.levels();
            piece.next_block += 1;
            let above = std::mem::replace(&mut piece.above, piece.bucket);
            match expected.above.unpack() {
                Some(Above::Root(root)) => self.coarse.set_root(root, NodeId::new(id)),
                Some(parent) if above != piece.bucket => {
                    let link = Placed::link(NodeId::new(id), parent);
                    self.buckets.push(stores.buckets(), above, &link)?;
                }
                _ => {}
            }
        }
        let (bucket, draft) = (piece.bucket, piece.draft);
        piece.nodes = match piece.nodes.checked_sub(1) {
            Some(nodes) => nodes,
            None => return Err(damaged(order, "a piece with more nodes than were counted")),
        };
        let is_last = piece.nodes == 0;
        if is_last {
            if piece.blocks > 0 {
                return Err(damaged(order, "a piece with fewer blocks than were counted"));
            }
            self.closed.push(number);
        }
        let id = NodeId::new(id);
        Ok(At { id, piece: number, is_last, bucket, draft, depth: expected.depth })
    }

    /// What to wait for where a child of a node is to come, which would have the given id inside the node's block.
    fn expect(
        &mut self,
        stores: &mut Stores,
        order: u64,
        parent: &At,
        child: Option<LoggedChild>,
        (inside, side): (u32, Side),
    ) -> Result<Expected, Error> {
        let Some(child) = child else { return Ok(NOTHING) };
        let above = Above::Node(parent.id, side).pack();
        let depth = parent.depth.saturating_add(1);
        let (id, piece) = match child.cut {
            Cut::None | Cut::Block if parent.is_last => {
                return Err(damaged(order, "a piece with more nodes than were counted"));
            }
            Cut::None => (inside, parent.piece),
            Cut::Block => (NONE, parent.piece),
            Cut::Page => {
                let size = self.sizes.next(stores.log())?;
                let size = size.ok_or_else(|| damaged(order, "a piece without a size"))?;
                (NONE, self.open_piece(order, Some(parent), size)?)
            }
        };
        Ok(Expected { above, id, piece, depth })
    }

    fn open_piece(
        &mut self,
        order: u64,
        parent: Option<&At>,
        size: PieceSize,
    ) -> Result<u32, Error> {
        let place = self.packer.place(order, parent.map(|parent| parent.draft), size)?;
        let block = self.packed.block(place);
        let (page, next_block) = block.ok_or_else(|| damaged(order, "a piece without a page"))?;
        let piece = OpenPiece {
            next_block,
            blocks: size.blocks,
            nodes: size.nodes,
            bucket: self.buckets.of_page(page),
            above: parent.map_or(NONE, |parent| parent.bucket),
            draft: place.draft,
        };
        Ok(match self.closed.pop() {
            Some(number) => {
                self.open[number as usize] = piece;
                number
            }
            None => {
                self.open.push(piece);
                self.open.len() as u32 - 1
            }
        })
    }

    /// The final name of a half-edge.
    #[inline]
    fn resolve(&self, half_edge: HalfEdgeId) -> Option<u32> {
        let face = *self.faces.get(half_edge.face().index())?;
        if face == NONE {
            return None;
        }
        let corner = face % 3;
        Some(face - corner + (half_edge.corner() + 3 - corner) % 3)
    }

    /// That nothing is waited for any more.
    fn check_end(&mut self, log: &mut Store, order: u64) -> Result<(), Error> {
        let sizes_end = self.sizes.next(log)?.is_none();
        self.sizes.piece.clear(log);
        let mut colours_end = true;
        if let Some(colours) = &mut self.colours {
            colours_end = colours.next(log)?.is_none();
            colours.piece.clear(log);
        }
        let all_end = sizes_end && colours_end;
        if order > 0 || self.closed.len() != self.open.len() || !all_end {
            return Err(damaged(order, "nodes that did not come"));
        }
        Ok(())
    }
}

#[cold]
pub(crate) fn damaged(order: u64, what: &'static str) -> Error {
    Error::Damaged { order, what }
}

/// Where log and buckets are: in one store, so that what is read of the log makes room for the buckets, unless the log is
/// to be kept.
#[derive(Debug)]
struct Stores {
    log: Store,
    buckets: Option<Store>,
}

impl Stores {
    fn log(&mut self) -> &mut Store {
        &mut self.log
    }

    fn buckets(&mut self) -> &mut Store {
        self.buckets.as_mut().unwrap_or(&mut self.log)
    }
}

/// A sequence of collapses whose nodes have their places in a file.
#[derive(Debug)]
pub struct Numbered {
    /// Where the buckets are.
    pub(crate) store: Store,
    pub(crate) buckets: Buckets,
    pub(crate) coarse: Coarse,
    pub(crate) totals: Totals,
    pub(crate) write: WriteOptions,
    /// The log, and what is known of it, where both are to be kept until the file is there.
    pub(crate) kept: Option<Kept>,
    log_bytes: u64,
}

impl Numbered {
    /// What the header of the file will say.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Scratch space that was taken at most, in bytes.
    pub fn scratch_bytes(&self) -> u64 {
        self.store.peak_file_bytes() + self.log_bytes
    }
}

impl Linked {
    fn load(&self) -> NumberLoad {
        NumberLoad {
            names: self.names,
            nodes: self.counts.nodes,
            page_nodes: self.write.page_nodes() as u64,
            base_vertices: self.coarse.base.vertices.len(),
            base_faces: self.coarse.base.faces.len(),
            chunk_bytes: self.store.chunk_bytes() as u64,
            held: self.store.held_bytes(),
            threads: rayon::current_num_threads() as u64,
            colours: self.colours.is_some(),
        }
    }

    /// Bytes of memory that numbering and writing take at least, with what is held of the log.
    pub fn least_memory_bytes(&self) -> u64 {
        NumberPlan::least(&self.load())
    }

    /// Gives all nodes their places in the file, going through the log once from its end.
    ///
    /// # Complexity
    /// Time linear in the number of nodes. Memory: as the options allow. Scratch space: none beyond what the log takes,
    /// because what was read makes room; 52 bytes per node beyond what fits into memory where the log is kept.
    ///
    /// # Errors
    /// [`Error::Record`] when a collapse contradicts those after it; [`Error::Memory`]; [`Error::Scratch`];
    /// [`Error::Interrupted`].
    pub fn number(
        self,
        options: &NumberOptions,
        observer: &mut Observer<'_>,
    ) -> Result<Numbered, Error> {
        let load = self.load();
        let plan = NumberPlan::new(options.memory_bytes, &load)?;
        let Self {
            scratch,
            write,
            names: bounds,
            store,
            mut log,
            sizes,
            colours,
            counts,
            mut coarse,
            kept,
            ..
        } = self;
        let mut stores = Stores { log: store, buckets: None };
        if kept.is_some() {
            let mut options = StoreOptions::default();
            options.chunk_bytes = stores.log.chunk_bytes();
            stores.buckets = Some(Store::new(&scratch, &options));
        }
        stores.buckets().set_memory_bytes(plan.held);
        let new_packer = || {
            let [piece_nodes, page_nodes] = [write.piece_nodes(), write.page_nodes()];
            Packer::new(piece_nodes as u32, page_nodes as u32, NumberPlan::max_drafts(&load))
        };
        let packed =
            pack((&log, &sizes, stores.log()), &coarse, bounds.vertices, new_packer(), observer)?;
        let num_blocks: u64 = packed.pages.iter().map(|page| u64::from(page.blocks)).sum();
        if num_blocks != counts.blocks {
            return Err(damaged(0, "more or fewer blocks than were counted"));
        }
        let num_pages = packed.pages.len() as u64;
        let numbering = Numbering::new(write.levels);
        let names = coarse.base.names();
        let mut numberer = Numberer {
            numbering,
            names,
            max_node: names.max_node().get(),
            vertices: vec![NOTHING; bounds.vertices as usize],
            faces: vec![NONE; bounds.faces as usize],
            open: Vec::new(),
            closed: Vec::new(),
            packer: new_packer(),
            packed: &packed,
            buckets: Buckets::new(stores.buckets(), numbering, &packed.pages, plan.bucket_nodes),
            sizes: Back::new(sizes),
            colours: colours.map(Back::new),
            coarse: &mut coarse,
            has_ranks: write.encoding == Encoding::Compact,
            depth: 0,
        };
        numberer.begin()?;
        let mut piece = Piece::default();
        let mut order = counts.nodes;
        while log.take_last(stores.log(), &mut piece)? {
            Stage::Number.tell(counts.nodes - order, counts.nodes, observer)?;
            for entry in piece.items().iter().rev() {
                order = order.checked_sub(1).ok_or_else(|| damaged(0, "too many entries"))?;
                numberer.place(&mut stores, order, entry)?;
            }
        }
        piece.clear(stores.log());
        numberer.check_end(stores.log(), order)?;
        let Numberer { buckets, depth, .. } = numberer;
        let totals = Totals {
            nodes: counts.nodes,
            blocks: counts.blocks,
            pages: num_pages,
            input_triangles: counts.faces + coarse.base.faces.len() as u64,
            tree_depth: depth.into(),
            bounds: counts.bounds(),
        };
        let Stores { log, buckets: own } = stores;
        let (store, log_bytes) = match own {
            Some(own) => (own, log.peak_file_bytes()),
            None => (log, 0),
        };
        Ok(Numbered { store, buckets, coarse, totals, write, kept, log_bytes })
    }
}
