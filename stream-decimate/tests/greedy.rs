//! Greedy decimation, judged by counts, topology and geometry.

mod indexed;

use std::ops::ControlFlow;

use glam::{Vec3, vec3};
use indexed::{Topology, bumpy_square, cube, distance_both_ways, sorted_bits, torus};
use mesh_io::IndexedMesh;
use proptest::prelude::*;
use stream_decimate::{DecimateOptions, DecimateReport, Error, Placement, Target, decimate_greedy};

fn greedy(mesh: &IndexedMesh, target: Target) -> (IndexedMesh, DecimateReport) {
    with_options(mesh, &DecimateOptions::new(target))
}

fn with_options(mesh: &IndexedMesh, options: &DecimateOptions) -> (IndexedMesh, DecimateReport) {
    let (out, report) =
        decimate_greedy(mesh, options, &mut |_| ControlFlow::Continue(())).expect("clean input");
    assert_eq!(report.output_triangles, out.triangles.len() as u64);
    assert_eq!(report.input_triangles, mesh.triangles.len() as u64);
    assert_eq!(out.first_bad_index(), None);
    (out, report)
}

#[test]
fn closed_meshes_keep_their_topology_and_get_their_count() {
    let mesh = torus(64, 32);
    let before = Topology::of(&mesh);
    for (percent, target) in [(50.0, 2048), (10.0, 410), (2.0, 82), (1.0, 41), (0.5, 20)] {
        let (out, report) = greedy(&mesh, Target::Ratio(percent / 100.0));
        assert_eq!(report.target_triangles, Some(target));
        // A closed mesh has an even number of triangles.
        let odd = target % 2;
        assert_eq!(out.triangles.len() as u64, target + odd);
        assert_eq!(report.missed.map_or(0, |missed| missed.topology), odd);
        assert_eq!(Topology::of(&out), before);
    }
}

#[test]
fn an_odd_count_is_met_where_there_is_a_boundary() {
    let mesh = bumpy_square(20);
    for target in [301, 300, 51, 50] {
        let (out, report) = greedy(&mesh, Target::Triangles(target));
        assert_eq!((out.triangles.len() as u64, report.missed), (target, None));
        assert_eq!(Topology::of(&out), Topology::of(&mesh));
    }
}

#[test]
fn what_cannot_be_met_is_said() {
    let (out, report) = greedy(&torus(24, 12), Target::Triangles(3));
    let missed = report.missed.expect("a torus has seven vertices and fourteen triangles at least");
    assert!(out.triangles.len() >= 14, "{}", out.triangles.len());
    let stayed: u64 = missed.counts().iter().map(|(_, count)| count).sum();
    assert_eq!(stayed, report.output_triangles - 3);
    assert_eq!(Topology::of(&out).euler, 0);
}

#[test]
fn more_than_there_are_changes_nothing() {
    let mesh = bumpy_square(6);
    for target in [Target::Ratio(1.0), Target::Triangles(1000)] {
        let (out, report) = greedy(&mesh, target);
        assert_eq!(out, mesh);
        assert_eq!((report.target_triangles, report.missed), (Some(72), None));
    }
}

#[test]
fn flat_faces_go_down_to_two_triangles_each() {
    let mesh = cube(16);
    let (out, report) = greedy(&mesh, Target::Triangles(12));
    assert_eq!((out.triangles.len(), report.missed), (12, None));
    for p in &out.positions {
        assert!((p.abs() - 1.0).abs().max_element() < 1e-4, "{p} is no corner");
    }
    assert!(distance_both_ways(&mesh, &out) < 1e-4);
}

#[test]
fn a_thin_spike_stays() {
    // A needle without any area to speak of on a bumpy square.
    let mut mesh = bumpy_square(24);
    mesh.positions[12 * 25 + 12].z += 1.0;
    let (out, _) = greedy(&mesh, Target::Triangles(100));
    assert!(distance_both_ways(&mesh, &out) < 0.1);
}

#[test]
fn nothing_moves_farther_than_the_largest_error() {
    for mesh in [torus(48, 24), bumpy_square(30), cube(8)] {
        let before = Topology::of(&mesh);
        let mut last = usize::MAX;
        for most in [0.001, 0.01, 0.05, 0.2] {
            let (out, report) = greedy(&mesh, Target::MaxError(most));
            assert_eq!((report.target_triangles, report.missed), (None, None));
            assert_eq!(Topology::of(&out), before);
            let moved = distance_both_ways(&mesh, &out);
            assert!(f64::from(moved) <= most * 1.0001, "{moved} for {most}");
            assert!(out.triangles.len() <= last);
            last = out.triangles.len();
        }
        assert!(last < mesh.triangles.len() / 8, "{last} of {}", mesh.triangles.len());
    }
}

#[test]
fn subset_placement_keeps_positions_bit_for_bit() {
    let mesh = torus(40, 20);
    let mut options = DecimateOptions::new(Target::Triangles(200));
    options.placement = Placement::Subset;
    let (out, _) = with_options(&mesh, &options);
    assert_eq!(out.triangles.len(), 200);
    let known = sorted_bits(&mesh.positions);
    assert!(sorted_bits(&out.positions).iter().all(|p| known.binary_search(p).is_ok()));
}

#[test]
fn size_does_not_matter() {
    let mesh = bumpy_square(16);
    let (expected, _) = greedy(&mesh, Target::Triangles(60));
    for exponent in [-60, -20, 20, 60] {
        let scale = 2.0f32.powi(exponent);
        let scaled = |mesh: &IndexedMesh| IndexedMesh {
            positions: mesh.positions.iter().map(|&p| p * scale).collect(),
            triangles: mesh.triangles.clone(),
            ..Default::default()
        };
        let (out, _) = greedy(&scaled(&mesh), Target::Triangles(60));
        assert_eq!(out, scaled(&expected), "2^{exponent}");
    }
}

#[test]
fn dirt_is_repaired_and_counted() {
    let mut mesh = bumpy_square(10);
    let first = mesh.triangles[0];
    mesh.positions.push(Vec3::NAN);
    let nan = mesh.positions.len() as u32 - 1;
    // A duplicate, one with an edge of no length, one with a corner nowhere, and a fin on an inner edge.
    mesh.positions.push(vec3(0.5, 0.5, 5.0));
    mesh.triangles.extend([first, [0, 0, 1], [0, 1, nan], [12, 24, nan + 1]]);
    let (out, report) = greedy(&mesh, Target::Triangles(80));
    let repaired = report.repaired;
    assert_eq!((repaired.duplicate, repaired.degenerate, repaired.non_finite), (1, 1, 1));
    assert!(repaired.non_manifold > 0);
    assert_eq!(out.triangles.len(), 80);
    Topology::of(&out);
}

#[test]
fn an_empty_mesh_stays_empty() {
    for target in [Target::Ratio(0.5), Target::Triangles(0), Target::MaxError(1.0)] {
        let (out, report) = greedy(&IndexedMesh::default(), target);
        assert_eq!((out.triangles.len(), report.missed), (0, None));
    }
}

#[test]
fn errors_name_what_is_wrong() {
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let bad = IndexedMesh {
        triangles: vec![[0, 1, 9]],
        positions: vec![Vec3::ZERO; 3],
        ..Default::default()
    };
    let options = DecimateOptions::new(Target::Ratio(0.5));
    let error = decimate_greedy(&bad, &options, &mut go_on).expect_err("vertex 9 is not there");
    assert!(error.to_string().contains("vertex index 9"), "{error}");
    let options = DecimateOptions::new(Target::Ratio(2.0));
    assert!(matches!(decimate_greedy(&bad, &options, &mut go_on), Err(Error::Options(_))));
}

#[test]
fn the_observer_may_break_it_off() {
    let options = DecimateOptions::new(Target::Triangles(10));
    let stopped = decimate_greedy(&torus(16, 8), &options, &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Interrupted)));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..Default::default() })]

    /// Triangles between a few points in space: nothing about them is a manifold.
    #[test]
    fn any_triangles_end_as_a_manifold(
        positions in prop::collection::vec(prop::array::uniform3(-3i8..3), 3..20),
        triangles in prop::collection::vec(prop::array::uniform3(0usize..20), 0..60),
        target in 0u64..40,
        subset in any::<bool>(),
    ) {
        let positions: Vec<Vec3> =
            positions.into_iter().map(|p| Vec3::from_array(p.map(f32::from))).collect();
        let corner = |v: usize| (v % positions.len()) as u32;
        let triangles = triangles.into_iter().map(|t| t.map(corner)).collect();
        let mesh = IndexedMesh { positions, triangles, ..Default::default() };
        let mut options = DecimateOptions::new(Target::Triangles(target));
        if subset {
            options.placement = Placement::Subset;
        }
        let (out, report) = with_options(&mesh, &options);
        Topology::of(&out);
        prop_assert!(out.positions.iter().all(|p| p.is_finite()));
        let stayed = report.missed.map_or(0, |missed| missed.counts().iter().map(|c| c.1).sum());
        prop_assert_eq!(stayed, report.output_triangles.saturating_sub(report.target_triangles.unwrap()));
    }
}
