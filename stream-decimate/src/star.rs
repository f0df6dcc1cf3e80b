//! Connectivity: around each vertex, its neighbours in counter-clockwise order.
//!
//! A [`Star`] is one cache line. It holds the fans of triangles about a vertex: neighbours `x₀ x₁ … xₙ` stand for the
//! triangles `(v, x₀, x₁) … (v, xₙ₋₁, xₙ)`, the last neighbour of a fan is marked. When the one fan left closes, the mark
//! goes, and the star is a ring: `(v, xₙ, x₀)` is a triangle too. A neighbour stands in a star once, however many fans
//! there are, and `x` stands in the star of `v` exactly if `v` stands in the star of `x`.
//!
//! This says all of the triangles, and half of what a half-edge structure does in memory; triangles can come in any
//! order, and a collapse is the splicing of one list into another.
//!
//! Where collapses are recorded, triangles have numbers that outlast what happens around them: then each neighbour `xᵢ` that is
//! not the last of a fan has a *tag*, the half-edge `v→xᵢ` of the triangle `(v, xᵢ, xᵢ₊₁)`.

mod saved;
mod slice;

use rayon::prelude::*;
use wide::i32x8;

use crate::portion::{permute, take_front};
pub(crate) use saved::LongStars;

/// Neighbours that fit into the cache line.
const INLINE: usize = 15;
/// Marks the last neighbour of a fan.
const LAST: u32 = 1 << 31;

/// The number of an entry without its mark.
#[inline]
fn id(entry: u32) -> u32 {
    entry & !LAST
}

/// The fans of triangles about one vertex.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Star {
    /// The neighbours; where there are too many of them, the first entry is the number of a list elsewhere.
    entries: [u32; INLINE],
    len: u32,
}

/// The tags of a star's entries.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Tags([u32; INLINE + 1]);

const UNTAGGED: Tags = Tags([u32::MAX; INLINE + 1]);

const EMPTY: Star = Star { entries: [0; INLINE], len: 0 };

impl Star {
    /// Bit `i` says that neighbour `i` of the first `len`, at most [`INLINE`], is this one.
    #[inline]
    fn mask_of(&self, neighbour: u32, len: usize) -> u32 {
        let [low, high]: [i32x8; 2] = bytemuck::cast(*self);
        let (ids, wanted) = (i32x8::splat(!LAST as i32), i32x8::splat(neighbour as i32));
        let mask = (low & ids).simd_eq(wanted).to_bitmask()
            | (high & ids).simd_eq(wanted).to_bitmask() << 8;
        mask & ((1 << len) - 1)
    }

    /// Bit `i` says that neighbour `i` of the first `len`, at most [`INLINE`], is the last of its fan.
    #[inline]
    fn mask_of_last(&self, len: usize) -> u32 {
        let [low, high]: [i32x8; 2] = bytemuck::cast(*self);
        (low.to_bitmask() | high.to_bitmask() << 8) & ((1 << len) - 1)
    }
}

/// The number of the lowest bit, if there is one.
#[inline]
fn lowest(mask: u32) -> Option<usize> {
    (mask != 0).then(|| mask.trailing_zeros() as usize)
}

/// What came of adding a triangle to a star.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Added {
    /// There is still a fan with two ends.
    Open,
    /// The star is a ring now.
    Ring,
    /// One of the fans is a ring now, but there are others.
    RingAndOthers,
}

/// Lists that are too long for a star.
#[derive(Debug, Default)]
struct Spill {
    lists: Vec<Vec<u32>>,
    /// The tags of each, or nothing.
    tags: Vec<Vec<u32>>,
    /// Numbers of lists not in use.
    free: Vec<u32>,
}

/// Where a triangle joins the fans of a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Joint {
    /// Index of the last neighbour of the fan that it lengthens at its end.
    end: Option<usize>,
    /// Index of the first neighbour of the fan that it lengthens at its start.
    start: Option<usize>,
}

/// The stars of all vertices.
#[derive(Debug, Default)]
pub(crate) struct Stars {
    stars: Vec<Star>,
    /// Of each star, or of none.
    tags: Vec<Tags>,
    are_tagged: bool,
    spill: Spill,
}

/// The stars of the vertices from `base` on.
///
/// Of a part of the stars, only short ones can be read and written: see [`is_long`](Self::is_long).
#[derive(Debug)]
pub(crate) struct StarSlice<'a> {
    base: u32,
    stars: &'a mut [Star],
    /// As many, or none.
    tags: &'a mut [Tags],
    spill: Option<&'a mut Spill>,
}

/// The neighbours of one vertex, as a list of fans.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fans<'a> {
    list: &'a [u32],
    /// Where the list is, if it fits.
    star: &'a Star,
}

impl<'a> Fans<'a> {
    /// Number of neighbours.
    #[inline]
    pub(crate) fn len(self) -> usize {
        self.list.len()
    }

    /// The neighbour at an index.
    #[inline]
    pub(crate) fn at(self, index: usize) -> u32 {
        id(self.list[index])
    }

    /// All neighbours.
    #[inline]
    pub(crate) fn neighbours(self) -> impl Iterator<Item = u32> + Clone + 'a {
        self.list.iter().map(|&e| id(e))
    }

    /// Whether this is one of them.
    #[inline]
    pub(crate) fn contains(self, neighbour: u32) -> bool {
        self.position(neighbour).is_some()
    }

    /// Whether the star is a ring.
    #[inline]
    pub(crate) fn is_ring(self) -> bool {
        self.list.last().is_some_and(|&e| e & LAST == 0)
    }

    /// Number of fans with two ends.
    pub(crate) fn num_fans(self) -> usize {
        self.list.iter().filter(|&&e| e & LAST != 0).count()
    }

    /// Number of triangles.
    #[inline]
    pub(crate) fn num_triangles(self) -> usize {
        self.list.len() - self.num_fans()
    }

    /// The two other corners of each triangle, counter-clockwise.
    #[inline]
    pub(crate) fn triangles(self) -> impl Iterator<Item = (u32, u32)> + 'a {
        let list = self.list;
        let first = list.first().copied().unwrap_or(0);
        list.iter()
            .enumerate()
            .filter(|(_, a)| **a & LAST == 0)
            .map(move |(i, &a)| (a, id(list.get(i + 1).copied().unwrap_or(first))))
    }

    /// Whether `(v, neighbour, ·)` is a triangle.
    #[inline]
    pub(crate) fn leads_to(self, neighbour: u32) -> bool {
        // The last of a fan only ends it.
        self.position(neighbour).is_some_and(|i| self.list[i] & LAST == 0)
    }

    /// Whether the neighbour at an index is the last of its fan.
    #[inline]
    pub(crate) fn is_last(self, index: usize) -> bool {
        self.list[index] & LAST != 0
    }

    /// The index of a neighbour.
    #[inline]
    pub(crate) fn position(self, neighbour: u32) -> Option<usize> {
        match self.list.len() <= INLINE {
            true => lowest(self.star.mask_of(neighbour, self.list.len())),
            false => self.list.iter().position(|&e| id(e) == neighbour),
        }
    }

    /// Whether `(v, a, b)` is a triangle.
    pub(crate) fn has_triangle(self, a: u32, b: u32) -> bool {
        self.triangles().any(|t| t == (a, b))
    }

    /// Where the triangle `(v, a, b)` joins the fans; `None` if there is a triangle with its edge `v→a` or `b→v`.
    #[inline]
    pub(crate) fn joint(self, a: u32, b: u32) -> Option<Joint> {
        let len = self.list.len();
        if len > INLINE {
            return self.joint_of_many(a, b);
        }
        let last = self.star.mask_of_last(len);
        let first = last << 1 | 1;
        let (end, start) = (self.star.mask_of(a, len), self.star.mask_of(b, len));
        if end & !last != 0 || start & !first != 0 {
            return None;
        }
        Some(Joint { end: lowest(end), start: lowest(start) })
    }

    #[cold]
    fn joint_of_many(self, a: u32, b: u32) -> Option<Joint> {
        let (end, start) = (self.position(a), self.position(b));
        let ends = |i: usize| self.list[i] & LAST != 0;
        if end.is_some_and(|i| !ends(i)) || start.is_some_and(|i| i > 0 && !ends(i - 1)) {
            return None;
        }
        Some(Joint { end, start })
    }

    /// The first and the last neighbour of each fan with two ends.
    pub(crate) fn ends(self) -> impl Iterator<Item = (u32, u32)> + 'a {
        let mut first = None;
        self.list.iter().filter_map(move |&e| {
            let start = *first.get_or_insert(id(e));
            (e & LAST != 0).then(|| {
                first = None;
                (start, id(e))
            })
        })
    }
}

impl Stars {
    /// Reserves memory for so many vertices.
    pub(crate) fn reserve_exact(&mut self, count: usize) {
        self.stars.reserve_exact(count);
        if self.are_tagged {
            self.tags.reserve_exact(count);
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.stars.len()
    }

    /// With tags from now on; there are no vertices yet.
    pub(crate) fn with_tags(mut self) -> Self {
        self.are_tagged = true;
        self
    }

    /// Adds a vertex without triangles.
    pub(crate) fn push(&mut self) {
        self.stars.push(EMPTY);
        if self.are_tagged {
            self.tags.push(UNTAGGED);
        }
    }

    /// Puts the stars in the order given; the numbers in them stay as they are.
    pub(crate) fn permute(&mut self, order: &[u32]) {
        permute(&mut self.stars, order);
        if self.are_tagged {
            permute(&mut self.tags, order);
        }
    }

    /// Exchanges two stars; the numbers in them stay as they are.
    pub(crate) fn swap(&mut self, a: usize, b: usize) {
        self.stars.swap(a, b);
        if self.are_tagged {
            self.tags.swap(a, b);
        }
    }

    /// Keeps the stars of the first `count` vertices, and puts new numbers into them.
    pub(crate) fn renumber(&mut self, new_of: &[u32], count: usize) {
        let new = |entry: &mut u32| *entry = new_of[id(*entry) as usize] | (*entry & LAST);
        self.stars.truncate(count);
        self.tags.truncate(count);
        self.stars.par_iter_mut().with_min_len(4096).for_each(|star| {
            if star.len as usize <= INLINE {
                star.entries[..star.len as usize].iter_mut().for_each(new);
            }
        });
        self.spill.lists.iter_mut().flatten().for_each(new);
    }

    /// The fans of a vertex.
    #[inline]
    pub(crate) fn fans(&self, v: u32) -> Fans<'_> {
        fans(&self.stars[v as usize], Some(&self.spill))
    }

    /// The tags of a vertex, as far as it has some.
    pub(crate) fn tags(&self, v: u32) -> &[u32] {
        let (Some(tags), star) = (self.tags.get(v as usize), &self.stars[v as usize]) else {
            return &[];
        };
        match star.len as usize {
            len if len <= INLINE => &tags.0[..len],
            _ => &self.spill.tags[star.entries[0] as usize],
        }
    }

    /// All of them.
    #[inline]
    pub(crate) fn all(&mut self) -> StarSlice<'_> {
        let Self { stars, tags, spill, .. } = self;
        StarSlice { base: 0, stars, tags, spill: Some(spill) }
    }

    /// Cuts them into slices whose lengths are given.
    pub(crate) fn slices(&mut self, lengths: impl Iterator<Item = usize>) -> Vec<StarSlice<'_>> {
        let (mut base, mut rest, mut rest_of_tags) = (0, &mut self.stars[..], &mut self.tags[..]);
        lengths
            .map(|length| {
                let stars = take_front(&mut rest, length);
                let tags = take_front(&mut rest_of_tags, if self.are_tagged { length } else { 0 });
                let slice = StarSlice { base, stars, tags, spill: None };
                base += length as u32;
                slice
            })
            .collect()
    }
}

#[inline]
fn fans<'a>(star: &'a Star, spill: Option<&'a Spill>) -> Fans<'a> {
    let len = star.len as usize;
    let list = match spill {
        _ if len <= INLINE => &star.entries[..len],
        Some(spill) => &spill.lists[star.entries[0] as usize],
        None => &[],
    };
    Fans { list, star }
}
