//! What changed since the last look, as ranges of indices.

use std::ops::Range;

/// A set of indices, gathered during an update and read as ranges.
#[derive(Clone, Debug, Default)]
pub(crate) struct DirtySet {
    words: Vec<u64>,
}

impl DirtySet {
    #[inline]
    pub(crate) fn insert(&mut self, index: u32) {
        let word = index as usize / 64;
        if word >= self.words.len() {
            self.words.resize((word + 1).next_power_of_two(), 0);
        }
        self.words[word] |= 1 << (index % 64);
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.words.capacity() * size_of::<u64>()
    }

    /// Takes the set as ascending ranges; ranges fewer than `gap` apart become one.
    pub(crate) fn take_ranges(&mut self, gap: u32) -> Vec<Range<u32>> {
        let mut ranges: Vec<Range<u32>> = Vec::new();
        for (word, bits) in self.words.iter_mut().enumerate() {
            let mut bits = std::mem::take(bits);
            while bits != 0 {
                let index = word as u32 * 64 + bits.trailing_zeros();
                bits &= bits - 1;
                match ranges.last_mut() {
                    Some(last) if index < last.end.saturating_add(gap) => last.end = index + 1,
                    _ => ranges.push(index..index + 1),
                }
            }
        }
        ranges
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn ranges_hold_what_was_inserted_and_gaps_no_wider_than_asked(
            indices in prop::collection::btree_set(0u32..500, 0..60),
            gap in 1u32..9,
        ) {
            let mut set = DirtySet::default();
            indices.iter().for_each(|&i| set.insert(i));
            let ranges = set.take_ranges(gap);
            prop_assert!(indices.iter().all(|i| ranges.iter().filter(|r| r.contains(i)).count() == 1));
            prop_assert!(ranges.windows(2).all(|w| w[1].start >= w[0].end + gap));
            prop_assert!(ranges.iter().all(|r| indices.contains(&r.start) && indices.contains(&(r.end - 1))));
            prop_assert!(set.take_ranges(gap).is_empty());
        }
    }
}
