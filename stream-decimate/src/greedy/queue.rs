//! A queue of edges by cost, in which an edge can be found, taken out and put elsewhere at once.

use halfedge::HalfEdgeId;

/// Costs that agree in the sign, the exponent and so many bits of the fraction are as good as equal: within 0.8 %.
const FRACTION_BITS: u32 = 7;
/// One bucket for each cost that is not negative.
const BUCKETS: usize = 1 << (8 + FRACTION_BITS);

/// The bucket of a cost: rises with its size. What is no number comes last; below zero is only what rounding left.
#[inline]
pub(super) fn key(cost: f32) -> u16 {
    // Without the sign, which would make a key beyond all buckets: one that never agrees with the bucket.
    (cost.abs().to_bits() >> (23 - FRACTION_BITS)) as u16
}

/// A bucket queue (a doubly linked ring of edges for every key): first in, first out among equals.
///
/// # Complexity
/// Constant time but for [`pop`](Self::pop), which looks for the next bucket that is not empty.
pub(super) struct Queue {
    /// Of every half-edge, and after those of every bucket, the next and the previous one in the ring; itself where the
    /// half-edge is not in the queue.
    links: Vec<[u32; 2]>,
    num_edges: usize,
    /// No bucket before this one has an edge in it.
    lowest: usize,
}

impl Queue {
    /// An empty queue for half-edges below `num_edges`.
    ///
    /// # Panics
    /// When those and the buckets are more than 32-bit numbers can name.
    pub(super) fn new(num_edges: usize) -> Self {
        let last = u32::try_from(num_edges + BUCKETS).expect("more half-edges than a queue holds");
        Self { links: (0..last).map(|i| [i; 2]).collect(), num_edges, lowest: BUCKETS }
    }

    /// Whether an edge is in the queue.
    pub(super) fn contains(&self, edge: HalfEdgeId) -> bool {
        self.links[edge.index()][0] != edge.get()
    }

    /// Puts an edge where its cost belongs, wherever it was before.
    pub(super) fn push(&mut self, edge: HalfEdgeId, cost: f32) {
        self.remove(edge);
        let bucket = usize::from(key(cost));
        self.lowest = self.lowest.min(bucket);
        let head = self.num_edges + bucket;
        let last = self.links[head][1];
        self.links[edge.index()] = [head as u32, last];
        self.links[last as usize][0] = edge.get();
        self.links[head][1] = edge.get();
    }

    /// Takes an edge out, if it is in.
    pub(super) fn remove(&mut self, edge: HalfEdgeId) {
        let [next, previous] = std::mem::replace(&mut self.links[edge.index()], [edge.get(); 2]);
        self.links[next as usize][1] = previous;
        self.links[previous as usize][0] = next;
        // An edge that was not in the queue has just been linked to itself, as it was.
    }

    /// Takes out an edge of the lowest cost there is; and the key it was put in with.
    pub(super) fn pop(&mut self) -> Option<(HalfEdgeId, u16)> {
        while self.lowest < BUCKETS {
            let head = self.num_edges + self.lowest;
            let first = self.links[head][0];
            if first as usize != head {
                let edge = HalfEdgeId::new(first);
                self.remove(edge);
                return Some((edge, self.lowest as u16));
            }
            self.lowest += 1;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn keys_rise_with_the_cost() {
        let costs = [0.0, 1e-40, 1e-20, 0.99, 1.0, 1.01, 1e20, f32::MAX, f32::INFINITY];
        assert!(costs.windows(2).all(|c| key(c[0]) < key(c[1])), "{:?}", costs.map(key));
        assert_eq!(key(1.0), key(1.007));
        for cost in [-0.0, -1e-9, f32::NAN, -f32::NAN] {
            assert!(usize::from(key(cost)) < BUCKETS, "{cost}");
        }
        assert!(key(f32::NAN) > key(f32::INFINITY));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// Against a sorted list, with edges put in, moved and taken out at will.
        #[test]
        fn the_cheapest_comes_first(
            steps in prop::collection::vec((0u32..20, prop::option::of(0.0f32..1.0)), 1..80),
        ) {
            let mut queue = Queue::new(20);
            let mut expected: Vec<(u16, usize, u32)> = Vec::new();
            for (order, &(edge, cost)) in steps.iter().enumerate() {
                expected.retain(|e| e.2 != edge);
                let id = HalfEdgeId::new(edge);
                match cost {
                    Some(cost) => {
                        queue.push(id, cost);
                        expected.push((key(cost), order, edge));
                    }
                    None => queue.remove(id),
                }
                prop_assert_eq!(queue.contains(id), cost.is_some());
            }
            expected.sort_unstable();
            for (key, _, edge) in expected {
                prop_assert_eq!(queue.pop(), Some((HalfEdgeId::new(edge), key)));
            }
            prop_assert_eq!(queue.pop(), None);
        }
    }
}
