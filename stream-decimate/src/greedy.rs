//! Greedy decimation in core: the cheapest collapse of the whole mesh first.
//!
//! The quality that stream decimation is measured by. Three things make it better than the textbook's version:
//!
//! - Quadrics have no memory: after each collapse those of the vertices around it are gathered anew from the triangles as
//!   they lie now (Lindstrom and Turk, *Fast and Memory Efficient Polygonal Simplification*, 1998). On scans that
//!   takes a quarter off the mean distance.
//! - A collapse also pays for how far it moves the surface from the input, by the fourth power of that distance. Thin
//!   spikes and needles, whose area is next to nothing, would else go first.
//! - Where everything is flat, short edges of small triangles go first.

mod queue;
mod surface;

use std::ops::ControlFlow;

use halfedge::{BuildError, HalfEdgeMesh, VertexId, repair};
use mesh_io::{IndexedMesh, Place};

use self::queue::Queue;
use self::surface::{Blocked, Surface, edge_of};
use crate::report::{MissedTarget, Repairs};
use crate::{DecimateOptions, DecimateReport, Error, Observer, Progress, Stage, Target};

/// Collapses between two looks at the observer.
const OBSERVE_EVERY: usize = 1 << 12;

/// Of a sweep over all edges at least this share of the faces has to go, or it was the last where only the largest error
/// stops the decimation.
const WORTH_ANOTHER_SWEEP: f64 = 1e-3;

/// Decimates a mesh in core, the cheapest collapse first (Garland and Heckbert, *Surface Simplification Using Quadric
/// Error Metrics*, 1997).
///
/// The input is repaired into a manifold first, as [`halfedge::repair`] does it; the output is one, with the same Euler
/// number and boundaries. Of the options, target and placement matter. Vertices and triangles of the output are in the
/// order of the input.
///
/// With [`Target::MaxError`] the surface moves by no more than that distance, by a bound that grows with each collapse.
///
/// # Complexity
/// Time near linear in the number of triangles, memory linear: about 200 bytes per triangle.
///
/// # Errors
/// [`Error::Options`] for options out of range, [`Error::Mesh`] when a triangle names a vertex that is not there,
/// [`Error::Interrupted`] when the observer asks for it.
///
/// # Examples
/// ```
/// use std::ops::ControlFlow;
/// use glam::vec3;
/// use mesh_io::IndexedMesh;
/// use stream_decimate::{DecimateOptions, Target, decimate_greedy};
///
/// // A flat square of 200 triangles needs no more than two.
/// let positions = (0..121).map(|i| vec3((i % 11) as f32, (i / 11) as f32, 0.0)).collect();
/// let cells = (0..10).flat_map(|y| (0..10).map(move |x| 11 * y + x));
/// let triangles = cells.flat_map(|v| [[v, v + 1, v + 12], [v, v + 12, v + 11]]).collect();
/// let square = IndexedMesh { positions, triangles, ..Default::default() };
/// let options = DecimateOptions::new(Target::MaxError(0.01));
/// let (mesh, report) = decimate_greedy(&square, &options, &mut |_| ControlFlow::Continue(()))?;
/// assert_eq!(mesh.triangles.len(), 2);
/// assert_eq!(report.input_triangles, 200);
/// # Ok::<(), stream_decimate::Error>(())
/// ```
pub fn decimate_greedy(
    mesh: &IndexedMesh,
    options: &DecimateOptions,
    observer: &mut Observer<'_>,
) -> Result<(IndexedMesh, DecimateReport), Error> {
    options.check()?;
    let input = mesh.triangles.len() as u64;
    let repaired =
        repair(&mesh.positions, &mesh.triangles).map_err(|error| Error::Mesh(bad_index(&error)))?;
    let found = repaired.report;
    let mut report = DecimateReport {
        input_triangles: input,
        target_triangles: options.target.triangles(input),
        peak_buffer_triangles: repaired.mesh.num_faces() as u64,
        repaired: Repairs {
            non_finite: found.non_finite_triangles as u64,
            degenerate: found.degenerate_triangles as u64,
            duplicate: found.duplicate_triangles as u64,
            non_manifold: found.cut_edges as u64,
            split_vertices: found.split_vertices as u64,
            ..Repairs::default()
        },
        ..DecimateReport::default()
    };
    let mut greedy = Greedy::new(repaired.mesh, repaired.positions, options);
    greedy.run(report.target_triangles.unwrap_or(0) as usize, observer)?;
    let faces = greedy.surface.mesh().num_faces() as u64;
    report.output_triangles = faces;
    report.missed = report
        .target_triangles
        .filter(|&target| faces > target)
        .map(|target| greedy.blocked.share_out(faces - target));
    Ok((greedy.into_mesh(), report))
}

/// The one way in which the repair can fail.
fn bad_index(error: &BuildError) -> mesh_io::Error {
    let (index, num_vertices) = match *error {
        BuildError::VertexOutOfRange { vertex, num_vertices, .. } => {
            (i64::from(vertex), num_vertices as u64)
        }
        _ => (-1, 0),
    };
    mesh_io::Error::IndexOutOfRange {
        name: "mesh".to_owned(),
        place: Place::File,
        index,
        num_vertices,
    }
}

/// Edges that could not be collapsed, by reason.
#[derive(Clone, Copy, Debug, Default)]
struct BlockedEdges {
    boundary: u64,
    topology: u64,
    flips: u64,
    error: u64,
}

impl BlockedEdges {
    fn count(&mut self, blocked: Blocked) {
        *match blocked {
            Blocked::Boundary => &mut self.boundary,
            Blocked::Topology => &mut self.topology,
            Blocked::Flips => &mut self.flips,
            Blocked::Error => &mut self.error,
        } += 1;
    }

    /// Says of so many triangles why they stayed, in proportion to the edges.
    fn share_out(self, triangles: u64) -> MissedTarget {
        let edges = self.boundary + self.topology + self.flips + self.error;
        let share = |reason: u64| triangles * reason / edges.max(1);
        let [boundary, flips, error] = [self.boundary, self.flips, self.error].map(share);
        MissedTarget { boundary, topology: triangles - boundary - flips - error, flips, error }
    }
}

/// A run.
struct Greedy {
    surface: Surface,
    /// The edges that may be collapsed, by a cost that is not above the true one by more than the neighbourhood changed
    /// since. Those found to be impossible are not in it until their neighbourhood changes.
    queue: Queue,
    blocked: BlockedEdges,
}

impl Greedy {
    fn new(mesh: HalfEdgeMesh, positions: Vec<glam::Vec3>, options: &DecimateOptions) -> Self {
        let most = match options.target {
            Target::MaxError(distance) => distance,
            _ => f64::INFINITY,
        };
        let queue = Queue::new(3 * mesh.face_capacity());
        let surface = Surface::new(mesh, positions, options.placement, most);
        Self { surface, queue, blocked: BlockedEdges::default() }
    }

    /// Collapses until so many faces are left, or nothing more can go.
    fn run(&mut self, target: usize, observer: &mut Observer<'_>) -> Result<(), Error> {
        let capacity = self.surface.mesh().num_faces();
        let mut until_look = 0;
        let mut before_sweep = usize::MAX;
        while self.surface.mesh().num_faces() > target {
            let faces = self.surface.mesh().num_faces();
            if until_look == 0 {
                until_look = OBSERVE_EVERY;
                let progress = Progress {
                    stage: Stage::Decimating,
                    read: capacity as u64,
                    expected: Some(capacity as u64),
                    written: 0,
                    buffered: faces as u64,
                    capacity: capacity as u64,
                    resolution: faces as f64 / capacity.max(1) as f64,
                };
                if observer(&progress) == ControlFlow::Break(()) {
                    return Err(Error::Interrupted);
                }
            }
            let Some((edge, key)) = self.queue.pop() else {
                let enough = match target {
                    0 => (WORTH_ANOTHER_SWEEP * faces as f64) as usize,
                    _ => 0,
                };
                if before_sweep - faces <= enough {
                    break;
                }
                before_sweep = faces;
                self.sweep();
                continue;
            };
            until_look -= 1;
            if faces - target == 1 && self.surface.mesh().reverse(edge).is_some() {
                // One face too many, and this would take two.
                self.blocked.count(Blocked::Topology);
                continue;
            }
            // By now it may cost more than when it was put into the queue; and more still with the deviation.
            let rating = self.surface.rate(edge);
            if queue::key(rating.cost) > key {
                self.queue.push(edge, rating.cost);
                continue;
            }
            match self.surface.check(edge, &rating) {
                Err(reason) => self.blocked.count(reason),
                Ok(step) if queue::key(step.cost) > key => self.queue.push(edge, step.cost),
                Ok(step) => self.collapse(&step),
            }
        }
        Ok(())
    }

    /// Gives every edge another chance.
    fn sweep(&mut self) {
        self.blocked = BlockedEdges::default();
        for edge in self.surface.edges() {
            self.queue.push(edge, self.surface.rate(edge).cost);
        }
    }

    fn collapse(&mut self, step: &surface::Step) {
        let collapse = &step.collapse;
        for v in [collapse.removed, collapse.kept] {
            for (edge, _) in self.surface.edges_at(v) {
                self.queue.remove(edge);
            }
        }
        self.surface.collapse(step);
        let kept = collapse.kept;
        self.surface.rate_around(kept, |edge, cost| self.queue.push(edge, cost));
        for h in self.surface.mesh().outgoing(kept) {
            let opposite = edge_of(self.surface.mesh(), h.next());
            if !self.queue.contains(opposite) {
                self.queue.push(opposite, self.surface.rate(opposite).cost);
            }
        }
    }

    /// What is left, without holes in the numbering.
    fn into_mesh(self) -> IndexedMesh {
        let (mesh, positions) = self.surface.into_parts();
        let mut number = vec![0; mesh.vertex_capacity()];
        let mut kept = Vec::with_capacity(mesh.num_vertices());
        for v in mesh.vertices() {
            number[v.index()] = kept.len() as u32;
            kept.push(positions[v.index()]);
        }
        let corners = mesh.faces().filter_map(|f| mesh.corners(f));
        let triangles = corners.map(|t| t.map(|v: VertexId| number[v.index()])).collect();
        IndexedMesh { positions: kept, triangles, ..Default::default() }
    }
}
