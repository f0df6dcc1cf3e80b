//! The front moved towards a tolerance (first paper, §4.3 and Figure 8).

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::{Duration, Instant};

use crate::front::{Front, SplitBlocked, slot_of};
use crate::{Node, NodeId, NodeStore};

/// How far an update goes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct UpdateLimits {
    /// Nodes with a larger error are split. In the unit of the error function, pixels for a view. Default 1.
    pub tolerance: f32,
    /// Split nodes whose error is below this share of the tolerance are collapsed. Below 1 it keeps nodes at the
    /// tolerance from going back and forth. Default 0.8.
    pub hysteresis: f32,
    /// No node is split once there are so many triangles. Default: no limit.
    pub max_triangles: usize,
}

impl Default for UpdateLimits {
    fn default() -> Self {
        Self { tolerance: 1.0, hysteresis: 0.8, max_triangles: usize::MAX }
    }
}

impl UpdateLimits {
    /// The default limits with this tolerance.
    pub fn with_tolerance(tolerance: f32) -> Self {
        Self { tolerance, ..Self::default() }
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
    /// Nodes that do not fit the mesh: the file they come from is damaged.
    pub damaged: usize,
    /// Nodes that are finer than they need to be and were not collapsed, because a neighbour holds them.
    pub held: usize,
    /// Time spent testing the front as it was.
    pub test_time: Duration,
    /// Time spent on splits and collapses and the tests of what they brought up; requests for nodes included.
    pub update_time: Duration,
}

/// A node with its error, the largest first; ties by id, so that the result does not depend on chance.
struct Candidate {
    error: f32,
    id: NodeId,
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
    /// One test per node of the front, and the splits and collapses done, sorted.
    pub fn update(
        &mut self,
        store: &mut impl NodeStore,
        error: impl Fn(&Node) -> f32,
        limits: &UpdateLimits,
    ) -> UpdateStats {
        let mut update = Update {
            front: self,
            store,
            error,
            limits,
            stats: UpdateStats::default(),
            coarse: BinaryHeap::new(),
            absent: Vec::new(),
        };
        update.coarsen();
        update.refine();
        update.stats
    }
}

/// One update under way.
struct Update<'a, S, E> {
    front: &'a mut Front,
    store: &'a mut S,
    error: E,
    limits: &'a UpdateLimits,
    stats: UpdateStats,
    /// Nodes that are not split and should be.
    coarse: BinaryHeap<Candidate>,
    /// Nodes that are not resident and may have to be split, with the error of their parent.
    absent: Vec<Candidate>,
}

impl<S: NodeStore, E: Fn(&Node) -> f32> Update<'_, S, E> {
    fn coarsen(&mut self) {
        let begin = Instant::now();
        // The finest first, as the build did: then what holds a node is gone before its turn.
        let mut fine: BinaryHeap<Reverse<(u32, NodeId)>> = BinaryHeap::new();
        for index in 0..self.front.slots.len() {
            fine.extend(self.too_fine(index).map(Reverse));
        }
        let tested = Instant::now();
        while let Some(Reverse((_, id))) = fine.pop() {
            if self.front.collapse(self.store, id).is_err() {
                self.stats.held += 1;
                continue;
            }
            self.stats.collapses += 1;
            let parent = self.store.node(id).and_then(|node| node.parent);
            if let Some(slot) = parent.and_then(|parent| slot_of(self.store, parent)) {
                fine.extend(self.too_fine(slot.index()).map(Reverse));
            }
        }
        self.stats.test_time += tested - begin;
        self.stats.update_time += tested.elapsed();
    }

    /// The node of a slot with its order, if it could be collapsed and should.
    fn too_fine(&mut self, slot: usize) -> Option<(u32, NodeId)> {
        let slot = &self.front.slots[slot];
        let id = slot.node.filter(|_| slot.num_split_children == 0)?;
        let node = self.store.node(id)?;
        self.stats.tests += 1;
        let below = self.limits.tolerance * self.limits.hysteresis;
        ((self.error)(node) < below).then_some((node.order, id))
    }

    fn refine(&mut self) {
        let begin = Instant::now();
        for index in 0..self.store.base().vertices.len() {
            if let Some(root) = self.store.base().vertices[index].root {
                self.consider(root, f32::INFINITY);
            }
        }
        for index in 0..self.front.slots.len() {
            if let Some(id) = self.front.slots[index].node {
                self.consider_children(id);
            }
        }
        let tested = Instant::now();
        self.request_absent();
        while self.front.num_triangles() < self.limits.max_triangles
            && let Some(Candidate { error: urgency, id }) = self.coarse.pop()
        {
            match self.front.split(self.store, id, urgency) {
                Ok(()) => {}
                Err(SplitBlocked::NotResident(_)) => self.stats.waiting += 1,
                Err(SplitBlocked::Damaged(_)) => self.stats.damaged += 1,
            }
            let just_split = std::mem::take(&mut self.front.just_split);
            self.stats.splits += just_split.len();
            for &id in &just_split {
                self.consider_children(id);
            }
            self.front.just_split = just_split;
            self.request_absent();
        }
        self.stats.test_time += tested - begin;
        self.stats.update_time += tested.elapsed();
    }

    fn consider_children(&mut self, parent: NodeId) {
        let Some(&node) = self.store.node(parent) else { return };
        for child in node.children() {
            // What a child would show that is not resident is no worse than what its parent does.
            let urgency = if self.store.node(child).is_some() { 0.0 } else { (self.error)(&node) };
            self.consider(child, urgency);
        }
    }

    /// Notes a node that is not split and should be, or that is not resident and might have to be.
    fn consider(&mut self, id: NodeId, urgency: f32) {
        match self.store.node(id) {
            Some(node) if node.slot.is_some() => {}
            Some(node) => {
                self.stats.tests += 1;
                let error = (self.error)(node);
                if error > self.limits.tolerance {
                    self.coarse.push(Candidate { error, id });
                }
            }
            None if urgency > self.limits.tolerance => {
                self.absent.push(Candidate { error: urgency, id });
            }
            None => {}
        }
    }

    /// Requests what is not resident, the most urgent first.
    fn request_absent(&mut self) {
        let mut absent = std::mem::take(&mut self.absent);
        absent.sort_unstable_by(|a, b| b.cmp(a));
        for &Candidate { error: urgency, id } in &absent {
            if self.store.request(id, urgency) {
                self.consider(id, 0.0);
            } else {
                self.stats.waiting += 1;
            }
        }
        absent.clear();
        self.absent = absent;
    }
}
