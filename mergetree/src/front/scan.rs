//! All nodes of the front tested, eight at a time, on all cores.

use rayon::prelude::*;

use crate::ErrorMeasure;
use crate::measure::{BoundsLanes, LANES};

/// Groups of eight nodes that are one piece of work.
const CHUNK: usize = 256;

/// Memory for what a scan finds, kept from one to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scan {
    found: Vec<Vec<(f32, u32)>>,
}

impl Scan {
    /// Computes the errors of all nodes whose bit is set in `present`, and passes on what `keep` makes of them with the
    /// node's index, in order. Returns how many were tested.
    pub(crate) fn run(
        &mut self,
        measure: &impl ErrorMeasure,
        (groups, present): (&[BoundsLanes], &[u8]),
        keep: impl Fn(f32, u32) -> Option<f32> + Sync,
        mut take: impl FnMut(f32, u32),
    ) -> usize {
        let num_chunks = groups.len().div_ceil(CHUNK);
        if self.found.len() < num_chunks {
            self.found.resize_with(num_chunks, Vec::new);
        }
        let test = |((first, groups), present): ((usize, &[BoundsLanes]), &[u8]),
                    found: &mut Vec<_>| {
            found.clear();
            let mut tests = 0;
            for ((index, bounds), &present) in (first * CHUNK..).zip(groups).zip(present) {
                if present == 0 {
                    continue;
                }
                tests += present.count_ones() as usize;
                for (lane, error) in measure.errors(bounds).into_iter().enumerate() {
                    let node = (index * LANES + lane) as u32;
                    if present >> lane & 1 == 1
                        && let Some(kept) = keep(error, node)
                    {
                        found.push((kept, node));
                    }
                }
            }
            tests
        };
        let work = groups.par_chunks(CHUNK).enumerate().zip(present.par_chunks(CHUNK));
        let tests = if num_chunks < 4 {
            let work = groups.chunks(CHUNK).enumerate().zip(present.chunks(CHUNK));
            work.zip(&mut self.found).map(|(work, found)| test(work, found)).sum()
        } else {
            work.zip(&mut self.found).map(|(work, found)| test(work, found)).sum()
        };
        for found in &mut self.found[..num_chunks] {
            found.drain(..).for_each(|(error, node)| take(error, node));
        }
        tests
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.found.iter().map(|found| found.capacity() * size_of::<(f32, u32)>()).sum()
    }
}
