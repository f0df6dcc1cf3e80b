//! Collapses chosen by repeated independent sets (DeCoro and Pajarola, *XFastMesh*, 2002, §5.2).
//!
//! Every round rates the cheapest legal collapse of each vertex whose surroundings changed, sorts them by cost with a
//! radix sort, and performs, cheapest first, those that do not touch each other. As each round removes a fixed share
//! of the vertices at least, rounds are few, trees are balanced and the whole is linear in the size of the mesh.

use glam::Vec3;
use halfedge::{Collapse, HalfEdgeId, HalfEdgeMesh, VertexId};
use qem::{ErrorMetric, Quadric};
use rayon::prelude::*;

use super::geometry::{Surface, area_normal};
use super::radix;
use crate::{CollapseRecord, OctNormal, RankAccount};

/// How the in-core builder chooses collapses.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// Collapsing stops when so few faces are left; the coarsest mesh has more where topology forbids to go on.
    /// Default 256.
    pub base_faces: usize,
    /// Share of the cheapest candidates looked at per round, above 0 and up to 1. More makes fewer rounds and flatter
    /// trees, less follows the order of cost more closely. Default 0.3.
    pub share_per_round: f32,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { base_faces: 256, share_per_round: 0.3 }
    }
}

/// The collapses of a mesh, in order, and what is left after them.
#[derive(Clone, Debug)]
pub struct Records {
    /// The collapses.
    pub records: Vec<CollapseRecord>,
    /// The mesh after them, in the numbering of the input.
    pub coarse: HalfEdgeMesh,
}

/// The cheapest legal collapse of a vertex.
#[derive(Clone, Copy)]
struct Candidate {
    cost: f32,
    half_edge: HalfEdgeId,
}

/// Collapses a mesh as far as topology, geometry and `options` allow.
///
/// `progress` is called now and then with the share done, from 0 to 1.
///
/// # Complexity
/// Time and memory linear in the number of faces.
///
/// # Panics
/// When a vertex has no position or normal.
pub fn collapse_in_independent_sets(
    mesh: HalfEdgeMesh,
    positions: &[Vec3],
    normals: &[OctNormal],
    options: &BuildOptions,
    progress: &dyn Fn(f32),
) -> Records {
    let num_faces = mesh.num_faces();
    let mut builder = Builder::new(mesh, positions, normals);
    let mut alive: Vec<u32> = builder.mesh.vertices().map(VertexId::get).collect();
    while builder.mesh.num_faces() > options.base_faces {
        builder.rate(&alive);
        let removed = builder.collapse_round(&alive, options);
        if removed == 0 {
            break;
        }
        let mesh = &builder.mesh;
        alive.retain(|&v| mesh.has_vertex(VertexId::new(v)));
        progress(1.0 - mesh.num_faces() as f32 / num_faces.max(1) as f32);
    }
    progress(1.0);
    Records { records: builder.records, coarse: builder.mesh }
}

struct Builder<'a> {
    mesh: HalfEdgeMesh,
    positions: &'a [Vec3],
    normals: &'a [OctNormal],
    /// Of every vertex, about itself.
    quadrics: Vec<Quadric>,
    /// Of every vertex, how far the surface around it lies from the input at most.
    deviations: Vec<f32>,
    candidates: Vec<Option<Candidate>>,
    /// Whether the candidate has to be rated anew.
    stale: Vec<bool>,
    /// The round in which a vertex was last near a collapse, and must not be removed.
    touched: Vec<u32>,
    round: u32,
    ranks: RankAccount,
    records: Vec<CollapseRecord>,
}

impl<'a> Builder<'a> {
    fn new(mesh: HalfEdgeMesh, positions: &'a [Vec3], normals: &'a [OctNormal]) -> Self {
        let n = mesh.vertex_capacity();
        let quadrics = (0..n)
            .into_par_iter()
            .map(|v| initial_quadric(&mesh, positions, VertexId::from_index(v)))
            .collect();
        Self {
            ranks: RankAccount::default(),
            positions,
            normals,
            quadrics,
            deviations: vec![0.0; n],
            candidates: vec![None; n],
            stale: vec![true; n],
            touched: vec![0; n],
            round: 0,
            records: Vec::with_capacity(mesh.num_vertices()),
            mesh,
        }
    }

    fn surface(&self) -> Surface<'_> {
        Surface { mesh: &self.mesh, positions: self.positions, normals: self.normals }
    }

    /// Rates the vertices whose surroundings changed, on all cores.
    fn rate(&mut self, alive: &[u32]) {
        let rated: Vec<(u32, Option<Candidate>)> = alive
            .par_iter()
            .filter(|&&v| self.stale[v as usize])
            .map_init(Vec::new, |scratch, &v| (v, self.best_collapse(VertexId::new(v), scratch)))
            .collect();
        for (v, candidate) in rated {
            self.candidates[v as usize] = candidate;
            self.stale[v as usize] = false;
        }
    }

    fn best_collapse(&self, v: VertexId, options: &mut Vec<Candidate>) -> Option<Candidate> {
        let own = &self.quadrics[v.index()];
        let at = self.positions[v.index()];
        options.clear();
        options.extend(self.mesh.outgoing(v).map(|half_edge| {
            let u = self.mesh.end(half_edge).index();
            let cost = own.cost(self.positions[u] - at) + self.quadrics[u].cost(Vec3::ZERO);
            Candidate { cost, half_edge }
        }));
        options.retain(|c| c.cost.is_finite());
        options.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.half_edge.cmp(&b.half_edge)));
        options.iter().find(|c| self.legal(c.half_edge).is_some()).copied()
    }

    fn legal(&self, h: HalfEdgeId) -> Option<Collapse> {
        self.mesh.check_collapse(h).ok().filter(|c| self.surface().keeps_orientation(c))
    }

    /// Performs the cheapest candidates that do not touch each other. Returns how many.
    fn collapse_round(&mut self, alive: &[u32], options: &BuildOptions) -> usize {
        self.round += 1;
        let mut order: Vec<(u32, u32)> = alive
            .iter()
            .filter_map(|&v| self.candidates[v as usize].map(|c| (c.cost.to_bits(), v)))
            .collect();
        radix::sort_by_key(&mut order);
        let share = options.share_per_round.clamp(0.01, 1.0);
        let considered = ((order.len() as f32 * share).ceil() as usize).min(order.len());
        let before = self.records.len();
        for &(_, v) in &order[..considered] {
            if self.mesh.num_faces() <= options.base_faces {
                break;
            }
            let Some(candidate) = self.candidates[v as usize] else { continue };
            if !self.mesh.has_face(candidate.half_edge.face()) {
                continue;
            }
            let end = self.mesh.end(candidate.half_edge).index();
            if self.touched[v as usize] == self.round || self.touched[end] == self.round {
                continue;
            }
            match self.legal(candidate.half_edge) {
                Some(collapse) => self.perform(&collapse),
                // Its surroundings changed since it was rated.
                None => self.stale[v as usize] = true,
            }
        }
        self.records.len() - before
    }

    fn perform(&mut self, c: &Collapse) {
        let (v, u) = (c.removed.index(), c.kept.index());
        let earlier = self.deviations[v].max(self.deviations[u]);
        let star = self.surface().star_bounds(c, earlier);
        for r in self.mesh.one_ring(c.removed) {
            self.touched[r.index()] = self.round;
        }
        let rank = self.ranks.next(&self.mesh, c);
        self.mesh.apply(c);
        let moved = self.quadrics[v].about(self.positions[u] - self.positions[v]);
        self.quadrics[u].merge(&moved);
        self.deviations[u] = star.deviation;
        self.stale[u] = true;
        // Of the neighbours, those whose best collapse went into either vertex or went with the faces.
        for r in self.mesh.one_ring(c.kept) {
            let r = r.index();
            self.stale[r] |= self.candidates[r].is_none_or(|best| {
                !self.mesh.has_face(best.half_edge.face())
                    || self.mesh.end(best.half_edge) == c.kept
            });
        }
        self.records.push(CollapseRecord { rank: Some(rank), ..CollapseRecord::new(c, star) });
    }
}

/// The planes around a vertex, and those that hold its boundary, about the vertex itself.
fn initial_quadric(mesh: &HalfEdgeMesh, positions: &[Vec3], v: VertexId) -> Quadric {
    let origin = positions[v.index()];
    let at = |v: VertexId| positions[v.index()] - origin;
    let mut quadric = Quadric::default();
    for h in mesh.outgoing(v) {
        let triangle = [h, h.next(), h.prev()].map(|h| at(mesh.start(h)));
        quadric.merge(&Quadric::from_triangle(triangle));
        for edge in [h, h.prev()].into_iter().filter(|&e| mesh.reverse(e).is_none()) {
            let normal = area_normal(triangle).normalize_or_zero();
            let ends = [at(mesh.start(edge)), at(mesh.end(edge))];
            quadric.merge(&Quadric::from_boundary_edge(ends, normal));
        }
    }
    quadric
}
