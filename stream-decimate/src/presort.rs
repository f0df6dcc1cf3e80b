//! Sorting a stream of triangles along the longest axis of its bounding box.
//!
//! A buffer can follow a stream only if neighbours come soon after one another. Sorted by their smallest coordinate on
//! the longest axis they do, whatever their order was: the triangles that wait for neighbours are those across one plane.
//!
//! # Sources
//! Wu and Kobbelt, *A Stream Algorithm for the Decimation of Massive Meshes*, 2003, §3.1, presort their input likewise.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use mesh_io::{Colour, Triangle, TriangleSource};
use scratch::Scratch;

use crate::external::{ExternalSort, Key, Sorted};
use crate::finality::{Feed, Finality};
use crate::{Error, Observer, Progress, Stage};

/// Bytes of memory to sort in, if nothing else is asked for.
pub(crate) const DEFAULT_BYTES: usize = 32 << 20;

/// Triangles read at a time.
const BATCH: usize = 1 << 14;

/// The key of triangles with a coordinate that is not finite: they come first, so that they tell nothing about the rest.
const NOT_FINITE: u32 = 0;

/// Opens a file once more from its start.
pub(crate) type Open<'a> =
    dyn FnMut() -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> + 'a;

/// A stream in the order of its triangles' smallest coordinates on one axis; those with the same in the order they came.
pub(crate) struct Presorted {
    sorted: Order,
    axis: usize,
    count: u64,
    /// Of the triangles given last.
    colours: Vec<[Colour; 3]>,
}

/// Triangles with or without colours of their corners.
enum Order {
    Plain(Sorted<Triangle, Along>),
    Coloured { sorted: Sorted<Coloured, Along>, taken: Vec<Coloured> },
}

/// A triangle with the colours of its corners.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Coloured {
    triangle: Triangle,
    colours: [Colour; 3],
}

/// Reads a file twice, to find its axis and to sort it, in so many bytes of memory.
///
/// The scratch files take 36 bytes per triangle, 48 with colours; twice that where there are more than `memory / 64 KiB` runs of
/// `memory / 44` triangles, which is above 380 million triangles for 32 MiB.
///
/// # Errors
/// The source's, those of the scratch files, and [`Error::Interrupted`].
pub(crate) fn presort(
    open: &mut Open<'_>,
    scratch: &Scratch,
    memory: usize,
    observer: &mut Observer<'_>,
) -> Result<Presorted, Error> {
    let mut batch = Vec::new();
    let mut done = 0;
    let mut source = open()?;
    let mut expected = source.triangle_hint().map(|count| 2 * count);
    let mut tell = |read, expected| {
        Progress { stage: Stage::Sorting, read, expected, ..Default::default() }.tell(observer)
    };
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    while source.read(&mut batch, BATCH)? > 0 {
        for corner in batch.iter().filter(|triangle| is_finite(triangle)).flatten() {
            (low, high) = (low.min(*corner), high.max(*corner));
        }
        done += batch.len() as u64;
        batch.clear();
        tell(done, expected)?;
    }
    // In double precision, where no difference overflows.
    let extent = (high.as_dvec3() - low.as_dvec3()).to_array();
    let axis =
        (1..3).fold(0, |longest, axis| if extent[axis] > extent[longest] { axis } else { longest });

    expected = Some(2 * done);
    source = open()?;
    let mut count = 0;
    let sorted = if source.has_colours() {
        let mut sort = ExternalSort::new(scratch, memory, Along { axis });
        scratch.require(sort.scratch_bytes(done))?;
        let (mut numbers, mut colours) = (Vec::new(), Vec::new());
        while source.read_numbered(&mut batch, &mut numbers, BATCH)? > 0 {
            count += batch.len() as u64;
            source.look_up_colours(&numbers, &mut colours);
            let both = batch.drain(..).zip(colours.drain(..));
            both.map(|(triangle, colours)| Coloured { triangle, colours })
                .try_for_each(|coloured| sort.push(coloured))?;
            numbers.clear();
            tell(done + count, expected)?;
        }
        Order::Coloured { sorted: sort.finish()?, taken: Vec::new() }
    } else {
        let mut sort = ExternalSort::new(scratch, memory, Along { axis });
        scratch.require(sort.scratch_bytes(done))?;
        while source.read(&mut batch, BATCH)? > 0 {
            count += batch.len() as u64;
            batch.drain(..).try_for_each(|triangle| sort.push(triangle))?;
            tell(done + count, expected)?;
        }
        Order::Plain(sort.finish()?)
    };
    drop(source);
    Ok(Presorted { sorted, axis, count, colours: Vec::new() })
}

impl Presorted {
    /// Triangles in all.
    pub(crate) fn triangle_count(&self) -> u64 {
        self.count
    }
}

impl Feed for Presorted {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        match &mut self.sorted {
            Order::Plain(sorted) => sorted.take(out, max),
            Order::Coloured { sorted, taken } => {
                taken.clear();
                let count = sorted.take(taken, max)?;
                out.extend(taken.iter().map(|coloured| coloured.triangle));
                self.colours.clear();
                self.colours.extend(taken.iter().map(|coloured| coloured.colours));
                Ok(count)
            }
        }
    }

    fn colours(&self) -> &[[Colour; 3]] {
        &self.colours
    }

    fn finality(&self) -> Finality<'_> {
        // All that is to come lies beyond the first that is to come.
        let next_key = match &self.sorted {
            Order::Plain(sorted) => sorted.next_key(),
            Order::Coloured { sorted, .. } => sorted.next_key(),
        };
        let coordinate = match next_key {
            None => f32::INFINITY,
            Some(NOT_FINITE) => f32::NEG_INFINITY,
            Some(key) => coordinate(key),
        };
        Finality::Below { axis: self.axis, coordinate }
    }
}

/// Sorts by the smallest coordinate on an axis.
#[derive(Debug)]
struct Along {
    axis: usize,
}

impl Key<Triangle> for Along {
    #[inline]
    fn of(&self, triangle: &Triangle) -> u32 {
        if !is_finite(triangle) {
            return NOT_FINITE;
        }
        let [a, b, c] = triangle.map(|corner| corner[self.axis]);
        // Adding zero turns −0 into +0, which is the same place.
        let bits = (a.min(b).min(c) + 0.0).to_bits();
        // The order of the numbers: all bits of negative ones turned round, only the sign of the others.
        if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
    }
}

impl Key<Coloured> for Along {
    #[inline]
    fn of(&self, coloured: &Coloured) -> u32 {
        self.of(&coloured.triangle)
    }
}

/// The coordinate that a key stands for.
fn coordinate(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

fn is_finite(triangle: &Triangle) -> bool {
    triangle.iter().all(|corner| corner.is_finite())
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use mesh_io::{IndexedMesh, MeshSource};
    use proptest::prelude::*;

    use super::*;

    /// Sorts, and checks at every step what is said about finality; the axis and the triangles.
    fn sorted(soup: &[Triangle], memory: usize, batch: usize) -> (usize, Vec<Triangle>) {
        let folder = tempfile::tempdir().unwrap();
        let mesh = IndexedMesh::from_soup(soup);
        let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "soup")) as Box<_>);
        let mut last = None;
        let mut presorted = presort(&mut open, &Scratch::new(folder.path()), memory, &mut |now| {
            assert!(now.stage == Stage::Sorting && now.expected == Some(2 * soup.len() as u64));
            assert!(last < Some(now.read));
            last = Some(now.read);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(last.unwrap_or(0), 2 * soup.len() as u64);
        assert_eq!(presorted.triangle_count(), soup.len() as u64);
        let (mut all, mut below) = (Vec::new(), f32::NEG_INFINITY);
        let axis = loop {
            let before = all.len();
            let count = presorted.read(&mut all, batch).unwrap();
            for corner in all[before..].iter().filter(|t| is_finite(t)).flatten() {
                assert!(corner[presorted.axis] >= below, "a vertex said to be final comes back");
            }
            let Finality::Below { axis, coordinate } = presorted.finality() else { unreachable!() };
            assert!(coordinate >= below);
            below = coordinate;
            if count == 0 {
                break axis;
            }
        };
        assert_eq!(below, f32::INFINITY, "in the end all are final");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        (axis, all)
    }

    fn naive(soup: &[Triangle], axis: usize) -> Vec<Triangle> {
        let smallest = |t: &Triangle| {
            let c = t.map(|corner| corner[axis] + 0.0);
            if is_finite(t) { c[0].min(c[1]).min(c[2]) } else { f32::NEG_INFINITY }
        };
        let mut sorted = soup.to_vec();
        sorted.sort_by(|a, b| smallest(a).total_cmp(&smallest(b)));
        sorted
    }

    fn bits(soup: &[Triangle]) -> Vec<[u32; 3]> {
        soup.as_flattened().iter().map(|corner| corner.to_array().map(f32::to_bits)).collect()
    }

    fn scattered(count: u32, extent: Vec3) -> Vec<Triangle> {
        let random = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32 - 0.5;
        let corner = |i: u32| Vec3::new(random(i), random(i ^ 0x55), random(i ^ 0x3333)) * extent;
        (0..count).map(|t| [corner(9 * t), corner(9 * t + 1), corner(9 * t + 2)]).collect()
    }

    #[test]
    fn along_the_longest_axis_whatever_the_memory() {
        for axis in 0..3 {
            let mut extent = Vec3::ONE;
            extent[axis] = 5.0;
            let soup = scattered(5000, extent);
            for memory in [0, 1 << 19, DEFAULT_BYTES] {
                let (along, all) = sorted(&soup, memory, 333);
                assert_eq!(along, axis);
                assert_eq!(bits(&all), bits(&naive(&soup, axis)));
            }
        }
    }

    #[test]
    fn what_is_not_finite_comes_first_and_decides_nothing() {
        let mut soup = scattered(100, Vec3::new(1.0, 2.0, 1.0));
        soup[50][1].x = f32::INFINITY;
        soup[70][0].z = f32::NAN;
        soup[20][2].y = f32::NEG_INFINITY;
        let (axis, all) = sorted(&soup, 0, 1);
        assert_eq!(axis, 1);
        assert_eq!(bits(&all[..3]), bits(&[soup[20], soup[50], soup[70]]));
        assert_eq!(sorted(&[], 0, 1), (0, Vec::new()));
        assert_eq!(sorted(&[[Vec3::NAN; 3]; 40], 0, 7).1.len(), 40);
    }

    #[test]
    fn the_observer_can_stop_it_in_either_reading() {
        let mesh = IndexedMesh::from_soup(&scattered(3, Vec3::ONE));
        let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "soup")) as Box<_>);
        let folder = tempfile::tempdir().unwrap();
        for stop in [1, 4] {
            let stopped = presort(&mut open, &Scratch::new(folder.path()), 0, &mut |progress| {
                if progress.read < stop {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            });
            assert!(matches!(stopped, Err(Error::Interrupted)));
        }
    }

    #[test]
    fn keys_are_in_the_order_of_the_coordinates() {
        let ascending = [f32::MIN, -1.0, -1e-40, 0.0, 1e-45, 1e-40, 1.0, 65_536.0, f32::MAX];
        let key = |c: f32| Along { axis: 2 }.of(&[Vec3::splat(c), Vec3::MAX, Vec3::MAX]);
        for pair in ascending.windows(2) {
            assert!(key(pair[0]) < key(pair[1]));
            assert!(key(pair[0]) > NOT_FINITE);
            assert_eq!(coordinate(key(pair[0])), pair[0]);
        }
        assert_eq!(key(-0.0), key(0.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

        #[test]
        fn any_triangles_in_any_memory(
            bits_of in prop::collection::vec(prop::array::uniform9(any::<u32>()), 0..300),
            memory in 0usize..40_000,
            batch in 1usize..100,
        ) {
            let corner = |b: &[u32]| Vec3::new(f32::from_bits(b[0]), f32::from_bits(b[1]), f32::from_bits(b[2]));
            let soup: Vec<Triangle> = bits_of.iter().map(|b| [corner(b), corner(&b[3..]), corner(&b[6..])]).collect();
            let (axis, all) = sorted(&soup, memory, batch);
            prop_assert_eq!(bits(&all), bits(&naive(&soup, axis)));
        }
    }
}
