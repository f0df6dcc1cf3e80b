//! How wrong the picture is while a node is not split: the bounds of nodes, eight at a time, and what judges them.

use glam::Vec3;

use crate::Node;

/// What an error can be computed from: the bounds of a node.
///
/// # Units
/// Lengths are the model's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeBounds {
    /// Position of the vertex that the split brings back; centre of the bounding sphere.
    pub position: Vec3,
    /// Radius of a sphere that holds all that this node or one below it can change.
    pub radius: f32,
    /// Unit axis of the normal cone.
    pub normal: Vec3,
    /// Sine of the half-angle of the normal cone; 1 for a right angle and more.
    pub cone_sine: f32,
    /// How far the surface lies from the input at most while this node is not split.
    pub deviation: f32,
    /// Index of the collapse in the global sequence.
    pub order: u32,
}

impl NodeBounds {
    /// Bounds of which nothing is known: any error is possible.
    pub const UNBOUNDED: Self = Self {
        position: Vec3::ZERO,
        radius: f32::INFINITY,
        normal: Vec3::Z,
        cone_sine: 1.0,
        deviation: f32::INFINITY,
        order: u32::MAX,
    };
}

impl From<&Node> for NodeBounds {
    #[inline]
    fn from(node: &Node) -> Self {
        Self {
            position: node.position,
            radius: node.radius,
            normal: node.normal.to_vec3(),
            cone_sine: node.cone_sine,
            deviation: node.deviation,
            order: node.order,
        }
    }
}

/// Number of nodes whose errors are computed together.
pub const LANES: usize = 8;

/// The bounds of eight nodes, side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct BoundsLanes {
    /// `x`, `y` and `z` of the positions.
    pub position: [[f32; LANES]; 3],
    /// Radii of the bounding spheres.
    pub radius: [f32; LANES],
    /// `x`, `y` and `z` of the axes of the normal cones.
    pub normal: [[f32; LANES]; 3],
    /// Sines of the half-angles of the cones.
    pub cone_sine: [f32; LANES],
    /// Deviations.
    pub deviation: [f32; LANES],
    /// Orders.
    pub order: [u32; LANES],
}

impl Default for BoundsLanes {
    fn default() -> Self {
        Self::splat(&NodeBounds { radius: 0.0, deviation: 0.0, order: 0, ..NodeBounds::UNBOUNDED })
    }
}

impl BoundsLanes {
    /// The same bounds in all lanes.
    pub fn splat(bounds: &NodeBounds) -> Self {
        Self {
            position: bounds.position.to_array().map(|c| [c; LANES]),
            radius: [bounds.radius; LANES],
            normal: bounds.normal.to_array().map(|c| [c; LANES]),
            cone_sine: [bounds.cone_sine; LANES],
            deviation: [bounds.deviation; LANES],
            order: [bounds.order; LANES],
        }
    }

    /// The bounds in a lane.
    ///
    /// # Panics
    /// When there is no such lane.
    #[inline]
    pub fn get(&self, lane: usize) -> NodeBounds {
        NodeBounds {
            position: Vec3::from_array(self.position.map(|c| c[lane])),
            radius: self.radius[lane],
            normal: Vec3::from_array(self.normal.map(|c| c[lane])),
            cone_sine: self.cone_sine[lane],
            deviation: self.deviation[lane],
            order: self.order[lane],
        }
    }

    /// Puts bounds into a lane.
    ///
    /// # Panics
    /// When there is no such lane.
    #[inline]
    pub fn set(&mut self, lane: usize, bounds: &NodeBounds) {
        for (axis, (p, n)) in
            bounds.position.to_array().into_iter().zip(bounds.normal.to_array()).enumerate()
        {
            self.position[axis][lane] = p;
            self.normal[axis][lane] = n;
        }
        self.radius[lane] = bounds.radius;
        self.cone_sine[lane] = bounds.cone_sine;
        self.deviation[lane] = bounds.deviation;
        self.order[lane] = bounds.order;
    }
}

/// Tells how wrong the picture is while nodes are not split. A child's error should not exceed its parent's.
///
/// Any function of [`NodeBounds`] is one; [`crate::View`] computes eight errors at a time.
pub trait ErrorMeasure: Sync {
    /// The errors of eight nodes, in the unit of the tolerance.
    fn errors(&self, bounds: &BoundsLanes) -> [f32; LANES];
}

impl<F: Fn(&NodeBounds) -> f32 + Sync> ErrorMeasure for F {
    fn errors(&self, bounds: &BoundsLanes) -> [f32; LANES] {
        std::array::from_fn(|lane| self(&bounds.get(lane)))
    }
}

/// Bounds of any number of nodes, by index.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoundsTable {
    groups: Vec<BoundsLanes>,
}

impl BoundsTable {
    #[inline]
    pub(crate) fn get(&self, index: usize) -> NodeBounds {
        self.groups[index / LANES].get(index % LANES)
    }

    #[inline]
    pub(crate) fn order(&self, index: usize) -> u32 {
        self.groups[index / LANES].order[index % LANES]
    }

    #[inline]
    pub(crate) fn set(&mut self, index: usize, bounds: &NodeBounds) {
        let group = index / LANES;
        if group >= self.groups.len() {
            self.groups.resize(group + 1, BoundsLanes::default());
        }
        self.groups[group].set(index % LANES, bounds);
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.groups.capacity() * size_of::<BoundsLanes>()
    }

    pub(crate) fn groups(&self) -> &[BoundsLanes] {
        &self.groups
    }
}
