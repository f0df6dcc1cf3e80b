//! A soup made into a file, in core and out of core, in both encodings: the file is sound and has the whole surface.

use std::ops::ControlFlow;

use mesh_io::{Error as MeshIoError, MeshSource, Triangle, TriangleSource};
use scratch::Scratch;
use xfm::level::{self, Wanted};
use xfm_build::{
    CoarseProblem, Error, Input, MeshError, MeshOptions, Mode, RecordProblem, build_mesh,
};
use xfm_format::{Encoding, PositionError, XfmFile, verify};

use super::soup::{Pipe, Soup, is_watertight, seeds};
use crate::target::MemoryLimit;
use crate::{Target, mutate};

/// From triangles to a file and back.
pub const TARGET: Target = Target {
    name: "build",
    seeds,
    mutate: mutate::bytes,
    run,
    memory: MemoryLimit { fixed: 96 << 20, per_byte: 0 },
};

fn run(bytes: &[u8]) {
    let soup = Soup::of(bytes);
    let [how, more, levels, error] = soup.choices;
    let mut options = MeshOptions::default();
    options.memory_bytes = 64 << 20;
    options.expected_triangles = Some(soup.triangles.len() as u64);
    options.mode = Some(if how & 1 == 0 { Mode::InCore } else { Mode::Streaming });
    options.threads = std::num::NonZeroUsize::new(1);
    options.write.encoding = if how & 2 == 0 { Encoding::Exact } else { Encoding::Compact };
    options.write.levels = 1 + u32::from(levels) % 5;
    options.write.position_error = PositionError::Units(10f64.powi(i32::from(error % 12) - 9));
    options.write.page_nodes = Some(64 + usize::from(more) * 4);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("case.xfm");
    let mut observer = |_| ControlFlow::Continue(());
    let built = if how & 4 == 0 {
        let mut open = || -> Result<Box<dyn TriangleSource + Send>, MeshIoError> {
            Ok(Box::new(MeshSource::new(soup.mesh(), "case")))
        };
        build_mesh(Input::File(&mut open), &path, folder.path(), &options, &mut observer)
    } else {
        let mut pipe = Pipe::new(soup.corners());
        build_mesh(Input::Pipe(&mut pipe), &path, folder.path(), &options, &mut observer)
    };
    match built {
        Ok(_) => check(&path, &soup),
        Err(error) => {
            assert!(!path.exists(), "a file in spite of: {error}");
            match error {
                MeshError::Empty => {}
                // What comes once cannot be sorted.
                MeshError::Collapse(stream_decimate::Error::Unsorted { .. }) if how & 4 != 0 => {}
                // The grid does not reach so far with so small an error.
                MeshError::Build(
                    Error::Coarse(CoarseProblem::TooFar)
                    | Error::Record { problem: RecordProblem::TooFar, .. },
                ) => {}
                error => panic!("{error}"),
            }
        }
    }
    let left = std::fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, usize::from(path.exists()), "something is left in the folder");
}

fn check(path: &std::path::Path, soup: &Soup) {
    let file = XfmFile::open(path).expect("what was written");
    let report = verify(&file, |_| {});
    assert!(report.is_ok(), "{:?}", report.errors.first());
    let mut forest = file.read_forest().expect("what was verified");
    let level = level::extract(&mut forest, &Wanted::Full, |_| false).expect("a sound base");
    assert_eq!(level.damaged, 0);
    assert_eq!(level.triangles.len() as u64, file.header().input_triangles);
    let scratch = Scratch::new(path.parent().expect("a folder"));
    let mut full = xfm::full::full_mesh(&file, &scratch, 0).expect("a sound file");
    let mut corners: Vec<Triangle> = Vec::new();
    full.corners::<xfm::Error>(|triangles| {
        corners.extend_from_slice(triangles);
        Ok(())
    })
    .expect("a sound file");
    let mut expected: Vec<Triangle> =
        level.triangles.iter().map(|t| t.map(|v| level.positions[v as usize])).collect();
    sort(&mut corners);
    sort(&mut expected);
    assert!(corners == expected, "the finest mesh is not that of the front");
    if file.header().encoding == Encoding::Exact && soup.is_watertight() {
        let mut input = soup.corners();
        sort(&mut input);
        assert!(corners == input, "the finest mesh is not the input");
        assert!(is_watertight(&corners));
    }
}

/// Each triangle from its least corner, all by their coordinates.
fn sort(triangles: &mut [Triangle]) {
    let key =
        |triangle: &Triangle| triangle.map(|c| (c + glam::Vec3::ZERO).to_array().map(f32::to_bits));
    for triangle in triangles.iter_mut() {
        let bits = key(triangle);
        let first = (0..3).min_by_key(|&corner| bits[corner]).unwrap_or(0);
        triangle.rotate_left(first);
    }
    triangles.sort_by_key(key);
}
