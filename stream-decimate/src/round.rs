//! DECIMATE (Wu and Kobbelt 2003, §4.3): multiple choice, many choices at a time.
//!
//! The best of `k` candidates drawn at random lies among the cheapest `1/k` of all. So instead of drawing `k` candidates
//! for each collapse, a round draws one sample, to learn the cost below which the cheapest lie, and then performs all
//! collapses below it: window of memory by window, each small enough for the caches of one core, the cheapest of a window
//! first. Windows are worked on in parallel; what reaches over the border of a window is done afterwards. The result does
//! not depend on the number of threads.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use qem::ErrorMetric;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

use crate::portion::{Portion, STALE, UNRATED, UNSURE, Window, state};
use crate::rate::{self, Rating, Rules};

/// Vertices in a window: their data fits into a core's second-level cache.
pub(crate) const WINDOW: usize = 4096;
/// One of so many rounds looks at what lies across the borders of windows.
const ACROSS: usize = 2;
/// Vertices looked at to find a threshold.
const SAMPLES: usize = 2048;
/// Least rank in the sample that makes a good threshold.
const LEAST_RANK: usize = 64;

/// Performs collapses.
#[derive(Debug)]
pub(crate) struct Decimation {
    pub(crate) rules: Rules,
    /// One of so many vertices is a candidate in each round.
    candidates: usize,
    pub(crate) random: Xoshiro256PlusPlus,
    sample: Vec<f32>,
    pub(crate) num_rounds: usize,
}

/// What was done in a window.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    /// Vertices that are gone, and those that took them.
    pub(crate) collapsed: Vec<(u32, u32)>,
    /// Triangles that are gone.
    pub(crate) triangles: usize,
}

impl Decimation {
    /// With the random choices of a seed.
    pub(crate) fn new(rules: Rules, candidates: usize, seed: u64) -> Self {
        Self {
            rules,
            candidates,
            random: Xoshiro256PlusPlus::seed_from_u64(seed),
            sample: Vec::new(),
            num_rounds: 0,
        }
    }

    /// Decimates down to this number of triangles, or by so many more as `slack` says less; false if there is no
    /// collapse left before that.
    pub(crate) fn run(&mut self, portion: &mut Portion, goal: usize, slack: usize) -> bool {
        if portion.num_triangles() > goal + slack {
            rate_new(portion, &self.rules);
        }
        while portion.num_triangles() > goal + slack {
            if 2 * portion.num_vertices() < portion.num_slots() {
                portion.compact();
            }
            let wanted = (portion.num_triangles() - goal).div_ceil(2);
            let threshold = match portion.num_triangles() - goal {
                1 => cheapest_on_boundary(portion),
                _ => self.threshold(portion, wanted),
            };
            let Some(threshold) = threshold else { return false };
            if !self.round(portion, threshold, goal) {
                return false;
            }
        }
        true
    }

    /// The cost below which there are the candidates' share of all vertices; or `wanted` of them, if that is less.
    /// `None` if there are no candidates.
    fn threshold(&mut self, portion: &mut Portion, wanted: usize) -> Option<f32> {
        self.sample.clear();
        let window = portion.whole();
        let slots = window.range();
        let draws = SAMPLES.min(slots.len());
        for _ in 0..draws {
            let v = self.random.random_range(slots.clone());
            let bound = match window.bound(v) {
                UNRATED => rate::costs(&window, v, &self.rules, |_, _| {}).cost,
                bound => bound,
            };
            if bound < f32::INFINITY {
                self.sample.push(bound);
            }
        }
        let bounds = window.bounds();
        // A little less than wanted, since a sample is only a sample.
        let of_wanted = wanted * draws / bounds.len().max(1);
        let mut rank = (of_wanted * 7 / 8).min(self.sample.len() / self.candidates);
        if rank < LEAST_RANK {
            self.sample.clear();
            self.sample.extend(bounds.iter().filter(|&&b| b < f32::INFINITY));
            rank = wanted.min(self.sample.len().div_ceil(self.candidates));
        }
        if self.sample.is_empty() {
            return None;
        }
        let rank = rank.clamp(1, self.sample.len()) - 1;
        let (_, threshold, _) = self.sample.select_nth_unstable_by(rank, f32::total_cmp);
        Some(*threshold)
    }

    /// Performs the collapses that cost no more than the threshold. False if there are some, but only such as would
    /// take too much.
    fn round(&mut self, portion: &mut Portion, threshold: f32, goal: usize) -> bool {
        self.num_rounds += 1;
        let rules = self.rules;
        let below = |portion: &Portion| portion.bounds.iter().filter(|&&b| b <= threshold).count();
        // No window makes more collapses than these.
        let far = portion.num_triangles() >= goal + 2 * below(portion);
        if far {
            let offset = if self.num_rounds.is_multiple_of(2) { WINDOW / 2 } else { WINDOW };
            let outcomes: Vec<Outcome> = portion
                .windows(WINDOW, offset)
                .into_par_iter()
                .map(|mut window| {
                    window.warm();
                    decimate_window(&mut window, threshold, &rules, usize::MAX)
                })
                .collect();
            let before = portion.num_triangles();
            for outcome in outcomes {
                portion.take_back(&outcome.collapsed, outcome.triangles);
            }
            if portion.num_triangles() < before && !self.num_rounds.is_multiple_of(ACROSS) {
                return true;
            }
        }
        let most = portion.num_triangles() - goal;
        let outcome = decimate_window(&mut portion.whole(), threshold, &rules, most);
        portion.take_back(&outcome.collapsed, outcome.triangles);
        outcome.triangles > 0 || below(portion) == 0 || most == 1
    }
}

/// The least cost of a collapse that removes a single triangle.
fn cheapest_on_boundary(portion: &Portion) -> Option<f32> {
    let bounds = portion.bounds.iter().zip(&portion.flags);
    bounds
        .filter(|&(&bound, &flags)| bound < f32::INFINITY && flags & state::BOUNDARY != 0)
        .map(|(&bound, _)| bound)
        .min_by(f32::total_cmp)
}

/// Rates the vertices that have become candidates; what is forbidden shows when it is their turn.
fn rate_new(portion: &mut Portion, rules: &Rules) {
    let new: Vec<u32> = (0..portion.num_slots() as u32)
        .filter(|&v| {
            portion.flags[v as usize] & STALE != 0 && portion.bounds[v as usize] == UNRATED
        })
        .collect();
    let mut window = portion.whole();
    let shared = &window;
    let ratings: Vec<_> = new
        .par_iter()
        .with_min_len(256)
        .map(|&v| rate::costs(shared, v, rules, |_, _| {}))
        .collect();
    for (&v, rating) in new.iter().zip(ratings) {
        accept(&mut window, v, &rating);
        *window.flags_mut(v) |= UNSURE;
    }
}

fn accept(window: &mut Window<'_>, v: u32, rating: &Rating) {
    *window.bound_mut(v) = rating.cost;
    *window.flags_mut(v) &= !(STALE | UNSURE);
    let vertex = window.vertex_mut(v);
    (vertex.target, vertex.second) = (rating.target, rating.second);
}

/// Performs the collapses of a window, the cheapest first, until `most` triangles are gone; no more than there are vertices
/// below the threshold.
fn decimate_window(window: &mut Window<'_>, threshold: f32, rules: &Rules, most: usize) -> Outcome {
    let mut outcome = Outcome::default();
    let (mut costs, mut retry) = (Vec::new(), Vec::new());
    // Costs are not negative: their bits are in the order of their values.
    let bits = |cost: f32| cost.to_bits();
    let mut heap: BinaryHeap<Reverse<(u32, u32)>> = window
        .bounds()
        .iter()
        .zip(window.base()..)
        .filter(|&(&bound, _)| bound <= threshold)
        .map(|(&bound, v)| Reverse((bits(bound), v)))
        .collect();
    let most = most.min(2 * heap.len());
    while let Some(Reverse((key, v))) = heap.pop() {
        if window.state(v) & state::MAY_GO == 0 {
            continue;
        }
        let bound = window.bound(v);
        if bits(bound) > key {
            if bound <= threshold {
                heap.push(Reverse((bits(bound), v)));
            }
            continue;
        }
        if !window.has_star(v) {
            continue;
        }
        let flags = window.flags(v);
        let mut known = None;
        if flags & (STALE | UNSURE) != 0 {
            let rating = if flags & STALE != 0 {
                rate::rate(window, v, rules)
            } else {
                rate::confirm(window, v, rules)
            };
            let Some(rating) = rating else { continue };
            accept(window, v, &rating);
            let next = heap.peek().map_or(u32::MAX, |Reverse((key, _))| *key);
            if rating.cost <= threshold && bits(rating.cost) <= next.max(key) {
                known = Some(rating);
            } else {
                if rating.cost <= threshold {
                    heap.push(Reverse((bits(rating.cost), v)));
                }
                continue;
            }
        }
        let u = window.vertex(v).target;
        if !rate::can_collapse_here(window, v, u) {
            continue;
        }
        let gone = if window.state(v) == state::RING { 2 } else { 1 };
        if outcome.triangles + gone > most {
            continue;
        }
        collapse(window, v, u, known.as_ref(), rules);
        outcome.collapsed.push((v, u));
        outcome.triangles += gone;
        correct_bounds(window, v, u, rules, &mut costs, &mut retry);
        if window.bound(u) <= threshold {
            // Its entry was put aside while there was no candidate; one entry too many does no harm.
            heap.push(Reverse((bits(window.bound(u)), u)));
        }
    }
    for v in retry {
        let flags = window.flags(v);
        if window.bound(v) == f32::INFINITY && flags & state::MAY_GO != 0 && flags & STALE != 0 {
            *window.bound_mut(v) = threshold;
        }
    }
    outcome
}

/// Collapses `v` into `u`, by a rating that has just been made, if there is one.
fn collapse(window: &mut Window<'_>, v: u32, u: u32, known: Option<&Rating>, rules: &Rules) {
    let (at, deviation) = match known {
        Some(rating) => (rating.at, rating.deviation),
        None => {
            let (at, _) = rate::place(window, v, u, rules);
            (at, rate::deviation(window, v, u, at, rules))
        }
    };
    let from = *window.vertex(v);
    let to = window.vertex_mut(u);
    let both = rate::merged(&to.quadric, &from.quadric, from.position - to.position);
    to.quadric = both.about(at);
    to.position += at;
    to.deviation = deviation;
    window.stars.collapse(v, u);
    *window.flags_mut(v) = state::FREE;
    *window.bound_mut(v) = f32::INFINITY;
}

/// Rates the edges of `u`, which took `v`, and corrects the bounds around it: quadrics only grow, so no cost sinks, and
/// only the costs of these edges rise.
fn correct_bounds(
    window: &mut Window<'_>,
    v: u32,
    u: u32,
    rules: &Rules,
    costs: &mut Vec<(u32, f32)>,
    retry: &mut Vec<u32>,
) {
    costs.clear();
    let rating = rate::costs(window, u, rules, |x, cost| costs.push((x, cost)));
    for i in 0..window.stars.valence(u) {
        let x = window.stars.fans(u).at(i);
        let flags = window.flags_mut(x);
        if *flags & state::MAY_GO == 0 {
            continue;
        }
        *flags |= UNSURE;
        if window.bound(x) == f32::INFINITY {
            // What was forbidden may be allowed now; but not what moved the surface too far, as a rule.
            if !rules.has_limit() {
                *window.flags_mut(x) |= STALE;
                retry.push(x);
            }
            continue;
        }
        let vertex = window.vertex_mut(x);
        if vertex.target == v || vertex.target == u {
            vertex.target = u;
            let second = vertex.second;
            let cost = costs.iter().find(|c| c.0 == x).map_or(second, |c| c.1);
            if cost > rate::TOLERANCE * second {
                *window.flags_mut(x) |= STALE;
            }
            let bound = window.bound_mut(x);
            *bound = bound.max(cost.min(second));
        }
    }
    if window.state(u) & state::MAY_GO != 0 {
        let flags = window.flags_mut(u);
        *flags = *flags & !STALE | UNSURE;
        *window.bound_mut(u) = rating.cost;
        let vertex = window.vertex_mut(u);
        (vertex.target, vertex.second) = (rating.target, rating.second);
    }
}
