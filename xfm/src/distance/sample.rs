//! Points spread evenly over a surface.
//!
//! The triangles are laid end to end along a line, each as long as its area, and the line is cut into as many equal pieces
//! as there are samples; one point is drawn in each piece. Where in its triangle the point falls is decided by
//! the place within the piece and by a golden-ratio sequence, which fills a triangle of many samples like a lattice. Any
//! range of samples can be drawn without the ones before it, and neighbours in the sequence are neighbours in space.

use std::ops::Range;

use glam::DVec3;

use super::tree::Tree;
use super::triangle;

/// 2⁶⁴ divided by the golden ratio: steps of it fill the unit interval as evenly as any sequence can.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Area-weighted, stratified, deterministic samples of one surface.
#[derive(Debug)]
pub(super) struct Sampler<'a> {
    tree: &'a Tree,
    /// For every triangle, the area of it and all before it.
    area_through: Vec<f64>,
    samples: usize,
    seed: u64,
}

impl<'a> Sampler<'a> {
    /// Lays out `samples` pieces; `None` if the surface has no area to cut.
    pub(super) fn new(tree: &'a Tree, samples: usize, seed: u64) -> Option<Self> {
        let mut total = 0.0;
        let area_through: Vec<f64> = (0..tree.triangles.len())
            .map(|triangle| {
                total += triangle::double_area(tree.corners(triangle));
                total
            })
            .collect();
        (total > 0.0).then_some(Self { tree, area_through, samples, seed })
    }

    /// Draws the samples of a range, in order, and hands each to `visit`.
    pub(super) fn draw(&self, range: Range<usize>, mut visit: impl FnMut(DVec3)) {
        let last = self.area_through.len() - 1;
        let total = self.area_through[last];
        let mut triangle = None;
        for sample in range {
            let within = unit_interval(mix(self.seed ^ mix(sample as u64)));
            let at = (sample as f64 + within) / self.samples as f64 * total;
            let from =
                triangle.unwrap_or_else(|| self.area_through.partition_point(|&area| area <= at));
            let mut found = from.min(last);
            while found < last && self.area_through[found] <= at {
                found += 1;
            }
            triangle = Some(found);
            let before = if found == 0 { 0.0 } else { self.area_through[found - 1] };
            let fraction = ((at - before) / (self.area_through[found] - before)).clamp(0.0, 1.0);
            let across =
                unit_interval((sample as u64).wrapping_add(mix(self.seed)).wrapping_mul(GOLDEN));
            visit(point_in(self.tree.corners(found), fraction, across));
        }
    }
}

/// The point of a triangle at two coordinates from [0, 1]: equal areas of the square go to equal areas of the triangle.
fn point_in([a, b, c]: [DVec3; 3], fraction: f64, across: f64) -> DVec3 {
    let from_a = fraction.sqrt();
    a + ((b - a) * (1.0 - across) + (c - a) * across) * from_a
}

/// The upper 53 bits as a number from [0, 1).
fn unit_interval(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// A permutation of 64-bit words that leaves no pattern behind (the finaliser of SplitMix64: G. Steele, D. Lea, C. Flood,
/// *Fast splittable pseudorandom number generators*, 2014).
fn mix(word: u64) -> u64 {
    let word = word.wrapping_add(GOLDEN);
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}
