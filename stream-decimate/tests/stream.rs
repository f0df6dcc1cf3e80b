//! Streams through buffers of all sizes.

mod common;

use common::{Kept, count, decimate, grid, options, sheet, torus};
use glam::{Vec3, vec3};
use mesh_io::Triangle;
use proptest::prelude::*;
use stream_decimate::{Error, Placement, StreamDecimator, Target};

#[test]
fn a_closed_mesh_stays_closed_and_of_its_genus_with_the_exact_count() {
    let mesh = torus(60, 500);
    for ratio in [0.5, 0.1, 0.02, 0.005] {
        for buffer in [1_500, 8_000, 400_000] {
            let (out, report) = decimate(&mesh, &options(ratio, buffer));
            let expected = (ratio * mesh.len() as f64).round() as u64;
            assert_eq!(report.output_triangles, expected, "{ratio} {buffer}: {report}");
            assert_eq!(report.missed, None);
            assert!(report.peak_buffer_triangles <= buffer as u64);
            let counted = count(&out);
            assert_eq!((counted.boundary, counted.bad_edges), (0, 0), "{ratio} {buffer}");
            assert_eq!(counted.euler(), 0, "{ratio} {buffer}");
        }
    }
}

#[test]
fn boundaries_flow_through_a_small_buffer() {
    let mesh = sheet(198, true);
    let holes = 33 * 33;
    let before = count(&mesh);
    assert_eq!(before.euler(), 1 - holes);
    assert!(before.boundary * 10 > before.edges, "a tenth of the edges");
    for buffer in [6_000, 400_000] {
        let (out, report) = decimate(&mesh, &options(0.2, buffer));
        assert_eq!(report.missed, None, "{report}");
        let counted = count(&out);
        assert_eq!((counted.bad_edges, counted.euler()), (0, 1 - holes), "{buffer}");
        assert_eq!(report.repaired, Default::default());
        assert_eq!(report.sealed_vertices > 0, buffer == 6_000);
    }
}

#[test]
fn the_result_depends_on_seed_but_not_on_threads_or_batches() {
    let mesh = torus(100, 300);
    let mut options = options(0.05, 20_000);
    let mut with_threads = |threads: usize| {
        options.threads = std::num::NonZeroUsize::new(threads);
        decimate(&mesh, &options).0
    };
    let first = with_threads(1);
    assert!(first == with_threads(2) && first == with_threads(5));
    let mut kept = Kept::default();
    let mut decimator = StreamDecimator::new(&options, None).unwrap();
    for batch in mesh.chunks(10_001) {
        decimator.push(batch, &mut kept).unwrap();
    }
    decimator.finish(&mut kept).unwrap();
    assert!(first == kept.0);
    options.seed = 1;
    assert!(first != decimate(&mesh, &options).0);
}

#[test]
fn a_flat_sheet_loses_nearly_all_triangles_and_does_not_fold() {
    let mesh = grid(150, 150, [false, false], |i, j| vec3(i as f32, j as f32, 0.0));
    for buffer in [10_000, 400_000] {
        let mut options = options(1.0, buffer);
        options.target = Target::Triangles(20);
        let (out, report) = decimate(&mesh, &options);
        assert_eq!(out.len(), 20, "{report}");
        let area: f32 = out.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).z).sum();
        assert!((area / 22_500.0 - 1.0).abs() < 0.01, "{area}");
        for [a, b, c] in &out {
            assert!((*b - *a).cross(*c - *a).z > 0.0, "turned over");
        }
    }
}

#[test]
fn a_subset_of_the_vertices_is_one() {
    let mesh = torus(40, 120);
    let mut options = options(0.1, 3_000);
    options.placement = Placement::Subset;
    let (out, _) = decimate(&mesh, &options);
    let bits = |c: Vec3| (c + Vec3::ZERO).to_array().map(f32::to_bits);
    let there: std::collections::HashSet<_> = mesh.iter().flatten().map(|c| bits(*c)).collect();
    assert!(out.iter().flatten().all(|c| there.contains(&bits(*c))));
}

#[test]
fn dirty_input_is_counted_and_does_no_harm() {
    let clean = torus(40, 100);
    let mut mesh = Vec::new();
    for (i, &[a, b, c]) in clean.iter().enumerate() {
        mesh.push([a, b, c]);
        match i % 100 {
            10 => mesh.push([b, c, a]),
            20 => mesh.push([a, a, b]),
            30 => mesh.push([a, vec3(f32::NAN, 0.0, 0.0), b]),
            40 => mesh.push([a, b, a + b]),
            _ => {}
        }
    }
    let (out, report) = decimate(&mesh, &options(1.0, 400_000));
    let repaired = report.repaired;
    assert_eq!((repaired.duplicate, repaired.degenerate, repaired.non_finite), (80, 80, 80));
    assert_eq!(repaired.non_manifold, 80);
    assert_eq!(out.len(), clean.len() + 80, "the fins are cut off, not lost");
    let (out, report) = decimate(&mesh, &options(0.1, 3_000));
    assert!(count(&out).bad_edges == 0, "{report}");
}

#[test]
fn fans_that_meet_in_a_vertex_become_vertices_of_their_own() {
    let tip = Vec3::ZERO;
    let cone = |side: f32| {
        let at = move |i: i32| {
            let angle = i as f32 * std::f32::consts::TAU / 6.0;
            vec3(side * angle.cos(), angle.sin(), side)
        };
        (0..6).map(move |i| [tip, at(i), at(i + 1 - 6 * (i / 5))])
    };
    let mesh: Vec<Triangle> = cone(1.0).zip(cone(-1.0)).flat_map(|(a, b)| [a, b]).collect();
    let (out, report) = decimate(&mesh, &options(1.0, 64));
    assert_eq!((out.len(), report.repaired.split_vertices), (12, 1));
}

#[test]
fn late_triangles_find_what_has_become_of_their_neighbours() {
    let mut mesh = sheet(198, true);
    let before = count(&mesh);
    // Rows of squares without holes, one of which in each comes after twenty others.
    let rows: Vec<usize> = (0..20).map(|i| 396 * 5 + i * 1_500).collect();
    for &start in rows.iter().rev() {
        let late: Vec<Triangle> = mesh.drain(start..start + 2).collect();
        let at = (start + 5_000).min(mesh.len());
        mesh.splice(at..at, late);
    }
    let (out, report) = decimate(&mesh, &options(0.3, 5_000));
    let repaired = report.repaired;
    assert!(repaired.late > 0, "{repaired:?}");
    assert!(repaired.late + repaired.late_cracks <= 40, "{repaired:?}");
    let counted = count(&out);
    assert_eq!(counted.bad_edges, 0);
    if repaired.late_cracks == 0 && report.missed.is_none() {
        assert_eq!(counted.euler(), before.euler());
    }
}

#[test]
fn an_unsorted_pipe_is_refused_when_it_leaves_cracks() {
    let mut mesh = torus(200, 400);
    let len = mesh.len();
    for i in 0..len {
        mesh.swap(i, i * 7_919 % len);
    }
    let mut decimator = StreamDecimator::new(&options(0.1, 4_000), None).unwrap();
    let mut kept = Kept::default();
    let result = mesh
        .chunks(1_000)
        .try_for_each(|batch| decimator.push(batch, &mut kept))
        .and_then(|()| decimator.finish(&mut kept).map(|_| ()));
    assert!(matches!(result, Err(Error::Unsorted { .. })), "{result:?}");
}

#[test]
fn a_missed_target_says_why() {
    // Tetrahedra cannot lose a triangle.
    let mesh: Vec<Triangle> = (0..100)
        .flat_map(|i| {
            let o = vec3(3.0 * i as f32, 0.0, 0.0);
            let [a, b, c, d] = [o, o + Vec3::X, o + Vec3::Y, o + Vec3::Z];
            [[a, c, b], [a, b, d], [b, c, d], [c, a, d]]
        })
        .collect();
    let (out, report) = decimate(&mesh, &options(0.5, 100));
    assert_eq!(out.len(), 400);
    assert_eq!(report.to_string(), "asked 200, got 400: topology 200");
}

#[test]
fn counts_of_streams_of_unknown_length_need_a_buffer() {
    let mut options = options(1.0, 1_000);
    options.target = Target::Triangles(501);
    let error = StreamDecimator::new(&options, None).unwrap_err();
    assert!(matches!(error, Error::UnknownLength { needed: 1_002, .. }), "{error}");
    assert!(StreamDecimator::new(&options, Some(10_000)).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 48, ..Default::default() })]

    /// Whatever the order and whatever triangles are missing: nothing is lost at full ratio, and the buffer's size
    /// makes no difference to that.
    #[test]
    fn any_order_is_put_together_again(seed in any::<u64>(), missing in 0usize..300) {
        let mut mesh = torus(12, 20);
        let mut random = seed | 1;
        let mut next = |below: usize| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 33) as usize % below
        };
        for i in (1..mesh.len()).rev() {
            mesh.swap(i, next(i + 1));
        }
        mesh.truncate(mesh.len() - missing);
        let (out, report) = decimate(&mesh, &options(1.0, 400_000));
        let sorted = |mesh: &[Triangle]| {
            let mut keys: Vec<_> = mesh
                .iter()
                .map(|t| {
                    let mut corners = t.map(|c| (c + Vec3::ZERO).to_array().map(f32::to_bits));
                    let least = (0..3).min_by_key(|&i| corners[i]).unwrap();
                    corners.rotate_left(least);
                    corners
                })
                .collect();
            keys.sort_unstable();
            keys
        };
        prop_assert_eq!(sorted(&mesh), sorted(&out), "{}", report);
        let (out, _) = decimate(&mesh, &options(0.3, 400_000));
        prop_assert_eq!(count(&out).bad_edges, 0);
    }
}
