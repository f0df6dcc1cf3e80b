//! Where the chunks of a spool are, in memory that grows without being moved.

use std::collections::VecDeque;

use crate::store::Place;

/// A chunk of a spool.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub place: Place,
    /// Records in it.
    pub records: u32,
}

const _: () = assert!(size_of::<Entry>() == 16);

/// Entries of a segment.
const SEGMENT: usize = 64;

/// A queue with two ends of entries, in segments that are never copied: a queue in one piece takes up to three times its size
/// while it grows.
#[derive(Debug, Default)]
pub(crate) struct Places {
    segments: VecDeque<Box<[Entry; SEGMENT]>>,
    /// Where in the first segment the first entry is.
    head: usize,
    len: usize,
}

impl Places {
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn get(&self, index: usize) -> Option<Entry> {
        let at = self.head + index;
        (index < self.len).then(|| self.segments[at / SEGMENT][at % SEGMENT])
    }

    pub fn push_back(&mut self, entry: Entry) {
        let at = self.head + self.len;
        if at == self.segments.len() * SEGMENT {
            self.segments.push_back(Box::new([entry; SEGMENT]));
        }
        self.segments[at / SEGMENT][at % SEGMENT] = entry;
        self.len += 1;
    }

    pub fn pop_back(&mut self) -> Option<Entry> {
        let last = self.get(self.len.checked_sub(1)?);
        self.len -= 1;
        if (self.head + self.len).is_multiple_of(SEGMENT) {
            self.segments.pop_back();
        }
        last
    }

    pub fn pop_front(&mut self) -> Option<Entry> {
        let first = self.get(0)?;
        (self.head, self.len) = (self.head + 1, self.len - 1);
        if self.head == SEGMENT {
            self.head = 0;
            self.segments.pop_front();
        }
        Some(first)
    }

    pub fn iter(&self) -> impl Iterator<Item = Entry> + '_ {
        (0..self.len).filter_map(|index| self.get(index))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn entries_behave_as_in_a_queue(
            steps in prop::collection::vec((0u32..200, 0usize..200, 0usize..200), 0..20)
        ) {
            let (mut places, mut naive) = (Places::default(), VecDeque::new());
            let mut count = 0;
            for (pushed, front, back) in steps {
                for _ in 0..pushed {
                    places.push_back(Entry { place: Place::Memory(count), records: count });
                    naive.push_back(count);
                    count += 1;
                }
                let records = |entry: Option<Entry>| entry.map(|entry| entry.records);
                for _ in 0..front {
                    prop_assert_eq!(records(places.pop_front()), naive.pop_front());
                }
                for _ in 0..back {
                    prop_assert_eq!(records(places.pop_back()), naive.pop_back());
                }
                prop_assert_eq!(places.len(), naive.len());
                prop_assert!(places.iter().map(|entry| entry.records).eq(naive.iter().copied()));
                prop_assert!(places.segments.len() <= naive.len() / SEGMENT + 2);
            }
        }
    }
}
