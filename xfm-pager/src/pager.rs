//! The pager itself: which blocks to load and which to let go.

mod thrift;
mod validate;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use mergetree::{BaseMesh, Colour, Node, NodeId, NodeStore, SlotId};
use rustc_hash::{FxBuildHasher, FxHashSet};
use xfm_format::{BlockId, Numbering, Page, PageReader, XfmFile};

use crate::loader::{Loader, Want};
use crate::resident::Residents;
use crate::{Counters, Error, PagerOptions, PagerStats, Problem};
use thrift::Thrift;

/// How often a page is tried again that the operating system did not give.
const ATTEMPTS: u8 = 3;
/// In place of a number of attempts: there is no use in trying again.
const DAMAGED: u8 = u8::MAX;

/// The nodes of a `.xfm` file, as many as a quota of memory holds.
///
/// A block is loaded when one of its nodes is [requested](NodeStore::request), and may go again once none of them is split
/// and none was requested or looked at for a whole frame. The blocks of the roots are always there.
///
/// With [loaders](PagerOptions::loaders) a request is noted, and answered in a later frame: [`end_frame`](Self::end_frame)
/// passes on what was requested since [`begin_frame`](Self::begin_frame), which takes over what has come. What is not
/// requested again is not read any more.
///
/// The memory of [`PagerStats::resident_bytes`] never exceeds the hard quota. When it is used up by blocks in use,
/// requests are refused, and the front stays as coarse there as it is.
///
/// A page that is damaged is noted among the [problems](Self::problems), once, and its nodes are never resident. A page
/// that the operating system does not give is tried three times, in three frames.
pub struct Pager {
    file: Arc<XfmFile>,
    options: PagerOptions,
    least_quota: usize,
    residents: Residents,
    source: Source,
    /// Per page the number of attempts that failed, or [`DAMAGED`], and the frame of the last one.
    failures: Vec<(u8, u32)>,
    problems: Vec<Problem>,
    /// Blocks requested in this frame that were not there.
    requested: FxHashSet<BlockId>,
    /// Per page the urgency it was requested with in this frame, below 0 if it was not.
    urgencies: Vec<f32>,
    /// Memory that the largest page takes.
    page_bytes: usize,
    wanted: Vec<u32>,
    frame: Counters,
    total: Counters,
    peak_bytes: usize,
    /// What memory does not exceed: the hard quota; or, while that was lowered and is not met yet, what there is.
    allowed_bytes: usize,
    /// What it was nevertheless, at most.
    exceeded: Option<usize>,
    /// Frame in which no block was found that could go; none will be before the next.
    exhausted: Option<u32>,
    thrift: Thrift,
}

/// Who reads pages.
enum Source {
    Caller(Box<AtOnce>),
    Loaders(Loader),
}

/// Whoever requests a node reads its page, one at a time.
struct AtOnce {
    reader: PageReader,
    page: Page,
    /// What is in `page`.
    number: Option<usize>,
    /// Memory that all this takes at most.
    bytes: usize,
}

/// In place of an urgency: not requested.
const UNWANTED: f32 = -1.0;
/// So many blocks are asked for in a frame at most; the front asks for the most urgent first.
const MAX_REQUESTS: usize = 4096;

impl std::fmt::Debug for Pager {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pager").field("file", &self.file).field("stats", &self.stats()).finish()
    }
}

impl Pager {
    /// Opens a file and loads the blocks of its roots.
    ///
    /// # Errors
    /// [`Error::Format`] when the file cannot be read, pages excepted; [`Error::QuotaTooSmall`] when the hard quota does
    /// not hold what must always be resident.
    pub fn open(path: impl AsRef<Path>, options: PagerOptions) -> Result<Self, Error> {
        Self::new(XfmFile::open(path)?, options)
    }

    /// The same for a file that is open.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn new(file: XfmFile, mut options: PagerOptions) -> Result<Self, Error> {
        options.soft_quota_bytes = options.soft_quota_bytes.min(options.hard_quota_bytes);
        let file = Arc::new(file);
        let source = Source::Caller(Box::new(AtOnce {
            reader: file.page_reader()?,
            page: Page::new(),
            number: None,
            bytes: file.largest_page_bytes().iter().sum(),
        }));
        // Without loaders there is one at a time.
        let most_requests = if options.loaders == 0 { 1 } else { MAX_REQUESTS };
        let mut pager = Self {
            residents: Residents::new(
                file.numbering(),
                file.num_blocks(),
                file.header().has_colour(),
            ),
            source,
            failures: vec![(0, 0); file.num_pages()],
            problems: Vec::new(),
            requested: FxHashSet::with_capacity_and_hasher(most_requests, FxBuildHasher),
            urgencies: vec![UNWANTED; file.num_pages()],
            wanted: Vec::with_capacity(most_requests),
            page_bytes: file.largest_page_bytes()[0],
            least_quota: 0,
            frame: Counters::default(),
            total: Counters::default(),
            peak_bytes: 0,
            allowed_bytes: options.hard_quota_bytes,
            exceeded: None,
            exhausted: None,
            thrift: Thrift::new(),
            options,
            file,
        };
        // In order, so that every page is read once.
        let roots: BTreeSet<BlockId> =
            pager.file.base().roots().map(|root| pager.numbering().block(root)).collect();
        roots.into_iter().for_each(|block| pager.load_root(block));
        let resident = pager.resident_bytes();
        let loaders = |pages| match options.loaders {
            0 => 0,
            threads => {
                Loader::cost(&pager.file, threads, pages).saturating_sub(pager.source_bytes())
            }
        };
        let minimum = resident + loaders(pager.pages_in_flight(0));
        pager.least_quota = minimum;
        if minimum > options.hard_quota_bytes {
            return Err(Error::QuotaTooSmall {
                file: pager.file.path().into(),
                minimum,
                hard_quota_bytes: options.hard_quota_bytes,
            });
        }
        if options.loaders > 0 {
            let pages = pager.pages_in_flight(options.hard_quota_bytes - minimum);
            let loader = Loader::start(Arc::clone(&pager.file), options.loaders, pages)?;
            pager.source = Source::Loaders(loader);
        }
        pager.note_peak();
        Ok(pager)
    }

    /// Pages that loaders may hold: so many that they never wait for a frame, where a sixteenth of the memory left is
    /// enough for that.
    fn pages_in_flight(&self, left: usize) -> usize {
        let page = self.page_bytes;
        let least = self.options.loaders + 1;
        (left / 16 / page.max(1)).min(self.options.pages_per_frame).max(least)
    }

    /// Loads the block of a root.
    fn load_root(&mut self, block: BlockId) {
        let Some(number) = self.file.block_page(block) else { return };
        if self.is_lost(number) || !self.read_page(number) {
            return;
        }
        let Source::Caller(at_once) = &self.source else { return };
        if let Some(block) = at_once.page.block(block) {
            self.residents.insert(&block, true);
            self.frame.loads += 1;
        }
    }

    /// The file.
    pub fn file(&self) -> &XfmFile {
        &self.file
    }

    /// The options, as they are obeyed.
    pub fn options(&self) -> PagerOptions {
        self.options
    }

    /// Changes the quotas, from the next frame on. A hard quota below what is [held](PagerStats::held_bytes) is obeyed as
    /// soon as the front lets go.
    pub fn set_quotas(&mut self, soft_quota_bytes: usize, hard_quota_bytes: usize) {
        self.options.hard_quota_bytes = hard_quota_bytes;
        self.options.soft_quota_bytes = soft_quota_bytes.min(hard_quota_bytes);
        self.allowed_bytes = hard_quota_bytes.max(self.resident_bytes());
        self.exhausted = None;
        self.view_changed();
        let others = self.other_bytes() - self.source_bytes() + self.residents.held_bytes();
        let pages = self.pages_in_flight(hard_quota_bytes.saturating_sub(others));
        let room = hard_quota_bytes.saturating_sub(self.resident_bytes());
        if let Source::Loaders(loader) = &mut self.source {
            // What fills the memory now may go in time, but has not yet.
            let [present, page_bytes] = loader.pages();
            loader.resize(pages.min(present + room / page_bytes));
        }
        self.note_peak();
    }

    /// The least hard quota that this file can be opened with, in bytes.
    pub fn least_quota_bytes(&self) -> usize {
        self.least_quota
    }

    /// How node ids are made of block and slot.
    pub fn numbering(&self) -> Numbering {
        self.file.numbering()
    }

    /// The pages that cannot be read, each once, in order of their discovery.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// All memory the pager takes.
    ///
    /// # Units
    /// Bytes.
    pub fn resident_bytes(&self) -> usize {
        self.other_bytes() + self.residents.bytes()
    }

    /// What is not nodes and how to find them.
    fn other_bytes(&self) -> usize {
        size_of::<Self>()
            + self.file.memory_bytes()
            + size_of_val(&self.failures[..])
            + size_of_val(&self.urgencies[..])
            + self.requested.capacity() * (size_of::<BlockId>() + 2)
            + self.wanted.capacity() * size_of::<u32>()
            + self.source_bytes()
    }

    fn source_bytes(&self) -> usize {
        match &self.source {
            Source::Caller(at_once) => at_once.bytes,
            Source::Loaders(loader) => loader.bytes(),
        }
    }

    /// The blocks that are resident, in no particular order. Does not count as looking at them.
    pub fn resident_blocks(&self) -> impl Iterator<Item = BlockId> + '_ {
        self.residents.blocks()
    }

    /// The part of [`resident_bytes`](Self::resident_bytes) that is in use, which the soft quota is about. The rest will be
    /// used by more blocks, should they come.
    ///
    /// # Units
    /// Bytes.
    pub fn used_bytes(&self) -> usize {
        self.resident_bytes() - self.residents.free_bytes()
    }

    /// What the pager has and did.
    pub fn stats(&self) -> PagerStats {
        let mut total = self.total;
        total.add(&self.frame);
        let [queued, reading, done] = match &self.source {
            Source::Caller(_) => [0; 3],
            Source::Loaders(loader) => loader.queue(),
        };
        PagerStats {
            resident_blocks: self.residents.num_blocks(),
            resident_nodes: self.residents.num_nodes(),
            resident_bytes: self.resident_bytes(),
            used_bytes: self.used_bytes(),
            peak_bytes: self.peak_bytes,
            held_bytes: self.other_bytes() + self.residents.held_bytes(),
            damaged_pages: self.problems.len(),
            queued_pages: queued,
            pages_in_flight: reading + done,
            frame: self.frame,
            total,
        }
    }

    /// Begins a frame: blocks that the last one did not use go until the soft quota is met, and pages that have come are
    /// taken over.
    ///
    /// To be called before every update of the front: without frames nothing is ever removed.
    pub fn begin_frame(&mut self) {
        let begin = Instant::now();
        // What is loaded while as much goes is as good as refused.
        let in_vain = self.frame.refusals + self.frame.loads.min(self.frame.evictions);
        self.thrift.observe(self.residents.num_held_nodes(), in_vain);
        self.total.add(&std::mem::take(&mut self.frame));
        let last_frame = self.residents.clock;
        let others = self.other_bytes();
        let soft = self.options.soft_quota_bytes;
        let evicted = self.residents.evict(last_frame, |residents| {
            others + residents.bytes() - residents.free_bytes() > soft
        });
        self.frame.evictions += evicted as u64;
        self.meet_hard_quota();
        let met = self.resident_bytes().min(self.allowed_bytes);
        self.allowed_bytes = met.max(self.options.hard_quota_bytes);
        self.residents.clock += 1;
        self.take_over();
        self.requested.clear();
        self.frame.handover_time += begin.elapsed();
    }

    /// Where the quota was lowered: what is used has to be less, and in fewer chunks of memory. While the front holds too much,
    /// moving the rest would be of no use.
    fn meet_hard_quota(&mut self) {
        let hard = self.options.hard_quota_bytes;
        let (mut enough, clock) = (hard, self.residents.clock);
        // Chunks may keep holes, and then fewer blocks fit than there should.
        for _ in 0..2 {
            if self.resident_bytes() <= hard {
                return;
            }
            let others = self.other_bytes();
            let evicted = self.residents.evict(clock, |residents| {
                others + residents.bytes() - residents.free_bytes() > enough
            });
            self.frame.evictions += evicted as u64;
            if self.used_bytes() > hard {
                return;
            }
            self.residents.compact();
            let excess = self.resident_bytes().saturating_sub(hard);
            enough = self.used_bytes().saturating_sub(2 * excess);
        }
    }

    /// Ends a frame: what was requested in it goes to the loaders, in place of what the last one requested.
    ///
    /// To be called after every update of the front. Without loaders there is nothing to do.
    pub fn end_frame(&mut self) {
        let urgencies = &mut self.urgencies;
        let wants = self.wanted.drain(..).map(|page| {
            let urgency = std::mem::replace(&mut urgencies[page as usize], UNWANTED);
            Want { page, urgency }
        });
        if let Source::Loaders(loader) = &self.source {
            loader.ask(wants.collect());
        }
    }

    /// Tells that what is wanted has changed: where memory was used up and loading of no use, it may be now.
    pub fn view_changed(&mut self) {
        self.thrift = Thrift::new();
    }

    /// Waits until a page has come that was asked for, nothing is asked for any more, or the time is over.
    pub fn wait(&self, most: Duration) {
        if let Source::Loaders(loader) = &self.source {
            loader.wait(most);
        }
    }

    /// Whether nothing that was asked for is still to come.
    pub fn is_idle(&self) -> bool {
        match &self.source {
            Source::Caller(_) => true,
            Source::Loaders(loader) => loader.queue() == [0; 3],
        }
    }

    /// Takes over what the loaders have read.
    fn take_over(&mut self) {
        let Source::Loaders(loader) = &self.source else { return };
        let mut loaded = loader.take(self.options.pages_per_frame);
        for loaded in &mut loaded {
            self.frame.load_time += loaded.time;
            self.count_read(loaded.number);
            match loaded.error.take() {
                None => self.keep_blocks(&loaded.page),
                Some(error) => self.note_failure(loaded.number, error),
            }
        }
        if let Source::Loaders(loader) = &self.source {
            loader.recycle(loaded);
        }
        self.note_peak();
    }

    /// Keeps the blocks of a page that were requested, as far as there is room for them, and the others while memory is
    /// plenty: unpacking the page again would cost more.
    fn keep_blocks(&mut self, page: &Page) {
        for block in page.blocks() {
            if self.requested.contains(&block.id) && !self.residents.contains(block.id) {
                let num_nodes = block.nodes.len();
                if self.make_room(num_nodes) {
                    // A root's block comes here only when it could not be read at first.
                    self.residents.insert(&block, block.parent().is_none());
                    self.frame.loads += 1;
                } else {
                    self.frame.refusals += 1;
                }
            }
        }
        self.read_ahead(page);
    }

    fn read_ahead(&mut self, page: &Page) {
        let plenty = self.options.soft_quota_bytes / 4 * 3;
        let others = self.other_bytes();
        for block in page.blocks() {
            let residents = &mut self.residents;
            if residents.contains(block.id) {
                continue;
            }
            // A run of nodes that is free is in use afterwards.
            let bytes = size_of_val(block.nodes) + size_of_val(block.colours);
            let cost = residents.cost(block.nodes.len()).max(bytes);
            if others + residents.bytes() + cost > plenty {
                break;
            }
            residents.insert(&block, block.parent().is_none());
            self.frame.read_ahead += 1;
        }
    }

    /// Frees memory until a block of so many nodes fits under the hard quota. Returns whether it does.
    fn make_room(&mut self, num_nodes: usize) -> bool {
        let hard = self.options.hard_quota_bytes;
        let others = self.other_bytes();
        let fits =
            |residents: &Residents| others + residents.bytes() + residents.cost(num_nodes) <= hard;
        if fits(&self.residents) {
            return true;
        }
        let clock = self.residents.clock;
        if self.exhausted != Some(clock) {
            // What the last frame looked at may be looked at again in this one.
            let evicted =
                self.residents.evict(clock.saturating_sub(1), |residents| !fits(residents));
            self.frame.evictions += evicted as u64;
        }
        let fits = fits(&self.residents);
        if !fits {
            self.exhausted = Some(clock);
        }
        fits
    }

    /// Loads a block that is not resident, or notes that it is wanted. Returns whether it is resident now.
    fn load(&mut self, block: BlockId, urgency: f32) -> bool {
        let Some(number) = self.file.block_page(block) else { return false };
        if self.is_lost(number) {
            return false;
        }
        // Whether the block fits shows once its page is unpacked: done only if a full one does.
        let slots = self.numbering().slots() as usize;
        if self.thrift.is_stopped || !self.make_room(slots) {
            self.frame.refusals += 1;
            return false;
        }
        if self.requested.len() == MAX_REQUESTS {
            return false;
        }
        self.requested.insert(block);
        if let Source::Loaders(_) = &self.source {
            let noted = &mut self.urgencies[number];
            if *noted == UNWANTED {
                self.wanted.push(number as u32);
            }
            *noted = noted.max(urgency.max(0.0));
            return false;
        }
        if !self.read_page(number) {
            return false;
        }
        let begin = Instant::now();
        let Source::Caller(at_once) = &mut self.source else { return false };
        let page = std::mem::take(&mut at_once.page);
        self.keep_blocks(&page);
        if let Source::Caller(at_once) = &mut self.source {
            at_once.page = page;
        }
        self.requested.clear();
        self.note_peak();
        self.frame.handover_time += begin.elapsed();
        self.residents.contains(block)
    }

    /// A node, if it is resident; does not count as looking at it.
    pub(crate) fn peek(&self, id: NodeId) -> Option<&Node> {
        self.residents.peek(id)
    }

    /// Number of nodes that are split, counted anew.
    pub(crate) fn num_split(&self) -> usize {
        self.residents.num_split()
    }

    fn is_lost(&self, page: usize) -> bool {
        let (failures, frame) = self.failures[page];
        failures == DAMAGED || failures > 0 && frame == self.residents.clock
    }

    /// Reads a page on this thread, unless it is the one read last; notes it when that fails for good.
    fn read_page(&mut self, wanted: usize) -> bool {
        let Source::Caller(at_once) = &mut self.source else { return false };
        let AtOnce { reader, page, number, .. } = &mut **at_once;
        if *number == Some(wanted) {
            return true;
        }
        let begin = Instant::now();
        let result = self.file.read_page_into(wanted, reader, page);
        *number = result.is_ok().then_some(wanted);
        self.frame.load_time += begin.elapsed();
        self.count_read(wanted);
        result.map_err(|error| self.note_failure(wanted, error)).is_ok()
    }

    fn count_read(&mut self, page: usize) {
        self.frame.pages_inflated += 1;
        self.frame.bytes_read += self.file.page_bytes(page).unwrap_or_default();
    }

    fn note_failure(&mut self, page: usize, error: xfm_format::Error) {
        let (failures, frame) = &mut self.failures[page];
        *failures += 1;
        *frame = self.residents.clock;
        if *failures >= ATTEMPTS || !matches!(error, xfm_format::Error::Io { .. }) {
            *failures = DAMAGED;
            self.problems.push(Problem { page, error });
        }
    }

    fn note_peak(&mut self) {
        let bytes = self.resident_bytes();
        self.peak_bytes = self.peak_bytes.max(bytes);
        if bytes > self.allowed_bytes {
            self.exceeded = self.exceeded.max(Some(bytes));
        }
    }
}

impl NodeStore for Pager {
    fn base(&self) -> &BaseMesh {
        self.file.base()
    }

    #[inline]
    fn node(&self, id: NodeId) -> Option<&Node> {
        self.residents.node(id)
    }

    fn colour(&self, id: NodeId) -> Option<Colour> {
        self.residents.colour(id)
    }

    /// Without loaders reads the node's block at once, whatever the urgency; with them notes that it is wanted.
    fn request(&mut self, id: NodeId, urgency: f32) -> bool {
        let block = self.numbering().block(id);
        if self.residents.contains(block) {
            self.frame.hits += 1;
        } else {
            self.frame.misses += 1;
            if !self.load(block, urgency) {
                return false;
            }
        }
        self.residents.node(id).is_some()
    }

    fn is_lost(&self, id: NodeId) -> bool {
        if self.problems.is_empty() || self.residents.node(id).is_some() {
            return false;
        }
        let page = self.file.block_page(self.numbering().block(id));
        page.is_none_or(|page| self.failures[page].0 == DAMAGED)
    }

    fn set_slot(&mut self, id: NodeId, slot: Option<SlotId>) {
        self.residents.set_slot(id, slot);
    }
}
