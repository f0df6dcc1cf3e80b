//! The quadric of plane distances.

use glam::{Mat3, Vec3};

use crate::ErrorMetric;

/// Weight of a boundary edge's plane, as a multiple of the squared length of the edge.
///
/// An edge of length `s` bounds a triangle of area near `s²/2`: the boundary then counts several times as much as the
/// surface beside it.
const BOUNDARY_WEIGHT: f32 = 4.0;

/// Share of the trace that pulls the minimiser towards the point it is asked near. Measured on scans: ten times less
/// throws vertices off in flat regions, ten times more costs visible quality.
pub(crate) const REGULARISATION: f32 = 1e-4;

/// `Q(x) = xᵀAx + 2bᵀx + c`, the sum over planes of weight times squared distance.
///
/// # Units
/// Lengths are the model's, weights are areas; `Q` has the unit of length to the fourth power.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Quadric {
    /// Diagonal of `A`: xx, yy, zz.
    pub(crate) diagonal: Vec3,
    /// The rest of the symmetric `A`: yz, xz, xy.
    pub(crate) off_diagonal: Vec3,
    pub(crate) b: Vec3,
    pub(crate) c: f32,
}

impl Quadric {
    /// The quadric of the plane `{x : normal·x = offset}`, with `normal` of unit length.
    pub fn from_plane(normal: Vec3, offset: f32, weight: f32) -> Self {
        Self {
            diagonal: normal * normal * weight,
            off_diagonal: Vec3::new(normal.y * normal.z, normal.x * normal.z, normal.x * normal.y)
                * weight,
            b: -offset * weight * normal,
            c: offset * offset * weight,
        }
    }

    /// The share of a triangle as seen from one of its corners: what [`from_triangle`](ErrorMetric::from_triangle) says of
    /// a triangle with a corner at the origin. `cross` is the cross product of two of its edges.
    #[inline]
    pub fn from_cross_product(cross: Vec3) -> Self {
        let twice_area = cross.length();
        if !(twice_area > 0.0 && twice_area.is_finite()) {
            return Self::default();
        }
        let scaled = cross * (0.5 / twice_area);
        Self {
            diagonal: cross * scaled,
            off_diagonal: Vec3::new(cross.y * scaled.z, cross.x * scaled.z, cross.x * scaled.y),
            ..Self::default()
        }
    }

    /// Adds a quadric about the same point that vanishes there.
    #[inline]
    pub fn merge_plane(&mut self, plane: &Self) {
        self.diagonal += plane.diagonal;
        self.off_diagonal += plane.off_diagonal;
    }

    /// Sum of the weights: the trace of `A`, since the normals are of unit length.
    pub fn weight(&self) -> f32 {
        self.diagonal.element_sum()
    }

    /// The mean squared distance to the planes, weighted; zero without planes.
    pub fn mean_squared_distance(&self, at: Vec3) -> f32 {
        let weight = self.weight();
        if weight > 0.0 { self.cost(at) / weight } else { 0.0 }
    }

    #[inline]
    fn times(&self, v: Vec3) -> Vec3 {
        let o = self.off_diagonal;
        self.diagonal * v
            + Vec3::new(o.z * v.y + o.y * v.z, o.z * v.x + o.x * v.z, o.y * v.x + o.x * v.y)
    }
}

impl ErrorMetric for Quadric {
    fn from_triangle([p, q, r]: [Vec3; 3]) -> Self {
        let cross = (q - p).cross(r - p);
        let twice_area = cross.length();
        if twice_area > 0.0 && twice_area.is_finite() {
            let normal = cross / twice_area;
            Self::from_plane(normal, normal.dot((p + q + r) / 3.0), 0.5 * twice_area)
        } else {
            Self::default()
        }
    }

    fn from_boundary_edge([p, q]: [Vec3; 2], normal: Vec3) -> Self {
        let edge = q - p;
        match edge.cross(normal).try_normalize() {
            Some(upright) => Self::from_plane(
                upright,
                upright.dot(0.5 * (p + q)),
                BOUNDARY_WEIGHT * edge.length_squared(),
            ),
            None => Self::default(),
        }
    }

    #[inline]
    fn merge(&mut self, other: &Self) {
        self.diagonal += other.diagonal;
        self.off_diagonal += other.off_diagonal;
        self.b += other.b;
        self.c += other.c;
    }

    #[inline]
    fn about(&self, origin: Vec3) -> Self {
        let moved = self.times(origin);
        Self {
            b: self.b + moved,
            // The cost at the new origin, which rounding must not make negative.
            c: (self.c + origin.dot(2.0 * self.b + moved)).max(0.0),
            ..*self
        }
    }

    #[inline]
    fn cost(&self, at: Vec3) -> f32 {
        (at.dot(self.times(at) + 2.0 * self.b) + self.c).max(0.0)
    }

    /// Solves `(A + εI)(x − near) = −(A·near + b)` with `ε` a small share of the trace of `A`.
    fn optimum(&self, near: Vec3) -> Vec3 {
        let pull = REGULARISATION * self.diagonal.element_sum();
        let (d, o) = (self.diagonal + pull, self.off_diagonal);
        let a = Mat3::from_cols(
            Vec3::new(d.x, o.z, o.y),
            Vec3::new(o.z, d.y, o.x),
            Vec3::new(o.y, o.x, d.z),
        );
        // Cramer's rule on a matrix scaled to trace one, so that tiny models do not underflow.
        let scale = d.element_sum();
        if scale <= 0.0 || !scale.is_finite() {
            return near;
        }
        let a = a * (1.0 / scale);
        let right = -(self.times(near) + self.b) / scale;
        let determinant = a.determinant();
        let (x, y, z) = (a.x_axis, a.y_axis, a.z_axis);
        let step = Vec3::new(right.dot(y.cross(z)), x.dot(right.cross(z)), x.dot(y.cross(right)))
            / determinant;
        if step.is_finite() { near + step } else { near }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;
    use proptest::prelude::*;

    use super::*;

    fn point(range: f32) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-range..range).prop_map(Vec3::from_array)
    }

    fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
        prop::array::uniform3(point(1.0))
            .prop_filter("too thin for a stable normal", |[a, b, c]| {
                (*b - *a).cross(*c - *a).length() > 0.05
            })
    }

    /// The specification, in double precision.
    fn naive_cost(triangles: &[[Vec3; 3]], at: Vec3) -> f64 {
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|p| p.as_dvec3());
                let cross = (b - a).cross(c - a);
                let distance = cross.normalize().dot(at.as_dvec3() - a);
                0.5 * cross.length() * distance * distance
            })
            .sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn cost_is_the_weighted_squared_distance(
            triangles in prop::collection::vec(triangle(), 1..8),
            at in point(1.0),
            origin in point(1.0),
        ) {
            let mut q = Quadric::default();
            for t in &triangles {
                q.merge(&Quadric::from_triangle(*t));
            }
            let expected = naive_cost(&triangles, at) as f32;
            prop_assert!((q.cost(at) - expected).abs() <= 1e-4 * (1.0 + expected));
            prop_assert!((q.about(origin).cost(at - origin) - expected).abs() <= 3e-4 * (1.0 + expected));
        }

        #[test]
        fn the_optimum_is_nowhere_worse_than_where_it_is_asked(
            triangles in prop::collection::vec(triangle(), 1..8),
            near in point(1.0),
        ) {
            let mut q = Quadric::default();
            for t in &triangles {
                q.merge(&Quadric::from_triangle(*t));
            }
            let found = q.optimum(near);
            prop_assert!(found.is_finite());
            prop_assert!(q.cost(found) <= q.cost(near) + 1e-5);
        }
    }

    #[test]
    fn a_triangle_seen_from_its_corner_is_that_triangle() {
        let (a, b) = (vec3(0.3, 0.1, -0.4), vec3(-0.2, 0.5, 0.6));
        let (one, other) =
            (Quadric::from_cross_product(a.cross(b)), Quadric::from_triangle([Vec3::ZERO, a, b]));
        for at in [Vec3::ONE, vec3(0.1, -0.7, 0.4)] {
            assert!((one.cost(at) - other.cost(at)).abs() < 1e-5);
        }
        assert_eq!(Quadric::from_cross_product(Vec3::ZERO), Quadric::default());
    }

    #[test]
    fn a_flat_region_leaves_the_point_in_its_plane_beside_where_it_was() {
        let mut q = Quadric::default();
        for i in 0..6 {
            let i = i as f32;
            q.merge(&Quadric::from_triangle([
                vec3(0.0, 0.0, 1.0),
                vec3(i.cos(), i.sin(), 1.0),
                vec3((i + 1.0).cos(), (i + 1.0).sin(), 1.0),
            ]));
        }
        let found = q.optimum(vec3(0.2, 0.3, 1.1));
        assert!(found.distance(vec3(0.2, 0.3, 1.0)) < 1e-3, "{found}");
    }

    #[test]
    fn a_boundary_edge_holds_its_line() {
        let mut q = Quadric::from_triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        q.merge(&Quadric::from_boundary_edge([Vec3::ZERO, Vec3::X], Vec3::Z));
        assert!(q.cost(vec3(7.0, 0.0, 0.0)) < 1e-4, "along the edge");
        assert!(q.cost(vec3(0.5, -1.0, 0.0)) > 1.0, "off the edge");
    }

    #[test]
    fn nothing_comes_of_nothing() {
        let q = Quadric::from_triangle([Vec3::ONE; 3]);
        assert_eq!(q, Quadric::default());
        assert_eq!(q.optimum(Vec3::X), Vec3::X);
        assert_eq!(q.mean_squared_distance(Vec3::X), 0.0);
    }

    #[test]
    fn tiny_and_huge_models_do_not_break_the_minimiser() {
        for scale in [1e-6f32, 1.0, 1e5] {
            let mut q = Quadric::default();
            for [a, b] in [[Vec3::X, Vec3::Y], [Vec3::Y, Vec3::Z], [Vec3::Z, Vec3::X]] {
                let p = Vec3::splat(scale);
                q.merge(&Quadric::from_triangle([p, p - a * scale, p - b * scale]));
            }
            let found = q.optimum(0.9 * Vec3::splat(scale));
            assert!(found.distance(Vec3::splat(scale)) < 1e-3 * scale, "{scale}: {found}");
        }
    }
}
