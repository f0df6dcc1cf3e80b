//! What became of the vertices that were sealed on suspicion: where a triangle belongs that comes after all.

use std::collections::VecDeque;

use glam::Vec3;
use rustc_hash::{FxHashMap, FxHashSet};

/// The bits of a position whose zeros are positive.
type Place = [u32; 3];

/// What is known of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trace {
    /// No vertex there was sealed, as far as one remembers.
    None,
    /// The vertex there became part of this one.
    Vertex(u32),
    /// The vertex there has been written, or is surrounded by triangles now.
    Gone,
}

/// Sealed vertices by where they were, the latest of them.
#[derive(Debug, Default)]
pub(crate) struct Sealed {
    vertices: FxHashMap<Place, u32>,
    order: VecDeque<Place>,
    /// Places of vertices that have gone since, as many at most.
    gone: FxHashSet<Place>,
    /// Which vertex took which since numbers were brought up to date.
    taken: FxHashMap<u32, u32>,
    most: usize,
}

fn place(position: Vec3) -> Place {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

impl Sealed {
    /// Remembers at most so many.
    pub(crate) fn remembering(most: usize) -> Self {
        Self { most, ..Self::default() }
    }

    /// Whether there is nothing to remember.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.vertices.is_empty() && self.gone.is_empty()
    }

    /// The vertex at this position is sealed.
    pub(crate) fn add(&mut self, position: Vec3, v: u32) {
        if self.vertices.len() >= self.most
            && let Some(oldest) = self.order.pop_front()
        {
            self.vertices.remove(&oldest);
        }
        if self.vertices.insert(place(position), v).is_none() {
            self.order.push_back(place(position));
        }
    }

    /// Vertices have been collapsed into others.
    pub(crate) fn collapsed(&mut self, pairs: &[(u32, u32)]) {
        if !self.vertices.is_empty() {
            self.taken.extend(pairs.iter().copied());
        }
    }

    /// Gives each vertex its new number, and lets go of those that `new_of` does not know.
    pub(crate) fn renumber(&mut self, new_of: impl Fn(u32) -> Option<u32>) {
        let (taken, gone, most) = (&self.taken, &mut self.gone, self.most);
        self.vertices.retain(|&place, v| {
            while let Some(&u) = taken.get(v) {
                *v = u;
            }
            let new = new_of(*v);
            match new {
                Some(new) => *v = new,
                None => {
                    if gone.len() >= most {
                        gone.clear();
                    }
                    gone.insert(place);
                }
            }
            new.is_some()
        });
        let vertices = &self.vertices;
        self.order.retain(|place| vertices.contains_key(place));
        self.taken.clear();
    }

    /// What became of the vertex at a position.
    pub(crate) fn trace(&self, position: Vec3) -> Trace {
        let place = place(position);
        match self.vertices.get(&place) {
            Some(&v) => Trace::Vertex(v),
            None if self.gone.contains(&place) => Trace::Gone,
            None => Trace::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_vertex_is_followed_to_what_it_has_become() {
        let mut sealed = Sealed::remembering(2);
        let at = |i: u32| vec3(i as f32, 0.0, 0.0);
        sealed.add(at(1), 1);
        sealed.add(at(2), 2);
        assert_eq!(sealed.trace(at(1)), Trace::Vertex(1));
        assert_eq!(sealed.trace(at(3)), Trace::None);
        sealed.collapsed(&[(1, 5), (5, 7)]);
        sealed.renumber(|v| (v == 7).then_some(70));
        assert_eq!(sealed.trace(at(1)), Trace::Vertex(70));
        assert_eq!(sealed.trace(at(2)), Trace::Gone);
        sealed.add(at(3), 3);
        sealed.add(at(4), 4);
        assert_eq!(sealed.trace(at(1)), Trace::None, "the oldest is forgotten");
    }
}
