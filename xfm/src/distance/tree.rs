//! The search tree over a surface: nearest triangle of a point.
//!
//! A packed tree of boxes: triangles are put in an order in which every aligned run of `LEAF · 4ᵏ` of them is compact,
//! by splitting at the median along the longest axis. Boxes of such runs are then all there is to a tree: no pointers, four
//! children to a node, tested together. Boxes are single precision and rounded outwards, triangles are double: a
//! box never hides a triangle nearer than the best one found, so the result is the exact minimum over all triangles.
//!
//! # Sources
//!
//! T. Lee, S. Lee, *OMT: Overlap minimizing top-down bulk loading algorithm for R-tree* (2003).

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::frame::Frame;
use super::surface::Surface;
use super::triangle;

/// Triangles under one lowest box.
const LEAF: usize = 2;
/// Below this many triangles a task is not worth splitting for another thread.
const SERIAL: usize = 8192;
/// How far boxes grow beyond their contents on each side: coordinates are at most 1, so rounding a coordinate of box or
/// point to single precision moves it by no more than 2⁻²⁵.
const BOX_MARGIN: f32 = 1.0 / (1 << 23) as f32;
/// The single-precision box distance may be too large by a few roundings; this factor takes them back.
const ROUNDING: f32 = 1.0 - 16.0 * f32::EPSILON;

/// A surface ready to be searched: triangles in tree order, vertices renumbered in order of first use, boxes above them.
#[derive(Debug)]
pub(super) struct Tree {
    /// In the frame's coordinates.
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// From the lowest level (whose boxes hold `LEAF` triangles each) to the root (one node).
    levels: Vec<Vec<Node>>,
}

/// The boxes of four children, by axis.
#[derive(Debug, Clone, Copy)]
struct Node {
    min: [Vec4; 3],
    max: [Vec4; 3],
}

/// A box in single precision; `EMPTY` is infinitely far from everything.
#[derive(Debug, Clone, Copy)]
struct Box3 {
    min: Vec3,
    max: Vec3,
}

/// A triangle on its way to its place in the order.
#[derive(Debug, Clone, Copy)]
struct Item {
    centre: Vec3,
    triangle: u32,
}

/// The nearest triangle of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    /// The squared distance, in the frame.
    pub(super) distance_squared: f64,
    /// The triangle in tree order: a good hint for a point nearby.
    pub(super) triangle: u32,
}

impl Tree {
    /// Sorts the triangles and builds the boxes over them.
    ///
    /// # Complexity
    ///
    /// O(n log n) time on all threads of the current pool, about 60 bytes per triangle.
    pub(super) fn new(surface: &Surface, frame: &Frame) -> Self {
        let order = order(surface, frame);
        let (positions, triangles) = renumber(surface, frame, &order);
        let leaves: Vec<Box3> = triangles
            .par_chunks(LEAF)
            .map(|leaf| Box3::around(leaf.iter().flatten().map(|&v| positions[v as usize])))
            .collect();
        let mut levels = vec![nodes_over(&leaves)];
        while let Some(level) = levels.last().filter(|level| level.len() > 1) {
            let boxes: Vec<Box3> = level.par_iter().map(Node::hull).collect();
            levels.push(nodes_over(&boxes));
        }
        Self { positions, triangles, levels }
    }

    /// The corners of a triangle.
    pub(super) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// The nearest triangle of `point`, starting from the guess `hint`; the distance does not depend on the hint.
    ///
    /// # Complexity
    ///
    /// O(log n) for a point near the surface and a hint near the point.
    pub(super) fn nearest(&self, point: DVec3, hint: u32) -> Nearest {
        let point32 = point.as_vec3();
        let mut best = Nearest {
            distance_squared: triangle::distance_squared(point, self.corners(hint as usize)),
            triangle: hint,
        };
        let mut bound = best.distance_squared as f32;
        // Three of a node's four children wait while the fourth is visited: 3 per level, 16 levels for 2³² triangles.
        let mut waiting = [(0.0_f32, 0_u8, 0_u32); 64];
        waiting[0] = (0.0, self.levels.len() as u8, 0);
        let mut num_waiting = 1;
        while num_waiting > 0 {
            num_waiting -= 1;
            let (distance, level, index) = waiting[num_waiting];
            if distance > bound {
                continue;
            }
            if level == 0 {
                let first = index as usize * LEAF;
                for candidate in first..(first + LEAF).min(self.triangles.len()) {
                    let found = triangle::distance_squared(point, self.corners(candidate));
                    if found < best.distance_squared {
                        best = Nearest { distance_squared: found, triangle: candidate as u32 };
                        // The rounding of this conversion is within what ROUNDING takes back.
                        bound = found as f32;
                    }
                }
                continue;
            }
            let node = &self.levels[level as usize - 1][index as usize];
            let distances = node.distances_squared(point32).to_array();
            // Insertion, farthest first, so that the nearest child is on top.
            let floor = num_waiting;
            for (child, &distance) in distances.iter().enumerate() {
                if distance > bound {
                    continue;
                }
                let mut at = num_waiting;
                while at > floor && waiting[at - 1].0 < distance {
                    waiting[at] = waiting[at - 1];
                    at -= 1;
                }
                waiting[at] = (distance, level - 1, index * 4 + child as u32);
                num_waiting += 1;
            }
        }
        best
    }
}

impl Node {
    const EMPTY: Self = Self { min: [Vec4::INFINITY; 3], max: [Vec4::NEG_INFINITY; 3] };

    /// Lower bounds of the squared distances to the four boxes; infinite where there is no child.
    fn distances_squared(&self, point: Vec3) -> Vec4 {
        let mut sum = Vec4::ZERO;
        for axis in 0..3 {
            let at = Vec4::splat(point[axis]);
            let outside = (self.min[axis] - at).max(at - self.max[axis]).max(Vec4::ZERO);
            sum += outside * outside;
        }
        sum * ROUNDING
    }

    /// The box around all children.
    fn hull(&self) -> Box3 {
        let [x, y, z] = self.min.map(Vec4::min_element);
        let [to_x, to_y, to_z] = self.max.map(Vec4::max_element);
        Box3 { min: Vec3::new(x, y, z), max: Vec3::new(to_x, to_y, to_z) }
    }
}

impl Box3 {
    /// The box around points, grown by the margin.
    fn around(points: impl Iterator<Item = DVec3>) -> Self {
        let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for point in points.map(|point| point.as_vec3()) {
            min = min.min(point);
            max = max.max(point);
        }
        Self { min: min - BOX_MARGIN, max: max + BOX_MARGIN }
    }
}

/// One level of nodes over the boxes of the level below.
fn nodes_over(boxes: &[Box3]) -> Vec<Node> {
    boxes
        .par_chunks(4)
        .map(|children| {
            let mut node = Node::EMPTY;
            for (slot, child) in children.iter().enumerate() {
                for axis in 0..3 {
                    node.min[axis][slot] = child.min[axis];
                    node.max[axis][slot] = child.max[axis];
                }
            }
            node
        })
        .collect()
}

/// The order of the triangles in the tree.
fn order(surface: &Surface, frame: &Frame) -> Vec<u32> {
    let mut items: Vec<Item> = surface
        .triangles
        .par_iter()
        .enumerate()
        .map(|(triangle, corners)| {
            let [a, b, c] = corners.map(|vertex| frame.enter(surface.positions[vertex as usize]));
            Item { centre: ((a + b + c) / 3.0).as_vec3(), triangle: triangle as u32 }
        })
        .collect();
    arrange(&mut items);
    items.into_iter().map(|item| item.triangle).collect()
}

/// Puts the items into an order in which every aligned run of `LEAF · 4ᵏ` is spatially compact.
fn arrange(items: &mut [Item]) {
    let mut unit = LEAF;
    if items.len() <= unit {
        return;
    }
    while unit * 4 < items.len() {
        unit *= 4;
    }
    // Of up to four full units the first half goes left, so that the cut is also a cut between children.
    let cut = items.len().div_ceil(unit).div_ceil(2) * unit;
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for item in items.iter() {
        min = min.min(item.centre);
        max = max.max(item.centre);
    }
    let axis = (max - min).max_position();
    items.select_nth_unstable_by(cut, |a, b| {
        a.centre[axis].total_cmp(&b.centre[axis]).then(a.triangle.cmp(&b.triangle))
    });
    let (left, right) = items.split_at_mut(cut);
    if left.len() > SERIAL {
        rayon::join(|| arrange(left), || arrange(right));
    } else {
        arrange(left);
        arrange(right);
    }
}

/// Triangles in the given order, and their vertices in the order in which those use them first.
fn renumber(surface: &Surface, frame: &Frame, order: &[u32]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    const UNUSED: u32 = u32::MAX;
    let mut new_index = vec![UNUSED; surface.positions.len()];
    let mut positions = Vec::with_capacity(surface.positions.len());
    let triangles = order
        .iter()
        .map(|&triangle| {
            surface.triangles[triangle as usize].map(|vertex| {
                let entry = &mut new_index[vertex as usize];
                if *entry == UNUSED {
                    *entry = positions.len() as u32;
                    positions.push(frame.enter(surface.positions[vertex as usize]));
                }
                *entry
            })
        })
        .collect();
    (positions, triangles)
}
