//! Rounds of collapses that do not touch each other (DeCoro and Pajarola 2002, §5.2), so that trees are balanced.
//!
//! In each round the cheaper part of all collapses is done, as the vertices lie in memory: large windows of it by different
//! threads, then what reaches over the border of two. A vertex takes only one other in a round.

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

use crate::collapse::{Collapsed, measure};
use crate::portion::{Portion, TAKEN, UNRATED, Window, state};
use crate::rate;

/// Windows that the buffer is cut into.
const WINDOWS: usize = 16;
/// Vertices of a window at least.
const LEAST_WINDOW: usize = 4096;
/// Share of the candidates that are below the threshold.
const SHARE: f64 = 0.4;
/// A collapse may cost so many times the threshold below which a vertex is looked at.
const LENIENCE: f32 = 1.5;
/// Vertices looked at to find a threshold.
const SAMPLES: usize = 4096;

/// Performs collapses, and remembers them.
#[derive(Debug, Default)]
pub(crate) struct Rounds {
    pub(crate) num_rounds: u64,
}

/// What was done in a window.
#[derive(Debug, Default)]
struct Done {
    collapses: Vec<Collapsed>,
    /// The vertices that are gone, and those that took them.
    pairs: Vec<(u32, u32)>,
    triangles: usize,
    /// Vertices whose turn it was, but which have neighbours in other windows.
    left: Vec<u32>,
}

impl Rounds {
    /// One round; there will be `goal` triangles or more. Appends what was done to `collapses`, and returns how many
    /// collapses that are.
    pub(crate) fn perform(
        &mut self,
        portion: &mut Portion,
        goal: usize,
        collapses: &mut Vec<Collapsed>,
    ) -> usize {
        let before = collapses.len();
        let Some(threshold) = self.threshold(portion, SHARE) else { return 0 };
        self.below(portion, threshold, goal, collapses);
        if collapses.len() == before {
            // Whatever is left: most of it has been tried, and is forbidden for now.
            self.below(portion, f32::MAX / LENIENCE, goal, collapses);
        }
        collapses.len() - before
    }

    /// The cost below which this share of the candidates lies.
    fn threshold(&self, portion: &mut Portion, share: f64) -> Option<f32> {
        // Each round draws anew, so that a run can begin with any.
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.num_rounds);
        let window = portion.whole();
        let slots = window.range();
        let few = slots.len() <= 4 * SAMPLES;
        let count = if few { slots.len() } else { SAMPLES };
        let mut costs = Vec::with_capacity(count);
        for i in 0..count as u32 {
            let v = if few { i } else { random.random_range(slots.clone()) };
            if window.state(v) & state::MAY_GO == 0 {
                continue;
            }
            let cost = match window.bound(v) {
                UNRATED => rate::least_in_place(&window, v),
                bound => bound,
            };
            if cost < f32::INFINITY {
                costs.push(cost);
            }
        }
        let rank = (share * costs.len() as f64) as usize;
        let rank = rank.min(costs.len().checked_sub(1)?);
        let (_, threshold, _) = costs.select_nth_unstable_by(rank, f32::total_cmp);
        Some(threshold.max(f32::MIN_POSITIVE))
    }

    fn below(
        &mut self,
        portion: &mut Portion,
        threshold: f32,
        goal: usize,
        collapses: &mut Vec<Collapsed>,
    ) {
        let below = num_due(&portion.whole(), threshold).max(1);
        let may_go = portion.num_triangles().saturating_sub(goal).div_ceil(2);
        let share = may_go as f64 / below as f64;
        self.num_rounds += 1;
        let size = (portion.num_slots() / WINDOWS).max(LEAST_WINDOW);
        let offset = if self.num_rounds.is_multiple_of(2) { size / 2 } else { size };
        let done: Vec<Done> = portion
            .windows(size, offset)
            .into_par_iter()
            .map(|mut window| window_round(&mut window, threshold, share))
            .collect();
        let mut left = Vec::new();
        for mut done in done {
            left.append(&mut done.left);
            take_back(portion, &done);
            collapses.append(&mut done.collapses);
        }
        let may_go = portion.num_triangles().saturating_sub(goal).div_ceil(2);
        let mut across = Done::default();
        let mut window = portion.whole();
        for v in left {
            if across.pairs.len() < may_go && is_due(&window, v, threshold) {
                collapse(&mut window, v, threshold, &mut across);
            }
        }
        let touched = across.pairs.iter().map(|&(_, u)| u);
        for u in touched {
            *window.flags_mut(u) &= !TAKEN;
        }
        take_back(portion, &across);
        collapses.append(&mut across.collapses);
    }
}

/// The names and slots of what is gone may be used again.
fn take_back(portion: &mut Portion, done: &Done) {
    portion.take_back(&done.pairs, done.triangles);
    if let Some(names) = &mut portion.names {
        for collapse in &done.collapses {
            names.give_back_vertex(collapse.removed.get());
            for h in [Some(collapse.half_edge), collapse.reverse].into_iter().flatten() {
                names.give_back_face(h.face().get());
            }
        }
    }
}

fn window_round(window: &mut Window<'_>, threshold: f32, share: f64) -> Done {
    let below = num_due(window, threshold);
    let most = (share * below as f64).ceil() as usize;
    let mut done = Done::default();
    for v in window.range() {
        if done.pairs.len() >= most {
            break;
        }
        if is_due(window, v, threshold) {
            if window.has_star(v) {
                collapse(window, v, threshold, &mut done);
            } else {
                done.left.push(v);
            }
        }
    }
    for &(_, u) in &done.pairs {
        *window.flags_mut(u) &= !TAKEN;
    }
    done
}

fn num_due(window: &Window<'_>, threshold: f32) -> usize {
    window.range().filter(|&v| is_due(window, v, threshold)).count()
}

#[inline]
fn is_due(window: &Window<'_>, v: u32, threshold: f32) -> bool {
    window.bound(v) <= threshold
        && window.flags(v) & TAKEN == 0
        && window.state(v) & state::MAY_GO != 0
}

/// Collapses a vertex into the neighbour that costs least, if that is little enough.
fn collapse(window: &mut Window<'_>, v: u32, threshold: f32, done: &mut Done) {
    let most = LENIENCE * threshold;
    let (u, deviation) = match rate::rate_recorded(window, v, most) {
        Ok(choice) => choice,
        Err(bound) => {
            *window.bound_mut(v) = bound;
            return;
        }
    };
    let record = measure::record(window, v, u, deviation);
    for i in 0..window.stars.fans(v).len() {
        let neighbour = window.stars.fans(v).at(i);
        let touched = &mut window.identity_mut(neighbour).touched;
        *touched = (*touched).max(record.rank + 1);
    }
    done.collapses.push(record);
    done.triangles += if window.state(v) == state::RING { 2 } else { 1 };
    done.pairs.push((v, u));
    let from = *window.vertex(v);
    let to = window.vertex_mut(u);
    to.quadric = rate::merged(&to.quadric, &from.quadric, from.position - to.position);
    to.deviation = deviation;
    window.take_paint(v, u);
    let mean = window.identity(v).mean;
    window.identity_mut(u).mean += mean;
    window.stars.collapse(v, u);
    *window.flags_mut(v) = state::FREE;
    *window.bound_mut(v) = f32::INFINITY;
    *window.flags_mut(u) |= TAKEN;
    if window.state(u) & state::MAY_GO != 0 {
        *window.bound_mut(u) = UNRATED;
    }
}
