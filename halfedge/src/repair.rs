//! From any list of triangles to a manifold.

use glam::Vec3;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::pairing::Buckets;
use crate::{BuildError, HalfEdgeId, HalfEdgeMesh};

/// What [`repair`] found and did. All zero for a clean mesh that names every vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RepairReport {
    /// Triangles dropped because a coordinate is not finite.
    pub non_finite_triangles: usize,
    /// Vertices merged into another with the same coordinates.
    pub welded_vertices: usize,
    /// Triangles dropped because they name a vertex twice.
    pub degenerate_triangles: usize,
    /// Triangles dropped because they repeat another one.
    pub duplicate_triangles: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles have opposite orientation.
    pub orientation_conflicts: usize,
    /// Edges of triangles that became boundary by a cut.
    pub cut_edges: usize,
    /// Vertices added because the triangles around a vertex formed several fans.
    pub split_vertices: usize,
    /// Vertices dropped because no triangle was left that names them.
    pub unused_vertices: usize,
}

impl RepairReport {
    /// The counts with their names, in the order of the policy, for reports.
    pub fn counts(&self) -> [(&'static str, usize); 9] {
        [
            ("non_finite_triangles", self.non_finite_triangles),
            ("welded_vertices", self.welded_vertices),
            ("degenerate_triangles", self.degenerate_triangles),
            ("duplicate_triangles", self.duplicate_triangles),
            ("non_manifold_edges", self.non_manifold_edges),
            ("orientation_conflicts", self.orientation_conflicts),
            ("cut_edges", self.cut_edges),
            ("split_vertices", self.split_vertices),
            ("unused_vertices", self.unused_vertices),
        ]
    }
}

/// A manifold mesh with the positions of its vertices.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Repaired {
    /// The connectivity; every vertex has a face.
    pub mesh: HalfEdgeMesh,
    /// Position of every vertex.
    pub positions: Vec<Vec3>,
    /// What was done.
    pub report: RepairReport,
}

/// Makes a manifold of any triangles.
///
/// # Policy
/// In this order; every step is counted in the [report](RepairReport).
///
/// 1. Triangles with a coordinate that is not finite are dropped.
/// 2. Triangles that name a vertex twice are dropped. Triangles without area that name three vertices stay.
/// 3. Vertices on open edges that have the same coordinates, bit for bit (−0 equals +0), become one, so that seams and
///    soups close. Two corners of one triangle do not: no triangle is lost here.
/// 4. Of triangles with the same corners and orientation all but the first are dropped.
/// 5. An edge with one triangle on each side is kept. Along an edge with more triangles, or with two of the same
///    orientation, pairs of opposite orientation are formed, the pair that continues most nearly flat first; what
///    is left over is cut and becomes boundary.
/// 6. A vertex whose triangles form several fans becomes one vertex per fan, at the same place.
/// 7. Should two edges still join the same two vertices, they are cut too, until none do.
/// 8. Vertices without a triangle are dropped.
///
/// No triangle is turned over. The surface stays where it was: cutting moves nothing.
///
/// # Complexity
/// Time and memory linear in the size of the input, for meshes whose edges have a bounded number of triangles.
///
/// # Errors
/// [`BuildError::VertexOutOfRange`] when a triangle names a vertex that is not there.
pub fn repair(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Repaired, BuildError> {
    let num_vertices = positions.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= num_vertices) {
            return Err(BuildError::VertexOutOfRange { triangle, vertex, num_vertices });
        }
    }
    let mut report = RepairReport::default();
    let mut kept: Vec<[u32; 3]> = triangles
        .iter()
        .copied()
        .filter(|t| t.iter().all(|&v| positions[v as usize].is_finite()))
        .collect();
    report.non_finite_triangles = triangles.len() - kept.len();
    let mut positions = positions.to_vec();
    let before = kept.len();
    kept.retain(|&[a, b, c]| a != b && b != c && c != a);
    report.degenerate_triangles = before - kept.len();
    report.welded_vertices = weld_open_edges(&positions, &mut kept);
    report.duplicate_triangles = drop_duplicates(positions.len(), &mut kept);

    let mut reverse = pair_half_edges(&positions, &kept, &mut report);
    loop {
        report.split_vertices += split_fans(&mut positions, &mut kept, &reverse);
        let cut = cut_repeated_edges(positions.len(), &kept, &mut reverse);
        report.cut_edges += cut;
        if cut == 0 {
            break;
        }
    }
    report.unused_vertices =
        drop_unused(&mut positions, &mut kept).saturating_sub(report.welded_vertices);
    // No edge is there twice any more, so the triangles alone say what is connected. That closes cuts between two ends
    // of one fan, which were needless.
    let mesh = HalfEdgeMesh::from_triangles(positions.len(), &kept)?;
    let closed = mesh.half_edges().filter(|&h| mesh.reverse(h).is_some()).count();
    report.cut_edges -= closed - reverse.iter().flatten().count();
    Ok(Repaired { mesh, positions, report })
}

/// Makes triangles name the first of all vertices on open edges with the same coordinates, but never one vertex twice.
/// Returns how many vertices fell away.
fn weld_open_edges(positions: &[Vec3], triangles: &mut [[u32; 3]]) -> usize {
    let on_open_edge = open_edge_vertices(positions.len(), triangles);
    let mut first_at = FxHashMap::default();
    let mut target: Vec<u32> = (0..positions.len() as u32).collect();
    for (v, p) in positions.iter().enumerate().filter(|&(v, _)| on_open_edge[v]) {
        // Adding +0 turns −0 into +0 and changes nothing else.
        let key = (*p + Vec3::ZERO).to_array().map(f32::to_bits);
        target[v] = *first_at.entry(key).or_insert(v as u32);
    }
    // Leaving vertices out of it brings no two others together: once over the triangles is enough.
    for t in triangles.iter() {
        let [a, b, c] = t.map(|v| target[v as usize]);
        if a == b || b == c || c == a {
            for &v in t {
                target[v as usize] = v;
            }
        }
    }
    for v in triangles.as_flattened_mut() {
        *v = target[*v as usize];
    }
    target.iter().zip(0..).filter(|&(&target, v)| target != v).count()
}

/// Marks the vertices on edges that only one triangle has.
fn open_edge_vertices(num_vertices: usize, triangles: &[[u32; 3]]) -> Vec<bool> {
    let buckets = Buckets::by_start(num_vertices, triangles);
    let mut open = vec![false; num_vertices];
    for h in (0..3 * triangles.len()).map(HalfEdgeId::from_index) {
        let (from, to) = buckets.edge(h);
        if !buckets.leaving(to).iter().any(|&g| buckets.edge(g).1 == from) {
            open[from as usize] = true;
            open[to as usize] = true;
        }
    }
    open
}

/// Drops triangles whose corners an earlier one has, in the same orientation. Returns how many.
fn drop_duplicates(num_vertices: usize, triangles: &mut Vec<[u32; 3]>) -> usize {
    let buckets = Buckets::by_start(num_vertices, triangles);
    let mut seen = FxHashSet::default();
    let mut repeated = Vec::new();
    for v in 0..num_vertices as u32 {
        // Every triangle is looked at where its smallest corner is; few share it, so a scan finds repetitions.
        seen.clear();
        for &h in buckets.leaving(v) {
            let (_, b) = buckets.edge(h);
            let (_, c) = buckets.edge(h.next());
            if v < b && v < c && !seen.insert((b, c)) {
                repeated.push(h.face().index());
            }
        }
    }
    repeated.sort_unstable();
    let mut next = repeated.iter().copied().peekable();
    let mut index = 0;
    triangles.retain(|_| {
        let drop = next.next_if_eq(&index).is_some();
        index += 1;
        !drop
    });
    repeated.len()
}

/// Pairs half-edges: plain edges as they are, the others by the flattest continuation.
fn pair_half_edges(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    report: &mut RepairReport,
) -> Vec<Option<HalfEdgeId>> {
    let buckets = Buckets::by_start(positions.len(), triangles);
    let mut reverse = vec![None; 3 * triangles.len()];
    let (mut along, mut against) = (Vec::new(), Vec::new());
    let mut neighbours = Vec::new();
    for v in 0..positions.len() as u32 {
        neighbours.clear();
        for &h in buckets.leaving(v) {
            neighbours.push(buckets.edge(h).1);
            // The edge that comes in to v in the same face.
            neighbours.push(buckets.edge(h.prev()).0);
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        for &u in neighbours.iter().filter(|&&u| u > v) {
            let between = |a: u32, b: u32, out: &mut Vec<HalfEdgeId>| {
                out.clear();
                out.extend(buckets.leaving(a).iter().filter(|&&h| buckets.edge(h).1 == b));
            };
            between(v, u, &mut along);
            between(u, v, &mut against);
            match (&along[..], &against[..]) {
                ([_], []) | ([], [_]) => {}
                (&[a], &[b]) => {
                    reverse[a.index()] = Some(b);
                    reverse[b.index()] = Some(a);
                }
                _ => {
                    let total = along.len() + against.len();
                    if total > 2 {
                        report.non_manifold_edges += 1;
                    } else {
                        report.orientation_conflicts += 1;
                    }
                    let pairs = flattest_pairs(positions, triangles, &along, &against);
                    report.cut_edges += total - 2 * pairs.len();
                    for (a, b) in pairs {
                        reverse[a.index()] = Some(b);
                        reverse[b.index()] = Some(a);
                    }
                }
            }
        }
    }
    reverse
}

/// Pairs half-edges of one edge, the two triangles that continue each other most nearly flat first. Ties go to the
/// lower ids.
fn flattest_pairs(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    along: &[HalfEdgeId],
    against: &[HalfEdgeId],
) -> Vec<(HalfEdgeId, HalfEdgeId)> {
    let normal = |h: HalfEdgeId| {
        let [a, b, c] = triangles[h.face().index()].map(|v| positions[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut candidates: Vec<_> = along
        .iter()
        .flat_map(|&a| against.iter().map(move |&b| (normal(a).dot(normal(b)), a, b)))
        .collect();
    candidates.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut pairs: Vec<(HalfEdgeId, HalfEdgeId)> = Vec::new();
    for (_, a, b) in candidates {
        if pairs.iter().all(|&(c, d)| c != a && d != b) {
            pairs.push((a, b));
        }
    }
    pairs
}

/// Gives every fan of triangles around a vertex a vertex of its own. Returns how many were added.
fn split_fans(
    positions: &mut Vec<Vec3>,
    triangles: &mut [[u32; 3]],
    reverse: &[Option<HalfEdgeId>],
) -> usize {
    let mut claimed = vec![false; positions.len()];
    let mut visited = vec![false; 3 * triangles.len()];
    let mut added = 0;
    for index in 0..3 * triangles.len() {
        if visited[index] {
            continue;
        }
        let first = HalfEdgeId::from_index(index);
        let old = triangles.as_flattened()[index];
        let vertex = if claimed[old as usize] {
            positions.push(positions[old as usize]);
            added += 1;
            (positions.len() - 1) as u32
        } else {
            claimed[old as usize] = true;
            old
        };
        // All round one way; if that ends on a boundary, the other way too.
        let mut mark = |h: HalfEdgeId| {
            visited[h.index()] = true;
            triangles.as_flattened_mut()[h.index()] = vertex;
        };
        let mut h = first;
        loop {
            mark(h);
            match reverse[h.prev().index()] {
                Some(turned) if turned == first => break,
                Some(turned) => h = turned,
                None => {
                    let mut back = first;
                    while let Some(r) = reverse[back.index()] {
                        back = r.next();
                        mark(back);
                    }
                    break;
                }
            }
        }
    }
    added
}

/// Unpairs half-edges that run between the same two vertices in the same direction as another. Returns how many edges
/// of triangles became boundary.
fn cut_repeated_edges(
    num_vertices: usize,
    triangles: &[[u32; 3]],
    reverse: &mut [Option<HalfEdgeId>],
) -> usize {
    let buckets = Buckets::by_start(num_vertices, triangles);
    let mut ends = Vec::new();
    let mut repeated = Vec::new();
    for v in 0..num_vertices as u32 {
        ends.clear();
        ends.extend(buckets.leaving(v).iter().map(|&h| (buckets.edge(h).1, h)));
        ends.sort_unstable();
        for run in ends.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1) {
            repeated.extend(run.iter().map(|&(_, h)| h));
        }
    }
    let mut cut = 0;
    for h in repeated {
        if let Some(r) = reverse[h.index()].take() {
            reverse[r.index()] = None;
            cut += 2;
        }
    }
    cut
}

/// Drops vertices that no triangle names. Returns how many.
fn drop_unused(positions: &mut Vec<Vec3>, triangles: &mut [[u32; 3]]) -> usize {
    let mut used = vec![false; positions.len()];
    for &v in triangles.as_flattened() {
        used[v as usize] = true;
    }
    let before = positions.len();
    let mut new_id = vec![0u32; before];
    let mut next = 0;
    for (old, _) in used.iter().enumerate().filter(|&(_, &used)| used) {
        new_id[old] = next;
        positions[next as usize] = positions[old];
        next += 1;
    }
    positions.truncate(next as usize);
    for v in triangles.as_flattened_mut() {
        *v = new_id[*v as usize];
    }
    before - positions.len()
}
