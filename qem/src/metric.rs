//! What a simplifier asks of an error metric.

use glam::Vec3;

/// A measure of the damage done by moving vertices, gathered per vertex and merged when vertices are.
///
/// All points are relative to an origin the caller chooses and keeps; [`about`](Self::about) changes it.
pub trait ErrorMetric: Clone + Default {
    /// The share of one triangle, the same for each of its corners.
    fn from_triangle(corners: [Vec3; 3]) -> Self;

    /// The share of a boundary edge whose triangle has this unit normal; zero for an edge or normal without length.
    fn from_boundary_edge(ends: [Vec3; 2], normal: Vec3) -> Self;

    /// Adds what `other` gathered, about the same origin.
    fn merge(&mut self, other: &Self);

    /// The same metric about another origin, which lies at `origin` as seen from the present one.
    #[must_use]
    fn about(&self, origin: Vec3) -> Self;

    /// The damage done by a vertex at this point: squared length times area, not negative.
    fn cost(&self, at: Vec3) -> f32;

    /// The point with the least cost. Where many have it, the one nearest to `near`; never far off, always finite for
    /// finite input.
    fn optimum(&self, near: Vec3) -> Vec3;
}
