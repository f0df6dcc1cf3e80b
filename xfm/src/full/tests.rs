//! The finest mesh out of core against that in core, and against files that contradict themselves.

use glam::Vec3;
use mergetree::{BuildOptions, Forest};
use mesh_io::IndexedSource;
use proptest::prelude::*;
use scratch::Scratch;
use xfm_format::{WriteOptions, XfmFile};

use super::*;
use crate::level::{self, Wanted};
use crate::same_surface::difference;

/// Little of everything.
const TINY: Shares = Shares {
    bucket: 50,
    chunk_bytes: 256,
    held: 512,
    linking: 0,
    walking: 1000,
    other: 0,
    table_chunk: 96,
};

/// The forest of a mesh after its repair; `None` where nothing is left.
fn forest(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<Forest> {
    let repaired = halfedge::repair(positions, triangles).unwrap();
    let mut options = BuildOptions::default();
    options.base_faces = 2;
    (repaired.mesh.num_faces() > 0)
        .then(|| mergetree::build(repaired.mesh, &repaired.positions, &options, &|_| ()).unwrap())
}

fn written(forest: &Forest, folder: &std::path::Path, levels: u32) -> Option<XfmFile> {
    let path = folder.join("mesh.xfm");
    let mut options = WriteOptions::default();
    options.levels = levels;
    xfm_format::write(forest, &path, &options).ok()?;
    Some(XfmFile::open(path).unwrap())
}

/// A grid over the unit square, some of whose squares are missing, closed to a torus where `closes` says so.
fn grid(n: u32, holes: &[(u32, u32)], closes: bool) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let side = n + 1;
    let at = |i: u32, j: u32| match closes {
        true => (i % n) * side + j % n,
        false => i * side + j,
    };
    let height = |i: u32, j: u32| (i * 7 % 5) as f32 * 0.1 + (j * 3 % 4) as f32 * 0.05;
    let position =
        |k: u32| Vec3::new((k / side) as f32, (k % side) as f32, height(k / side, k % side));
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        if !holes.contains(&(i, j)) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    ((0..side * side).map(position).collect(), triangles)
}

fn check(forest: &Forest, levels: u32, shares: Option<Shares>) {
    let folder = tempfile::tempdir().unwrap();
    let file = written(forest, folder.path(), levels).unwrap();
    let in_core =
        level::extract(&mut file.read_forest().unwrap(), &Wanted::Full, |_| false).unwrap();
    let scratch = Scratch::new(folder.path());
    let mut full = match shares {
        Some(shares) => full_mesh_with(&file, &scratch, shares).unwrap(),
        None => full_mesh(&file, &scratch, 0).unwrap(),
    };
    let (mut positions, mut triangles, mut soup) = (Vec::new(), Vec::new(), Vec::new());
    full.positions(|p| -> Result<(), Error> {
        positions.extend_from_slice(p);
        Ok(())
    })
    .unwrap();
    full.triangles(|t| -> Result<(), Error> {
        triangles.extend_from_slice(t);
        Ok(())
    })
    .unwrap();
    full.corners(|t| -> Result<(), Error> {
        soup.extend_from_slice(t);
        Ok(())
    })
    .unwrap();
    assert_eq!(full.num_vertices(), positions.len() as u64);
    assert_eq!(full.num_triangles(), triangles.len() as u64);
    assert_eq!(positions.len(), in_core.positions.len());
    let found = difference((&in_core.positions, &in_core.triangles), (&positions, &triangles));
    assert_eq!((found.missing, found.extra, found.repeated), (0, 0, 0));
    assert!(soup.iter().zip(&triangles).all(|(c, t)| *c == t.map(|v| positions[v as usize])));
    // Each vertex is one: what is connected in core is connected here, and nothing else.
    let mesh = |positions: &[Vec3], triangles| {
        let mesh = halfedge::HalfEdgeMesh::from_triangles(positions.len(), triangles).unwrap();
        let boundary = mesh.half_edges().filter(|&h| mesh.reverse(h).is_none()).count();
        (mesh.num_vertices(), boundary)
    };
    assert_eq!(mesh(&positions, &triangles), mesh(&in_core.positions, &in_core.triangles));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the file alone");
}

#[test]
fn tori_and_fields_with_holes_come_out_whole_with_little_memory() {
    for (holes, closes) in [(&[][..], true), (&[(3, 4), (4, 4), (9, 9), (0, 5)], false)] {
        let (positions, triangles) = grid(12, holes, closes);
        let forest = forest(&positions, &triangles).unwrap();
        assert!(forest.nodes.len() > 50);
        for levels in [1, 4] {
            check(&forest, levels, Some(TINY));
            check(&forest, levels, None);
        }
    }
}

#[test]
fn shares_stay_within_what_is_allowed() {
    for memory in [0, 1 << 20, 64 << 20, 1 << 30, 1 << 36] {
        for half_edges in [3, 1_000_000, u64::from(u32::MAX)] {
            let shares = Shares::new(memory, 5 << 20, half_edges);
            let tables = memory.saturating_sub(21 << 20).max(LEAST);
            let buckets = half_edges.div_ceil(shares.bucket) * shares.chunk_bytes as u64;
            // Chunks that are the smallest already may take more.
            let writing = if shares.chunk_bytes == 4 << 10 { 0 } else { buckets };
            assert!(shares.held + writing + shares.other <= tables, "{shares:?}");
            assert!(shares.bucket * LINK_BYTES + shares.held + shares.linking <= tables);
            assert!(shares.walking + shares.other <= tables);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    /// Corners on a small lattice: edges with many triangles, fans that touch, pieces of all sizes.
    #[test]
    fn any_soup_comes_out_as_in_core(
        triangles in prop::collection::vec(prop::array::uniform3(0u32..40), 1..120),
        holes in prop::collection::vec((0u32..8, 0u32..8), 0..20),
        levels in 1u32..6,
    ) {
        let (mut positions, mut all) = grid(8, &holes, false);
        let first = positions.len() as u32;
        positions.extend((0..40).map(|k| Vec3::new((k % 4) as f32, (k / 4 % 4) as f32, 5.0 + (k / 16) as f32)));
        all.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        if let Some(forest) = forest(&positions, &all) {
            check(&forest, levels, Some(TINY));
        }
    }

    /// Links that lead elsewhere: an error or a wrong mesh, never a panic, and always an end.
    #[test]
    fn contradictions_end_without_a_panic(
        wrong in prop::collection::vec((any::<prop::sample::Index>(), 0usize..4, any::<prop::sample::Index>()), 1..20),
    ) {
        let (positions, triangles) = grid(10, &[(2, 2)], false);
        let mut forest = forest(&positions, &triangles).unwrap();
        let names: Vec<_> = forest.nodes.iter().flat_map(|node| node.adjacent).collect();
        for (node, k, name) in wrong {
            let node = node.get(&forest.nodes).order as usize;
            forest.nodes[node].adjacent[k] = *name.get(&names);
        }
        let folder = tempfile::tempdir().unwrap();
        if let Some(file) = written(&forest, folder.path(), 3) {
            let full = full_mesh_with(&file, &Scratch::new(folder.path()), TINY);
            if let Ok(mut full) = full {
                let mut count = 0;
                let counted = full.corners(|t| -> Result<(), Error> { count += t.len(); Ok(()) });
                prop_assert!(counted.is_err() || count as u64 == file.header().input_triangles);
            }
        }
    }
}
