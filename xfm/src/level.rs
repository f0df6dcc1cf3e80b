//! One level of detail out of a forest: as many faces as asked for, as near as asked for, or for one camera.

use glam::Vec3;
use halfedge::BuildError;
use mergetree::{Colour, Dependencies, Front, NodeId, NodeStore, UpdateLimits, View};

/// Which level is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wanted {
    /// The input itself.
    Full,
    /// About so many triangles: the first level, on the way from the coarsest, that has no fewer.
    Faces(usize, Way),
    /// The coarsest level no farther than this from the input, in model units.
    Error(f32),
    /// The coarsest level that looks like the input up to so many pixels.
    Pixels(View, f32),
}

/// The way from the coarsest mesh to the finest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Backwards along the build: its own meshes, and the count within one. On scans the mean error is a tenth below that of
    /// the other way, at the price of a larger maximum.
    Build,
    /// The splits of largest deviation first: for a file that has ranks instead of the build's order.
    Deviation,
}

/// A level of detail: a mesh of its own, without seams.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Vertices, each used by a triangle.
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Colours of the vertices; empty where the forest has none.
    pub colours: Vec<Colour>,
    /// How far the mesh is from the input at most, in model units, as the forest's bounds tell; 0 for the whole input.
    pub error: f32,
    /// Nodes that do not fit the mesh around them, because the file is damaged: their detail is missing.
    pub damaged: usize,
}

/// Refines from the coarsest mesh to the level wanted and takes its mesh.
///
/// `settle` is called when nodes that are needed have been requested and are not resident, and returns whether it is worth
/// trying again. For a store that is wholly in memory it is never called.
///
/// # Complexity
///
/// Linear in the size of the level, but for a sort of its splits.
///
/// # Errors
///
/// [`BuildError`] if the coarsest mesh is not a manifold, which only a damaged file has.
pub fn extract<S: NodeStore>(
    store: &mut S,
    wanted: &Wanted,
    mut settle: impl FnMut(&mut S) -> bool,
) -> Result<Level, BuildError> {
    let mut front = Front::new(store, Dependencies::Order)?;
    let inside_out = store.base().is_inside_out();
    let damaged = loop {
        let stats = match *wanted {
            Wanted::Full => {
                // Every node is wrong while it is not split.
                front.update(store, |_| 1.0, &UpdateLimits::with_tolerance(0.0))
            }
            Wanted::Faces(faces, way) => {
                let mut limits = UpdateLimits::with_tolerance(-1.0);
                (limits.max_triangles, limits.exactly) = (faces, true);
                match way {
                    Way::Build => front.update(store, |node| node.order as f32, &limits),
                    Way::Deviation => front.update(store, |node| node.deviation, &limits),
                }
            }
            Wanted::Error(error) => {
                let limits = UpdateLimits::with_tolerance(error);
                front.update(store, |node| node.deviation, &limits)
            }
            Wanted::Pixels(view, pixels) => {
                let view = view.inside_out(inside_out);
                let limits = UpdateLimits::with_tolerance(pixels);
                front.update_view(store, &view, &limits)
            }
        };
        if stats.waiting == 0 || !settle(store) {
            break stats.damaged;
        }
    };
    let (positions, triangles) = front.to_mesh();
    let colours = front.to_colours();
    Ok(Level { positions, triangles, colours, error: error_of(store, &front), damaged })
}

/// The largest deviation of the nodes right below the front: what was left out.
fn error_of(store: &impl NodeStore, front: &Front) -> f32 {
    let mut error = 0.0_f32;
    let mut look_at = |id: NodeId, parent: f32| match store.node(id) {
        Some(node) if node.slot.is_some() => {}
        Some(node) => error = error.max(node.deviation),
        // What is not there deviates no more than its parent.
        None => error = error.max(parent),
    };
    for root in store.base().roots() {
        look_at(root, f32::INFINITY);
    }
    for (id, _) in front.split_nodes() {
        if let Some(node) = store.node(id) {
            node.children().for_each(|child| look_at(child, node.deviation));
        }
    }
    error
}

#[cfg(test)]
mod tests {
    use halfedge::HalfEdgeMesh;
    use mergetree::{BuildOptions, Camera, Forest};

    use super::*;

    /// A torus of `2 · n · m` triangles and its forest.
    fn torus(n: u32, m: u32) -> (Vec<Vec3>, Vec<[u32; 3]>, Forest) {
        use std::f32::consts::TAU;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for j in 0..m {
            for i in 0..n {
                let (u, v) = (TAU * i as f32 / n as f32, TAU * j as f32 / m as f32);
                let radius = 1.0 + 0.4 * v.cos();
                positions.push(Vec3::new(radius * u.cos(), radius * u.sin(), 0.4 * v.sin()));
                let at = |i: u32, j: u32| (j % m) * n + i % n;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles).expect("a manifold");
        let forest =
            mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ()).expect("built");
        (positions, triangles, forest)
    }

    fn never(_: &mut Forest) -> bool {
        unreachable!("everything is in memory")
    }

    fn level(forest: &mut Forest, wanted: &Wanted) -> Level {
        // The forest notes what is split, so every level starts from a copy.
        extract(&mut forest.clone(), wanted, never).expect("a sound forest")
    }

    fn euler(level: &Level) -> i64 {
        let mesh = HalfEdgeMesh::from_triangles(level.positions.len(), &level.triangles)
            .expect("every level is a manifold");
        mesh.validate().expect("and a sound one");
        // A closed mesh has three half-edges per face, and so three halves of an edge.
        level.positions.len() as i64 - level.triangles.len() as i64 / 2
    }

    #[test]
    fn full_is_the_input() {
        let (positions, triangles, mut forest) = torus(60, 24);
        let level = level(&mut forest, &Wanted::Full);
        assert_eq!(level.error, 0.0);
        assert_eq!(level.damaged, 0);
        let key = |positions: &[Vec3], t: &[u32; 3]| {
            let mut corners = t.map(|v| positions[v as usize].to_array().map(f32::to_bits));
            let first = (0..3).min_by_key(|&k| corners[k]).expect("three corners");
            corners.rotate_left(first);
            corners
        };
        let mut expected: Vec<_> = triangles.iter().map(|t| key(&positions, t)).collect();
        let mut found: Vec<_> = level.triangles.iter().map(|t| key(&level.positions, t)).collect();
        expected.sort_unstable();
        found.sort_unstable();
        assert!(expected == found);
    }

    #[test]
    fn faces_come_as_asked_for_on_a_closed_manifold() {
        let (_, triangles, mut forest) = torus(80, 40);
        for way in [Way::Build, Way::Deviation] {
            let mut last_error = f32::INFINITY;
            for faces in [800, 1600, 3200, triangles.len()] {
                let level = level(&mut forest, &Wanted::Faces(faces, way));
                let found = level.triangles.len();
                assert!(found >= faces && found <= faces + 1, "asked for {faces}, got {found}");
                assert_eq!(euler(&level), 0, "a torus at every level");
                assert!(level.error <= last_error);
                last_error = level.error;
            }
            assert_eq!(last_error, 0.0);
        }
    }

    #[test]
    fn errors_are_kept_and_cost_triangles() {
        let (_, _, mut forest) = torus(80, 40);
        let mut last = 0;
        for error in [0.05, 0.01, 0.002] {
            let level = level(&mut forest, &Wanted::Error(error));
            assert!(level.error <= error, "{} of {error}", level.error);
            assert!(level.triangles.len() > last);
            assert_eq!(euler(&level), 0);
            last = level.triangles.len();
        }
    }

    #[test]
    fn a_camera_gets_detail_where_it_looks() {
        let (_, triangles, mut forest) = torus(120, 60);
        let camera = Camera { eye: Vec3::new(-0.1, 0.0, 0.2), at: Vec3::X, ..Camera::default() };
        let level = level(&mut forest, &Wanted::Pixels(View::new(&camera), 2.0));
        assert!(level.triangles.len() < triangles.len() * 3 / 4);
        assert_eq!(euler(&level), 0);
        assert!(level.triangles.len() > 600, "{}", level.triangles.len());
        let near = level.positions.iter().filter(|p| p.x > 0.0).count();
        assert!(near > 2 * (level.positions.len() - near), "{near} of {}", level.positions.len());
    }
}
