//! Decimation by clustering.

mod indexed;

use std::ops::ControlFlow;

use glam::Vec3;
use indexed::{bumpy_square, cube, distance_both_ways, torus};
use mesh_io::{IndexedMesh, MeshSource};
use stream_decimate::{DecimateOptions, DecimateReport, Error, Target, decimate_clustered};

fn clustered(mesh: &IndexedMesh, target: Target) -> (IndexedMesh, DecimateReport) {
    let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "mesh")) as _);
    let options = DecimateOptions::new(target);
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let (out, report) = decimate_clustered(&mut open, &options, &mut go_on).expect("clean input");
    assert_eq!(report.output_triangles, out.triangles.len() as u64);
    assert_eq!(report.input_triangles, mesh.triangles.len() as u64);
    assert_eq!(out.first_bad_index(), None);
    (out, report)
}

#[test]
fn counts_come_near_what_is_asked() {
    for mesh in [torus(128, 64), bumpy_square(90), cube(32)] {
        for target in [4000, 1000, 250] {
            let (out, report) = clustered(&mesh, Target::Triangles(target));
            let got = out.triangles.len() as u64;
            assert!(got.abs_diff(target) * 5 <= target, "{got} for {target}");
            assert_eq!(report.target_triangles, Some(target));
            assert_eq!(report.missed.is_some(), got != target);
        }
    }
}

#[test]
fn the_surface_stays_near() {
    let mesh = torus(48, 24);
    let (out, _) = clustered(&mesh, Target::Triangles(800));
    // A cell is about 0.2 wide.
    assert!(distance_both_ways(&mesh, &out) < 0.2);
    let mut last = 0;
    for most in [0.5, 0.2, 0.1] {
        let (out, report) = clustered(&mesh, Target::MaxError(most));
        assert_eq!((report.target_triangles, report.missed), (None, None));
        assert!(f64::from(distance_both_ways(&mesh, &out)) <= most, "{most}");
        assert!(out.triangles.len() > last);
        last = out.triangles.len();
    }
}

#[test]
fn no_triangle_is_degenerate_or_there_twice() {
    let (out, _) = clustered(&torus(90, 45), Target::Triangles(600));
    let mut sorted: Vec<_> = out
        .triangles
        .iter()
        .map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap())
        .collect();
    assert!(sorted.iter().all(|&[a, b, c]| a != b && b != c && c != a));
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), out.triangles.len());
    let mut used = vec![false; out.positions.len()];
    out.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
    assert!(used.into_iter().all(|used| used), "every vertex is used");
}

#[test]
fn asked_for_everything_nothing_is_lost() {
    let mesh = bumpy_square(12);
    let (out, report) = clustered(&mesh, Target::Ratio(1.0));
    assert_eq!((out.triangles.len(), report.missed), (mesh.triangles.len(), None));
    assert!(distance_both_ways(&mesh, &out) < 1e-3);
}

#[test]
fn what_cannot_be_used_is_counted() {
    let mut mesh = bumpy_square(20);
    mesh.positions.extend([Vec3::NAN, Vec3::splat(f32::INFINITY)]);
    let count = mesh.positions.len() as u32;
    mesh.triangles.extend([[0, 1, count - 1], [0, 1, count - 2], [3, 3, 4]]);
    let (out, report) = clustered(&mesh, Target::Triangles(100));
    assert_eq!((report.repaired.non_finite, report.repaired.degenerate), (2, 1));
    assert!(out.positions.iter().all(|p| p.is_finite()));
    for nothing in [IndexedMesh::default(), IndexedMesh::from_soup(&[[Vec3::NAN; 3]])] {
        for target in [Target::Triangles(10), Target::MaxError(0.1), Target::Ratio(0.5)] {
            assert_eq!(clustered(&nothing, target).0, IndexedMesh::default());
        }
    }
}

#[test]
fn extreme_sizes_and_places_are_fine() {
    let mesh = bumpy_square(20);
    for (scale, offset) in [(1e-20, 0.0), (1e20, 0.0), (1e-3, 5000.0), (1.0, 1e6)] {
        let positions = mesh.positions.iter().map(|&p| p * scale + offset).collect();
        let moved =
            IndexedMesh { positions, triangles: mesh.triangles.clone(), ..Default::default() };
        for target in [Target::Triangles(100), Target::MaxError(1e-30)] {
            let (out, _) = clustered(&moved, target);
            assert!(out.positions.iter().all(|p| p.is_finite()));
        }
    }
}

#[test]
fn errors_and_interruptions_come_through() {
    let bad = IndexedMesh {
        positions: vec![Vec3::ZERO],
        triangles: vec![[0, 0, 7]],
        ..Default::default()
    };
    let options = DecimateOptions::new(Target::Ratio(0.5));
    let mut open = || Ok(Box::new(MeshSource::new(bad.clone(), "bad")) as _);
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let error = decimate_clustered(&mut open, &options, &mut go_on).expect_err("no vertex 7");
    assert!(matches!(error, Error::Mesh(_)), "{error}");
    let mesh = bumpy_square(5);
    let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "mesh")) as _);
    let stopped = decimate_clustered(&mut open, &options, &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Interrupted)));
}
