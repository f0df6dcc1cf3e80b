//! Vertices by the bits of their coordinates.

use glam::Vec3;

/// A hash of a position whose zeros are positive.
#[inline]
pub(crate) fn key(position: Vec3) -> u32 {
    let [x, y, z] = position.to_array().map(|c| u64::from(c.to_bits()));
    let mixed =
        (x | y << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ z.wrapping_mul(0xd6e8_feb8_6659_fd93);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 32) as u32
}

const EMPTY: u32 = u32::MAX;

/// Places that were found lately, to be found again without a look into the table.
const RECENT: usize = 2048;

/// A hash table with linear probing that only grows; several vertices may have the same key.
#[derive(Debug, Default)]
pub(crate) struct Lookup {
    slots: Vec<[u32; 2]>,
    used: usize,
    /// The vertex that was found last for each lowest part of a key, and where.
    recent: Vec<(Vec3, u32)>,
}

impl Lookup {
    /// Empties the table, with room for about so many vertices.
    pub(crate) fn reset(&mut self, expected: usize) {
        self.used = 0;
        let size = (2 * expected.max(64)).next_power_of_two();
        self.slots.clear();
        self.slots.resize(size, [0, EMPTY]);
        self.recent.clear();
        self.recent.resize(RECENT, (Vec3::NAN, EMPTY));
    }

    /// Adds a vertex.
    #[inline]
    pub(crate) fn insert(&mut self, position: Vec3, vertex: u32) {
        let key = key(position);
        if 3 * self.used >= 2 * self.slots.len() {
            let old = std::mem::take(&mut self.slots);
            self.reset(old.len());
            for [key, vertex] in old.into_iter().filter(|s| s[1] != EMPTY) {
                self.put(key, vertex);
            }
        }
        self.put(key, vertex);
        let recent = &mut self.recent[key as usize % RECENT];
        if recent.0 != position {
            *recent = (position, vertex);
        }
    }

    #[inline]
    fn put(&mut self, key: u32, vertex: u32) {
        let mask = self.slots.len() - 1;
        let mut at = key as usize & mask;
        while self.slots[at][1] != EMPTY {
            at = (at + 1) & mask;
        }
        self.slots[at] = [key, vertex];
        self.used += 1;
    }

    /// All vertices of this key for which the test holds, the last one added last.
    pub(crate) fn find_all<'a>(
        &'a self,
        key: u32,
        is_it: impl Fn(u32) -> bool + 'a,
    ) -> impl Iterator<Item = u32> + 'a {
        let mask = self.slots.len().wrapping_sub(1);
        let mut at = key as usize & mask;
        std::iter::from_fn(move || {
            let slot = *self.slots.get(at)?;
            at = (at + 1) & mask;
            (slot[1] != EMPTY).then_some(slot)
        })
        .filter(move |&[k, v]| k == key && is_it(v))
        .map(|[_, v]| v)
    }

    /// The first vertex at a position, where `position_of` tells where they are.
    #[inline]
    pub(crate) fn find(
        &mut self,
        position: Vec3,
        position_of: impl Fn(u32) -> Vec3,
    ) -> Option<u32> {
        let key = key(position);
        let (place, vertex) = self.recent[key as usize % RECENT];
        if place == position {
            return Some(vertex);
        }
        let found = self.find_all(key, |v| position_of(v) == position).next()?;
        self.recent[key as usize % RECENT] = (position, found);
        Some(found)
    }
}
