//! The pager itself: which blocks to load and which to let go.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

use mergetree::{BaseMesh, Node, NodeId, NodeStore, SlotId};
use xfm_format::{BlockId, Numbering, XfmFile};

use crate::cache::PageCache;
use crate::resident::Residents;
use crate::{Counters, Error, PagerOptions, PagerStats, Problem};

/// How often a page is tried again that the operating system did not give.
const ATTEMPTS: u8 = 3;
/// In place of a number of attempts: there is no use in trying again.
const DAMAGED: u8 = u8::MAX;

/// The nodes of a `.xfm` file, as many as a quota of memory holds.
///
/// A block is loaded when one of its nodes is [requested](NodeStore::request), and may go again once none of them is split
/// and none was requested or looked at for a whole frame. The blocks of the roots are always there.
///
/// The memory of [`PagerStats::resident_bytes`] never exceeds the hard quota. When it is used up by blocks in use,
/// requests are refused, and the front stays as coarse there as it is.
///
/// A page that is damaged is noted among the [problems](Self::problems), once, and its nodes are never resident. A page
/// that the operating system does not give is tried three times, in three frames.
pub struct Pager {
    file: XfmFile,
    options: PagerOptions,
    residents: Residents,
    cache: PageCache,
    /// Per page the number of attempts that failed, or [`DAMAGED`], and the frame of the last one.
    failures: Vec<(u8, u32)>,
    problems: Vec<Problem>,
    frame: Counters,
    total: Counters,
    peak_bytes: usize,
    /// Frame in which no block was found that could go; none will be before the next.
    exhausted: Option<u32>,
}

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
        let cache = PageCache::new(&file)?;
        let residents = Residents::new(file.numbering(), file.num_blocks());
        let failures = vec![(0, 0); file.num_pages()];
        let mut pager = Self {
            residents,
            cache,
            failures,
            problems: Vec::new(),
            frame: Counters::default(),
            total: Counters::default(),
            peak_bytes: 0,
            exhausted: None,
            options,
            file,
        };
        // In order, so that every page is read once.
        let roots: BTreeSet<BlockId> =
            pager.file.base().roots().map(|root| pager.numbering().block(root)).collect();
        let begin = Instant::now();
        let mut minimum = pager.resident_bytes();
        for block in roots {
            minimum += pager.load_root(block, minimum);
        }
        if minimum > options.hard_quota_bytes {
            return Err(Error::QuotaTooSmall {
                file: pager.file.path().into(),
                minimum,
                hard_quota_bytes: options.hard_quota_bytes,
            });
        }
        pager.frame.load_time += begin.elapsed();
        pager.note_peak();
        Ok(pager)
    }

    /// Loads the block of a root, if there is room; returns what it costs in any case.
    fn load_root(&mut self, block: BlockId, used: usize) -> usize {
        let Some(number) = self.file.block_page(block) else { return 0 };
        if self.is_lost(number) || self.cache.find(number).is_none() && !self.read_page(number) {
            return 0;
        }
        let Some(block) = self.cache.find(number).and_then(|page| page.block(block)) else {
            return 0;
        };
        let cost = self.residents.cost(block.nodes.len());
        if used + cost <= self.options.hard_quota_bytes {
            self.residents.insert(&block, true);
            self.frame.loads += 1;
        }
        cost
    }

    /// The file.
    pub fn file(&self) -> &XfmFile {
        &self.file
    }

    /// The options, as they are obeyed.
    pub fn options(&self) -> PagerOptions {
        self.options
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
        size_of::<Self>()
            + self.file.memory_bytes()
            + size_of_val(&self.failures[..])
            + self.residents.bytes()
            + self.cache.bytes()
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
        PagerStats {
            resident_blocks: self.residents.num_blocks(),
            resident_nodes: self.residents.num_nodes(),
            resident_bytes: self.resident_bytes(),
            used_bytes: self.used_bytes(),
            peak_bytes: self.peak_bytes,
            damaged_pages: self.problems.len(),
            frame: self.frame,
            total,
        }
    }

    /// Begins a frame: blocks that the last one did not use go until the soft quota is met.
    ///
    /// To be called before every update of the front: without frames nothing is ever removed.
    pub fn begin_frame(&mut self) {
        self.total.add(&std::mem::take(&mut self.frame));
        while self.used_bytes() > self.options.soft_quota_bytes && self.cache.shrink() {}
        let last_frame = self.residents.clock;
        let others = self.resident_bytes() - self.residents.bytes();
        let soft = self.options.soft_quota_bytes;
        let evicted = self.residents.evict(last_frame, |residents| {
            others + residents.bytes() - residents.free_bytes() > soft
        });
        self.frame.evictions += evicted as u64;
        self.residents.clock += 1;
    }

    /// Frees memory until `needed` more bytes fit under the hard quota. Returns whether they do.
    fn make_room(&mut self, needed: impl Fn(&Residents) -> usize) -> bool {
        let hard = self.options.hard_quota_bytes;
        let fits = |pager: &Self| pager.resident_bytes() + needed(&pager.residents) <= hard;
        while !fits(self) && self.cache.shrink() {}
        if fits(self) {
            return true;
        }
        let clock = self.residents.clock;
        if self.exhausted != Some(clock) {
            let others = self.resident_bytes() - self.residents.bytes();
            // What the last frame looked at may be looked at again in this one.
            let evicted = self.residents.evict(clock.saturating_sub(1), |residents| {
                others + residents.bytes() + needed(residents) > hard
            });
            self.frame.evictions += evicted as u64;
        }
        let fits = fits(self);
        if !fits {
            self.exhausted = Some(clock);
        }
        fits
    }

    /// Loads a block that is not resident. Returns whether it is now.
    fn load(&mut self, block: BlockId) -> bool {
        let Some(number) = self.file.block_page(block) else { return false };
        if self.is_lost(number) {
            return false;
        }
        let inflated = self.cache.find(number).is_some();
        if !inflated {
            // Whether the block fits shows once its page is unpacked: done only if a full one does.
            let slots = self.numbering().slots() as usize;
            if !self.make_room(|residents| residents.cost(slots)) {
                self.frame.refusals += 1;
                return false;
            }
            self.grow_cache();
            if !self.read_page(number) {
                return false;
            }
        }
        let found = self.cache.find(number).and_then(|page| page.block(block));
        let Some(num_nodes) = found.map(|block| block.nodes.len()) else { return false };
        // The page wanted was used last, and goes last.
        if !self.make_room(|residents| residents.cost(num_nodes)) {
            self.frame.refusals += 1;
            return false;
        }
        let Some(block) = self.cache.find(number).and_then(|page| page.block(block)) else {
            return false;
        };
        // A root's block comes here only when it could not be read at first.
        self.residents.insert(&block, block.parent().is_none());
        self.frame.loads += 1;
        if inflated {
            self.frame.page_hits += 1;
        } else {
            self.read_ahead(number);
        }
        self.note_peak();
        true
    }

    /// Makes room for another page where a quarter of the soft quota is not taken by pages.
    fn grow_cache(&mut self) {
        let cost = self.cache.cost();
        let pages = (self.cache.len() + 1) * cost;
        // A block of any size must still fit.
        let all = self.resident_bytes() + cost + self.residents.cost(31);
        if self.cache.len() < self.options.cached_pages
            && pages <= self.options.soft_quota_bytes / 4
            && all <= self.options.hard_quota_bytes
        {
            self.cache.grow();
        }
    }

    /// Keeps the other blocks of a page too, as long as memory is plenty: unpacking it again would cost more.
    fn read_ahead(&mut self, number: usize) {
        let plenty = self.options.soft_quota_bytes / 4 * 3;
        let others = self.resident_bytes() - self.residents.bytes();
        let Some(page) = self.cache.find(number) else { return };
        for block in page.blocks() {
            let residents = &mut self.residents;
            if residents.contains(block.id) {
                continue;
            }
            // A run of nodes that is free is in use afterwards.
            let cost = residents.cost(block.nodes.len()).max(size_of_val(block.nodes));
            if others + residents.bytes() + cost > plenty {
                break;
            }
            residents.insert(&block, block.parent().is_none());
            self.frame.read_ahead += 1;
        }
    }

    fn is_lost(&self, page: usize) -> bool {
        let (failures, frame) = self.failures[page];
        failures == DAMAGED || failures > 0 && frame == self.residents.clock
    }

    /// Reads a page into the cache; notes it when that fails for good.
    fn read_page(&mut self, number: usize) -> bool {
        self.frame.pages_inflated += 1;
        self.frame.bytes_read += self.file.page_bytes(number).unwrap_or_default();
        match self.cache.read(&self.file, number) {
            Ok(_) => true,
            Err(error) => {
                let (failures, frame) = &mut self.failures[number];
                *failures += 1;
                *frame = self.residents.clock;
                if *failures >= ATTEMPTS || !matches!(error, xfm_format::Error::Io { .. }) {
                    *failures = DAMAGED;
                    self.problems.push(Problem { page: number, error });
                }
                false
            }
        }
    }

    fn note_peak(&mut self) {
        self.peak_bytes = self.peak_bytes.max(self.resident_bytes());
    }

    /// Checks every invariant: directory, lists and counts agree, and memory is within the hard quota.
    ///
    /// # Complexity
    /// Linear in the number of blocks of the file.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn validate(&self) -> Result<(), String> {
        self.residents.validate()?;
        let (bytes, hard) = (self.resident_bytes(), self.options.hard_quota_bytes);
        if bytes.max(self.peak_bytes) > hard {
            return Err(format!("{bytes} bytes, at most {}, of {hard}", self.peak_bytes));
        }
        for root in self.file.base().roots() {
            let block = self.numbering().block(root);
            let page = self.file.block_page(block);
            let lost = page.is_none_or(|page| self.failures[page].0 > 0);
            if !self.residents.contains(block) && !lost {
                return Err(format!("the block of root {root} is not resident"));
            }
        }
        Ok(())
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

    /// Loads the node's block at once, whatever the urgency.
    fn request(&mut self, id: NodeId, _urgency: f32) -> bool {
        let block = self.numbering().block(id);
        if self.residents.contains(block) {
            self.frame.hits += 1;
        } else {
            self.frame.misses += 1;
            let begin = Instant::now();
            let loaded = self.load(block);
            self.frame.load_time += begin.elapsed();
            if !loaded {
                return false;
            }
        }
        self.residents.node(id).is_some()
    }

    fn set_slot(&mut self, id: NodeId, slot: Option<SlotId>) {
        self.residents.set_slot(id, slot);
    }
}
