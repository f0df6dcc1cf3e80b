//! `.xfm` files: opened, verified, read whole, refined, and written out as the finest mesh.

use halfedge::HalfEdgeMesh;
use mergetree::{BuildOptions, Camera, Dependencies, build};
use scratch::Scratch;
use xfm::level::{self, Wanted};
use xfm_format::{Encoding, PositionError, WriteOptions, XfmFile, verify, write};
use xfm_pager::{Detail, Pager, PagerOptions, Session};

use super::soup::Soup;
use crate::Target;
use crate::target::MemoryLimit;
use crate::xfm_parts;

/// The reader and what is built on it.
pub const TARGET: Target = Target {
    name: "xfm",
    seeds,
    mutate: xfm_parts::mutate,
    run,
    memory: MemoryLimit { fixed: 1 << 20, per_byte: 1024 },
};

fn seeds() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("seed.xfm");
    let mut seeds = Vec::new();
    for (encoding, levels, triangles, closed) in [
        (Encoding::Exact, 3, 300, true),
        (Encoding::Compact, 3, 300, true),
        (Encoding::Exact, 5, 120, false),
        (Encoding::Compact, 1, 120, false),
    ] {
        let mut soup = Soup::torus(triangles);
        if !closed {
            soup.triangles.drain(28..34);
        }
        let mesh = HalfEdgeMesh::from_triangles(soup.positions.len(), &soup.triangles)
            .expect("a manifold");
        let mut options = BuildOptions::default();
        options.base_faces = 12;
        let mut forest = build(mesh, &soup.positions, &options, &|_| ()).expect("small");
        if !closed {
            let colour = |i: usize| [i as u8, (i / 3) as u8, 7, 255];
            forest.colours = (0..forest.nodes.len()).map(colour).collect();
            forest.base.colours = (0..forest.base.vertices.len()).map(colour).collect();
        }
        let mut options = WriteOptions::default();
        options.encoding = encoding;
        options.levels = levels;
        options.page_nodes = Some(64);
        options.position_error = PositionError::Units(1e-3);
        write(&forest, &path, &options).expect("a valid forest");
        seeds.push(std::fs::read(&path).expect("what was written"));
    }
    // With columns as they are, so that a change of a byte is one of a value.
    for at in [0, 2] {
        let parts = xfm_parts::Parts::of(&seeds[at]);
        seeds.extend(parts.map(|mut parts| {
            parts.unpack();
            parts.join()
        }));
    }
    seeds
}

fn open(bytes: &[u8]) -> Result<XfmFile, xfm_format::Error> {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "case")
}

fn run(bytes: &[u8]) {
    let Ok(file) = open(bytes) else { return };
    let report = verify(&file, |_| {});
    for problem in &report.errors {
        assert!(!problem.message.contains('\n'), "{}", problem.message);
    }
    let is_ok = report.is_ok();
    let level = match file.read_forest() {
        Ok(mut forest) => level::extract(&mut forest, &Wanted::Full, |_| false).ok(),
        Err(error) => {
            assert!(!is_ok, "verified, but not read: {error}");
            None
        }
    };
    let full = full_triangles(&file);
    if is_ok {
        let level = level.expect("a sound coarsest mesh");
        // A node may contradict those around it in ways that only its split tells.
        if level.damaged == 0 {
            assert_eq!(full.expect("a sound file"), level.triangles.len() as u64);
        }
    }
    drop(file.field_bytes());
    refine(open(bytes).expect("it was opened before"), is_ok);
}

/// How many triangles the finest mesh has, by the way that needs no front.
fn full_triangles(file: &XfmFile) -> Result<u64, xfm::Error> {
    let scratch = Scratch::new(std::env::temp_dir());
    let mut count = 0;
    xfm::full::full_mesh(file, &scratch, 0)?.corners::<xfm::Error>(|triangles| {
        count += triangles.len() as u64;
        Ok(())
    })?;
    Ok(count)
}

/// What a viewer does, with little memory.
fn refine(file: XfmFile, is_ok: bool) {
    let [min, max] = file.header().bounds;
    let triangles = file.header().input_triangles;
    let faces = file.base().faces.len();
    let largest = file.largest_page_bytes()[1];
    let options = PagerOptions::with_quotas(64 << 10, largest.saturating_mul(2).max(256 << 10));
    let Ok(pager) = Pager::new(file, options) else { return };
    let Ok(mut session) = Session::new(pager, Dependencies::Order) else {
        assert!(!is_ok, "verified, but its coarsest mesh is none");
        return;
    };
    let mut camera = Camera::default();
    for (distance, detail) in [
        (1.0, Detail::Pixels(0.0)),
        (0.1, Detail::Pixels(1.0)),
        (10.0, Detail::Budget(faces + 20)),
        (0.5, Detail::Pixels(0.5)),
    ] {
        let size = (max - min).length();
        camera.eye = max + (max - min) * distance + size * 0.1;
        camera.at = (min + max) / 2.0;
        let stats = session.frame(&camera, detail);
        assert_eq!(stats.triangles_shown, session.front().num_triangles());
        assert!(stats.triangles_shown as u64 <= triangles.max(faces as u64) || !is_ok);
        let changes = session.take_changes();
        drop(changes);
        if let Err(problem) = session.front().validate(session.pager()) {
            assert!(!is_ok, "verified, but the front is none: {problem}");
        }
        session.pager().validate().expect("a sound pager");
    }
}
