//! Dirty input becomes a manifold and the report says how.

mod common;

use glam::{Vec3, vec3};
use halfedge::{HalfEdgeMesh, Repaired, repair};
use proptest::prelude::*;

fn check(r: &Repaired) {
    r.mesh.validate().unwrap();
    assert_eq!(r.mesh.vertex_capacity(), r.positions.len());
    // The triangle list alone gives the same mesh: no edge is there twice.
    let triangles: Vec<_> =
        r.mesh.faces().map(|f| r.mesh.corners(f).unwrap().map(|v| v.get())).collect();
    let again = HalfEdgeMesh::from_triangles(r.positions.len(), &triangles).unwrap();
    assert!(r.mesh.half_edges().all(|h| r.mesh.reverse(h) == again.reverse(h)));
}

fn corner_points() -> Vec<Vec3> {
    vec![
        vec3(0.0, 0.0, 0.0),
        vec3(1.0, 0.0, 0.0),
        vec3(0.0, 1.0, 0.0),
        vec3(1.0, 1.0, 0.1),
        vec3(0.5, 0.5, 1.0),
    ]
}

#[test]
fn clean_meshes_pass_unchanged() {
    for shape in common::all() {
        let positions: Vec<Vec3> = (0..shape.num_vertices).map(|i| Vec3::splat(i as f32)).collect();
        let r = repair(&positions, &shape.triangles).unwrap();
        check(&r);
        // The double torus names no vertex of the second copy where the two are joined; all else is clean.
        assert!(r.report.counts()[..8].iter().all(|&(_, n)| n == 0), "{}", shape.name);
        assert_eq!(r.mesh.num_faces(), shape.triangles.len());
    }
}

#[test]
fn a_fin_is_cut_off_and_the_flat_sheet_stays_whole() {
    let r = repair(&corner_points(), &[[0, 1, 2], [1, 3, 2], [1, 4, 2]]).unwrap();
    check(&r);
    assert_eq!(r.report.non_manifold_edges, 1);
    assert_eq!(r.report.cut_edges, 1);
    assert_eq!(r.report.split_vertices, 2);
    let flat =
        r.mesh.find_half_edge(halfedge::VertexId::new(1), halfedge::VertexId::new(2)).unwrap();
    assert!(r.mesh.reverse(flat).is_some());
}

#[test]
fn a_bow_tie_becomes_two_vertices_in_one_place() {
    let positions: Vec<Vec3> = (0..5).map(|i| vec3(i as f32, (i * i) as f32, 0.0)).collect();
    let r = repair(&positions, &[[0, 1, 2], [0, 3, 4]]).unwrap();
    check(&r);
    assert_eq!(r.report.split_vertices, 1);
    assert_eq!(r.positions.len(), 6);
    assert_eq!(r.positions[5], positions[0]);
}

#[test]
fn everything_dirty_is_counted() {
    let nan = Vec3::new(f32::NAN, 0.0, 0.0);
    let mut positions = corner_points();
    positions.extend([nan, vec3(-0.0, 0.0, 0.0), vec3(9.0, 9.0, 9.0)]);
    let triangles = [[0, 1, 2], [2, 6, 1], [0, 1, 5], [0, 0, 1], [1, 2, 3]];
    let r = repair(&positions, &triangles).unwrap();
    check(&r);
    assert_eq!(r.report.non_finite_triangles, 1);
    assert_eq!(r.report.welded_vertices, 1);
    assert_eq!(r.report.duplicate_triangles, 1, "2 6 1 is 0 1 2 once 6 is 0");
    assert_eq!(r.report.degenerate_triangles, 1);
    assert_eq!(r.report.orientation_conflicts, 1, "1→2 twice");
    assert_eq!(r.report.unused_vertices, 3, "the far, the NaN and vertex 4");
    assert_eq!(r.mesh.num_faces(), 2);
}

#[test]
fn seams_are_welded_but_no_triangle_is_lost_to_it() {
    let mut positions = corner_points();
    positions.extend([positions[1], positions[2], positions[0]]);
    // A seam along 1–2, and a sliver between 0 and its twin 7.
    let r = repair(&positions, &[[0, 1, 2], [5, 3, 6], [0, 7, 1]]).unwrap();
    check(&r);
    assert_eq!(r.report.welded_vertices, 2);
    assert_eq!(r.mesh.num_faces(), 3);
    let open = r.mesh.half_edges().filter(|&h| r.mesh.reverse(h).is_none()).count();
    assert_eq!(open, 9 - 2 - 2, "two edges are shared");
}

#[test]
fn an_index_out_of_range_is_named() {
    let error = repair(&corner_points(), &[[0, 1, 2], [0, 1, 9]]).unwrap_err();
    assert_eq!(error.to_string(), "triangle 1 names vertex 9, but there are 5 vertices");
}

#[test]
fn a_moebius_strip_is_cut_open() {
    let n = 8u32;
    let mut triangles = Vec::new();
    for i in 0..n {
        let next = |side: u32| if i + 1 == n { 1 - side } else { 2 * (i + 1) + side };
        triangles.extend([[2 * i, next(0), 2 * i + 1], [2 * i + 1, next(0), next(1)]]);
    }
    let positions: Vec<Vec3> = (0..2 * n)
        .map(|i| {
            let t = (i / 2) as f32 / n as f32 * std::f32::consts::TAU;
            let r = 2.0 + ((i % 2) as f32 - 0.5) * (t / 2.0).cos();
            vec3(r * t.cos(), r * t.sin(), ((i % 2) as f32 - 0.5) * (t / 2.0).sin())
        })
        .collect();
    let r = repair(&positions, &triangles).unwrap();
    check(&r);
    assert!(r.report.orientation_conflicts > 0);
    assert_eq!(r.mesh.num_faces(), triangles.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..Default::default() })]

    #[test]
    fn any_triangles_become_a_manifold(
        triangles in prop::collection::vec(prop::array::uniform3(0u32..9), 0..60),
        coordinates in prop::collection::vec(prop::array::uniform3(0i8..3), 9),
    ) {
        let positions: Vec<Vec3> = coordinates
            .iter()
            .map(|c| vec3(c[0] as f32, c[1] as f32, c[2] as f32))
            .collect();
        let r = repair(&positions, &triangles).unwrap();
        check(&r);
        let dropped = r.report.degenerate_triangles + r.report.duplicate_triangles;
        prop_assert_eq!(r.mesh.num_faces() + dropped, triangles.len());
        let cut = r.mesh.half_edges().filter(|&h| r.mesh.reverse(h).is_none()).count();
        prop_assert!(r.report.cut_edges <= cut);
    }
}
