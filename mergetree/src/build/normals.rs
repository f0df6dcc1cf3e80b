//! Vertex normals.

use glam::Vec3;
use halfedge::{HalfEdgeMesh, VertexId};
use rayon::prelude::*;

use crate::OctNormal;

/// The normal of every vertex from the triangles around it, each weighted by the sine of its angle over the product of
/// its edges there; exact on spheres. A vertex whose triangles have no area gets +z.
///
/// # Complexity
/// Time linear in the number of half-edges.
///
/// # Sources
/// Max, *Weights for Computing Vertex Normals from Facet Normals*, 1999.
///
/// # Panics
/// When a vertex has no position.
pub fn vertex_normals(mesh: &HalfEdgeMesh, positions: &[Vec3]) -> Vec<OctNormal> {
    (0..mesh.vertex_capacity())
        .into_par_iter()
        .map(|v| {
            let p = positions[v];
            let mut sum = Vec3::ZERO;
            for h in mesh.outgoing(VertexId::from_index(v)) {
                let a = positions[mesh.end(h).index()] - p;
                let b = positions[mesh.start(h.prev()).index()] - p;
                let weight = a.length_squared() * b.length_squared();
                if weight > 0.0 && weight.is_finite() {
                    sum += a.cross(b) / weight;
                }
            }
            OctNormal::new(sum)
        })
        .collect()
}
