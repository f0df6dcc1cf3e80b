//! Rating: what the best collapse of a vertex would cost (Garland and Heckbert 1997; Wu and Kobbelt 2003, §4.3).
//!
//! A collapse is rated by the least value of the two quadrics' sum, and puts the vertex left there: the place it would
//! get at the end anyway. Only the best collapse that is legal and turns no triangle over counts.

use std::cell::RefCell;

use glam::Vec3;
use qem::{Batch, ErrorMetric, LANES, Quadric};

use crate::Placement;
use crate::collapse::measure;
use crate::deviation::Patch;
use crate::new_star::NewStar;
use crate::portion::{Vertex, Window, state};

/// What moving the surface by a distance costs, as a share of that distance to the fourth power: the quadrics alone would
/// cut off thin spikes and needles, which have no area to speak of.
const DEVIATION_WEIGHT: f32 = 40.0;

/// Least cosine of the angle by which a collapse may turn a triangle.
const LEAST_COSINE: f32 = 0.2;
/// The same in sweeps, where nothing else keeps the new triangles from lying across a fold.
const LEAST_COSINE_OF_SWEEPS: f32 = 0.7;

/// A neighbour that was the best may cost so many times the second best before another one is looked for.
pub(crate) const TOLERANCE: f32 = 3.0;

/// What a collapse may do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub(crate) placement: Placement,
    /// How far the surface may move at most.
    pub(crate) most_deviation: f32,
}

impl Rules {
    /// Whether there is a limit to how far the surface may move.
    pub(crate) fn has_limit(&self) -> bool {
        self.most_deviation < f32::INFINITY
    }
}

/// Neighbours rated without a list on the heap.
const MOST_RATED: usize = 10;

/// The best collapse of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rating {
    /// Squared distance times area; infinite where there is no collapse.
    pub(crate) cost: f32,
    /// At most the cost of any other.
    pub(crate) second: f32,
    /// The neighbour that stays.
    pub(crate) target: u32,
    /// At most how far the surface around it will have moved; infinite if the collapse is forbidden, or if nobody asked.
    pub(crate) deviation: f32,
    /// Where that neighbour will be, as seen from where it is.
    pub(crate) at: Vec3,
}

const NONE: Rating = Rating {
    cost: f32::INFINITY,
    second: f32::INFINITY,
    target: u32::MAX,
    deviation: f32::INFINITY,
    at: Vec3::ZERO,
};

/// The cost of collapsing into one neighbour.
#[derive(Clone, Copy, Debug)]
struct Choice {
    cost: f32,
    target: u32,
    /// Where the neighbour will be, as seen from where it is.
    at: Vec3,
}

/// The neighbours that a vertex may be collapsed into, with the costs.
struct Choices {
    few: [Choice; MOST_RATED],
    many: Vec<Choice>,
    len: usize,
}

impl Choices {
    fn all(&mut self) -> &mut [Choice] {
        if self.many.is_empty() { &mut self.few[..self.len] } else { &mut self.many }
    }

    fn push(&mut self, choice: Choice) {
        if self.len < MOST_RATED {
            self.few[self.len] = choice;
        } else {
            if self.many.is_empty() {
                self.many.extend_from_slice(&self.few);
            }
            self.many.push(choice);
        }
        self.len += 1;
    }
}

/// Rates a vertex that may go, whose present rating may be out of date: keeps to its target if that is still the best.
/// The vertex and its neighbours have to be in the window; `None` if the neighbours of the best of them are not.
pub(crate) fn confirm(window: &Window<'_>, v: u32, rules: &Rules) -> Option<Rating> {
    let &Vertex { target, second, .. } = window.vertex(v);
    if !window.stars.fans(v).contains(target) || window.state(target) & takers(window, v) == 0 {
        return rate(window, v, rules);
    }
    if !window.has_star(target) {
        return None;
    }
    let (at, cost) = place(window, v, target, rules);
    let tolerated = TOLERANCE * second;
    if cost <= tolerated {
        let deviation = checked(window, v, target, at, rules);
        let cost = cost + penalty(deviation);
        if cost <= tolerated && deviation < f32::INFINITY {
            return Some(Rating { cost, second, target, deviation, at });
        }
    }
    rate(window, v, rules)
}

/// The states of neighbours that may take a vertex.
#[inline]
fn takers(window: &Window<'_>, v: u32) -> u8 {
    match window.state(v) {
        state::RING => state::MAY_TAKE,
        _ => state::BOUNDARY | state::FROZEN,
    }
}

/// Rates a vertex that may go. The vertex and its neighbours have to be in the window; `None` if the neighbours of one
/// that may be the best of them are not.
pub(crate) fn rate(window: &Window<'_>, v: u32, rules: &Rules) -> Option<Rating> {
    let mut choices = choices(window, v, rules);
    let mut choices = choices.all();
    let mut rating = NONE;
    while let Some((best, Choice { cost, target, at })) = least(choices) {
        if cost >= rating.cost {
            rating.second = rating.second.min(cost);
            break;
        }
        let last = choices.len() - 1;
        choices.swap(best, last);
        choices = &mut choices[..last];
        if !window.has_star(target) {
            return None;
        }
        let deviation = checked(window, v, target, at, rules);
        let cost = cost + penalty(deviation);
        if cost < rating.cost {
            rating = Rating { cost, second: rating.cost, target, deviation, at };
        } else {
            rating.second = rating.second.min(cost);
        }
    }
    Some(rating)
}

/// The best collapse of a vertex that costs no more than `most`, among those into a neighbour that stays where it is: that
/// neighbour, and at most how far the surface around it will have moved. The vertex and its neighbours have to be in the
/// window. Where there is none, the least cost, forbidden or not.
pub(crate) fn rate_in_place(window: &Window<'_>, v: u32, most: f32) -> Result<(u32, f32), f32> {
    let mut choices = InPlace::new(window, v);
    best_in_place(window, v, &mut choices, most, moved)
}

/// As [`rate_in_place`], for a collapse that is recorded: more of it is measured, and on a boundary only the neighbour after
/// the vertex may take it. Where there is none, the cost that has to be allowed before there can be one.
pub(crate) fn rate_recorded(window: &Window<'_>, v: u32, most: f32) -> Result<(u32, f32), f32> {
    let mut choices = InPlace::new(window, v);
    let fans = window.stars.fans(v);
    if !fans.is_ring() {
        choices.keep(fans.at(0));
    }
    let measure = |window: &Window<'_>, v, u| measure::moved(window, v, u).unwrap_or(f32::INFINITY);
    // What was forbidden is tried again when more is allowed.
    best_in_place(window, v, &mut choices, most, measure)
        .map_err(|least| if least <= most { most.next_up() } else { least })
}

fn best_in_place(
    window: &Window<'_>,
    v: u32,
    choices: &mut InPlace,
    most: f32,
    moved: impl Fn(&Window<'_>, u32, u32) -> f32,
) -> Result<(u32, f32), f32> {
    let choices = choices.all();
    let mut least = f32::INFINITY;
    for _ in 0..choices.len() {
        let Some(best) = choices.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        let (cost, u) = *best;
        least = least.min(cost);
        if cost.is_nan() || cost > most {
            break;
        }
        if can_collapse_here(window, v, u) && is_legal(window, v, u) {
            let earlier = window.vertex(v).deviation.max(window.vertex(u).deviation);
            let deviation = earlier + moved(window, v, u);
            if cost + penalty(deviation) <= most {
                return Ok((u, deviation));
            }
        }
        best.0 = f32::INFINITY;
    }
    Err(least)
}

/// The least cost of collapsing a vertex into a neighbour that stays where it is.
pub(crate) fn least_in_place(window: &Window<'_>, v: u32) -> f32 {
    InPlace::new(window, v).all().iter().fold(f32::INFINITY, |least, choice| least.min(choice.0))
}

/// Neighbours that may take a vertex and stay where they are, and the costs.
struct InPlace {
    choices: [(f32, u32); MOST_RATED],
    len: usize,
}

impl InPlace {
    fn new(window: &Window<'_>, v: u32) -> Self {
        let center = window.vertex(v);
        let fans = window.stars.fans(v);
        let takers = takers(window, v);
        let mut list = Self { choices: [(f32::INFINITY, 0); MOST_RATED], len: 0 };
        let has_colour_costs = window.has_colour_costs();
        let consider = |u: u32| {
            if list.len < MOST_RATED && window.state(u) & takers != 0 {
                let other = window.vertex(u);
                let mut cost = center.quadric.cost(other.position - center.position)
                    + other.quadric.cost(Vec3::ZERO);
                if has_colour_costs {
                    cost += window.colour_cost(v, u);
                }
                list.choices[list.len] = (cost, u);
                list.len += 1;
            }
        };
        if fans.is_ring() {
            fans.neighbours().for_each(consider);
        } else {
            let ends = fans.ends().take(1).flat_map(|(first, last)| [first, last]);
            ends.for_each(consider);
        }
        list
    }

    /// Drops all neighbours but one.
    fn keep(&mut self, u: u32) {
        let kept = self.choices[..self.len].iter().position(|choice| choice.1 == u);
        if let Some(kept) = kept {
            self.choices[0] = self.choices[kept];
        }
        self.len = usize::from(kept.is_some());
    }

    fn all(&mut self) -> &mut [(f32, u32)] {
        &mut self.choices[..self.len]
    }
}

/// Whether all that the collapse changes lies in the window.
pub(crate) fn can_collapse_here(window: &Window<'_>, v: u32, u: u32) -> bool {
    let stars = &window.stars;
    let valence = stars.valence(v) + stars.valence(u);
    !stars.is_long(valence)
        && window.has_star(u)
        && stars.fans(v).neighbours().all(|x| !stars.is_long(stars.valence(x)))
}

/// How far `v` is from the triangles that are left once it is at `u`; infinite if one is turned over.
fn moved(window: &Window<'_>, v: u32, u: u32) -> f32 {
    let at = window.position(u);
    let mut star = NewStar::<1>::new([window.position(v) - at, Vec3::ZERO], LEAST_COSINE_OF_SWEEPS);
    for (a, b) in window.stars.fans(v).triangles() {
        if a != u && b != u {
            star.push(window.position(a) - at, window.position(b) - at, 0);
        }
    }
    star.finish().max(boundary_moved(window, v, u, at))
}

/// How far two neighbours on a boundary are from the boundary once they are one vertex at `at`; nothing for others. There the
/// surface may grow beyond its boundary without any point of it being moved.
pub(crate) fn boundary_moved(window: &Window<'_>, v: u32, u: u32, at: Vec3) -> f32 {
    if window.state(v) != state::BOUNDARY {
        return 0.0;
    }
    let [from, to] = [v, u].map(|x| window.position(x) - at);
    let mut least = [from.length_squared(), to.length_squared()];
    for (x, other) in [(v, u), (u, v)] {
        let ends = window.stars.fans(x).ends().flat_map(|(first, last)| [first, last]);
        for end in ends.filter(|&end| end != other) {
            let end = window.position(end) - at;
            for (least, p) in least.iter_mut().zip([from, to]) {
                let along = (p.dot(end) / end.length_squared()).clamp(0.0, 1.0);
                *least = least.min((p - along * end).length_squared());
            }
        }
    }
    least[0].max(least[1]).sqrt()
}

/// What moving the surface so far costs.
fn penalty(deviation: f32) -> f32 {
    let squared = deviation * deviation;
    DEVIATION_WEIGHT * squared * squared
}

/// At most how far the surface will have moved with a collapse; infinite if it is forbidden.
fn checked(window: &Window<'_>, v: u32, u: u32, at: Vec3, rules: &Rules) -> f32 {
    if !is_legal(window, v, u) {
        return f32::INFINITY;
    }
    let deviation = deviation(window, v, u, at, rules);
    if deviation > rules.most_deviation { f32::INFINITY } else { deviation }
}

/// Why a vertex stayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Forbidden {
    /// It is on a boundary, or may only be collapsed into one.
    Boundary,
    /// The mesh would not stay what it is.
    Topology,
    /// A triangle would be turned over.
    Flip,
}

/// Why a vertex stayed when no collapse was left.
pub(crate) fn forbidden(window: &Window<'_>, v: u32, rules: &Rules) -> Forbidden {
    if window.state(v) != state::RING {
        return Forbidden::Boundary;
    }
    let mut choices = choices(window, v, rules);
    match choices.all().iter().any(|choice| is_legal(window, v, choice.target)) {
        true => Forbidden::Flip,
        false => Forbidden::Topology,
    }
}

/// The costs of collapsing a vertex into each of its neighbours, legal or not: calls `with` for each, and returns the
/// least two.
pub(crate) fn costs(
    window: &Window<'_>,
    v: u32,
    rules: &Rules,
    mut with: impl FnMut(u32, f32),
) -> Rating {
    let mut rating = NONE;
    for &Choice { cost, target, .. } in choices(window, v, rules).all().iter() {
        with(target, cost);
        if cost < rating.cost {
            rating = Rating { cost, second: rating.cost, target, ..rating };
        } else {
            rating.second = rating.second.min(cost);
        }
    }
    rating
}

fn choices(window: &Window<'_>, v: u32, rules: &Rules) -> Choices {
    let nothing = Choice { cost: f32::INFINITY, target: u32::MAX, at: Vec3::ZERO };
    let mut choices = Choices { few: [nothing; MOST_RATED], many: Vec::new(), len: 0 };
    let fans = window.stars.fans(v);
    if !fans.is_ring() {
        for (first, last) in fans.ends().take(1) {
            for u in [first, last] {
                if window.state(u) & takers(window, v) != 0 {
                    let (at, cost) = place(window, v, u, rules);
                    choices.push(Choice { cost, target: u, at });
                }
            }
        }
        return choices;
    }
    let center = window.vertex(v);
    let mut batch = Batch::default();
    let mut targets = [(0, Vec3::ZERO); LANES];
    for i in 0..fans.len() {
        let u = fans.at(i);
        let takes = window.state(u);
        if takes == state::RING && rules.placement == Placement::Optimal {
            let other = window.vertex(u);
            let at = other.position - center.position;
            targets[batch.len()] = (u, at);
            batch.push(&other.quadric, at, 0.5 * at);
        } else if takes & state::MAY_TAKE != 0 {
            let (at, cost) = place(window, v, u, rules);
            choices.push(Choice { cost, target: u, at });
        }
        if batch.len() == LANES || (i + 1 == fans.len() && !batch.is_empty()) {
            let (costs, [x, y, z]) = batch.minima(&center.quadric);
            for (lane, &(target, place)) in targets.iter().enumerate().take(batch.len()) {
                let at = Vec3::new(x[lane], y[lane], z[lane]) - place;
                choices.push(Choice { cost: costs[lane], target, at });
            }
            batch.clear();
        }
    }
    choices
}

/// The first of the cheapest.
#[inline]
fn least(choices: &[Choice]) -> Option<(usize, Choice)> {
    let (mut at, mut best) = (0, *choices.first()?);
    for (i, &choice) in choices.iter().enumerate().skip(1) {
        if choice.cost < best.cost {
            (at, best) = (i, choice);
        }
    }
    Some((at, best))
}

/// Where `u` would be with `v` collapsed into it, as seen from `u`; and the cost.
#[inline]
pub(crate) fn place(window: &Window<'_>, v: u32, u: u32, rules: &Rules) -> (Vec3, f32) {
    let (from, to) = (window.vertex(v), window.vertex(u));
    let step = from.position - to.position;
    let both = merged(&to.quadric, &from.quadric, step);
    if rules.placement == Placement::Subset || window.state(u) == state::FROZEN {
        return (Vec3::ZERO, both.cost(Vec3::ZERO));
    }
    let both_on_boundary = window.state(v) == window.state(u);
    let near = if both_on_boundary { 0.5 * step } else { Vec3::ZERO };
    let at = both.optimum(near);
    (at, both.cost(at))
}

/// The sum of two quadrics, the second of which is about a point at `step`.
#[inline]
pub(crate) fn merged(first: &Quadric, second: &Quadric, step: Vec3) -> Quadric {
    let mut both = second.about(-step);
    both.merge(first);
    both
}

/// Whether the mesh stays a manifold of the same topology.
fn is_legal(window: &Window<'_>, v: u32, u: u32) -> bool {
    let (of_v, of_u) = (window.stars.fans(v), window.stars.fans(u));
    let ring = of_v.is_ring();
    // Link condition: no neighbours in common but the wings.
    let wings = if ring { 2 } else { 1 };
    if of_v.neighbours().filter(|&x| of_u.contains(x)).count() != wings {
        return false;
    }
    let thin = |x: u32| {
        if window.stars.is_long(window.stars.valence(x)) {
            return false;
        }
        let fans = window.stars.fans(x);
        if fans.is_ring() { fans.len() < 4 } else { fans.num_triangles() < 2 }
    };
    // What is left of the survivor.
    let gone = 2 * wings;
    let left = of_v.num_triangles() + of_u.num_triangles() - gone;
    if left == 0 || (of_u.is_ring() && left < 3) {
        return false;
    }
    of_v.neighbours().filter(|&x| of_u.contains(x)).all(|x| !thin(x))
}

/// At most how far the surface around `u` has moved once it is at `at`, as seen from where it is, and has taken `v`;
/// infinite if that turns a triangle over.
pub(crate) fn deviation(window: &Window<'_>, v: u32, u: u32, at: Vec3, rules: &Rules) -> f32 {
    let (from, to) = (window.vertex(v), window.vertex(u));
    let at = to.position + at;
    let mut star = NewStar::<2>::new([from.position - at, to.position - at], LEAST_COSINE);
    for (center, own, without) in [(v, 0, u), (u, 1, v)] {
        for (a, b) in window.stars.fans(center).triangles() {
            if a != without && b != without {
                star.push(window.position(a) - at, window.position(b) - at, own);
            }
        }
    }
    let moved = star.finish().max(boundary_moved(window, v, u, at));
    if moved < f32::INFINITY && rules.has_limit() {
        return bound(window, v, u, at);
    }
    from.deviation.max(to.deviation) + moved
}

/// A proven bound for how far the surface around `u` lies from the input once it is at `at` and has taken `v`.
fn bound(window: &Window<'_>, v: u32, u: u32, at: Vec3) -> f32 {
    thread_local! {
        static SCRATCH: RefCell<(Patch, Vec<u32>)> = RefCell::default();
    }
    SCRATCH.with_borrow_mut(|(patch, numbers)| {
        let bounded = |x: u32| (window.position(x), window.vertex(x).deviation);
        patch.restart([v, u].map(bounded));
        numbers.clear();
        numbers.extend([v, u]);
        for (center, x) in [v, u].into_iter().enumerate() {
            for (a, b) in window.stars.fans(x).triangles() {
                if center == 1 && (a == v || b == v) {
                    continue;
                }
                let [a, b] = [a, b].map(|x| {
                    numbers.iter().position(|&n| n == x).unwrap_or_else(|| {
                        let (point, bound) = bounded(x);
                        numbers.push(x);
                        patch.add_vertex(point, bound)
                    })
                });
                patch.add_triangle([center, a, b]);
            }
        }
        patch.bound_after(at)
    })
}
