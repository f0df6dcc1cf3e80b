//! Memory for the nodes of blocks, in runs of whole cache lines.
//!
//! A block has a few nodes of 64 aligned bytes; asking the allocator for each costs as much again as 120 bytes per block.
//! Here they lie side by side in chunks, whose free nodes are bits.

use mergetree::{Colour, Node};

/// Nodes per chunk: the bits of a `u128`.
const CHUNK_NODES: usize = 128;
/// What the allocator needs for a chunk beside its nodes.
const CHUNK_OVERHEAD: usize = 128;
/// A longer run is never asked for.
const MAX_RUN: usize = 31;

#[derive(Debug)]
struct Chunk {
    /// Empty while no run of the chunk is in use.
    nodes: Box<[Node]>,
    /// Bit per node: whether it is in use.
    used: u128,
}

/// Memory for runs of nodes.
#[derive(Debug, Default)]
pub(crate) struct Arena {
    chunks: Vec<Chunk>,
    /// Per chunk the length of its longest free run, up to [`MAX_RUN`]; 0 for a chunk without memory.
    longest: Vec<u8>,
    /// How many chunks have a longest free run of each length.
    with_longest: [u32; MAX_RUN + 1],
    /// Chunks without memory.
    empty: Vec<u32>,
    num_used: usize,
    /// Per chunk the colours of its nodes, where nodes have some.
    colours: Option<Vec<Box<[Colour]>>>,
    /// The chunk that a run was put into last: while memory grows, the next one fits there, too.
    last: usize,
}

impl Arena {
    /// An empty one, for nodes with colours or without.
    pub fn new(has_colours: bool) -> Self {
        Self { colours: has_colours.then(Vec::new), ..Self::default() }
    }

    /// Memory that a node takes.
    pub fn node_bytes(&self) -> usize {
        size_of::<Node>() + if self.colours.is_some() { size_of::<Colour>() } else { 0 }
    }

    /// Memory that a chunk's entries in tables take.
    fn entry_bytes(&self) -> usize {
        size_of::<Chunk>() + if self.colours.is_some() { size_of::<Box<[Colour]>>() } else { 0 }
    }

    /// Memory taken.
    pub fn bytes(&self) -> usize {
        (self.chunks.len() - self.empty.len()) * self.chunk_bytes()
            + self.chunks.capacity() * self.entry_bytes()
            + self.longest.capacity()
            + self.empty.capacity() * size_of::<u32>()
    }

    /// The part of [`bytes`](Self::bytes) that is in chunks and not in use.
    pub fn free_bytes(&self) -> usize {
        let nodes = (self.chunks.len() - self.empty.len()) * CHUNK_NODES;
        (nodes - self.num_used) * self.node_bytes()
    }

    fn chunk_bytes(&self) -> usize {
        let overheads = if self.colours.is_some() { 2 } else { 1 };
        CHUNK_NODES * self.node_bytes() + overheads * CHUNK_OVERHEAD
    }

    /// Memory that a run of this length would take more.
    pub fn cost(&self, length: usize) -> usize {
        if self.with_longest.iter().skip(length).any(|&chunks| chunks > 0) {
            return 0;
        }
        let one = self.entry_bytes() + 1 + size_of::<u32>();
        let table = if self.empty.is_empty() && self.chunks.len() == self.chunks.capacity() {
            self.growth() * one
        } else {
            0
        };
        self.chunk_bytes() + table
    }

    fn growth(&self) -> usize {
        (self.chunks.len() / 8).max(8)
    }

    fn find(&self, length: usize) -> Option<usize> {
        let fits = |&longest: &u8| usize::from(longest) >= length;
        match self.longest.get(self.last) {
            Some(longest) if fits(longest) => Some(self.last),
            _ => self.longest.iter().position(fits),
        }
    }

    /// Stores a run of nodes, at most 31, with their colours where nodes have some, and says where.
    pub fn insert(&mut self, nodes: &[Node], colours: &[Colour]) -> u32 {
        debug_assert!((1..=MAX_RUN).contains(&nodes.len()));
        let index = self.find(nodes.len()).unwrap_or_else(|| self.grow());
        self.insert_into(index, nodes, colours)
    }

    /// Stores a run of nodes in the first chunk that has room for it, if that comes before the one of `at`, and says where.
    pub fn insert_before(&mut self, at: u32, nodes: &[Node], colours: &[Colour]) -> Option<u32> {
        let fits = |&longest: &u8| usize::from(longest) >= nodes.len();
        let chunks = &self.longest[..(at as usize / CHUNK_NODES).min(self.longest.len())];
        let index = chunks.iter().position(fits)?;
        Some(self.insert_into(index, nodes, colours))
    }

    fn insert_into(&mut self, index: usize, nodes: &[Node], colours: &[Colour]) -> u32 {
        self.last = index;
        let chunk = &mut self.chunks[index];
        let start = free_run(chunk.used, nodes.len()).trailing_zeros() as usize;
        chunk.nodes[start..start + nodes.len()].copy_from_slice(nodes);
        chunk.used |= ones(nodes.len()) << start;
        let longest = longest_free_run(chunk.used);
        self.set_longest(index, longest);
        self.num_used += nodes.len();
        let into = self.colours.as_mut().and_then(|all| all[index].get_mut(start..));
        for (into, colour) in into.unwrap_or_default().iter_mut().zip(colours) {
            *into = *colour;
        }
        (index * CHUNK_NODES + start) as u32
    }

    fn grow(&mut self) -> usize {
        let nodes = vec![Node::BLANK; CHUNK_NODES].into_boxed_slice();
        let chunk = Chunk { nodes, used: 0 };
        let blank = || vec![[u8::MAX; 4]; CHUNK_NODES].into_boxed_slice();
        if let Some(index) = self.empty.pop() {
            if let Some(colours) = &mut self.colours {
                colours[index as usize] = blank();
            }
            self.chunks[index as usize] = chunk;
            return index as usize;
        }
        if self.chunks.len() == self.chunks.capacity() {
            let growth = self.growth();
            self.chunks.reserve_exact(growth);
            let capacity = self.chunks.capacity();
            self.longest.reserve_exact(capacity - self.longest.len());
            self.empty.reserve_exact(capacity - self.empty.len());
            if let Some(colours) = &mut self.colours {
                colours.reserve_exact(capacity - colours.len());
            }
        }
        if let Some(colours) = &mut self.colours {
            colours.push(blank());
        }
        self.chunks.push(chunk);
        self.longest.push(0);
        self.with_longest[0] += 1;
        self.chunks.len() - 1
    }

    /// Frees a run.
    pub fn remove(&mut self, at: u32, length: usize) {
        let (index, start) = (at as usize / CHUNK_NODES, at as usize % CHUNK_NODES);
        let chunk = &mut self.chunks[index];
        chunk.used &= !(ones(length) << start);
        self.num_used -= length;
        if chunk.used == 0 {
            chunk.nodes = Box::default();
            if let Some(colours) = &mut self.colours {
                colours[index] = Box::default();
            }
            self.set_longest(index, 0);
            self.empty.push(index as u32);
        } else {
            let longest = longest_free_run(chunk.used);
            self.set_longest(index, longest);
        }
    }

    /// Gives back what tables have for chunks at the end that are not there.
    pub fn shrink(&mut self) {
        let used = self.chunks.iter().rposition(|chunk| !chunk.nodes.is_empty());
        let length = used.map_or(0, |last| last + 1);
        self.with_longest[0] -= (self.chunks.len() - length) as u32;
        self.chunks.truncate(length);
        self.longest.truncate(length);
        self.empty.retain(|&chunk| (chunk as usize) < length);
        self.chunks.shrink_to_fit();
        let capacity = self.chunks.capacity();
        self.longest.shrink_to(capacity);
        self.empty.shrink_to(capacity);
        if let Some(colours) = &mut self.colours {
            colours.truncate(length);
            colours.shrink_to(capacity);
        }
    }

    fn set_longest(&mut self, chunk: usize, longest: u8) {
        let before = std::mem::replace(&mut self.longest[chunk], longest);
        self.with_longest[usize::from(before)] -= 1;
        self.with_longest[usize::from(longest)] += 1;
    }

    /// The node in a place: those of a run follow each other from where it was stored.
    #[inline]
    pub fn get(&self, at: u32) -> Option<&Node> {
        self.chunks.get(at as usize / CHUNK_NODES)?.nodes.get(at as usize % CHUNK_NODES)
    }

    /// The colours of a run, or none.
    pub fn colours(&self, at: u32, length: usize) -> &[Colour] {
        let (index, start) = (at as usize / CHUNK_NODES, at as usize % CHUNK_NODES);
        let chunk = self.colours.as_ref().and_then(|all| all.get(index));
        chunk.and_then(|chunk| chunk.get(start..start + length)).unwrap_or_default()
    }

    /// The node in a place, to be changed.
    pub fn get_mut(&mut self, at: u32) -> Option<&mut Node> {
        let chunk = self.chunks.get_mut(at as usize / CHUNK_NODES)?;
        chunk.nodes.get_mut(at as usize % CHUNK_NODES)
    }

    /// Checks that chunks, bits and counts agree, and that [`bytes`](Self::bytes) are those of what is there.
    pub fn validate(&self) -> Result<(), String> {
        let mut num_used = 0;
        let mut bytes = self.chunks.capacity() * self.entry_bytes()
            + self.longest.capacity()
            + self.empty.capacity() * size_of::<u32>();
        let mut num_empty = 0;
        let mut with_longest = [0; MAX_RUN + 1];
        for (index, (chunk, &longest)) in self.chunks.iter().zip(&self.longest).enumerate() {
            num_used += chunk.used.count_ones() as usize;
            num_empty += usize::from(chunk.nodes.is_empty());
            with_longest[usize::from(longest)] += 1;
            let colours = self.colours.as_ref().map(|all| &*all[index]);
            for block in [size_of_val(&*chunk.nodes), colours.map_or(0, size_of_val)] {
                bytes += if block > 0 { block + CHUNK_OVERHEAD } else { 0 };
            }
            let expected = if chunk.nodes.is_empty() { 0 } else { longest_free_run(chunk.used) };
            if longest != expected || chunk.nodes.is_empty() != (chunk.used == 0) {
                return Err(format!("chunk {index} of the arena is wrong"));
            }
        }
        if (num_used, num_empty, with_longest)
            != (self.num_used, self.empty.len(), self.with_longest)
        {
            return Err("the counts of the arena are wrong".into());
        }
        if bytes != self.bytes() {
            return Err(format!("the arena takes {bytes} bytes and says {}", self.bytes()));
        }
        Ok(())
    }
}

const fn ones(length: usize) -> u128 {
    (1 << length) - 1
}

/// Bit `i` is set where a free run of this length begins at `i`.
fn free_run(used: u128, length: usize) -> u128 {
    let mut runs = !used;
    let mut found = 1;
    while found < length {
        let step = found.min(length - found);
        runs &= runs >> step;
        found += step;
    }
    runs
}

fn longest_free_run(used: u128) -> u8 {
    let mut runs = !used;
    let mut length = 0;
    while runs != 0 && length < MAX_RUN as u8 {
        runs &= runs >> 1;
        length += 1;
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_where_they_are_free() {
        let used = 0b1001_1100u128 | u128::MAX << 16;
        assert_eq!(free_run(used, 1) & 0xffff, 0b0110_0011 | 0xff00);
        assert_eq!(free_run(used, 2), 0b0010_0001 | 0x7f00);
        assert_eq!(free_run(used, 8), 0x100);
        assert_eq!(free_run(used, 9), 0);
        assert_eq!(longest_free_run(used), 8);
        assert_eq!(longest_free_run(0), 31);
        assert_eq!(longest_free_run(u128::MAX), 0);
    }

    #[test]
    fn runs_come_back_unharmed_and_memory_is_given_back() {
        for has_colours in [false, true] {
            insert_and_remove(Arena::new(has_colours));
        }
    }

    fn insert_and_remove(mut arena: Arena) {
        let colour = |node: &Node| node.order.to_le_bytes();
        let mut runs: Vec<(u32, Vec<Node>)> = Vec::new();
        let mut state = 7u64;
        for step in 0..4000u32 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let random = (state >> 33) as usize;
            if runs.is_empty() || !random.is_multiple_of(3) && step < 2500 {
                let nodes: Vec<Node> = (0..1 + random / 3 % 31)
                    .map(|i| Node { order: step * 100 + i as u32, ..Node::BLANK })
                    .collect();
                let cost = arena.cost(nodes.len());
                let before = arena.bytes();
                let colours: Vec<_> = nodes.iter().map(colour).collect();
                runs.push((arena.insert(&nodes, &colours), nodes));
                assert!(arena.bytes() <= before + cost);
            } else {
                let (at, nodes) = runs.swap_remove(random / 3 % runs.len());
                arena.remove(at, nodes.len());
            }
            if step % 500 == 499 {
                arena.shrink();
            }
            arena.validate().unwrap();
            if step % 50 == 0 {
                for (at, nodes) in &runs {
                    for (rank, node) in nodes.iter().enumerate() {
                        assert_eq!(arena.get(*at + rank as u32), Some(node));
                        let found = arena.colours(*at + rank as u32, 1);
                        assert!(found == [colour(node)] || arena.colours.is_none());
                    }
                }
            }
        }
        for (at, nodes) in runs {
            arena.remove(at, nodes.len());
        }
        arena.shrink();
        arena.validate().unwrap();
        assert_eq!(arena.bytes(), 0);
        assert_eq!(arena.free_bytes(), 0);
        assert!(arena.chunks.iter().all(|chunk| chunk.nodes.is_empty()));
    }
}
