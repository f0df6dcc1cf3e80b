//! Finding equal positions again.

use glam::Vec3;

const FREE: u32 = u32::MAX;

/// One entry: the coordinates' bits with −0 as +0, and the vertex.
#[derive(Clone, Copy)]
struct Slot {
    key: [u32; 3],
    vertex: u32,
}

const EMPTY: Slot = Slot { key: [0; 3], vertex: FREE };

/// An open-addressing table; at most three quarters full.
#[derive(Default)]
struct Table {
    slots: Vec<Slot>,
    used: usize,
}

impl Table {
    /// The slot with this key, or the free one where it belongs. The table must not be empty.
    #[inline]
    fn find(&self, key: [u32; 3]) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = hash(key) as usize & mask;
        loop {
            let slot = &self.slots[at];
            if slot.vertex == FREE || slot.key == key {
                return at;
            }
            at = (at + 1) & mask;
        }
    }

    fn get(&self, key: [u32; 3]) -> Option<u32> {
        if self.slots.is_empty() {
            return None;
        }
        let vertex = self.slots[self.find(key)].vertex;
        (vertex != FREE).then_some(vertex)
    }

    fn make_room(&mut self) {
        if 4 * (self.used + 1) > 3 * self.slots.len() {
            let grown = (2 * self.slots.len()).max(1024);
            let old = std::mem::replace(&mut self.slots, vec![EMPTY; grown]);
            for slot in old.into_iter().filter(|slot| slot.vertex != FREE) {
                let at = self.find(slot.key);
                self.slots[at] = slot;
            }
        }
    }
}

#[inline]
fn hash(key: [u32; 3]) -> u64 {
    let mut h = (u64::from(key[0]) | (u64::from(key[1]) << 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h ^= h >> 32;
    h = (h ^ u64::from(key[2])).wrapping_mul(0xd6e8_feb8_6659_fd93);
    h ^ (h >> 29)
}

/// Gives equal positions the same number, counting up from zero.
///
/// Memory is bounded by two generations of `generation` vertices: when the young one is full it becomes the old one, and
/// what was not asked for since is forgotten. Up to `generation` vertices nothing is ever forgotten, and in a stream
/// that comes back to a vertex within that many others neither.
pub(crate) struct Welder {
    young: Table,
    old: Table,
    generation: usize,
    count: u64,
}

impl Welder {
    /// Never forgets.
    pub(crate) fn exact() -> Self {
        Self::with_generation(usize::MAX)
    }

    pub(crate) fn with_generation(generation: usize) -> Self {
        Self { young: Table::default(), old: Table::default(), generation, count: 0 }
    }

    /// The vertex at this position, and whether it is a new one; `None` once 32 bits cannot count the vertices.
    #[inline]
    pub(crate) fn weld(&mut self, position: Vec3) -> Option<(u32, bool)> {
        // Adding zero turns −0 into +0 and changes nothing else.
        let key = [position.x, position.y, position.z].map(|c| (c + 0.0).to_bits());
        if self.young.used >= self.generation {
            self.old = std::mem::take(&mut self.young);
        }
        self.young.make_room();
        let at = self.young.find(key);
        let slot = &mut self.young.slots[at];
        if slot.vertex != FREE {
            return Some((slot.vertex, false));
        }
        let (vertex, new) = match self.old.get(key) {
            Some(vertex) => (vertex, false),
            None => (u32::try_from(self.count).ok().filter(|&v| v != FREE)?, true),
        };
        self.count += u64::from(new);
        *slot = Slot { key, vertex };
        self.young.used += 1;
        Some((vertex, new))
    }

    /// Vertices so far.
    pub(crate) fn num_vertices(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_bits_are_one_vertex_and_the_two_zeros_too() {
        let mut welder = Welder::exact();
        assert_eq!(welder.weld(Vec3::new(0.0, 1.0, -0.0)), Some((0, true)));
        assert_eq!(welder.weld(Vec3::new(-0.0, 1.0, 0.0)), Some((0, false)));
        assert_eq!(welder.weld(Vec3::new(0.0, 1.0, f32::from_bits(1))), Some((1, true)));
        assert_eq!(welder.weld(Vec3::splat(f32::NAN)), Some((2, true)));
        assert_eq!(welder.weld(Vec3::splat(f32::NAN)), Some((2, false)));
        assert_eq!(welder.num_vertices(), 3);
    }

    #[test]
    fn agrees_with_an_ordered_map() {
        let mut welder = Welder::exact();
        let mut naive = std::collections::BTreeMap::new();
        let mut seed = 1u32;
        for _ in 0..50_000 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let p = [seed >> 28, (seed >> 20) & 31, (seed >> 12) & 15].map(|c| c as f32);
            let next = naive.len() as u32;
            let expected = *naive.entry(p.map(f32::to_bits)).or_insert(next);
            let (vertex, new) = welder.weld(Vec3::from(p)).unwrap();
            assert_eq!((vertex, new), (expected, expected == next));
        }
    }

    #[test]
    fn generations_bound_the_memory_and_keep_what_is_in_use() {
        let mut welder = Welder::with_generation(100);
        let kept = Vec3::splat(-1.0);
        assert_eq!(welder.weld(kept), Some((0, true)));
        for i in 0..10_000 {
            welder.weld(Vec3::splat(i as f32)).unwrap();
            assert_eq!(welder.weld(kept), Some((0, false)), "asked for all the time");
        }
        assert!(welder.young.slots.len() + welder.old.slots.len() <= 2 * 1024);
        assert_eq!(welder.weld(Vec3::splat(0.0)), Some((10_001, true)), "long forgotten");
    }
}
