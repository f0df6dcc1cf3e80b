//! What is known about the last triangles of vertices, and the counting pass that finds it out.
//!
//! The corners' vertex numbers of an indexed file are read once and put down in a scratch file. Going through them
//! forwards tells where each vertex is used for the first time, going backwards where for the last time; both take one
//! bit per vertex, and for more vertices than there are bits, several rounds. What comes back then are the triangles
//! with these tags; the file is not parsed again.
//!
//! Since the decimator knows vertices by their coordinates, not by their numbers, vertices that share their coordinates
//! with another one get no tags: of those nothing is known.
//!
//! # Sources
//! Isenburg and Lindstrom, *Streaming Meshes*, 2005, where vertices are *finalized* with their last triangle.

use std::ops::Range;

use glam::Vec3;
use mesh_io::{Colour, Triangle, TriangleSource};
use scratch::{Scratch, ScratchFile};

use crate::external::{ExternalSort, Key};
use crate::{Error, Observer, Progress, Stage};

/// Triangles of a block, in memory and in the scratch file.
const BLOCK: usize = 1 << 14;

/// Vertices whose bits are in memory at a time: 16 MiB of them.
const ROUND: u64 = 1 << 27;

/// Bytes for finding vertices with the same coordinates.
const SORT_BYTES: usize = 24 << 20;

/// Bit `i` of a tag: corner `i` is its vertex's last.
const LAST: u8 = 0b000_001;

/// Bit `3 + i` of a tag: corner `i` is its vertex's first.
const FIRST: u8 = 0b001_000;

/// What is known about the last use of vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Finality<'a> {
    /// Nothing.
    Unknown,
    /// A byte for each triangle of the batch: bit `i` says that this triangle is the last one with the vertex of corner
    /// `i`, bit `3 + i` that it is the first one. A bit that is not set says nothing where the vertex shares its
    /// coordinates with another one.
    Corners(&'a [u8]),
    /// Every vertex with a coordinate below this one on this axis has had its last triangle.
    Below { axis: usize, coordinate: f32 },
}

/// Triangles, and what is known about the last use of their vertices.
pub(crate) trait Feed: Send {
    /// Appends at most `max` triangles and returns how many; zero means the end (or `max == 0`).
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error>;

    /// What is known once the batch read last is taken.
    fn finality(&self) -> Finality<'_>;

    /// The colours of the corners of the batch read last; none where corners have no colours.
    fn colours(&self) -> &[[Colour; 3]];
}

/// A source as it is: nothing is known.
pub(crate) struct Direct<'a> {
    source: &'a mut (dyn TriangleSource + Send),
    numbers: Vec<[u64; 3]>,
    colours: Vec<[Colour; 3]>,
}

impl<'a> Direct<'a> {
    pub(crate) fn new(source: &'a mut (dyn TriangleSource + Send)) -> Self {
        Self { source, numbers: Vec::new(), colours: Vec::new() }
    }
}

impl Feed for Direct<'_> {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        if !self.source.has_colours() {
            return Ok(self.source.read(out, max)?);
        }
        self.numbers.clear();
        self.colours.clear();
        let count = self.source.read_numbered(out, &mut self.numbers, max)?;
        self.source.look_up_colours(&self.numbers, &mut self.colours);
        Ok(count)
    }

    fn colours(&self) -> &[[Colour; 3]] {
        &self.colours
    }

    fn finality(&self) -> Finality<'_> {
        Finality::Unknown
    }
}

/// A source with each corner's first and last use.
pub(crate) struct Counted {
    source: Box<dyn TriangleSource + Send>,
    table: Table,
    next: u64,
    block: Block,
    /// The triangles of the block that were given last.
    given: Range<usize>,
    /// Their colours.
    colours: Vec<[Colour; 3]>,
}

impl Counted {
    /// Triangles in all.
    pub(crate) fn triangle_count(&self) -> u64 {
        self.table.count
    }
}

/// Reads all of a source that has vertex numbers, and counts.
///
/// Memory is bounded by about 45 MiB, whatever the size of the mesh, besides what the source itself takes. The scratch
/// files take 13 bytes per triangle, and for vertices that share their coordinates up to 28 bytes each.
///
/// # Errors
/// The source's, those of the scratch files, and [`Error::Interrupted`].
///
/// # Panics
/// If the source has no vertex numbers.
pub(crate) fn count(
    source: Box<dyn TriangleSource + Send>,
    scratch: &Scratch,
    observer: &mut Observer<'_>,
) -> Result<Counted, Error> {
    count_in_rounds(source, scratch, ROUND, observer)
}

/// [`count`] with so many vertices at a time.
fn count_in_rounds(
    mut source: Box<dyn TriangleSource + Send>,
    scratch: &Scratch,
    round: u64,
    observer: &mut Observer<'_>,
) -> Result<Counted, Error> {
    assert!(source.has_vertex_numbers(), "vertices without numbers cannot be counted");
    let mut table = Table::read(&mut *source, scratch, observer)?;
    let mut shared = Shared::find(&mut *source, &table, scratch)?;
    for first in (0..table.limit).step_by(round as usize) {
        table.tag(first..table.limit.min(first + round), &mut shared)?;
    }
    let (block, colours) = (Block::default(), Vec::new());
    Ok(Counted { source, table, next: 0, block, given: 0..0, colours })
}

impl Feed for Counted {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        if self.given.end == self.block.tags.len() && max > 0 {
            self.table.load(self.next, &mut self.block)?;
            self.next += 1;
            self.given = 0..0;
        }
        let start = self.given.end;
        let stop = start.saturating_add(max).min(self.block.tags.len());
        self.given = start..stop;
        let numbers = self.block.numbers[start..stop].iter();
        let numbers: Vec<[u64; 3]> = numbers.map(|triangle| triangle.map(u64::from)).collect();
        self.source.look_up(&numbers, out);
        self.colours.clear();
        self.source.look_up_colours(&numbers, &mut self.colours);
        Ok(numbers.len())
    }

    fn colours(&self) -> &[[Colour; 3]] {
        &self.colours
    }

    fn finality(&self) -> Finality<'_> {
        Finality::Corners(&self.block.tags[self.given.clone()])
    }
}

/// Consecutive triangles.
#[derive(Debug, Default)]
struct Block {
    numbers: Vec<[u32; 3]>,
    tags: Vec<u8>,
}

/// Each triangle's vertices and tags, in scratch files.
struct Table {
    numbers: ScratchFile<[u32; 3]>,
    tags: ScratchFile<u8>,
    count: u64,
    /// Above every vertex number.
    limit: u64,
}

impl Table {
    /// The vertices of all triangles; the tags are not written yet.
    fn read(
        source: &mut dyn TriangleSource,
        scratch: &Scratch,
        observer: &mut Observer<'_>,
    ) -> Result<Self, Error> {
        let expected = source.triangle_hint();
        scratch.require(expected.unwrap_or(0).saturating_mul(13))?;
        let (numbers, tags) = (scratch.file()?, scratch.file()?);
        let mut table = Self { numbers, tags, count: 0, limit: 0 };
        let (mut numbers, mut narrow) = (Vec::new(), Vec::new());
        while source.read_numbers(&mut numbers, BLOCK)? > 0 {
            table.limit = numbers.as_flattened().iter().fold(table.limit, |l, &v| l.max(v + 1));
            if table.limit > 1 << 32 {
                let name = "the input".to_owned();
                return Err(
                    mesh_io::Error::TooLarge { name, what: "vertices", limit: 1 << 32 }.into()
                );
            }
            narrow.extend(numbers.drain(..).map(|triangle| triangle.map(|v| v as u32)));
            table.numbers.write(table.count, &narrow)?;
            table.count += narrow.len() as u64;
            narrow.clear();
            Progress { stage: Stage::Counting, read: table.count, expected, ..Default::default() }
                .tell(observer)?;
        }
        Ok(table)
    }

    /// Every vertex below the limit, in the order of the numbers.
    fn each_vertex(
        &self,
        source: &mut dyn TriangleSource,
        mut act: impl FnMut(Vertex) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut corners = Vec::new();
        for first in (0..self.limit).step_by(3 * BLOCK) {
            let stop = self.limit.min(first + 3 * BLOCK as u64);
            let numbers: Vec<_> = (first..stop).step_by(3).map(|v| [v, v + 1, v + 2]).collect();
            corners.clear();
            source.look_up(&numbers, &mut corners);
            for (number, &position) in (first..stop).zip(corners.as_flattened()) {
                act(Vertex::new(number as u32, position))?;
            }
        }
        Ok(())
    }

    fn num_blocks(&self) -> u64 {
        self.count.div_ceil(BLOCK as u64)
    }

    /// Reads a block; one beyond the end is empty.
    fn load(&mut self, block: u64, into: &mut Block) -> Result<(), Error> {
        self.load_numbers(block, into)?;
        Ok(self.tags.read(block * BLOCK as u64, &mut into.tags)?)
    }

    /// Reads a block without its tags.
    fn load_numbers(&mut self, block: u64, into: &mut Block) -> Result<(), Error> {
        let first = block * BLOCK as u64;
        let length = self.count.saturating_sub(first).min(BLOCK as u64) as usize;
        into.numbers.resize(length, [0; 3]);
        into.tags.clear();
        into.tags.resize(length, 0);
        Ok(self.numbers.read(first, &mut into.numbers)?)
    }

    /// Tags the corners of these vertices. The rounds begin with vertex 0.
    fn tag(&mut self, vertices: Range<u64>, shared: &mut Shared) -> Result<(), Error> {
        let mut block = Block::default();
        let mut seen = shared.bits(vertices.clone())?;
        for at in 0..self.num_blocks() {
            // In the first round there is nothing to read yet.
            if vertices.start == 0 {
                self.load_numbers(at, &mut block)?
            } else {
                self.load(at, &mut block)?
            }
            for (triangle, tag) in block.numbers.iter().zip(&mut block.tags) {
                *tag |= seen.take(triangle) * FIRST;
            }
            self.tags.write(at * BLOCK as u64, &block.tags)?;
        }
        drop(seen);
        let mut seen = shared.bits(vertices)?;
        for at in (0..self.num_blocks()).rev() {
            self.load(at, &mut block)?;
            for (triangle, tag) in block.numbers.iter().zip(&mut block.tags).rev() {
                *tag |= seen.take(triangle) * LAST;
            }
            self.tags.write(at * BLOCK as u64, &block.tags)?;
        }
        Ok(())
    }
}

/// One bit for each vertex of a range: whether it was seen. Those outside always were.
struct Seen {
    first: u32,
    words: Vec<u64>,
}

impl Seen {
    fn new(range: Range<u64>) -> Self {
        let length = (range.end - range.start).div_ceil(64) as usize;
        Self { first: range.start as u32, words: vec![0; length] }
    }

    /// The word and the bit in it.
    #[inline]
    fn place(&self, vertex: u32) -> (usize, u64) {
        let at = vertex.wrapping_sub(self.first);
        (at as usize / 64, 1 << (at % 64))
    }

    #[inline]
    fn contains(&self, vertex: u32) -> bool {
        let (word, bit) = self.place(vertex);
        self.words.get(word).is_none_or(|word| word & bit != 0)
    }

    /// Says whether it was not seen before.
    #[inline]
    fn insert(&mut self, vertex: u32) -> bool {
        let (word, bit) = self.place(vertex);
        let Some(word) = self.words.get_mut(word) else { return false };
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }

    /// Bit `i` for each corner whose vertex was not seen before this triangle.
    #[inline]
    fn take(&mut self, &[a, b, c]: &[u32; 3]) -> u8 {
        let fresh = [self.insert(a), self.insert(b), self.insert(c)].map(u8::from);
        let mut bits = fresh[0] | fresh[1] << 1 | fresh[2] << 2;
        // Corners that are the same vertex are alike.
        if bits & 1 != 0 {
            bits |= u8::from(a == b) << 1 | u8::from(a == c) << 2;
        }
        if bits & 2 != 0 {
            bits |= u8::from(b == c) << 2;
        }
        bits
    }
}

/// The vertices that share their coordinates with another one, in a scratch file.
struct Shared {
    numbers: ScratchFile<u32>,
    count: u64,
    waiting: Vec<u32>,
}

impl Shared {
    /// Sorts vertices by a hash of their coordinates, so that equal ones become neighbours; only those whose hash ends
    /// in the same bits as another one's, which are few.
    fn find(
        source: &mut dyn TriangleSource,
        table: &Table,
        scratch: &Scratch,
    ) -> Result<Self, Error> {
        let slots = (16 * table.limit).next_power_of_two().clamp(64, ROUND);
        let (mut once, mut twice) = (Seen::new(0..slots), Seen::new(0..slots));
        table.each_vertex(source, |vertex| {
            let slot = vertex.low & (slots - 1) as u32;
            if !once.insert(slot) {
                twice.insert(slot);
            }
            Ok(())
        })?;
        drop(once);
        let mut sort = ExternalSort::new(scratch, SORT_BYTES, ByHash);
        scratch.require(sort.scratch_bytes(table.limit) + table.limit * size_of::<u32>() as u64)?;
        table.each_vertex(source, |vertex| {
            let slot = vertex.low & (slots - 1) as u32;
            if twice.contains(slot) { sort.push(vertex) } else { Ok(()) }
        })?;
        drop(twice);
        let mut sorted = sort.finish()?;
        let mut shared = Self { numbers: scratch.file()?, count: 0, waiting: Vec::new() };
        let mut batch = Vec::new();
        let mut group = Group::default();
        while sorted.take(&mut batch, BLOCK)? > 0 {
            for vertex in batch.drain(..) {
                group.push(vertex, &mut shared.waiting);
            }
            shared.flush()?;
        }
        group.close(&mut shared.waiting);
        shared.flush()?;
        Ok(shared)
    }

    fn flush(&mut self) -> Result<(), Error> {
        self.numbers.write(self.count, &self.waiting)?;
        self.count += self.waiting.len() as u64;
        self.waiting.clear();
        Ok(())
    }

    /// The vertices of this range, of which the shared ones count as seen.
    fn bits(&mut self, range: Range<u64>) -> Result<Seen, Error> {
        let mut seen = Seen::new(range);
        let mut numbers = Vec::new();
        for first in (0..self.count).step_by(BLOCK) {
            numbers.resize((self.count - first).min(BLOCK as u64) as usize, 0);
            self.numbers.read(first, &mut numbers)?;
            for &vertex in &numbers {
                seen.insert(vertex);
            }
        }
        Ok(seen)
    }
}

/// A vertex and a hash of its coordinates.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Vertex {
    high: u32,
    low: u32,
    number: u32,
}

/// Sorts by the upper half of the hash.
struct ByHash;

impl Key<Vertex> for ByHash {
    fn of(&self, vertex: &Vertex) -> u32 {
        vertex.high
    }
}

impl Vertex {
    fn new(number: u32, position: Vec3) -> Self {
        // Adding zero turns −0 into +0 and changes nothing else.
        let [x, y, z] = position.to_array().map(|c| u64::from((c + 0.0).to_bits()));
        let mut hash = (x | (y << 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        hash = ((hash ^ (hash >> 32)) ^ z).wrapping_mul(0xd6e8_feb8_6659_fd93);
        hash ^= hash >> 32;
        hash = hash.wrapping_mul(0xd6e8_feb8_6659_fd93);
        Self { high: (hash >> 32) as u32, low: hash as u32, number }
    }
}

/// Vertices with the same upper half of their hash.
#[derive(Default)]
struct Group {
    vertices: Vec<Vertex>,
    /// There were so many already that the lower half does not matter: chance does not bring them together.
    crowded: bool,
}

impl Group {
    const CROWD: usize = 256;

    fn push(&mut self, vertex: Vertex, shared: &mut Vec<u32>) {
        if self.vertices.first().is_some_and(|first| first.high != vertex.high) {
            self.close(shared);
        }
        self.vertices.push(vertex);
        if self.vertices.len() == Self::CROWD {
            self.crowded = true;
            // One stays, to tell the group by.
            shared.extend(self.vertices.drain(1..).map(|vertex| vertex.number));
        }
    }

    fn close(&mut self, shared: &mut Vec<u32>) {
        self.vertices.sort_unstable_by_key(|vertex| (vertex.low, vertex.number));
        for group in self.vertices.chunk_by(|a, b| self.crowded || a.low == b.low) {
            if group.len() > 1 || self.crowded {
                shared.extend(group.iter().map(|vertex| vertex.number));
            }
        }
        self.vertices.clear();
        self.crowded = false;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::ops::ControlFlow;

    use mesh_io::{IndexedMesh, MeshSource};
    use proptest::prelude::*;

    use super::*;

    /// By definition, with all in memory.
    fn naive(mesh: &IndexedMesh) -> Vec<u8> {
        let key = |v: u32| mesh.positions[v as usize].to_array().map(|c| (c + 0.0).to_bits());
        let mut at = HashMap::<[u32; 3], Vec<u32>>::new();
        // Nobody knows of vertices beyond those that triangles use.
        let limit = mesh.triangles.as_flattened().iter().max().map_or(0, |&v| v + 1);
        (0..limit).for_each(|v| at.entry(key(v)).or_default().push(v));
        let uses = |v: u32| mesh.triangles.iter().positions_of(v);
        let tag = |(t, triangle): (usize, &[u32; 3])| {
            let mut tag = 0;
            for (corner, &v) in triangle.iter().enumerate() {
                if at[&key(v)].len() == 1 {
                    let (first, last) = uses(v);
                    tag |= u8::from(first == t) << (3 + corner) | u8::from(last == t) << corner;
                }
            }
            tag
        };
        mesh.triangles.iter().enumerate().map(tag).collect()
    }

    trait PositionsOf {
        fn positions_of(self, vertex: u32) -> (usize, usize);
    }

    impl<'a, I: Iterator<Item = &'a [u32; 3]>> PositionsOf for I {
        /// Of the first and the last triangle with this vertex.
        fn positions_of(self, vertex: u32) -> (usize, usize) {
            let mut places =
                self.enumerate().filter(|(_, t)| t.contains(&vertex)).map(|(at, _)| at);
            let first = places.next().unwrap_or(usize::MAX);
            (first, places.last().unwrap_or(first))
        }
    }

    fn counted(mesh: &IndexedMesh, round: u64, batch: usize) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let source = Box::new(MeshSource::new(mesh.clone(), "mesh"));
        let scratch = Scratch::new(folder.path());
        let mut told = 0;
        let mut counted = count_in_rounds(source, &scratch, round, &mut |progress| {
            assert_eq!(progress.stage, Stage::Counting);
            assert_eq!(progress.expected, Some(mesh.triangles.len() as u64));
            told = progress.read;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(counted.triangle_count(), mesh.triangles.len() as u64);
        assert_eq!(told, counted.triangle_count());
        let (mut triangles, mut tags) = (Vec::new(), Vec::new());
        loop {
            let before = triangles.len();
            let count = counted.read(&mut triangles, batch).unwrap();
            assert_eq!(triangles.len() - before, count);
            let Finality::Corners(more) = counted.finality() else { unreachable!() };
            assert_eq!(more.len(), count);
            tags.extend_from_slice(more);
            if count == 0 {
                break;
            }
        }
        let bits = |soup: &[Triangle]| {
            let bits = |corner: &Vec3| corner.to_array().map(f32::to_bits);
            soup.as_flattened().iter().map(bits).collect::<Vec<_>>()
        };
        assert_eq!(bits(&triangles), bits(&mesh.to_soup()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        tags
    }

    #[test]
    fn a_strip_of_two() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
        let mesh =
            IndexedMesh { positions, triangles: vec![[0, 1, 2], [2, 1, 3]], ..Default::default() };
        // Vertex 0 comes and goes with the first, vertex 3 with the second, the others from one to the other.
        assert_eq!(counted(&mesh, ROUND, 10), [0b111_001, 0b100_111]);
    }

    #[test]
    fn corners_that_are_the_same_vertex_are_tagged_alike() {
        let positions = vec![Vec3::ZERO, Vec3::X];
        let mesh =
            IndexedMesh { positions, triangles: vec![[0, 1, 0], [1, 1, 1]], ..Default::default() };
        assert_eq!(counted(&mesh, ROUND, 10), [0b111_101, 0b000_111]);
    }

    #[test]
    fn vertices_at_the_same_place_are_not_tagged() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO * -1.0, Vec3::ONE];
        let mesh =
            IndexedMesh { positions, triangles: vec![[0, 1, 2], [3, 2, 4]], ..Default::default() };
        assert_eq!(counted(&mesh, ROUND, 10), [0b110_010, 0b100_110]);
        // However many there are.
        let soup = IndexedMesh::from_soup(&vec![[Vec3::X, Vec3::Y, Vec3::Z]; 1000]);
        assert_eq!(counted(&soup, ROUND, 10), [0; 1000]);
        assert!(counted(&IndexedMesh::default(), ROUND, 10).is_empty());
    }

    #[test]
    fn many_blocks_and_many_rounds() {
        // A long fan that comes back to its centre, in several blocks.
        let n = 2 * BLOCK as u32 + 100;
        let positions = (0..=n + 1).map(|i| Vec3::new(i as f32, (i % 7) as f32, 0.0)).collect();
        let triangles = (1..=n).map(|i| [0, i, i + 1]).collect();
        let mesh = IndexedMesh { positions, triangles, ..Default::default() };
        let mut expected = vec![0b100_010; n as usize];
        expected[0] = 0b111_010;
        expected[n as usize - 1] = 0b100_111;
        for round in [ROUND, 20_000, 1 << 14] {
            assert_eq!(counted(&mesh, round, 1000), expected);
        }
    }

    #[test]
    fn the_observer_can_stop_it() {
        let mesh = IndexedMesh::from_soup(&[[Vec3::X, Vec3::Y, Vec3::Z]]);
        let folder = tempfile::tempdir().unwrap();
        let source = Box::new(MeshSource::new(mesh, "mesh"));
        let stopped = count(source, &Scratch::new(folder.path()), &mut |_| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(Error::Interrupted)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

        #[test]
        fn tags_are_what_they_are_defined_to_be(
            places in prop::collection::vec(prop::array::uniform3(-2i8..3), 1..60),
            corners in prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 0..120),
            round in 1u64..70,
            batch in 1usize..50,
        ) {
            let position = |p: &[i8; 3]| Vec3::from_array(p.map(|c| f32::from(c) * -0.0 + f32::from(c)));
            let positions: Vec<Vec3> = places.iter().map(position).collect();
            let index = |corner: prop::sample::Index| corner.index(positions.len()) as u32;
            let triangles = corners.into_iter().map(|t| t.map(index)).collect();
            let mesh = IndexedMesh { positions, triangles, ..Default::default() };
            prop_assert_eq!(counted(&mesh, round, batch), naive(&mesh));
        }
    }
}
