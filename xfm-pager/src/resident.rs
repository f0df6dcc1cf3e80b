//! The blocks in memory: found by their number in constant time, removed in order of their last use.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use mergetree::{Colour, Node, NodeId, SlotId};
use xfm_format::{Block, BlockId, Numbering};

use crate::arena::Arena;
use crate::directory::Directory;

const NONE: u32 = u32::MAX;

/// A block in memory.
#[derive(Debug)]
struct Resident {
    /// Where its nodes are in the arena.
    nodes: u32,
    block: u32,
    /// Frame in which it was last looked at. Set through a shared reference, hence atomic.
    last_used: AtomicU32,
    /// Frame in which it got its place in the list.
    listed: u32,
    /// Neighbours in the list of blocks that may go; for a free entry `next` is the next free one.
    prev: u32,
    next: u32,
    /// 0 for an entry that is free.
    num_nodes: u8,
    num_split: u8,
    /// Holds a root and never goes.
    pinned: bool,
}

const _: () = assert!(size_of::<Resident>() == 28);

impl Resident {
    /// Where a node of the block is in the arena, if there is one in this slot.
    #[inline]
    fn place(&self, slot: u32) -> Option<u32> {
        (slot < u32::from(self.num_nodes)).then_some(self.nodes + slot)
    }
}

/// The blocks in memory.
///
/// Blocks that may go, none of whose nodes is split, form a list in order of their last use. Merely looking at a block
/// does not move it; it is given its new place, at the end, when its turn would have come ("second chance").
#[derive(Debug)]
pub(crate) struct Residents {
    numbering: Numbering,
    directory: Directory,
    entries: Vec<Resident>,
    arena: Arena,
    free: u32,
    oldest: u32,
    newest: u32,
    num_listed: usize,
    num_listed_nodes: usize,
    num_blocks: usize,
    num_nodes: usize,
    /// The present frame.
    pub clock: u32,
}

impl Residents {
    /// None yet, of a file whose nodes have colours or not.
    pub fn new(numbering: Numbering, num_blocks: usize, has_colours: bool) -> Self {
        Self {
            numbering,
            directory: Directory::new(num_blocks),
            entries: Vec::new(),
            arena: Arena::new(has_colours),
            free: NONE,
            oldest: NONE,
            newest: NONE,
            num_listed: 0,
            num_listed_nodes: 0,
            num_blocks: 0,
            num_nodes: 0,
            clock: 0,
        }
    }

    pub fn num_blocks(&self) -> usize {
        self.num_blocks
    }

    pub fn num_nodes(&self) -> usize {
        self.num_nodes
    }

    /// The blocks in memory.
    pub fn blocks(&self) -> impl Iterator<Item = BlockId> + '_ {
        let present = self.entries.iter().filter(|resident| resident.num_nodes != 0);
        present.map(|resident| BlockId::new(resident.block))
    }

    /// Memory taken.
    pub fn bytes(&self) -> usize {
        self.directory.bytes()
            + self.entries.capacity() * size_of::<Resident>()
            + self.arena.bytes()
    }

    /// The part of [`bytes`](Self::bytes) that will be used by more blocks, should they come.
    pub fn free_bytes(&self) -> usize {
        let free = self.entries.capacity() - self.num_blocks;
        free * size_of::<Resident>() + self.arena.free_bytes()
    }

    /// Nodes in blocks that must not go.
    pub fn num_held_nodes(&self) -> usize {
        self.num_nodes - self.num_listed_nodes
    }

    /// The part of [`bytes`](Self::bytes) that is in blocks that must not go: those with a split node, and those of roots.
    pub fn held_bytes(&self) -> usize {
        let nodes = self.num_held_nodes();
        let blocks = self.num_blocks - self.num_listed;
        self.directory.bytes() + nodes * self.arena.node_bytes() + blocks * size_of::<Resident>()
    }

    /// Memory that a block of so many nodes would take more.
    pub fn cost(&self, num_nodes: usize) -> usize {
        let entries = if self.is_full() { self.growth() * size_of::<Resident>() } else { 0 };
        entries + Directory::cost() + self.arena.cost(num_nodes)
    }

    fn is_full(&self) -> bool {
        self.free == NONE && self.entries.len() == self.entries.capacity()
    }

    fn growth(&self) -> usize {
        (self.entries.len() / 8).max(32)
    }

    pub fn contains(&self, block: BlockId) -> bool {
        self.directory.get(block.index()).is_some()
    }

    /// The node, if it is in memory.
    #[inline]
    pub fn node(&self, id: NodeId) -> Option<&Node> {
        let entry = self.directory.get(self.numbering.block(id).index())?;
        let resident = self.entries.get(entry as usize)?;
        if resident.last_used.load(Relaxed) != self.clock {
            resident.last_used.store(self.clock, Relaxed);
        }
        self.arena.get(resident.place(self.numbering.slot(id))?)
    }

    /// The same without counting as use.
    pub fn peek(&self, id: NodeId) -> Option<&Node> {
        let entry = self.directory.get(self.numbering.block(id).index())?;
        self.arena.get(self.entries.get(entry as usize)?.place(self.numbering.slot(id))?)
    }

    /// Number of nodes that are split.
    ///
    /// # Complexity
    /// Linear in the number of blocks.
    pub fn num_split(&self) -> usize {
        let present = self.entries.iter().filter(|resident| resident.num_nodes != 0);
        present.map(|resident| usize::from(resident.num_split)).sum()
    }

    /// The colour of a node, if it is in memory and has one.
    pub fn colour(&self, id: NodeId) -> Option<Colour> {
        let entry = self.directory.get(self.numbering.block(id).index())?;
        let place = self.entries.get(entry as usize)?.place(self.numbering.slot(id))?;
        self.arena.colours(place, 1).first().copied()
    }

    /// Takes a block that is not in memory yet. A pinned one stays.
    pub fn insert(&mut self, block: &Block<'_>, pinned: bool) {
        assert!(!self.contains(block.id), "block {} is already resident", block.id);
        if self.is_full() {
            self.entries.reserve_exact(self.growth());
        }
        let resident = Resident {
            nodes: self.arena.insert(block.nodes, block.colours),
            block: block.id.get(),
            last_used: AtomicU32::new(self.clock),
            listed: self.clock,
            prev: NONE,
            next: NONE,
            num_nodes: block.nodes.len() as u8,
            num_split: 0,
            pinned,
        };
        let entry = if self.free == NONE {
            self.entries.push(resident);
            self.entries.len() as u32 - 1
        } else {
            let entry = self.free;
            self.free = self.entries[entry as usize].next;
            self.entries[entry as usize] = resident;
            entry
        };
        self.directory.insert(block.id.index(), entry);
        self.num_blocks += 1;
        self.num_nodes += block.nodes.len();
        if !pinned {
            self.list(entry);
        }
    }

    /// Notes whether a node is split.
    pub fn set_slot(&mut self, id: NodeId, slot: Option<SlotId>) {
        let entry = self.directory.get(self.numbering.block(id).index());
        let entry = entry.unwrap_or_else(|| panic!("node {id} is not resident"));
        let resident = &mut self.entries[entry as usize];
        let node = resident
            .place(self.numbering.slot(id))
            .and_then(|place| self.arena.get_mut(place))
            .unwrap_or_else(|| panic!("node {id} is not resident"));
        let was_split = std::mem::replace(&mut node.slot, slot).is_some();
        resident.last_used.store(self.clock, Relaxed);
        let before = resident.num_split;
        resident.num_split = before + u8::from(slot.is_some()) - u8::from(was_split);
        let (now, pinned) = (resident.num_split, resident.pinned);
        if !pinned {
            match (before, now) {
                (0, 1) => self.unlist(entry),
                (1, 0) => self.list(entry),
                _ => {}
            }
        }
    }

    /// Removes blocks last used before the frame `before`, the oldest first, while `more` says so. Returns how many.
    pub fn evict(&mut self, before: u32, more: impl Fn(&Self) -> bool) -> usize {
        let mut evicted = 0;
        // Twice: those that were looked at get their new place the first time.
        for _ in 0..2 * self.num_listed {
            if self.oldest == NONE || !more(self) {
                break;
            }
            let entry = self.oldest;
            self.unlist(entry);
            let resident = &self.entries[entry as usize];
            let last_used = resident.last_used.load(Relaxed);
            if last_used > resident.listed || last_used >= before {
                self.list(entry);
                continue;
            }
            self.remove(entry);
            evicted += 1;
        }
        evicted
    }

    /// Moves blocks from the last chunks of memory into holes of the first ones, so that chunks become free, and gives back what
    /// tables have room for and is not there.
    ///
    /// # Complexity
    /// Linear in the number of blocks, but for a sort.
    pub fn compact(&mut self) {
        let live = (0..self.entries.len() as u32)
            .filter(|&entry| self.entries[entry as usize].num_nodes > 0);
        let mut entries: Vec<u32> = live.collect();
        entries
            .sort_unstable_by_key(|&entry| std::cmp::Reverse(self.entries[entry as usize].nodes));
        let mut nodes = Vec::new();
        for entry in entries {
            let resident = &mut self.entries[entry as usize];
            let (place, count) = (resident.nodes, usize::from(resident.num_nodes));
            nodes.clear();
            nodes.extend((place..).take(count).filter_map(|place| self.arena.get(place)).copied());
            let colours = self.arena.colours(place, count).to_vec();
            if let Some(before) = self.arena.insert_before(place, &nodes, &colours) {
                self.arena.remove(place, count);
                resident.nodes = before;
            }
        }
        self.arena.shrink();
        self.shrink_entries();
    }

    /// Closes the gaps between entries and gives back what is free.
    fn shrink_entries(&mut self) {
        let mut new = vec![NONE; self.entries.len()];
        let mut live = 0;
        for (entry, new) in self.entries.iter().zip(&mut new) {
            if entry.num_nodes > 0 {
                *new = live;
                live += 1;
            }
        }
        let renamed = |entry: u32| new.get(entry as usize).copied().unwrap_or(NONE);
        self.entries.retain_mut(|entry| {
            entry.prev = renamed(entry.prev);
            entry.next = renamed(entry.next);
            entry.num_nodes > 0
        });
        self.entries.shrink_to_fit();
        for (place, entry) in (0..).zip(&self.entries) {
            self.directory.replace(entry.block as usize, place);
        }
        self.oldest = renamed(self.oldest);
        self.newest = renamed(self.newest);
        self.free = NONE;
    }

    fn remove(&mut self, entry: u32) {
        let resident = &mut self.entries[entry as usize];
        let num_nodes = usize::from(std::mem::take(&mut resident.num_nodes));
        self.arena.remove(resident.nodes, num_nodes);
        self.num_nodes -= num_nodes;
        self.num_blocks -= 1;
        self.directory.remove(resident.block as usize);
        resident.next = self.free;
        self.free = entry;
    }

    /// Appends to the list of blocks that may go.
    fn list(&mut self, entry: u32) {
        let resident = &mut self.entries[entry as usize];
        resident.listed = *resident.last_used.get_mut();
        resident.prev = self.newest;
        resident.next = NONE;
        match self.newest {
            NONE => self.oldest = entry,
            newest => self.entries[newest as usize].next = entry,
        }
        self.newest = entry;
        self.num_listed += 1;
        self.num_listed_nodes += usize::from(self.entries[entry as usize].num_nodes);
    }

    fn unlist(&mut self, entry: u32) {
        let Resident { prev, next, .. } = self.entries[entry as usize];
        match prev {
            NONE => self.oldest = next,
            prev => self.entries[prev as usize].next = next,
        }
        match next {
            NONE => self.newest = prev,
            next => self.entries[next as usize].prev = prev,
        }
        self.num_listed -= 1;
        self.num_listed_nodes -= usize::from(self.entries[entry as usize].num_nodes);
    }

    /// Checks that directory, entries, list and counts agree.
    pub fn validate(&self) -> Result<(), String> {
        self.arena.validate()?;
        let mut num_nodes = 0;
        let mut num_listed = 0;
        let mut num_listed_nodes = 0;
        let mut num_blocks = 0;
        for (index, resident) in self.entries.iter().enumerate() {
            if resident.num_nodes == 0 {
                continue;
            }
            let count = usize::from(resident.num_nodes);
            num_blocks += 1;
            num_nodes += count;
            if self.directory.get(resident.block as usize) != Some(index as u32) {
                return Err(format!("the directory does not lead to block {}", resident.block));
            }
            let slots = 0..u32::from(resident.num_nodes);
            let nodes = slots.filter_map(|slot| self.arena.get(resident.place(slot)?));
            let num_split = nodes.filter(|node| node.slot.is_some()).count();
            if num_split != usize::from(resident.num_split) {
                return Err(format!("block {} counts its split nodes wrongly", resident.block));
            }
            let is_listed = num_split == 0 && !resident.pinned;
            num_listed += usize::from(is_listed);
            num_listed_nodes += if is_listed { count } else { 0 };
        }
        let in_directory = self.directory.count()?;
        if (num_blocks, num_blocks, num_nodes) != (self.num_blocks, in_directory, self.num_nodes) {
            return Err("the counts of blocks and nodes are wrong".into());
        }
        let (mut entry, mut prev, mut walked) = (self.oldest, NONE, 0);
        while entry != NONE && walked <= num_listed {
            let resident = &self.entries[entry as usize];
            if resident.prev != prev || resident.num_nodes == 0 || resident.num_split > 0 {
                return Err(format!("the list is broken at block {}", resident.block));
            }
            (prev, entry, walked) = (entry, resident.next, walked + 1);
        }
        if (walked, num_listed, prev) != (num_listed, self.num_listed, self.newest)
            || num_listed_nodes != self.num_listed_nodes
        {
            return Err("the list does not hold the blocks that may go".into());
        }
        let (mut free, mut num_free) = (self.free, 0);
        while free != NONE && num_free <= self.entries.len() {
            free = self.entries[free as usize].next;
            num_free += 1;
        }
        if num_free + num_blocks != self.entries.len() {
            return Err("an entry is lost".into());
        }
        Ok(())
    }
}
