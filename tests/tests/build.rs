//! From triangles to a file, in core and in a buffer much smaller than the mesh.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;

use glam::Vec3;
use mergetree::{Camera, CameraPath, Dependencies, Front, UpdateLimits};
use mesh_io::{IndexedMesh, MeshSource};
use tests::{model, topology, triangle_set, triangles};
use xfm_build::{Input, MeshOptions, MeshReport, Mode, build_mesh};
use xfm_format::{XfmFile, verify};
use xfm_pager::{Detail, Pager, PagerOptions, Session};
use xtask::generate::Shape;

/// The least memory: the buffer is as small as it gets, and everything is spilled.
const LEAST: u64 = 1;

fn mesh(shape: Shape, count: u64, holes: f64) -> IndexedMesh {
    let model = model(shape, count, holes);
    IndexedMesh {
        triangles: triangles(&model.mesh),
        positions: model.positions,
        ..Default::default()
    }
}

fn build(mesh: &IndexedMesh, path: &Path, options: &MeshOptions) -> MeshReport {
    let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "mesh")) as _);
    let scratch = path.parent().unwrap();
    let go_on = &mut |_| ControlFlow::Continue(());
    build_mesh(Input::File(&mut open), path, scratch, options, go_on).unwrap()
}

fn in_core() -> MeshOptions {
    let mut options = MeshOptions::default();
    options.mode = Some(Mode::InCore);
    options
}

fn streaming() -> MeshOptions {
    let mut options = MeshOptions::default();
    options.mode = Some(Mode::Streaming);
    options.memory_bytes = LEAST;
    options
}

#[test]
fn full_refinement_is_the_input_in_core_and_streamed() {
    let models = [
        (Shape::Scan, 60_000, 0.0),
        (Shape::Torus, 60_000, 0.0),
        (Shape::Isosurface, 60_000, 0.0),
        (Shape::Torus, 60_000, 0.05),
        (Shape::Torus, 900, 0.1),
    ];
    for (shape, count, holes) in models {
        let mesh = mesh(shape, count, holes);
        let input = triangle_set(&mesh.positions, &mesh.triangles);
        for options in [in_core(), streaming()] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("model.xfm");
            let report = build(&mesh, &path, &options);
            assert_eq!(report.built.input_triangles, input.len() as u64);
            assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "nothing but the file");
            let file = XfmFile::open(&path).unwrap();
            assert_eq!(verify(&file, |_| {}).errors, []);
            let mut pager = Pager::open(&path, PagerOptions::default()).unwrap();
            let mut front = Front::new(&pager, Dependencies::Order).unwrap();
            front.update(&mut pager, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
            front.validate(&pager).unwrap();
            let (positions, full) = front.to_mesh();
            assert_eq!(triangle_set(&positions, &full), input, "{shape:?} {:?}", options.mode);
        }
    }
}

#[test]
fn fronts_are_manifolds_and_no_triangle_of_a_sheet_is_turned_over() {
    // A height field: whatever faces down is folded.
    let (wide, high) = (160u32, 160u32);
    let height = |x: u32, y: u32| {
        let bits = (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)) >> 9;
        let noise = (bits & 1023) as f32 / 1024.0 - 0.5;
        4.0 * (0.11 * x as f32).sin() * (0.07 * y as f32).cos() + 0.6 * noise
    };
    let positions = (0..wide * high).map(|i| (i % wide, i / wide));
    let positions = positions.map(|(x, y)| Vec3::new(x as f32, y as f32, height(x, y))).collect();
    let quads = (0..(wide - 1) * (high - 1)).map(|q| q % (wide - 1) + q / (wide - 1) * wide);
    let triangles: Vec<_> =
        quads.flat_map(|a| [[a, a + 1, a + wide + 1], [a, a + wide + 1, a + wide]]).collect();
    let mesh = IndexedMesh { positions, triangles, ..Default::default() };
    let input = topology(mesh.positions.len(), &mesh.triangles).0;
    for options in [in_core(), streaming()] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.xfm");
        build(&mesh, &path, &options);
        let pager = Pager::open(&path, PagerOptions::default()).unwrap();
        let bounds = pager.file().header().bounds;
        let mut session = Session::new(pager, Dependencies::Order).unwrap();
        let orbit = CameraPath::orbit(bounds[0], bounds[1], 24);
        let (mut all, mut down) = (0, 0);
        for frame in 0..24 {
            let camera = orbit.camera(frame as f32 / 23.0, &Camera::default());
            session.frame(&camera, Detail::Pixels(1.5));
            session.front().validate(session.pager()).unwrap();
            let (positions, mesh) = session.front().to_mesh();
            assert_eq!(topology(positions.len(), &mesh).0, input);
            for t in &mesh {
                let [a, b, c] = t.map(|v| positions[v as usize]);
                all += 1;
                // Along the straight boundary some stand upright.
                down += usize::from((b - a).cross(c - a).z < 0.0);
            }
        }
        assert!(all > 24 * 1000, "{all} triangles are few");
        assert_eq!(down, 0, "of {all} triangles, {:?}", options.mode);
    }
}

#[test]
fn the_file_does_not_depend_on_the_number_of_threads() {
    let mesh = mesh(Shape::Scan, 80_000, 0.0);
    for options in [in_core(), streaming()] {
        let folder = tempfile::tempdir().unwrap();
        let files = [1, 2, 5].map(|threads| {
            let mut options = options.clone();
            options.threads = NonZeroUsize::new(threads);
            let path = folder.path().join(format!("{threads}.xfm"));
            build(&mesh, &path, &options);
            std::fs::read(path).unwrap()
        });
        assert!(files[0] == files[1] && files[1] == files[2]);
    }
}
