//! Random sequences of collapses on small meshes, against a mesh that is only a list of triangles.

mod common;

use std::collections::BTreeSet;

use halfedge::{Collapse, HalfEdgeId, HalfEdgeMesh};
use proptest::prelude::*;

/// The specification: a collapse renames a vertex and drops triangles that name a vertex twice.
fn naive_collapse(triangles: &mut BTreeSet<[u32; 3]>, removed: u32, kept: u32) {
    *triangles = triangles
        .iter()
        .map(|t| t.map(|v| if v == removed { kept } else { v }))
        .filter(|&[a, b, c]| a != b && b != c && c != a)
        .map(rotate)
        .collect();
}

fn rotate(t: [u32; 3]) -> [u32; 3] {
    let [a, b, c] = t;
    [t, [b, c, a], [c, a, b]].into_iter().min_by_key(|t| t[0]).unwrap()
}

fn as_set(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.faces().map(|f| rotate(mesh.corners(f).unwrap().map(|v| v.get()))).collect()
}

fn euler(mesh: &HalfEdgeMesh) -> i64 {
    let boundary = mesh.half_edges().filter(|&h| mesh.reverse(h).is_none()).count();
    let edges = (3 * mesh.num_faces() + boundary) / 2;
    mesh.num_vertices() as i64 - edges as i64 + mesh.num_faces() as i64
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_collapses_keep_the_topology_and_are_taken_back_exactly(
        which in 0usize..7,
        picks in prop::collection::vec(any::<prop::sample::Index>(), 1..120),
    ) {
        let shape = &common::all()[which];
        let mut mesh = HalfEdgeMesh::from_triangles(shape.num_vertices, &shape.triangles).unwrap();
        mesh.validate().unwrap();
        prop_assert_eq!(euler(&mesh), shape.euler, "{}", shape.name);
        let mut done: Vec<(HalfEdgeMesh, Collapse)> = Vec::new();
        for pick in picks {
            let h = HalfEdgeId::from_index(pick.index(3 * mesh.face_capacity()));
            let Ok(collapse) = mesh.check_collapse(h) else { continue };
            let before = mesh.clone();
            mesh.apply(&collapse);
            prop_assert_eq!(mesh.validate(), Ok(()));
            prop_assert_eq!(euler(&mesh), shape.euler);
            let mut expected = as_set(&before);
            naive_collapse(&mut expected, collapse.removed.get(), collapse.kept.get());
            prop_assert_eq!(expected.len(), mesh.num_faces(), "no two faces become one");
            prop_assert_eq!(expected, as_set(&mesh));
            done.push((before, collapse));
        }
        for (before, collapse) in done.iter().rev() {
            mesh.undo(collapse);
            prop_assert_eq!(&mesh, before);
        }
    }

    #[test]
    fn a_collapse_is_refused_only_where_it_would_change_the_topology(
        which in 0usize..7,
        picks in prop::collection::vec(any::<prop::sample::Index>(), 1..60),
    ) {
        let shape = &common::all()[which];
        let mut mesh = HalfEdgeMesh::from_triangles(shape.num_vertices, &shape.triangles).unwrap();
        for pick in picks {
            let h = HalfEdgeId::from_index(pick.index(3 * mesh.face_capacity()));
            if !mesh.has_face(h.face()) {
                prop_assert!(mesh.check_collapse(h).is_err());
                continue;
            }
            let (removed, kept) = (mesh.start(h), mesh.end(h));
            let before = as_set(&mesh);
            let mut after = before.clone();
            naive_collapse(&mut after, removed.get(), kept.get());
            let gone = before.len() - after.len();
            let triangles: Vec<_> = after.iter().copied().collect();
            let manifold = HalfEdgeMesh::from_triangles(shape.num_vertices, &triangles);
            let faces_of_edge = 1 + usize::from(mesh.reverse(h).is_some());
            let boundary_ok = !mesh.is_boundary_vertex(removed) || mesh.reverse(h).is_none();
            // Same Euler number, manifold, nothing lost but the faces of the edge, every other vertex still there.
            let legal = boundary_ok
                && gone == faces_of_edge
                && manifold.is_ok_and(|m| {
                    euler(&m) == shape.euler
                        && m.num_vertices() == mesh.num_vertices() - 1
                        && m.half_edges().filter(|&g| m.reverse(g).is_none()).count()
                            == mesh.half_edges().filter(|&g| mesh.reverse(g).is_none()).count()
                                - usize::from(mesh.reverse(h).is_none())
                });
            match mesh.check_collapse(h) {
                Ok(collapse) => {
                    prop_assert!(legal, "{} {}→{} allowed", shape.name, removed, kept);
                    mesh.apply(&collapse);
                }
                // The two-triangle sphere a tetrahedron would become passes the test above but is no simplicial mesh.
                Err(halfedge::CollapseRejected::Tetrahedron(_)) => {}
                Err(why) => prop_assert!(!legal, "{} {}→{} refused: {}", shape.name, removed, kept, why),
            }
        }
    }
}

#[test]
fn a_tetrahedron_does_not_collapse() {
    let mesh =
        HalfEdgeMesh::from_triangles(4, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]).unwrap();
    for h in 0..12 {
        assert!(mesh.check_collapse(HalfEdgeId::new(h)).is_err());
    }
}

#[test]
fn a_lone_triangle_does_not_collapse() {
    let mesh = HalfEdgeMesh::from_triangles(3, &[[0, 1, 2]]).unwrap();
    for h in 0..3 {
        assert!(mesh.check_collapse(HalfEdgeId::new(h)).is_err());
    }
}

#[test]
fn one_rings_are_in_order() {
    let shape = common::octahedron();
    let mesh = HalfEdgeMesh::from_triangles(shape.num_vertices, &shape.triangles).unwrap();
    let ring: Vec<u32> = mesh.one_ring(halfedge::VertexId::new(0)).map(|v| v.get()).collect();
    let first = ring.iter().position(|&v| v == 1).unwrap();
    let turned: Vec<u32> = (0..4).map(|i| ring[(first + i) % 4]).collect();
    assert_eq!(turned, [1, 2, 3, 4]);
}
