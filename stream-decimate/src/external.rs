//! Sorting of any number of records in bounded memory.
//!
//! Runs as long as memory allows are sorted and written to a scratch file one after another, then merged; where there
//! are too many runs to merge at once, in several rounds.

use bytemuck::Pod;
use rayon::slice::ParallelSliceMut;
use scratch::{Scratch, ScratchFile};

use crate::Error;

/// Bytes read at a time from each run, at least; less would be slow on a disk.
const MIN_PIECE_BYTES: usize = 64 << 10;

/// Records gathered before they are written.
const GATHERED: usize = 1 << 14;

/// What records are sorted by.
pub(crate) trait Key<T>: Sync {
    /// The smaller comes first.
    fn of(&self, record: &T) -> u32;
}

/// Takes records in any order.
#[derive(Debug)]
pub(crate) struct ExternalSort<T, K> {
    key: K,
    scratch: Scratch,
    memory: usize,
    /// Records of a run.
    capacity: usize,
    records: Vec<T>,
    /// Keys above, places in `records` below.
    order: Vec<u64>,
    runs: Option<Runs<T>>,
}

/// Sorted runs in a file, one after another.
#[derive(Debug)]
pub(crate) struct Runs<T> {
    file: ScratchFile<T>,
    /// Where each run ends.
    ends: Vec<u64>,
}

impl<T: Pod, K: Key<T>> ExternalSort<T, K> {
    /// Sorts by this key, those with the same key in the order they come in, within so many bytes of memory.
    pub(crate) fn new(scratch: &Scratch, memory: usize, key: K) -> Self {
        let piece = GATHERED * size_of::<T>();
        let capacity = memory.saturating_sub(piece) / (size_of::<T>() + size_of::<u64>());
        let capacity = capacity.clamp(16, u32::MAX as usize);
        let scratch = scratch.clone();
        Self { key, scratch, memory, capacity, records: Vec::new(), order: Vec::new(), runs: None }
    }

    /// Scratch space for so many records, in bytes.
    pub(crate) fn scratch_bytes(&self, records: u64) -> u64 {
        let bytes = records * size_of::<T>() as u64;
        let runs = records.div_ceil(self.capacity as u64);
        match runs {
            0 | 1 => 0,
            _ if runs <= self.fan_in() as u64 => bytes,
            _ => 2 * bytes,
        }
    }

    /// Runs that can be merged at once.
    fn fan_in(&self) -> usize {
        (self.memory / MIN_PIECE_BYTES.max(size_of::<T>())).max(4)
    }

    pub(crate) fn push(&mut self, record: T) -> Result<(), Error> {
        if self.records.len() == self.capacity {
            self.write_run()?;
        }
        self.records.push(record);
        Ok(())
    }

    fn sort(&mut self) {
        let Self { key, records, order, .. } = self;
        order.clear();
        let keyed = |(place, record)| (u64::from(key.of(record)) << 32) | place as u64;
        order.extend(records.iter().enumerate().map(keyed));
        order.par_sort_unstable();
    }

    fn write_run(&mut self) -> Result<(), Error> {
        self.sort();
        let runs = match &mut self.runs {
            Some(runs) => runs,
            none => none.insert(Runs { file: self.scratch.file()?, ends: Vec::new() }),
        };
        let mut end = runs.ends.last().copied().unwrap_or(0);
        let mut gathered = Vec::with_capacity(GATHERED);
        for places in self.order.chunks(GATHERED) {
            gathered.clear();
            gathered.extend(places.iter().map(|&place| self.records[place as u32 as usize]));
            runs.file.write(end, &gathered)?;
            end += gathered.len() as u64;
        }
        runs.ends.push(end);
        self.records.clear();
        Ok(())
    }

    /// All records, sorted.
    pub(crate) fn finish(mut self) -> Result<Sorted<T, K>, Error> {
        if self.runs.is_some() {
            self.write_run()?;
        } else {
            self.sort();
        }
        let (fan_in, memory) = (self.fan_in(), self.memory);
        let Self { key, scratch, records, order, runs, .. } = self;
        let Some(mut runs) = runs else {
            return Ok(Sorted::Whole { records, order, next: 0 });
        };
        drop((records, order));
        while runs.ends.len() > fan_in {
            runs = merge_groups(runs, fan_in, memory, &key, scratch.file()?)?;
        }
        let merge = Merge::new(&mut runs, 0, usize::MAX, memory, &key)?;
        Ok(Sorted::Merged { key, runs, merge })
    }
}

/// Merges every `fan_in` neighbouring runs to one, into another file.
fn merge_groups<T: Pod>(
    mut runs: Runs<T>,
    fan_in: usize,
    memory: usize,
    key: &impl Key<T>,
    file: ScratchFile<T>,
) -> Result<Runs<T>, Error> {
    let mut merged = Runs { file, ends: Vec::new() };
    let mut end = 0;
    let mut gathered = Vec::with_capacity(GATHERED);
    for first in (0..runs.ends.len()).step_by(fan_in) {
        let mut merge = Merge::new(&mut runs, first, fan_in, memory, key)?;
        while merge.take(&mut runs, key, &mut gathered, GATHERED)? > 0 {
            merged.file.write(end, &gathered)?;
            end += gathered.len() as u64;
            gathered.clear();
        }
        merged.ends.push(end);
    }
    Ok(merged)
}

/// Gives all records back in the order of their keys.
#[derive(Debug)]
pub(crate) enum Sorted<T, K> {
    /// All in memory, as they came, and their order.
    Whole { records: Vec<T>, order: Vec<u64>, next: usize },
    /// In a file.
    Merged { key: K, runs: Runs<T>, merge: Merge<T> },
}

impl<T: Pod, K: Key<T>> Sorted<T, K> {
    /// Appends the next records, at most `max`; zero means the end (or `max == 0`).
    pub(crate) fn take(&mut self, out: &mut Vec<T>, max: usize) -> Result<usize, Error> {
        match self {
            Self::Whole { records, order, next, .. } => {
                let places = &order[*next..order.len().min(next.saturating_add(max))];
                out.extend(places.iter().map(|&place| records[place as u32 as usize]));
                *next += places.len();
                Ok(places.len())
            }
            Self::Merged { key, runs, merge } => merge.take(runs, key, out, max),
        }
    }

    /// The key of the record that comes next.
    pub(crate) fn next_key(&self) -> Option<u32> {
        match self {
            Self::Whole { order, next, .. } => order.get(*next).map(|&entry| (entry >> 32) as u32),
            Self::Merged { merge, .. } => merge.next_key(),
        }
    }
}

/// Merges runs: a tournament among their first records that are not taken yet.
#[derive(Debug)]
pub(crate) struct Merge<T> {
    cursors: Vec<Cursor<T>>,
    /// A binary heap of winners with the root at 1: each the smaller of the two below it, in the last row the key of each
    /// run's first record (above) and the run (below), so that the earlier of two runs wins a tie.
    tree: Vec<u64>,
}

/// A run that has nothing left.
const EXHAUSTED: u64 = u64::MAX;

/// How far a run is.
#[derive(Debug)]
struct Cursor<T> {
    piece: Vec<T>,
    at: usize,
    next: u64,
    end: u64,
}

impl<T: Pod> Merge<T> {
    /// Of at most `count` runs from number `first` on.
    fn new(
        runs: &mut Runs<T>,
        first: usize,
        count: usize,
        memory: usize,
        key: &impl Key<T>,
    ) -> Result<Self, Error> {
        let ends = &runs.ends[first..runs.ends.len().min(first.saturating_add(count))];
        let mut start = if first == 0 { 0 } else { runs.ends[first - 1] };
        let piece = (memory / size_of::<T>() / ends.len().max(1)).max(1);
        let mut cursors = Vec::with_capacity(ends.len());
        for &end in ends {
            let length = usize::try_from(end - start).unwrap_or(usize::MAX).min(piece);
            cursors.push(Cursor { piece: vec![T::zeroed(); length], at: length, next: start, end });
            start = end;
        }
        let leaves = ends.len().next_power_of_two();
        let mut merge = Self { cursors, tree: vec![EXHAUSTED; 2 * leaves] };
        for run in 0..merge.cursors.len() {
            merge.cursors[run].refill(&mut runs.file)?;
            merge.replay(run, key);
        }
        Ok(merge)
    }

    /// Lets the run's first record find its place.
    #[inline]
    fn replay(&mut self, run: usize, key: &impl Key<T>) {
        let mut node = self.tree.len() / 2 + run;
        let cursor = &self.cursors[run];
        self.tree[node] = match cursor.piece.get(cursor.at) {
            Some(record) => (u64::from(key.of(record)) << 32) | run as u64,
            None => EXHAUSTED,
        };
        while node > 1 {
            let winner = self.tree[node].min(self.tree[node ^ 1]);
            node /= 2;
            self.tree[node] = winner;
        }
    }

    fn next_key(&self) -> Option<u32> {
        let winner = self.tree[1];
        (winner != EXHAUSTED).then_some((winner >> 32) as u32)
    }

    fn take(
        &mut self,
        runs: &mut Runs<T>,
        key: &impl Key<T>,
        out: &mut Vec<T>,
        max: usize,
    ) -> Result<usize, Error> {
        for taken in 0..max {
            let winner = self.tree[1];
            if winner == EXHAUSTED {
                return Ok(taken);
            }
            let run = winner as u32 as usize;
            let cursor = &mut self.cursors[run];
            out.push(cursor.piece[cursor.at]);
            cursor.at += 1;
            if cursor.at == cursor.piece.len() {
                cursor.refill(&mut runs.file)?;
            }
            self.replay(run, key);
        }
        Ok(max)
    }
}

impl<T: Pod> Cursor<T> {
    /// Reads the next piece of the run.
    fn refill(&mut self, file: &mut ScratchFile<T>) -> Result<(), Error> {
        let left = usize::try_from(self.end - self.next).unwrap_or(usize::MAX);
        self.piece.truncate(left);
        file.read(self.next, &mut self.piece)?;
        self.next += self.piece.len() as u64;
        self.at = 0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    struct First;

    impl<const N: usize> Key<[u32; N]> for First {
        fn of(&self, record: &[u32; N]) -> u32 {
            record[0]
        }
    }

    fn sorted(keys: &[u32], memory: usize, batch: usize) -> Vec<[u32; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let mut sort = ExternalSort::new(&scratch, memory, First);
        for (place, &key) in keys.iter().enumerate() {
            sort.push([key, place as u32]).unwrap();
        }
        let mut sorted = sort.finish().unwrap();
        let mut out = Vec::new();
        loop {
            let next = sorted.next_key();
            let before = out.len();
            let count = sorted.take(&mut out, batch).unwrap();
            assert_eq!(out.get(before).map(|record: &[u32; 2]| record[0]), next);
            assert_eq!(out.len() - before, count);
            if count == 0 {
                break;
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        out
    }

    fn naive(keys: &[u32]) -> Vec<[u32; 2]> {
        let mut records: Vec<[u32; 2]> = Vec::new();
        records.extend(keys.iter().enumerate().map(|(place, &key)| [key, place as u32]));
        records.sort_by_key(|record| record[0]);
        records
    }

    #[test]
    fn in_memory_in_one_merge_and_in_several() {
        let keys: Vec<u32> =
            (0..10_000u32).map(|i| i.wrapping_mul(2_654_435_761).rotate_left(7) >> 20).collect();
        // Runs of 16 records, merged four at a time, then fewer and longer runs, then one.
        for memory in [0, 1 << 18, 1 << 20] {
            assert_eq!(sorted(&keys, memory, 777), naive(&keys));
        }
        assert!(sorted(&[], 0, 10).is_empty());
        let extremes = [u32::MAX, 0, u32::MAX, 1, 0];
        assert_eq!(sorted(&extremes.repeat(20), 0, 1), naive(&extremes.repeat(20)));
    }

    #[test]
    fn the_space_needed_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let sort = ExternalSort::<[u32; 2], _>::new(&scratch, 0, First);
        assert_eq!([0, 16, 17, 64, 65].map(|n| sort.scratch_bytes(n)), [0, 0, 136, 512, 1040]);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

        #[test]
        fn any_keys_are_sorted_and_equal_ones_keep_their_order(
            keys in prop::collection::vec(prop_oneof![0u32..5, any::<u32>()], 0..1200),
            memory in prop_oneof![Just(0usize), 0usize..(1 << 19)],
            batch in 1usize..400,
        ) {
            prop_assert_eq!(sorted(&keys, memory, batch), naive(&keys));
        }
    }
}
