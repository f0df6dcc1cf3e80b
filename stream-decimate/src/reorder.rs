//! Puts what is near in space near in memory.
//!
//! All work on a mesh is a walk from neighbour to neighbour; with the vertices along a space-filling curve, most of them
//! are found in the caches nearest to the core.

use glam::Vec3;
use rayon::prelude::*;

use crate::portion::{Portion, state};

/// Bits per axis of a position on the curve.
const BITS: u32 = 10;

/// Renumbers the vertices in use along a Morton curve, and gives back the others.
pub(crate) fn reorder(portion: &mut Portion) {
    let used = |v: &u32| portion.state(*v) != state::FREE;
    let slots = 0..portion.num_slots() as u32;
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for v in slots.clone().filter(used) {
        (low, high) = (low.min(portion.position(v)), high.max(portion.position(v)));
    }
    let extent = (high - low).max_element();
    let scale = ((1 << BITS) - 1) as f32 / if extent > 0.0 { extent } else { 1.0 };
    let mut order: Vec<u64> = slots
        .filter(used)
        .map(|v| u64::from(morton((portion.position(v) - low) * scale)) << 32 | u64::from(v))
        .collect();
    order.par_sort_unstable();
    let used = order.len();
    let free = (0..portion.num_slots() as u32).filter(|&v| portion.state(v) == state::FREE);
    let order: Vec<u32> = order.into_iter().map(|key| key as u32).chain(free).collect();
    portion.renumber(&order, used);
}

/// Interleaves the bits of the whole parts.
fn morton(at: Vec3) -> u32 {
    let [x, y, z] = at.to_array().map(|c| spread(c as u32));
    x | y << 1 | z << 2
}

/// Puts two zeros before each of the ten lowest bits.
fn spread(n: u32) -> u32 {
    let n = (n | n << 16) & 0x0300_00ff;
    let n = (n | n << 8) & 0x0300_f00f;
    let n = (n | n << 4) & 0x030c_30c3;
    (n | n << 2) & 0x0924_9249
}
