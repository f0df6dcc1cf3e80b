//! Forwards: every collapse becomes an entry of a log, with its bounds and its place among the pieces that trees are cut
//! into.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use mergetree::{
    BoundCodes, Bounded, CollapseRecord, Colour, Cut, CutRule, HalfEdgeNames, Node, OctNormal,
    OpenPiece,
};
use scratch::{CheckpointError, CheckpointReader, Scratch, Spool, Store, StoreOptions};
use xfm_format::{Numbering, Rounding, WriteOptions};

use crate::coarse::{Coarse, close};
use crate::kept::{Draft, Earlier, Keep, Kept, Known, Opened, log_error};
use crate::log::{LogEntry, LoggedChild, LoggedColour, PieceSize};
use crate::names::{CoarseMesh, MAX_VERTEX, NONE, NameBounds, from_option};
use crate::plan::{self, LinkPlan};
use crate::{CoarseProblem, Error, RecordProblem};

/// How collapses are linked.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinkOptions {
    /// How large names can be.
    pub names: NameBounds,
    /// Memory that the linker may take, its tables included, in bytes. Default 256 MiB.
    ///
    /// The tables take 36 bytes for each name of a vertex and an eighth for each of a face. A quarter of the rest is kept for
    /// what grows slowly with the number of collapses, and for the coarsest mesh; in what is left lies the log, as much of it
    /// as fits. With 64 MiB beside the tables there is room for 60 million collapses, with 256 MiB for as many as a file can
    /// have.
    pub memory_bytes: u64,
    /// The file to be written.
    pub write: WriteOptions,
    /// Whether vertices have colours: all of them or none. Default no.
    pub colours: bool,
}

impl LinkOptions {
    /// Bytes of memory that linking takes at least.
    pub fn least_memory_bytes(&self) -> u64 {
        LinkPlan::least(self.names, plan::LEAST_CHUNK_BYTES, self.colours)
    }

    /// The defaults for names below these.
    pub fn new(names: NameBounds) -> Self {
        Self { names, memory_bytes: 256 << 20, write: WriteOptions::default(), colours: false }
    }
}

/// The tree under a vertex, as far as its next collapse has to know it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Top {
    position: [f32; 3],
    normal: OctNormal,
    /// Which collapse it is.
    pub order: u32,
    codes: [u16; 3],
    /// Nodes and blocks of its page, as far as it reaches down, minus one each.
    page_nodes: u16,
    page_blocks: u16,
    /// Nodes of its block, as far as it reaches down; 0 where there is no tree.
    block_nodes: u8,
    zero: u8,
}

const _: () = assert!(size_of::<Top>() == plan::TOP_BYTES as usize);

impl Top {
    fn new(node: &Node, codes: BoundCodes, piece: OpenPiece) -> Self {
        Self {
            position: node.position.to_array(),
            normal: node.normal,
            order: node.order,
            codes: [codes.radius, codes.cone_sine, codes.deviation],
            page_nodes: (piece.page_nodes - 1) as u16,
            page_blocks: (piece.page_blocks - 1) as u16,
            block_nodes: piece.block_nodes,
            zero: 0,
        }
    }

    /// The pieces its root is in; `None` where there is no tree.
    pub fn piece(&self) -> Option<OpenPiece> {
        (self.block_nodes > 0).then(|| OpenPiece {
            block_nodes: self.block_nodes,
            page_nodes: u32::from(self.page_nodes) + 1,
            page_blocks: u32::from(self.page_blocks) + 1,
        })
    }

    /// Whether it can be the top of a tree of so many collapses, or of none.
    fn is_sound(&self, nodes: u64, rule: CutRule) -> bool {
        self.piece().is_none_or(|piece| {
            u64::from(self.order) < nodes
                && u32::from(piece.block_nodes) <= rule.block_nodes
                && piece.page_nodes <= rule.page_nodes
                && piece.page_blocks <= piece.page_nodes
                && self.codes.iter().all(|&code| code <= BoundCodes::MAX)
                && self.position.iter().all(|c| c.is_finite())
        })
    }

    fn bounded(&self) -> Bounded {
        let [radius, cone_sine, deviation] = self.codes;
        Bounded {
            position: self.position.into(),
            normal: self.normal,
            codes: BoundCodes { radius, cone_sine, deviation },
        }
    }
}

/// What has been counted of a sequence of collapses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Counts {
    pub nodes: u64,
    /// Blocks and pieces that have an end above.
    pub blocks: u64,
    pub pieces: u64,
    /// Faces that the nodes bring.
    pub faces: u64,
    pub min: Vec3,
    pub max: Vec3,
}

impl Counts {
    fn new() -> Self {
        Self {
            nodes: 0,
            blocks: 0,
            pieces: 0,
            faces: 0,
            min: Vec3::INFINITY,
            max: Vec3::NEG_INFINITY,
        }
    }

    /// The box of all positions; zeros where there are none.
    pub fn bounds(&self) -> [Vec3; 2] {
        if self.min.cmple(self.max).all() { [self.min, self.max] } else { [Vec3::ZERO; 2] }
    }

    pub fn add_position(&mut self, position: Vec3) {
        self.min = self.min.min(position);
        self.max = self.max.max(position);
    }
}

/// Links collapses into trees as they come, and writes a log of them.
///
/// Of every vertex that is there the linker knows the top of its tree: where it is, its bounds, and how much of it lies in
/// the same block and page; that is all that the next collapse into it, or of it, needs.
///
/// # Complexity
/// Time: constant per collapse. Memory: as [`LinkOptions::memory_bytes`] says. Scratch space: 60 bytes per collapse beyond
/// what fits into that memory.
#[derive(Debug)]
pub struct Linker {
    scratch: Scratch,
    write: WriteOptions,
    rounding: Rounding,
    rule: CutRule,
    numbering: Numbering,
    names: NameBounds,
    tops: Vec<Top>,
    store: Store,
    log: Spool<LogEntry>,
    sizes: Spool<PieceSize>,
    /// Beside the log, where vertices have colours.
    colours: Option<Spool<LoggedColour>>,
    counts: Counts,
    /// More blocks than these cannot be named, whatever the coarsest mesh.
    max_blocks: u64,
    /// More nodes than these are only just possible, or not any more.
    max_nodes: u64,
    plan: LinkPlan,
    /// What the one who collapses wants to have written down when the log is whole.
    notes: Vec<u8>,
    kept: Option<Kept>,
}

impl Linker {
    /// A linker with its scratch file in this folder.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tables do not fit into the memory allowed; [`Error::Format`] when an option of the file is
    /// out of its range.
    pub fn new(scratch: &Scratch, options: &LinkOptions) -> Result<Self, Error> {
        let plan = LinkPlan::new(options)?;
        let rounding = options.write.rounding()?;
        let mut store_options = StoreOptions::default();
        store_options.chunk_bytes = plan.chunk_bytes;
        store_options.memory_bytes = plan.held;
        Ok(Self::with_store(
            scratch,
            Store::new(scratch, &store_options),
            options,
            (plan, rounding),
        ))
    }

    /// A linker with a log that stays once there is a checkpoint of it or it is whole, until the file is there, so that a later
    /// run can go on with it ([`Linker::resume`], [`Linked::resume`]). None of the log lies in memory.
    ///
    /// # Errors
    /// As [`new`](Self::new), and when there is such a log already: then either go on with it or [remove](Keep::remove) it.
    pub fn new_kept(scratch: &Scratch, options: &LinkOptions, keep: &Keep) -> Result<Self, Error> {
        let plan = LinkPlan::new(options)?;
        let rounding = options.write.rounding()?;
        let store = Store::new_kept(scratch, &keep.log_name(), plan.chunk_bytes)?;
        let mut linker = Self::with_store(scratch, store, options, (plan, rounding));
        linker.kept = Some(Kept::new(scratch, keep));
        Ok(linker)
    }

    /// The linker of an earlier run with the same options, as it was at its last checkpoint, from which the one who collapses
    /// has to read what it added itself. `None` where there is nothing, or a log that is whole, which [`Linked::resume`] goes
    /// on with. All of the log is read once, so that damage is not found at the very end.
    ///
    /// # Errors
    /// [`Error::State`] when it is damaged, or about something else than `keep` and the options say; [`Error::Scratch`] when
    /// the log cannot be read, or is in use.
    pub fn resume(
        scratch: &Scratch,
        options: &LinkOptions,
        keep: &Keep,
    ) -> Result<Option<(Self, CheckpointReader)>, Error> {
        let plan = LinkPlan::new(options)?;
        let rounding = options.write.rounding()?;
        let earlier = Earlier::open(scratch, keep, &options.write)?;
        let Some(mut earlier) = earlier.filter(|earlier| !earlier.is_whole) else {
            return Ok(None);
        };
        let asked = (options.names, plan.chunk_bytes, options.colours);
        if (earlier.names, earlier.chunk_bytes, earlier.colours.is_some()) != asked {
            return Err(keep.fail(scratch, CheckpointError::Other));
        }
        let Opened { store, mut log, mut sizes, mut colours, kept } =
            earlier.open_log(scratch, keep)?;
        let mut linker = Self::with_store(scratch, store, options, (plan, rounding));
        let store = &mut linker.store;
        log.check(store)
            .and_then(|()| sizes.check(store))
            .and_then(|()| colours.as_mut().map_or(Ok(()), |colours| colours.check(store)))
            .map_err(|error| log_error(error, scratch, keep))?;
        (linker.log, linker.sizes, linker.colours) = (log, sizes, colours);
        linker.kept = Some(kept);
        linker.counts = earlier.counts;
        let (tops, nodes, rule) = (&mut linker.tops, earlier.counts.nodes, linker.rule);
        let mut read = || -> Result<(), CheckpointError> {
            let count = earlier.reader.begin::<Top>("tops", tops.len() as u64)?;
            earlier.reader.read_items(&mut tops[..count as usize])?;
            earlier.reader.end()?;
            match tops.iter().all(|top| top.is_sound(nodes, rule)) {
                true => Ok(()),
                false => Err(CheckpointError::Damaged("tops")),
            }
        };
        read().map_err(|error| keep.fail(scratch, error))?;
        Ok(Some((linker, earlier.reader)))
    }

    /// Begins a checkpoint, if the log is kept.
    pub(crate) fn checkpoint(&mut self) -> Result<Option<Draft>, Error> {
        let Some(kept) = &self.kept else { return Ok(None) };
        let known = Known {
            write: &self.write,
            names: self.names,
            counts: &self.counts,
            store: &mut self.store,
            log: &mut self.log,
            sizes: &mut self.sizes,
            colours: self.colours.as_mut(),
        };
        kept.checkpoint(known, &self.tops).map(Some)
    }

    /// What is to be written down beside the log when it is whole.
    pub(crate) fn set_notes(&mut self, notes: Vec<u8>) {
        self.notes = notes;
    }

    /// Makes sure, as far as the system tells, that the disk has room for so many collapses.
    ///
    /// # Errors
    /// [`Error::Scratch`] when it does not.
    pub fn require(&self, nodes: u64) -> Result<(), Error> {
        self.require_with(nodes, 0)
    }

    /// The same, where the one who collapses adds so much to a checkpoint.
    pub(crate) fn require_with(&self, nodes: u64, checkpoint_bytes: u64) -> Result<(), Error> {
        Ok(self.scratch.require(self.scratch_bytes_of(nodes, checkpoint_bytes))?)
    }

    fn scratch_bytes_of(&self, nodes: u64, checkpoint_bytes: u64) -> u64 {
        let is_kept = self.kept.is_some();
        let checkpoints = if is_kept {
            plan::checkpoint_bytes(self.names).saturating_add(checkpoint_bytes)
        } else {
            0
        };
        // One stays until the next is written.
        self.plan.scratch_bytes(nodes, is_kept).saturating_add(2 * checkpoints)
    }

    fn with_store(
        scratch: &Scratch,
        store: Store,
        options: &LinkOptions,
        (plan, rounding): (LinkPlan, Rounding),
    ) -> Self {
        let numbering = Numbering::new(options.write.levels);
        Self {
            scratch: scratch.clone(),
            write: options.write.clone(),
            rounding,
            rule: plan::cut_rule(&options.write),
            numbering,
            names: options.names,
            tops: vec![Top::zeroed(); options.names.vertices as usize],
            log: Spool::new(&store),
            sizes: Spool::new(&store),
            colours: options.colours.then(|| Spool::new(&store)),
            store,
            counts: Counts::new(),
            max_blocks: plan::max_blocks(HalfEdgeNames::new(0), numbering),
            max_nodes: plan.max_nodes(),
            plan,
            notes: Vec::new(),
            kept: None,
        }
    }

    /// Number of collapses so far.
    pub fn num_nodes(&self) -> u64 {
        self.counts.nodes
    }

    /// Scratch space taken so far, in bytes.
    pub fn scratch_bytes(&self) -> u64 {
        self.store.peak_file_bytes()
    }

    /// Takes the next collapse, with position and normal of the vertex that it removes.
    ///
    /// # Errors
    /// [`Error::Record`] when the collapse by itself is none; [`Error::TooLarge`] after too many, and [`Error::Memory`] after
    /// too many for the memory; [`Error::Scratch`].
    /// After an error the linker is of no use any more.
    pub fn push(
        &mut self,
        record: &CollapseRecord,
        position: Vec3,
        normal: OctNormal,
    ) -> Result<(), Error> {
        self.push_with(record, position, normal, None)
    }

    /// As [`push`](Self::push), with the colour of the vertex if vertices [have colours](LinkOptions::colours).
    ///
    /// # Errors
    /// As [`push`](Self::push); also where there is a colour and should be none, or none and should be one.
    pub fn push_with(
        &mut self,
        record: &CollapseRecord,
        position: Vec3,
        normal: OctNormal,
        colour: Option<Colour>,
    ) -> Result<(), Error> {
        let order = self.counts.nodes;
        if order >= self.max_nodes {
            self.plan.check(order + 1, 0, 0)?;
        }
        let wrong = |problem| Error::Record { order, problem };
        check_record(record, self.names).map_err(wrong)?;
        if !position.is_finite() {
            return Err(wrong(RecordProblem::NotFinite));
        }
        if colour.is_some() != self.colours.is_some() {
            return Err(wrong(RecordProblem::Colour));
        }
        let [v, u] = [record.removed.index(), record.kept.index()];
        let below = [self.tops[v], self.tops[u]];
        let pieces = below.each_ref().map(Top::piece);
        let mut node = Node {
            position,
            normal,
            radius: record.star.radius,
            cone_sine: record.star.cone_sine(),
            deviation: record.star.deviation,
            order: order as u32,
            ..Node::BLANK
        };
        let children = below.iter().zip(&pieces).filter(|(_, piece)| piece.is_some());
        if self.rounding.position(position).is_none() {
            return Err(wrong(RecordProblem::TooFar));
        }
        let codes = self
            .rounding
            .round(&mut node, children.map(|(top, _)| top.bounded()))
            .ok_or_else(|| wrong(RecordProblem::NotFinite))?;
        let Node { position, normal, .. } = node;
        let [left, right] = pieces;
        let (piece, cuts) = self.rule.join(left, right);
        let child = |i: usize| {
            let block_nodes = pieces[i]?.block_nodes;
            Some(LoggedChild { block_nodes, cut: cuts[i] })
        };
        let entry = LogEntry::new(record, position, normal, codes, [child(0), child(1)]);
        self.log.push(&mut self.store, &entry)?;
        if let (Some(colours), Some(colour)) = (&mut self.colours, colour) {
            colours.push(&mut self.store, &colour.into())?;
        }
        for (piece, cut) in pieces.into_iter().zip(cuts) {
            if let Some(piece) = piece {
                self.cut(piece, cut)?;
            }
        }
        self.tops[v] = Top::zeroed();
        self.tops[u] = Top::new(&node, codes, piece);
        self.counts.nodes += 1;
        self.counts.faces += 1 + u64::from(record.reverse.is_some());
        self.counts.add_position(position);
        Ok(())
    }

    fn cut(&mut self, piece: OpenPiece, cut: Cut) -> Result<(), Error> {
        if cut == Cut::None {
            return Ok(());
        }
        self.counts.blocks += 1;
        if self.counts.blocks >= self.max_blocks {
            return Err(Error::TooLarge { nodes: self.counts.nodes, max: self.max_blocks });
        }
        if cut == Cut::Page {
            self.counts.pieces += 1;
            self.sizes.push(&mut self.store, &piece.into())?;
        }
        Ok(())
    }

    /// Ends the sequence with the mesh that is left.
    ///
    /// # Errors
    /// [`Error::Coarse`] when it cannot be what is left; [`Error::TooLarge`]; where the log is kept also [`Error::Scratch`]
    /// and [`Error::State`].
    pub fn finish(mut self, mesh: &CoarseMesh) -> Result<Linked, Error> {
        self.plan.check(self.counts.nodes, mesh.vertices.len(), mesh.faces.len())?;
        let num_colours = if self.colours.is_some() { mesh.vertices.len() } else { 0 };
        if mesh.colours.len() != num_colours {
            return Err(Error::Coarse(CoarseProblem::Colours));
        }
        let mut coarse = close(mesh, self.names, &mut self.tops)?;
        coarse.round(self.rounding)?;
        for vertex in &coarse.base.vertices {
            self.counts.add_position(vertex.position);
        }
        let names = HalfEdgeNames::new(mesh.faces.len());
        let max = plan::max_blocks(names, self.numbering);
        self.counts.blocks += coarse.roots.len() as u64;
        self.counts.pieces += coarse.roots.len() as u64;
        if self.counts.blocks > max {
            return Err(Error::TooLarge { nodes: self.counts.nodes, max });
        }
        let mut linked = Linked {
            scratch: self.scratch,
            write: self.write,
            names: self.names,
            store: self.store,
            log: self.log,
            sizes: self.sizes,
            colours: self.colours,
            counts: self.counts,
            coarse,
            notes: self.notes,
            kept: None,
        };
        if let Some(mut kept) = self.kept {
            kept.save(&mut linked)?;
            linked.kept = Some(kept);
        }
        Ok(linked)
    }
}

/// That a collapse is one, as far as can be seen without its surroundings.
fn check_record(record: &CollapseRecord, names: NameBounds) -> Result<(), RecordProblem> {
    let is_vertex = |v: halfedge::VertexId| v.get() < names.vertices && v.get() <= MAX_VERTEX;
    let limit = 3 * u64::from(names.faces);
    let is_half_edge = |h: u32| h == NONE || u64::from(h) < limit;
    let half_edges = record.adjacent.iter().copied().chain([record.reverse]).map(from_option);
    if !(is_vertex(record.removed)
        && is_vertex(record.kept)
        && u64::from(record.half_edge.get()) < limit
        && half_edges.fold(true, |all, h| all & is_half_edge(h)))
    {
        return Err(RecordProblem::Name);
    }
    if record.removed == record.kept {
        return Err(RecordProblem::Same);
    }
    if record.reverse.is_some() != record.adjacent[2].is_some() {
        return Err(RecordProblem::SecondFace);
    }
    Ok(())
}

/// A sequence of collapses with its end: what can be numbered and written to a file.
#[derive(Debug)]
pub struct Linked {
    pub(crate) scratch: Scratch,
    pub(crate) write: WriteOptions,
    pub(crate) names: NameBounds,
    pub(crate) store: Store,
    pub(crate) log: Spool<LogEntry>,
    pub(crate) sizes: Spool<PieceSize>,
    pub(crate) colours: Option<Spool<LoggedColour>>,
    pub(crate) counts: Counts,
    pub(crate) coarse: Coarse,
    pub(crate) notes: Vec<u8>,
    /// Where the log has a name.
    pub(crate) kept: Option<Kept>,
}

impl Linked {
    /// Number of collapses.
    pub fn num_nodes(&self) -> u64 {
        self.counts.nodes
    }

    /// Number of faces of the coarsest mesh.
    pub fn num_base_faces(&self) -> u64 {
        self.coarse.base.faces.len() as u64
    }
}
