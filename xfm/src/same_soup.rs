//! Whether two streams have the same triangles, bit for bit, whatever their order, in bounded memory.
//!
//! Triangles go to buckets by a hash of what they are. Those of a bucket that the one stream has are counted in a table, and
//! then those that the other has are looked up there.

use std::hash::{BuildHasher, BuildHasherDefault, Hasher};

use glam::Vec3;
use mesh_io::Triangle;
use rustc_hash::{FxHashMap, FxHasher};
use scratch::{Piece, Scratch, Spool, Store, StoreOptions};

use crate::{Error, interrupt};

/// A triangle by the bits of its coordinates, beginning with its least corner; orientation is kept. Minus zero is zero.
type Key = [u32; 9];

/// Bytes of a bucket's table for each of its triangles: key, counts, and what a hash table keeps free, which may have doubled.
const TABLE_BYTES: u64 = 120;

/// How the triangles of two streams differ. Those that are no surface (a coordinate is not finite, or two corners are at one
/// place) are left out of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SoupDifference {
    /// Triangles of the input.
    pub input_triangles: u64,
    /// Those of the input that the file does not have.
    pub missing: u64,
    /// Those of the file that the input does not have, or not so often.
    pub extra: u64,
    /// A corner of one of those, if there is one.
    pub near: Option<Vec3>,
    /// Those of the input that are in the file less often than they are in the input.
    pub repeated: u64,
    /// Those of the input that are no surface.
    pub no_surface: u64,
}

/// Which stream a triangle is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The file's.
    File,
    /// The input's.
    Input,
}

/// Gathers the triangles of a file and of an input, and then compares them.
///
/// # Complexity
///
/// Time linear; 36 bytes of scratch space for each triangle of both, less what fits into memory.
#[derive(Debug)]
pub struct SoupComparison {
    store: Store,
    /// Of each bucket those of the file and those of the input.
    buckets: Vec<[Spool<Key>; 2]>,
    found: SoupDifference,
}

impl SoupComparison {
    /// For a file of so many triangles, within so many bytes of memory.
    pub fn new(scratch: &Scratch, file_triangles: u64, memory_bytes: u64) -> Self {
        let table = (memory_bytes / 2).max(1);
        let num_buckets = file_triangles.saturating_mul(TABLE_BYTES).div_ceil(table).max(1);
        // Each bucket has two chunks that are being written.
        let chunk = (memory_bytes / 4 / (2 * num_buckets)) as usize & !63;
        let mut options = StoreOptions::default();
        options.chunk_bytes = chunk.clamp(4 << 10, 256 << 10);
        options.memory_bytes = memory_bytes / 8;
        let store = Store::new(scratch, &options);
        let buckets = (0..num_buckets).map(|_| [Spool::new(&store), Spool::new(&store)]).collect();
        Self { store, buckets, found: SoupDifference::default() }
    }

    /// Takes triangles of one side.
    ///
    /// # Errors
    ///
    /// When a scratch file cannot be written.
    pub fn push(&mut self, side: Side, triangles: &[Triangle]) -> Result<(), Error> {
        for triangle in triangles {
            let key = key(triangle);
            self.found.input_triangles += u64::from(side == Side::Input);
            let Some(key) = key else {
                self.found.no_surface += u64::from(side == Side::Input);
                continue;
            };
            let bucket = bucket_of(&key, self.buckets.len());
            self.buckets[bucket][side as usize].push(&mut self.store, &key)?;
        }
        Ok(())
    }

    /// Scratch space that was taken at most, in bytes.
    pub fn scratch_bytes(&self) -> u64 {
        self.store.peak_file_bytes()
    }

    /// What differs, now that all have come.
    ///
    /// # Errors
    ///
    /// When a scratch file cannot be read, and after Ctrl-C.
    pub fn finish(self) -> Result<SoupDifference, Error> {
        let Self { mut store, buckets, mut found } = self;
        // How often each is in the file, and how often it came from the input.
        let mut counts: FxHashMap<Key, [u32; 2]> = FxHashMap::default();
        let mut piece = Piece::default();
        for [mut of_file, mut of_input] in buckets {
            interrupt::check()?;
            counts.clear();
            counts.reserve(of_file.len() as usize);
            while of_file.take_last(&mut store, &mut piece)? {
                for key in piece.items() {
                    let [in_file, _] = counts.entry(*key).or_default();
                    *in_file = in_file.saturating_add(1);
                }
            }
            while of_input.take_last(&mut store, &mut piece)? {
                for key in piece.items() {
                    match counts.get_mut(key) {
                        None => {
                            found.missing += 1;
                            found.note(key);
                        }
                        Some([in_file, in_input]) => {
                            found.repeated += u64::from(in_input >= in_file);
                            *in_input = in_input.saturating_add(1);
                        }
                    }
                }
            }
            // The order of the table is that of its hashes, which are the same in every run.
            for (key, &[in_file, in_input]) in &counts {
                if in_file > in_input {
                    found.extra += u64::from(in_file - in_input);
                    found.note(key);
                }
            }
        }
        Ok(found)
    }
}

impl SoupDifference {
    /// Notes that a triangle is one of those that differ: the least of them is told, whatever their order.
    fn note(&mut self, &[x, y, z, ..]: &Key) {
        let corner = [x, y, z].map(f32::from_bits);
        let before = self.near.map(|near| near.to_array());
        if before.is_none_or(|before| corner.map(f32::to_bits) < before.map(f32::to_bits)) {
            self.near = Some(corner.into());
        }
    }
}

/// What a triangle is by; `None` for one that is no surface.
fn key(triangle: &Triangle) -> Option<Key> {
    if !triangle.iter().all(|corner| corner.is_finite()) {
        return None;
    }
    // Adding zero makes zero of minus zero and changes nothing else.
    let [a, b, c] = triangle.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
    if a == b || b == c || c == a {
        return None;
    }
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = [a, b, c].min([b, c, a]).min([c, a, b]);
    Some([ax, ay, az, bx, by, bz, cx, cy, cz])
}

fn bucket_of(key: &Key, buckets: usize) -> usize {
    let mut hasher = BuildHasherDefault::<FxHasher>::default().build_hasher();
    key.iter().for_each(|&word| hasher.write_u32(word));
    // Other bits than those that the tables go by.
    let spread = hasher.finish().wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
    ((u128::from(spread) * buckets as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn compare(file: &[Triangle], input: &[Triangle], memory: u64) -> SoupDifference {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let mut comparison = SoupComparison::new(&scratch, file.len() as u64, memory);
        comparison.push(Side::File, file).unwrap();
        comparison.push(Side::Input, input).unwrap();
        let found = comparison.finish().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        found
    }

    const T: Triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn order_does_not_matter_but_orientation_does() {
        let turned = [Vec3::X, Vec3::Y, Vec3::new(-0.0, 0.0, -0.0)];
        assert_eq!(
            compare(&[T], &[turned], 1 << 20),
            SoupDifference { input_triangles: 1, ..Default::default() }
        );
        let flipped = [Vec3::X, Vec3::ZERO, Vec3::Y];
        let found = compare(&[T], &[flipped], 1 << 20);
        assert_eq!((found.missing, found.extra, found.near), (1, 1, Some(Vec3::ZERO)));
    }

    #[test]
    fn what_is_no_surface_is_left_out_and_what_is_repeated_is_counted() {
        let flat = [Vec3::X, Vec3::X, Vec3::Y];
        let odd = [Vec3::NAN, Vec3::X, Vec3::Y];
        let found = compare(&[T, flat], &[T, odd, T, flat], 1 << 20);
        assert_eq!((found.missing, found.extra, found.repeated, found.no_surface), (0, 0, 1, 2));
        let found = compare(&[T, T], &[T], 1 << 20);
        assert_eq!((found.missing, found.extra, found.repeated), (0, 1, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

        #[test]
        fn any_soups_differ_as_counting_says(
            soups in prop::array::uniform2(prop::collection::vec(prop::array::uniform3(0u8..6), 0..300)),
            memory in prop_oneof![Just(1u64), Just(5000), Just(1 << 20)],
        ) {
            let triangle = |t: &[u8; 3]| t.map(|c| Vec3::new(f32::from(c % 2), f32::from(c / 2), 0.0));
            let [file, input] = soups.map(|soup| soup.iter().map(triangle).collect::<Vec<_>>());
            let mut naive: std::collections::BTreeMap<Key, [u64; 2]> = Default::default();
            for (side, soup) in [&file, &input].into_iter().enumerate() {
                soup.iter().filter_map(key).for_each(|key| naive.entry(key).or_default()[side] += 1);
            }
            let found = compare(&file, &input, memory);
            let sum = |count: fn(u64, u64) -> u64| naive.values().map(|&[f, i]| count(f, i)).sum::<u64>();
            prop_assert_eq!(found.missing, sum(|f, i| if f == 0 { i } else { 0 }));
            prop_assert_eq!(found.extra, sum(|f, i| f.saturating_sub(i)));
            prop_assert_eq!(found.repeated, sum(|f, i| if f > 0 { i.saturating_sub(f) } else { 0 }));
            prop_assert_eq!(found.input_triangles, input.len() as u64);
            prop_assert_eq!(found.near.is_some(), found.missing + found.extra > 0);
        }
    }
}
