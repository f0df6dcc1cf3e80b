//! The whole line: a mesh becomes a file, the file is paged, and fronts of it are meshes.

use mergetree::{Camera, CameraPath, Dependencies, Front, UpdateLimits};
use tests::{forest, model, topology, triangle_set, triangles};
use xfm_format::{Encoding, WriteOptions, XfmFile, verify, write};
use xfm_pager::{Detail, Pager, PagerOptions, Session};
use xtask::generate::Shape;

const MODELS: [(Shape, f64); 4] =
    [(Shape::Scan, 0.0), (Shape::Torus, 0.0), (Shape::Isosurface, 0.0), (Shape::Torus, 0.1)];

#[test]
fn full_refinement_of_a_paged_file_is_the_input() {
    for (shape, holes) in MODELS {
        let model = model(shape, 6_000, holes);
        let input = triangles(&model.mesh);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.xfm");
        write(&forest(&model), &path, &WriteOptions::default()).unwrap();
        let file = XfmFile::open(&path).unwrap();
        assert_eq!(file.header().input_triangles, input.len() as u64);
        assert!(verify(&file, |_| {}).errors.is_empty());

        let mut pager = Pager::open(&path, PagerOptions::default()).unwrap();
        let mut front = Front::new(&pager, Dependencies::Order).unwrap();
        front.update(&mut pager, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
        front.validate(&pager).unwrap();
        let (positions, full) = front.to_mesh();
        assert_eq!(triangle_set(&positions, &full), triangle_set(&model.positions, &input));
    }
}

#[test]
fn full_refinement_of_a_compact_file_is_the_input_within_the_error() {
    for (shape, holes) in MODELS {
        let model = model(shape, 6_000, holes);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.xfm");
        let mut options = WriteOptions::default();
        options.encoding = Encoding::Compact;
        write(&forest(&model), &path, &options).unwrap();
        let file = XfmFile::open(&path).unwrap();
        assert!(verify(&file, |_| {}).errors.is_empty());
        let rounding = file.header().rounding;
        let error = rounding.error();
        let rounded: Vec<_> =
            model.positions.iter().map(|&p| rounding.position(p).unwrap()).collect();
        for (was, is) in model.positions.iter().zip(&rounded) {
            assert!(f64::from(was.distance(*is)) <= error);
        }
        let mut pager = Pager::open(&path, PagerOptions::default()).unwrap();
        let mut front = Front::new(&pager, Dependencies::Order).unwrap();
        front.update(&mut pager, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
        front.validate(&pager).unwrap();
        let (positions, full) = front.to_mesh();
        let input = triangles(&model.mesh);
        assert_eq!(triangle_set(&positions, &full), triangle_set(&rounded, &input));
    }
}

#[test]
fn every_frame_of_a_flight_is_a_manifold_of_the_input_s_topology_whatever_the_quota() {
    for (shape, holes) in MODELS {
        let model = model(shape, 20_000, holes);
        let input = topology(model.positions.len(), &triangles(&model.mesh)).0;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.xfm");
        let mut options = WriteOptions::default();
        if shape == Shape::Scan {
            options.encoding = Encoding::Compact;
        }
        write(&forest(&model), &path, &options).unwrap();
        let bounds = XfmFile::open(&path).unwrap().header().bounds;
        let orbit = CameraPath::orbit(bounds[0], bounds[1], 12);
        for (dependencies, quota) in [
            (Dependencies::Order, usize::MAX),
            (Dependencies::Links, usize::MAX),
            (Dependencies::Order, least_quota(&path) + 300_000),
        ] {
            let pager = Pager::open(&path, PagerOptions::with_quotas(quota, quota)).unwrap();
            let mut session = Session::new(pager, dependencies).unwrap();
            let mut shown = 0;
            for frame in 0..12 {
                let camera = orbit.camera(frame as f32 / 11.0, &Camera::default());
                let stats = session.frame(&camera, Detail::Pixels(0.7));
                assert!(stats.resident_bytes <= quota, "{} of {quota}", stats.resident_bytes);
                session.front().validate(session.pager()).unwrap();
                let (positions, mesh) = session.front().to_mesh();
                assert_eq!(topology(positions.len(), &mesh).0, input);
                shown = shown.max(stats.triangles_shown);
            }
            assert!(shown > 1000, "{shape:?} shows {shown} triangles at most");
        }
    }
}

/// The smallest hard quota that a file can be opened with, in bytes.
fn least_quota(path: &std::path::Path) -> usize {
    match Pager::open(path, PagerOptions::with_quotas(0, 0)) {
        Err(xfm_pager::Error::QuotaTooSmall { minimum, .. }) => minimum,
        other => panic!("opened with nothing: {other:?}"),
    }
}

#[test]
fn a_flight_with_a_budget_keeps_to_it() {
    let model = model(Shape::Scan, 40_000, 0.0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.xfm");
    write(&forest(&model), &path, &WriteOptions::default()).unwrap();
    let pager = Pager::open(&path, PagerOptions::default()).unwrap();
    let bounds = pager.file().header().bounds;
    let mut session = Session::new(pager, Dependencies::Order).unwrap();
    let orbit = CameraPath::orbit(bounds[0], bounds[1], 60);
    for frame in 0..60 {
        let camera = orbit.camera(frame as f32 / 59.0, &Camera::default());
        let stats = session.frame(&camera, Detail::Budget(5_000));
        if frame > 10 {
            let shown = stats.triangles_shown;
            assert!((2_500..6_500).contains(&shown), "{shown} in frame {frame}");
        }
    }
}

#[test]
fn the_same_input_gives_the_same_file() {
    let model = model(Shape::Isosurface, 8_000, 0.0);
    let folder = tempfile::tempdir().unwrap();
    let write_it = |name: &str| {
        let path = folder.path().join(name);
        write(&forest(&model), &path, &WriteOptions::default()).unwrap();
        std::fs::read(path).unwrap()
    };
    assert!(write_it("a.xfm") == write_it("b.xfm"));
}
