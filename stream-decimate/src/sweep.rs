//! The way to a coarse mesh while that is far: sweeps.
//!
//! Where many collapses cost next to nothing compared to those that will follow, their order matters little. So a sweep goes
//! through the vertices as they lie in memory, and collapses each right away whose best collapse costs less than a
//! threshold. What takes a vertex stays where it is: a look at each neighbour's place rates all collapses. Much larger
//! windows than those of [rounds](crate::round) do, since neighbours are near in memory.

use rand::RngExt;
use rayon::prelude::*;

use crate::portion::{Portion, ROUGH, STALE, TAKEN, UNRATED, Window, state};
use crate::rate;
use crate::round::{Decimation, Outcome, WINDOW};

/// Windows that the buffer is cut into.
const WINDOWS: usize = 16;
/// Triangles at which sweeps end, as a multiple of those wanted in the end.
pub(crate) const SWEPT: f64 = 4.0;
/// A collapse may cost so many times the threshold below which a vertex is looked at.
const LENIENCE: f32 = 2.0;
/// Vertices looked at to find a threshold.
const SAMPLES: usize = 2048;
/// Sweeps end when one does not take one of so many of the triangles that are too many.
const WORTH: usize = 8;

/// What was done in a window.
#[derive(Debug, Default)]
struct Swept {
    outcome: Outcome,
    /// Vertices whose turn it was, but which have neighbours in other windows.
    left: Vec<u32>,
}

impl Decimation {
    /// Decimates down to about this number of triangles, but never below `least`.
    pub(crate) fn sweep(&mut self, portion: &mut Portion, goal: usize, least: usize) {
        while portion.num_triangles() > goal {
            let before = portion.num_triangles();
            if !self.sweep_once(portion, goal, least) {
                break;
            }
            if 2 * portion.num_vertices() < portion.num_slots() {
                portion.compact();
            }
            if before - portion.num_triangles() < (before - goal) / WORTH {
                break;
            }
        }
        for (flags, bound) in portion.flags.iter_mut().zip(&mut portion.bounds) {
            if *flags & ROUGH != 0 {
                *flags &= !ROUGH;
                *bound = UNRATED;
            }
        }
    }

    /// The cost below which `wanted` of the vertices in question lie, or the cheaper half, if that is less.
    fn sweep_threshold(&mut self, portion: &mut Portion, wanted: usize) -> Option<f32> {
        let window = portion.whole();
        let all: Vec<u32> = window.range().filter(|&v| is_in_question(&window, v)).collect();
        let count = SAMPLES.min(all.len());
        let mut costs: Vec<f32> = (0..count)
            .map(|i| match count < SAMPLES {
                true => all[i],
                false => all[self.random.random_range(0..all.len())],
            })
            .map(|v| match window.bound(v) {
                UNRATED => rate::least_in_place(&window, v),
                bound => bound,
            })
            .filter(|&cost| cost < f32::INFINITY)
            .collect();
        let share = (wanted as f64 / all.len().max(1) as f64).min(1.0);
        let share = (share * (1.0 + share)).min(0.9);
        let rank = (share * costs.len() as f64) as usize;
        if costs.is_empty() || rank == 0 {
            return None;
        }
        let (_, threshold, _) = costs.select_nth_unstable_by(rank - 1, f32::total_cmp);
        Some(*threshold)
    }

    /// One sweep; false if there is nothing left to do.
    fn sweep_once(&mut self, portion: &mut Portion, goal: usize, least: usize) -> bool {
        let wanted = portion.num_triangles().saturating_sub(goal).div_ceil(2);
        let Some(threshold) = self.sweep_threshold(portion, wanted) else { return false };
        // No window may do more than its share of what may be done.
        let below = num_due(&portion.whole(), threshold);
        let may_go = portion.num_triangles().saturating_sub(least) / 2;
        let share = may_go as f64 / below.max(1) as f64;
        self.num_rounds += 1;
        let size = (portion.num_slots() / WINDOWS).max(WINDOW);
        let offset = if self.num_rounds.is_multiple_of(2) { size / 2 } else { size };
        let swept: Vec<Swept> = portion
            .windows(size, offset)
            .into_par_iter()
            .map(|mut window| sweep_window(&mut window, threshold, share))
            .collect();
        let mut left = Vec::new();
        for swept in swept {
            portion.take_back(&swept.outcome.collapsed, swept.outcome.triangles);
            left.extend(swept.left);
        }
        // What reaches over a border of windows, where the first ones did not take all that may go.
        let may_go = portion.num_triangles().saturating_sub(least) / 2;
        let mut across = Outcome::default();
        let mut window = portion.whole();
        for v in left {
            if across.collapsed.len() < may_go && is_due(&window, v, threshold) {
                sweep_away(&mut window, v, threshold, &mut across);
            }
        }
        for &(_, u) in &across.collapsed {
            *window.flags_mut(u) &= !TAKEN;
        }
        portion.take_back(&across.collapsed, across.triangles);
        true
    }
}

/// How many are due at most.
fn num_due(window: &Window<'_>, threshold: f32) -> usize {
    window.range().filter(|&v| window.bound(v) <= threshold && is_in_question(window, v)).count()
}

/// Goes through a window, and collapses those below the threshold that cost no more than that allows; a vertex takes only
/// one other.
fn sweep_window(window: &mut Window<'_>, threshold: f32, share: f64) -> Swept {
    let below = num_due(window, threshold);
    let most = (share * below as f64) as usize;
    let mut swept = Swept::default();
    for v in window.range() {
        if swept.outcome.collapsed.len() >= most {
            break;
        }
        if is_due(window, v, threshold) {
            if window.has_star(v) {
                sweep_away(window, v, threshold, &mut swept.outcome);
            } else {
                swept.left.push(v);
            }
        }
    }
    for &(_, u) in &swept.outcome.collapsed {
        *window.flags_mut(u) &= !TAKEN;
    }
    swept
}

/// Whether a vertex may go, and has not been rated but roughly.
#[inline]
fn is_in_question(window: &Window<'_>, v: u32) -> bool {
    (window.bound(v) == UNRATED || window.flags(v) & ROUGH != 0)
        && window.state(v) & state::MAY_GO != 0
}

#[inline]
fn is_due(window: &Window<'_>, v: u32, threshold: f32) -> bool {
    window.bound(v) <= threshold && window.flags(v) & TAKEN == 0 && is_in_question(window, v)
}

/// Collapses a vertex, if that costs little enough.
fn sweep_away(window: &mut Window<'_>, v: u32, threshold: f32, outcome: &mut Outcome) {
    let (u, deviation) = match rate::rate_in_place(window, v, LENIENCE * threshold) {
        Ok(choice) => choice,
        Err(least) => {
            *window.bound_mut(v) = least;
            *window.flags_mut(v) |= STALE | ROUGH;
            return;
        }
    };
    outcome.triangles += if window.state(v) == state::RING { 2 } else { 1 };
    outcome.collapsed.push((v, u));
    let from = *window.vertex(v);
    let to = window.vertex_mut(u);
    to.quadric = rate::merged(&to.quadric, &from.quadric, from.position - to.position);
    to.deviation = deviation;
    window.stars.collapse(v, u);
    *window.flags_mut(v) = state::FREE;
    *window.bound_mut(v) = f32::INFINITY;
    *window.flags_mut(u) |= TAKEN;
    for i in 0..window.stars.valence(u) {
        let x = window.stars.fans(u).at(i);
        if window.state(x) & state::MAY_GO != 0 {
            *window.flags_mut(x) |= STALE;
            if window.bound(x) == f32::INFINITY {
                *window.bound_mut(x) = UNRATED;
            }
        }
    }
    if window.state(u) & state::MAY_GO != 0 {
        *window.flags_mut(u) |= STALE;
        *window.bound_mut(u) = UNRATED;
    }
}
