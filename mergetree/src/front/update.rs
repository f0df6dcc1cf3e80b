//! The front moved towards a tolerance (first paper, §4.3 and Figure 8).

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::{Duration, Instant};

use crate::front::{Front, Slot, SplitBlocked, has_bit};
use crate::measure::{BoundsLanes, LANES};
use crate::{ErrorMeasure, NodeBounds, NodeId, NodeStore, SlotId, View};

/// How far an update goes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct UpdateLimits {
    /// Nodes with a larger error are split. In the unit of the error function, pixels for a view. With an infinite one all is
    /// collapsed, what has an infinite error, too. Default 1.
    pub tolerance: f32,
    /// Split nodes whose error is below this share of the tolerance are collapsed. Below 1 it keeps nodes at the
    /// tolerance from going back and forth. Default 0.8.
    pub hysteresis: f32,
    /// No node is split once there are so many triangles; what is split for another's sake may go beyond. Default: no limit.
    pub max_triangles: usize,
    /// Whether that many are not exceeded for another's sake either, but by one where a split adds two. For a single update: what
    /// was then split in vain would be collapsed by the next one, again and again. Default no.
    pub exactly: bool,
    /// No node is split once so many splits and collapses were made, and none collapsed once half as many were; what is
    /// left, the least wrong, is for the next update, and so is what a collapse made possible elsewhere. Default: no limit.
    pub max_updates: usize,
    /// The same for the time that splits and collapses take. Default: no limit. How far an update goes is then the machine's
    /// affair.
    pub max_time: Duration,
}

impl Default for UpdateLimits {
    fn default() -> Self {
        Self {
            tolerance: 1.0,
            hysteresis: 0.8,
            max_triangles: usize::MAX,
            exactly: false,
            max_updates: usize::MAX,
            max_time: Duration::MAX,
        }
    }
}

impl UpdateLimits {
    /// The default limits with this tolerance.
    pub fn with_tolerance(tolerance: f32) -> Self {
        Self { tolerance, ..Self::default() }
    }

    /// Whether a split node need not be, by its error.
    fn is_fine(&self, error: f32) -> bool {
        error < self.tolerance * self.hysteresis || self.tolerance == f32::INFINITY
    }
}

/// What an update did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct UpdateStats {
    /// Nodes whose error was computed.
    pub tests: usize,
    /// Nodes split, forced ones included.
    pub splits: usize,
    /// Nodes collapsed.
    pub collapses: usize,
    /// Nodes that are too coarse and were not split: something they depend on is not resident.
    pub waiting: usize,
    /// Nodes that were given up in this update: they, or what they depend on, are lost or do not fit the mesh, because the
    /// file they come from is damaged.
    pub damaged: usize,
    /// Nodes that are finer than they need to be and were not collapsed, because a neighbour holds them.
    pub held: usize,
    /// Vertices that are on their way to their place, or back.
    pub morphing: usize,
    /// Whether there is more to do than a limit allowed.
    pub limited: bool,
    /// Time spent testing the front as it was.
    pub test_time: Duration,
    /// Time spent on splits and collapses and the tests of what they brought up; requests for nodes included.
    pub update_time: Duration,
}

/// In place of the error of a node that something holds.
const HELD: f32 = f32::NEG_INFINITY;
/// How urgent an error is that is not seen yet.
const LATER: f32 = 0.1;

/// A node that is not split and should be, the largest error first; ties by id, so that the result does not depend on
/// chance.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    error: f32,
    id: NodeId,
    vertex: u32,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.error.total_cmp(&other.error).then(other.id.cmp(&self.id))
    }
}

impl Front {
    /// Moves the front towards a tolerance: first collapses what is too fine, then splits what is too coarse, the
    /// largest error first.
    ///
    /// `error` tells how wrong the picture is while a node is not split; a child's error should not exceed its parent's.
    ///
    /// # Complexity
    /// Two tests per vertex of the active mesh, and the splits and collapses done, sorted.
    pub fn update(
        &mut self,
        store: &mut impl NodeStore,
        error: impl Fn(&NodeBounds) -> f32 + Sync,
        limits: &UpdateLimits,
    ) -> UpdateStats {
        self.update_by(store, &error, limits)
    }

    /// [`update`](Self::update) for a view: errors are pixels.
    pub fn update_view(
        &mut self,
        store: &mut impl NodeStore,
        view: &View,
        limits: &UpdateLimits,
    ) -> UpdateStats {
        self.update_by(store, view, limits)
    }

    /// [`update`](Self::update) for anything that tells errors.
    pub fn update_by(
        &mut self,
        store: &mut impl NodeStore,
        measure: &impl ErrorMeasure,
        limits: &UpdateLimits,
    ) -> UpdateStats {
        let mut update = Update {
            front: self,
            store,
            measure,
            limits,
            stats: UpdateStats::default(),
            coarse: Vec::new(),
            fine: Vec::new(),
            held: Vec::new(),
            asked: 0,
        };
        update.test();
        update.coarsen();
        update.refine();
        update.morph();
        update.stats
    }

    /// Requests the nodes below the front that are not resident and that a view to come would want, less urgently than what
    /// the present one does. Returns how many.
    pub fn prefetch(&mut self, store: &mut impl NodeStore, view: &View, tolerance: f32) -> usize {
        let mut wanted = Vec::new();
        let (bounds, absent) = self.frontier.absent_table();
        self.scans[1].run(
            view,
            (bounds.groups(), absent),
            |error, _| (error > tolerance).then_some(error),
            |error, vertex| wanted.push((error, vertex)),
        );
        wanted.sort_unstable_by(|a: &(f32, u32), b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(error, vertex) in &wanted {
            // What an earlier request brought is looked at when it is wanted in fact.
            if let Some(top) =
                self.frontier.get(vertex).top.filter(|&top| store.node(top).is_none())
            {
                store.request(top, LATER * error.min(1e3 * tolerance));
            }
        }
        wanted.len()
    }

    /// How many frames a vertex takes to its place after a split, and back before a collapse; 0, the default, for none.
    ///
    /// [`vertices`](Self::vertices) are where they are on their way; connectivity is not concerned.
    pub fn set_geomorph(&mut self, frames: u32) {
        self.morphs.set_frames(&mut self.mesh, frames);
    }
}

/// One update under way.
struct Update<'a, S, M> {
    front: &'a mut Front,
    store: &'a mut S,
    measure: &'a M,
    limits: &'a UpdateLimits,
    stats: UpdateStats,
    /// Nodes that are not split and should be.
    coarse: Vec<Candidate>,
    /// Slots of nodes that are split and need not be, with their orders.
    fine: Vec<(u32, u32)>,
    /// Those of them that something holds.
    held: Vec<u32>,
    /// How often the time was asked for.
    asked: u32,
}

impl<S: NodeStore, M: ErrorMeasure> Update<'_, S, M> {
    /// Tests both sides of the front: nodes that could be collapsed, and nodes that could be split.
    fn test(&mut self) {
        let begin = Instant::now();
        let Self { front, measure, coarse, fine, held, .. } = self;
        let (limits, above) = (self.limits, self.limits.tolerance);
        let Front { scans, bounds, leaves, frontier, slots, held: holders, .. } = &mut **front;
        let (bounds, frontier) = (&*bounds, &*frontier);
        let [of_leaves, of_frontier] = scans;
        let (collapsible, splittable) = rayon::join(
            || {
                of_leaves.run(
                    *measure,
                    (bounds.groups(), leaves),
                    |error, slot| match limits.is_fine(error) {
                        true if holders.is_held(slot as usize, frontier, slots) => Some(HELD),
                        is_fine => is_fine.then_some(error),
                    },
                    |error, slot| match error == HELD {
                        true => held.push(slot),
                        false => fine.push((bounds.order(slot as usize), slot)),
                    },
                )
            },
            || {
                let (groups, present) = frontier.table();
                of_frontier.run(
                    *measure,
                    (groups.groups(), present),
                    |error, _| (error > above).then_some(error),
                    |error, vertex| {
                        if let Some(id) = frontier.get(vertex).top {
                            coarse.push(Candidate { error, id, vertex });
                        }
                    },
                )
            },
        );
        self.stats.tests += collapsible + splittable;
        self.stats.test_time += begin.elapsed();
    }

    /// Collapses what is too fine, the finest first, as the build did: then what holds a node is gone before its turn.
    fn coarsen(&mut self) {
        let begin = Instant::now();
        let most = self.limits.max_updates / 2;
        let mut fine: BinaryHeap<_> =
            std::mem::take(&mut self.fine).into_iter().map(Reverse).collect();
        loop {
            while self.stats.collapses < most
                && !self.is_late(begin, 2)
                && let Some(Reverse((_, slot))) = fine.pop()
            {
                if let Some(parent) = self.collapse(SlotId::new(slot)) {
                    fine.extend(parent.map(Reverse));
                }
            }
            let is_bounded =
                self.limits.max_updates < usize::MAX || self.limits.max_time < Duration::MAX;
            if is_bounded || self.stats.collapses == 0 {
                // What was held and may be free now is for the next update.
                self.stats.limited |= !fine.is_empty();
                break;
            }
            let front = &*self.front;
            let before = fine.len();
            self.held.retain(|&slot| {
                let is_held = front.held.is_held(slot as usize, &front.frontier, &front.slots);
                if !is_held && has_bit(&front.leaves, slot as usize) {
                    fine.push(Reverse((front.bounds.order(slot as usize), slot)));
                }
                is_held
            });
            if fine.len() == before {
                break;
            }
        }
        self.stats.held += self.held.len();
        self.stats.update_time += begin.elapsed();
    }

    /// Whether a share of the time is over; looked at every few times only.
    fn is_late(&mut self, begin: Instant, parts: u32) -> bool {
        self.asked = self.asked.wrapping_add(1);
        self.asked.is_multiple_of(16) && begin.elapsed() > self.limits.max_time / parts
    }

    /// Collapses the node of a slot, if it may; then tells its parent, if that is too fine in turn.
    #[expect(clippy::option_option, reason = "whether it was collapsed, and what came of it")]
    fn collapse(&mut self, slot: SlotId) -> Option<Option<(u32, u32)>> {
        let front = &mut *self.front;
        let Slot { node: Some(id), parent, .. } = front.slots[slot.index()] else { return None };
        let node = *self.store.node(id)?;
        let Ok(adjacent) = front.can_collapse(slot, id, &node) else {
            self.held.push(slot.get());
            return None;
        };
        if !front.morphs.is_back(&front.mesh, slot) {
            return None;
        }
        if front.collapse_now(self.store, slot, id, adjacent).is_err() {
            return None;
        }
        self.stats.collapses += 1;
        let parent = parent.filter(|parent| has_bit(&front.leaves, parent.index()));
        let Some(parent) = parent else { return Some(None) };
        self.stats.tests += 1;
        let bounds = front.bounds.get(parent.index());
        let error = self.measure.errors(&BoundsLanes::splat(&bounds))[0];
        Some(self.limits.is_fine(error).then_some((bounds.order, parent.get())))
    }

    /// Splits what is too coarse, the most wrong first.
    fn refine(&mut self) {
        let begin = Instant::now();
        let mut absent = Vec::new();
        let mut coarse = std::mem::take(&mut self.coarse);
        coarse.retain(|candidate| {
            let waits = self.front.frontier.waits_for(candidate.vertex).is_some();
            if waits {
                absent.push(*candidate);
            }
            !waits
        });
        let mut coarse = BinaryHeap::from(coarse);
        self.request(&mut absent, &mut coarse);
        let mut fresh = Vec::new();
        while let Some(&Candidate { error, id, vertex }) = coarse.peek() {
            if self.front.num_triangles() >= self.limits.max_triangles
                || self.stats.splits + self.stats.collapses >= self.limits.max_updates
                || self.is_late(begin, 1)
            {
                self.stats.limited |= self.front.num_triangles() < self.limits.max_triangles;
                break;
            }
            coarse.pop();
            if self.front.frontier.get(vertex).top != Some(id) {
                // Split meanwhile, for another's sake.
                continue;
            }
            let most = if self.limits.exactly { self.limits.max_triangles } else { usize::MAX };
            match self.front.split_at(self.store, id, Some(vertex), error, most) {
                Ok(()) => {}
                Err(blocked) if blocked.is_for_good(self.store) => {
                    self.stats.damaged += 1;
                    // Another vertex was given up that this one waited for: perhaps it can do without.
                    if self.front.frontier.is_next(vertex, id) {
                        coarse.push(Candidate { error, id, vertex });
                    }
                }
                Err(SplitBlocked::NotResident(other) | SplitBlocked::Damaged(other)) => {
                    self.stats.waiting += 1;
                    self.front.frontier.set_blocked(vertex, Some(other));
                }
            }
            self.stats.splits += self.front.just_split.len();
            for &slot in &self.front.just_split {
                fresh.extend([self.front.mesh.vertex_of(slot), self.front.mesh.kept(slot)]);
            }
            self.consider(&mut fresh, &mut coarse, &mut absent);
            if !absent.is_empty() {
                self.request(&mut absent, &mut coarse);
            }
        }
        self.stats.update_time += begin.elapsed();
    }

    /// Notes the next splits of vertices that should be made, or requested.
    fn consider(
        &mut self,
        vertices: &mut Vec<u32>,
        coarse: &mut BinaryHeap<Candidate>,
        absent: &mut Vec<Candidate>,
    ) {
        let frontier = &self.front.frontier;
        vertices.retain(|&v| frontier.get(v).top.is_some());
        for vertices in vertices.chunks(LANES) {
            let mut lanes = BoundsLanes::default();
            for (lane, &v) in vertices.iter().enumerate() {
                lanes.set(lane, &frontier.bounds(v));
            }
            self.stats.tests += vertices.len();
            for (&vertex, error) in vertices.iter().zip(self.measure.errors(&lanes)) {
                if error > self.limits.tolerance
                    && let Some(id) = frontier.get(vertex).top
                {
                    let candidate = Candidate { error, id, vertex };
                    if frontier.waits_for(vertex).is_some() {
                        absent.push(candidate);
                    } else {
                        coarse.push(candidate);
                    }
                }
            }
        }
        vertices.clear();
    }

    /// Requests what is not resident, the most urgent first, and notes what is at once.
    fn request(&mut self, absent: &mut Vec<Candidate>, coarse: &mut BinaryHeap<Candidate>) {
        absent.sort_unstable_by(|a, b| b.cmp(a));
        let mut here = Vec::new();
        for &candidate in &*absent {
            let Candidate { error, vertex, .. } = candidate;
            let frontier = &mut self.front.frontier;
            let Some(id) = frontier.waits_for(vertex) else { continue };
            if self.store.is_lost(id) {
                self.stats.damaged += 1;
                frontier.give_up(vertex);
                continue;
            }
            let resident = self.store.node(id).is_some() || self.store.request(id, error);
            if !resident {
                self.stats.waiting += 1;
            } else if !frontier.is_absent(vertex) {
                frontier.set_blocked(vertex, None);
                coarse.push(candidate);
            } else if frontier.look_again(self.store, vertex) {
                here.push(vertex);
            }
        }
        absent.clear();
        // Their own bounds are known now, so none of them is absent.
        self.consider(&mut here, coarse, absent);
    }

    /// Moves the vertices that are on their way; those whose node is wanted again turn round.
    fn morph(&mut self) {
        let begin = Instant::now();
        let Front { morphs, mesh, bounds, leaves, .. } = &mut *self.front;
        let (measure, limits) = (self.measure, self.limits);
        morphs.advance(mesh, |slot| {
            let error = measure.errors(&BoundsLanes::splat(&bounds.get(slot.index())))[0];
            !has_bit(leaves, slot.index()) || !limits.is_fine(error)
        });
        self.stats.morphing = morphs.num_moving();
        self.stats.update_time += begin.elapsed();
    }
}
