//! The surface while it is decimated: what a collapse costs, whether it may be, and what it does.

use glam::Vec3;
use halfedge::{Collapse, CollapseRejected, FaceId, HalfEdgeId, HalfEdgeMesh, VertexId};
use qem::{Batch, ErrorMetric, LANES, Quadric};

use crate::Placement;
use crate::deviation::Patch;

/// Least cosine of the angle by which a collapse may turn a triangle.
const LEAST_COSINE: f32 = 0.2;

/// What moving the surface by a distance costs, as a share of that distance to the fourth power.
const DEVIATION_WEIGHT: f32 = 10.0;

/// A penalty below this share of the cost does not matter.
const NEGLIGIBLE: f32 = 1e-3;

/// What collapsing an edge costs at least, as a share of its squared length times the area of the triangles around it:
/// below what can be seen, and above the rounding of single precision.
const LENGTH_WEIGHT: f32 = 1e-5;

/// Why an edge cannot be collapsed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blocked {
    /// The boundary would lose its shape.
    Boundary,
    /// The topology would change.
    Topology,
    /// A triangle would be turned over.
    Flips,
    /// The surface would move too far from the input.
    Error,
}

/// A collapse that may be performed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) collapse: Collapse,
    /// Where the vertex that stays will be.
    at: Vec3,
    /// How far the surface around it will lie from the input at most.
    deviation: f32,
    /// Squared distance times area.
    pub(super) cost: f32,
}

/// What a collapse costs by its quadrics alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rating {
    /// Where the vertex that stays would be.
    at: Vec3,
    /// Squared distance times area.
    pub(super) cost: f32,
}

/// The half-edge that stands for an edge: the one of the lower number.
#[inline]
pub(super) fn edge_of(mesh: &HalfEdgeMesh, h: HalfEdgeId) -> HalfEdgeId {
    mesh.reverse(h).map_or(h, |reverse| h.min(reverse))
}

/// The plane of a face; zero for one without area.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    /// Of unit length.
    normal: Vec3,
    area: f32,
}

impl Plane {
    fn of([a, b, c]: [Vec3; 3]) -> Self {
        let cross = (b - a).cross(c - a);
        let length = cross.length();
        if length > 0.0 {
            Self { normal: cross / length, area: 0.5 * length }
        } else {
            Self::default()
        }
    }

    /// Whether the triangle lies nearly across, or upside down, once it has these corners. One without area has no side
    /// to be turned from.
    fn is_turned(&self, a: Vec3, b: Vec3, c: Vec3) -> bool {
        let after = (b - a).cross(c - a);
        let cosine = self.normal.dot(after);
        let enough = LEAST_COSINE * LEAST_COSINE * after.length_squared();
        self.area > 0.0 && !(cosine > 0.0 && cosine * cosine > enough)
    }

    /// The quadric about a point of the plane, counted `times` times.
    fn quadric(&self, times: f32) -> Quadric {
        Quadric::from_plane(self.normal, 0.0, times * self.area)
    }
}

/// A mesh with what decimation knows of its vertices and faces.
pub(super) struct Surface {
    mesh: HalfEdgeMesh,
    /// In units of `unit`.
    positions: Vec<Vec3>,
    /// Of every face, as it lies now.
    planes: Vec<Plane>,
    /// Of every vertex, about itself: the planes of the triangles and boundary edges there are around it now.
    quadrics: Vec<Quadric>,
    /// Of every vertex, how far the surface around it lies from the input at most, in units of `unit`.
    deviations: Vec<f32>,
    placement: Placement,
    /// The greatest deviation allowed.
    most: f32,
    /// A power of two near the size of the model: costs, which go with the fourth power of lengths, then neither vanish
    /// nor overflow, and positions keep their bits.
    unit: f32,
    /// The triangles around the collapse that is looked at, and the vertices of the patch.
    patch: Patch,
    around: Vec<VertexId>,
}

impl Surface {
    /// Prepares a mesh. `most` is how far the surface may move, in model units.
    pub(super) fn new(
        mesh: HalfEdgeMesh,
        mut positions: Vec<Vec3>,
        placement: Placement,
        most: f64,
    ) -> Self {
        let unit = power_of_two_near(extent(&positions));
        for p in &mut positions {
            *p /= unit;
        }
        let vertices = mesh.vertex_capacity();
        let plane = |f| {
            let corners = mesh.corners(FaceId::from_index(f));
            corners.map_or(Plane::default(), |t| Plane::of(t.map(|v| positions[v.index()])))
        };
        let mut surface = Self {
            planes: (0..mesh.face_capacity()).map(plane).collect(),
            mesh,
            positions,
            quadrics: vec![Quadric::default(); vertices],
            deviations: vec![0.0; vertices],
            placement,
            most: rounded_down(most / f64::from(unit)),
            unit,
            patch: Patch::default(),
            around: Vec::new(),
        };
        for v in (0..vertices).map(VertexId::from_index) {
            surface.quadrics[v.index()] = surface.gather(v);
        }
        surface
    }

    pub(super) fn mesh(&self) -> &HalfEdgeMesh {
        &self.mesh
    }

    /// The mesh, and its positions in model units.
    pub(super) fn into_parts(mut self) -> (HalfEdgeMesh, Vec<Vec3>) {
        for p in &mut self.positions {
            *p *= self.unit;
        }
        (self.mesh, self.positions)
    }

    #[inline]
    fn at(&self, v: VertexId) -> Vec3 {
        self.positions[v.index()]
    }

    /// All edges.
    pub(super) fn edges(&self) -> impl Iterator<Item = HalfEdgeId> + '_ {
        self.mesh.half_edges().filter(|&h| edge_of(&self.mesh, h) == h)
    }

    /// The edges at a vertex, and the neighbours they lead to.
    pub(super) fn edges_at(
        &self,
        v: VertexId,
    ) -> impl Iterator<Item = (HalfEdgeId, VertexId)> + '_ {
        let mesh = &self.mesh;
        // On a boundary the last one only comes in.
        let last = mesh
            .is_boundary_vertex(v)
            .then(|| mesh.outgoing(v).last().map(|h| (h.prev(), mesh.start(h.prev()))));
        mesh.outgoing(v).map(|h| (edge_of(mesh, h), mesh.end(h))).chain(last.flatten())
    }

    /// The quadric of the triangles and boundary edges around a vertex, about it: all their planes go through it.
    fn gather(&self, v: VertexId) -> Quadric {
        let mut quadric = Quadric::default();
        for h in self.mesh.outgoing(v) {
            let plane = &self.planes[h.face().index()];
            quadric.merge(&plane.quadric(1.0));
            for edge in [h, h.prev()].into_iter().filter(|&e| self.mesh.reverse(e).is_none()) {
                let ends =
                    [self.mesh.start(edge), self.mesh.end(edge)].map(|e| self.at(e) - self.at(v));
                quadric.merge(&Quadric::from_boundary_edge(ends, plane.normal));
            }
        }
        quadric
    }

    /// What collapsing an edge costs at least: by the quadrics alone, whether it is possible or not.
    pub(super) fn rate(&self, edge: HalfEdgeId) -> Rating {
        let (v, u) = (self.mesh.start(edge), self.mesh.end(edge));
        match self.placement {
            Placement::Optimal => self.place(v, u),
            Placement::Subset => {
                let [there, back] = [self.place_at(v, u), self.place_at(u, v)];
                if back.cost < there.cost { back } else { there }
            }
        }
    }

    /// Rates all edges at a vertex, as [`rate`](Self::rate) does.
    pub(super) fn rate_around(&self, v: VertexId, mut rated: impl FnMut(HalfEdgeId, f32)) {
        let mut edges = self.edges_at(v);
        if self.placement == Placement::Subset {
            edges.for_each(|(edge, _)| rated(edge, self.rate(edge).cost));
            return;
        }
        let center = &self.quadrics[v.index()];
        loop {
            let mut batch = Batch::default();
            let mut members = [(HalfEdgeId::new(0), 0.0); LANES];
            for (edge, u) in edges.by_ref().take(LANES) {
                let way = self.at(u) - self.at(v);
                let quadric = &self.quadrics[u.index()];
                members[batch.len()] = (edge, least_cost(way, center, quadric));
                batch.push(quadric, way, self.near([v, u], way));
            }
            if batch.is_empty() {
                return;
            }
            let costs = batch.least_costs(center);
            for ((edge, least), cost) in members.into_iter().zip(costs).take(batch.len()) {
                rated(edge, cost + least);
            }
        }
    }

    /// Where, as seen from the first of both, a vertex that merges two is put if nothing gives it a hold: on the boundary,
    /// or between them, nearer to where it costs less. So a corner stays exactly where it is.
    fn near(&self, [v, u]: [VertexId; 2], way: Vec3) -> Vec3 {
        match [v, u].map(|v| self.mesh.is_boundary_vertex(v)) {
            [true, false] => Vec3::ZERO,
            [false, true] => way,
            _ => {
                let at_first = self.quadrics[u.index()].cost(-way);
                let at_second = self.quadrics[v.index()].cost(way);
                let sum = at_first + at_second;
                if sum > 0.0 { way * (at_first / sum) } else { 0.5 * way }
            }
        }
    }

    /// The vertex that two become, where it is best placed.
    fn place(&self, v: VertexId, u: VertexId) -> Rating {
        let way = self.at(u) - self.at(v);
        let [one, other] = [v, u].map(|v| &self.quadrics[v.index()]);
        let mut quadric = *one;
        quadric.merge(&other.about(-way));
        let at = quadric.optimum(self.near([v, u], way));
        Rating { at: self.at(v) + at, cost: quadric.cost(at) + least_cost(way, one, other) }
    }

    /// The vertex that two become, where the second of them is.
    fn place_at(&self, removed: VertexId, kept: VertexId) -> Rating {
        let way = self.at(kept) - self.at(removed);
        let [gone, stays] = [removed, kept].map(|v| &self.quadrics[v.index()]);
        let cost = gone.cost(way) + stays.cost(Vec3::ZERO) + least_cost(way, gone, stays);
        Rating { at: self.at(kept), cost }
    }

    /// The best way to collapse an edge that was [rated](Self::rate) so, at its full cost.
    ///
    /// # Errors
    /// Why there is none.
    pub(super) fn check(&mut self, edge: HalfEdgeId, rating: &Rating) -> Result<Step, Blocked> {
        let mut best: Result<Step, Blocked> = Err(Blocked::Topology);
        for h in [Some(edge), self.mesh.reverse(edge)].into_iter().flatten() {
            let step = match self.mesh.check_collapse(h) {
                Err(rejected) => Err(reason(rejected)),
                // Whichever end goes, the other one is placed anew.
                Ok(collapse) if self.placement == Placement::Optimal => {
                    return self.step(collapse, rating);
                }
                Ok(collapse) => {
                    let Collapse { removed, kept, .. } = collapse;
                    self.step(collapse, &self.place_at(removed, kept))
                }
            };
            let better = match (&best, &step) {
                (Ok(best), Ok(step)) => step.cost < best.cost,
                (best, _) => best.is_err(),
            };
            if better {
                best = step;
            }
        }
        best
    }

    /// A collapse with the vertex placed so, if that turns nothing over and moves nothing too far.
    fn step(&mut self, collapse: Collapse, rating: &Rating) -> Result<Step, Blocked> {
        let &Rating { at, cost } = rating;
        self.look_around(&collapse, at)?;
        let deviation = if self.most == f32::INFINITY {
            let enough = (NEGLIGIBLE * cost / DEVIATION_WEIGHT).sqrt().sqrt();
            self.patch.estimate_after(at, enough)
        } else {
            self.patch.bound_after(at)
        };
        // Also where one of them is no number.
        let is_near = deviation <= self.most && (at * self.unit).is_finite();
        if !is_near {
            return Err(Blocked::Error);
        }
        let squared = deviation * deviation;
        Ok(Step { collapse, at, deviation, cost: cost + DEVIATION_WEIGHT * squared * squared })
    }

    /// Puts the triangles around a collapse into the patch, unless one of them is turned over.
    fn look_around(&mut self, collapse: &Collapse, at: Vec3) -> Result<(), Blocked> {
        let ends = [collapse.removed, collapse.kept];
        let of = |v: VertexId| (self.positions[v.index()], self.deviations[v.index()]);
        self.patch.restart(ends.map(of));
        self.around.clear();
        self.around.extend(ends);
        for (end, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
            for h in self.mesh.outgoing(end) {
                let [r, s] = [self.mesh.end(h), self.mesh.start(h.prev())];
                let gone = r == other || s == other;
                if !gone && self.planes[h.face().index()].is_turned(at, self.at(r), self.at(s)) {
                    return Err(Blocked::Flips);
                }
                if gone && end == collapse.kept {
                    // It was there among those of the other end.
                    continue;
                }
                let corners = [end, r, s].map(|v| {
                    self.around.iter().position(|&w| w == v).unwrap_or_else(|| {
                        self.around.push(v);
                        let (at, deviation) = of(v);
                        self.patch.add_vertex(at, deviation)
                    })
                });
                self.patch.add_triangle(corners);
            }
        }
        Ok(())
    }

    /// Performs a step that [`check`](Self::check) gave for the surface as it is now.
    pub(super) fn collapse(&mut self, step: &Step) {
        let (removed, kept) = (step.collapse.removed, step.collapse.kept);
        self.count_triangles(removed, -1.0, None);
        self.count_triangles(kept, -1.0, Some(removed));
        self.mesh.apply(&step.collapse);
        self.positions[kept.index()] = step.at;
        self.deviations[kept.index()] = step.deviation;
        for h in self.mesh.outgoing(kept) {
            let corners =
                [h, h.next(), h.prev()].map(|h| self.positions[self.mesh.start(h).index()]);
            self.planes[h.face().index()] = Plane::of(corners);
        }
        self.count_triangles(kept, 1.0, None);
        self.quadrics[kept.index()] = self.gather(kept);
        if self.mesh.is_boundary_vertex(kept) {
            let ring: Vec<_> = self.mesh.one_ring(kept).collect();
            for r in ring {
                self.quadrics[r.index()] = self.gather(r);
            }
        }
    }

    /// Counts the triangles around a vertex, but for those `without` another one, in the quadrics of their other corners,
    /// so many times.
    fn count_triangles(&mut self, v: VertexId, times: f32, without: Option<VertexId>) {
        for h in self.mesh.outgoing(v) {
            let others = [self.mesh.end(h), self.mesh.start(h.prev())];
            if !others.map(Some).contains(&without) {
                let quadric = self.planes[h.face().index()].quadric(times);
                for r in others {
                    self.quadrics[r.index()].merge(&quadric);
                }
            }
        }
    }
}

fn reason(rejected: CollapseRejected) -> Blocked {
    match rejected {
        CollapseRejected::LeavesBoundary(_) => Blocked::Boundary,
        _ => Blocked::Topology,
    }
}

fn least_cost(way: Vec3, one: &Quadric, other: &Quadric) -> f32 {
    LENGTH_WEIGHT * way.length_squared() * (one.weight() + other.weight())
}

/// The length of the longest side of the box around the points, or the largest number if it is longer.
fn extent(positions: &[Vec3]) -> f32 {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = positions.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)));
    (high - low).max_element().min(f32::MAX)
}

/// A power of two that is not above `x` and not below its half; 1 where there is none.
fn power_of_two_near(x: f32) -> f32 {
    if x.is_normal() && x > 0.0 { f32::from_bits(x.to_bits() & 0x7f80_0000) } else { 1.0 }
}

/// The nearest single that is not above.
fn rounded_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}
