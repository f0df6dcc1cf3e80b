//! Whether vertices have the colours that an input has at their places, in bounded memory.
//!
//! Vertices go to buckets by a hash of where they are. Those of a bucket that the input has are gathered in a table, and then
//! those of the file are looked up there. The input may have several colours at one place: any of them will do.

use glam::Vec3;
use mesh_io::Colour;
use rustc_hash::FxHashSet;
use scratch::{Piece, Scratch, Spool, Store, StoreOptions};

use crate::same_soup::Side;
use crate::{Error, interrupt};

/// A place by the bits of its coordinates, minus zero being zero.
type Place = [u32; 3];
/// A place and a colour.
type Record = [u32; 4];

/// Bytes of a bucket's tables for each vertex, with what hash tables keep free, which may have doubled.
const TABLE_BYTES: u64 = 100;

/// How the colours of a file differ from those of an input.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ColourDifference {
    /// Vertices of the file with a colour that the input does not have at their place, though it has others there.
    pub differ: u64,
    /// Where one of them is.
    pub near: Option<Vec3>,
}

/// Gathers the vertices of a file and the corners of an input, and then compares them.
///
/// # Complexity
///
/// Time linear; 16 bytes of scratch space for each vertex of the file and each corner of the input, less what fits into memory.
#[derive(Debug)]
pub struct ColourComparison {
    store: Store,
    /// Of each bucket those of the file and those of the input.
    buckets: Vec<[Spool<Record>; 2]>,
}

impl ColourComparison {
    /// For a file of so many vertices, within so many bytes of memory.
    pub fn new(scratch: &Scratch, file_vertices: u64, memory_bytes: u64) -> Self {
        let table = (memory_bytes / 2).max(1);
        let num_buckets = file_vertices.saturating_mul(TABLE_BYTES).div_ceil(table).max(1);
        // Each bucket has two chunks that are being written.
        let chunk = (memory_bytes / 4 / (2 * num_buckets)) as usize & !63;
        let mut options = StoreOptions::default();
        options.chunk_bytes = chunk.clamp(4 << 10, 256 << 10);
        options.memory_bytes = memory_bytes / 8;
        let store = Store::new(scratch, &options);
        let buckets = (0..num_buckets).map(|_| [Spool::new(&store), Spool::new(&store)]).collect();
        Self { store, buckets }
    }

    /// Takes a vertex of one side.
    ///
    /// # Errors
    ///
    /// When a scratch file cannot be written.
    pub fn push(&mut self, side: Side, position: Vec3, colour: Colour) -> Result<(), Error> {
        // Adding zero makes zero of minus zero and changes nothing else.
        let [x, y, z] = (position + Vec3::ZERO).to_array().map(f32::to_bits);
        let mix =
            |hash: u64, word: u32| (hash ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let hash = [x, y, z].into_iter().fold(0, |hash, word| mix(hash, word).rotate_left(23));
        let bucket = ((u128::from(hash) * self.buckets.len() as u128) >> 64) as usize;
        let record = [x, y, z, u32::from_le_bytes(colour)];
        Ok(self.buckets[bucket][side as usize].push(&mut self.store, &record)?)
    }

    /// What differs, now that all have come.
    ///
    /// # Errors
    ///
    /// When a scratch file cannot be read, and after Ctrl-C.
    pub fn finish(self) -> Result<ColourDifference, Error> {
        let Self { mut store, buckets } = self;
        let mut found = ColourDifference::default();
        let (mut places, mut records) = (FxHashSet::<Place>::default(), FxHashSet::default());
        let mut least: Option<Place> = None;
        let mut piece = Piece::default();
        for [mut of_file, mut of_input] in buckets {
            interrupt::check()?;
            places.clear();
            records.clear();
            while of_input.take_last(&mut store, &mut piece)? {
                for &record in piece.items() {
                    let [x, y, z, _] = record;
                    places.insert([x, y, z]);
                    records.insert(record);
                }
            }
            while of_file.take_last(&mut store, &mut piece)? {
                for record in piece.items() {
                    let [x, y, z, _] = *record;
                    let place = [x, y, z];
                    // What the input has nowhere else is a matter of triangles.
                    if !records.contains(record) && places.contains(&place) {
                        found.differ += 1;
                        least = Some(least.map_or(place, |least| least.min(place)));
                    }
                }
            }
        }
        found.near = least.map(|place| Vec3::from_array(place.map(f32::from_bits)));
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compare(file: &[(Vec3, Colour)], input: &[(Vec3, Colour)], memory: u64) -> ColourDifference {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let mut comparison = ColourComparison::new(&scratch, file.len() as u64, memory);
        file.iter().for_each(|&(p, c)| comparison.push(Side::File, p, c).unwrap());
        input.iter().for_each(|&(p, c)| comparison.push(Side::Input, p, c).unwrap());
        comparison.finish().unwrap()
    }

    #[test]
    fn any_colour_that_the_input_has_at_a_place_will_do() {
        let at = |i: u32| Vec3::new(i as f32, -0.0, 0.5);
        let colour = |i: u32| [i as u8, (i >> 8) as u8, 1, 255];
        let input: Vec<_> = (0..3000).flat_map(|i| [(at(i / 2), colour(i)); 2]).collect();
        let mut file: Vec<_> =
            (0..1500).map(|i| (at(i) + Vec3::ZERO, colour(2 * i + i % 2))).collect();
        for memory in [1, 1 << 20] {
            assert_eq!(compare(&file, &input, memory), ColourDifference::default());
        }
        file[7].1[2] = 0;
        file[700].1[3] = 0;
        file.push((Vec3::NAN, [0; 4]));
        for memory in [1, 1 << 20] {
            let found = compare(&file, &input, memory);
            assert_eq!(found, ColourDifference { differ: 2, near: Some(Vec3::new(7.0, 0.0, 0.5)) });
        }
    }
}
