//! What the verifier finds beyond checksums, and a file of every version that must stay readable.

mod common;

use std::collections::BTreeSet;
use std::path::PathBuf;

use common::{collapse, coloured, sheet, torus, unnumbered};
use mergetree::{Colour, Dependencies, Forest, Front, HalfEdgeName, UpdateLimits};
use xfm_format::{
    Encoding, Error, Place, PositionError, Report, WriteOptions, XfmFile, verify, write,
};

fn options() -> WriteOptions {
    let mut options = WriteOptions::default();
    options.levels = 2;
    options.page_nodes = Some(64);
    options
}

fn verified(forest: &Forest) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    write(forest, &path, &options()).unwrap();
    verify(&XfmFile::open(&path).unwrap(), |_| {})
}

fn messages(report: &Report) -> String {
    report.errors.iter().map(|e| format!("{}: {}\n", e.place, e.message)).collect()
}

#[test]
fn a_half_edge_of_an_earlier_collapse_is_found() {
    let mut forest = collapse(&torus(8), 400, 3);
    let names = forest.base.names();
    let last = forest.nodes.len() - 1;
    forest.nodes[last].adjacent[0] = Some(names.of_node(mergetree::NodeId::new(0), 1));
    let found = messages(&verified(&forest));
    assert!(
        found.contains("w names a half-edge of node") && found.contains("collapsed before"),
        "{found}"
    );
}

#[test]
fn a_half_edge_of_a_face_that_is_not_there_is_found() {
    let mut forest = collapse(&sheet(8), 400, 3);
    let names = forest.base.names();
    let one_face = forest.nodes.iter().rposition(|n| !n.has_second_face()).unwrap();
    let target = names.of_node(mergetree::NodeId::from_index(one_face), 4);
    forest.nodes[0].adjacent[1] = Some(target);
    let found = messages(&verified(&forest));
    assert!(found.contains("x names a half-edge of the second face"), "{found}");
}

#[test]
fn a_coarsest_mesh_that_is_no_manifold_is_found() {
    let mut forest = collapse(&torus(8), 400, 3);
    let [a, b, c] = forest.base.faces[0];
    forest.base.faces[0] = [a, c, b];
    let report = verified(&forest);
    assert_eq!(report.errors[0].place, Place::Base);
}

#[test]
fn progress_goes_from_the_first_page_to_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    write(&collapse(&torus(20), 3000, 3), &path, &options()).unwrap();
    let file = XfmFile::open(&path).unwrap();
    let mut seen = Vec::new();
    verify(&file, |progress| seen.push((progress.done, progress.total)));
    let total = 2 * file.num_pages();
    assert_eq!(seen, (1..=total).map(|done| (done, total)).collect::<Vec<_>>());
}

/// Changes every byte of every page, with the checksums made right, and collects what the verifier says. A change that it
/// says nothing about must be one of numbers that nothing can be held against.
#[test]
fn forged_links_and_bounds_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    write(&collapse(&torus(18), 4000, 3), &path, &options()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let original = unnumbered(&XfmFile::open(&path).unwrap().read_forest().unwrap());
    let (index, index_len) = (u64_at(192), u64_at(200));
    let mut found = BTreeSet::new();
    for page in 0..index_len / 32 {
        let entry = index + 32 * page;
        let range = u64_at(entry + 8)..u64_at(entry + 8) + u32_at(entry + 16);
        for at in range.clone() {
            // Shapes and links come first and matter most.
            let changes: &[u8] = if at < range.start + 150 { &[1, 2, 3, 0x30] } else { &[1] };
            for &change in changes {
                let mut forged = bytes.clone();
                forged[at] ^= change;
                let sum = crc32fast::hash(
                    &[b"P", &(page as u64).to_le_bytes()[..], &forged[range.clone()]].concat(),
                );
                forged[entry + 28..entry + 32].copy_from_slice(&sum.to_le_bytes());
                let sum = crc32fast::hash(&[b"I", &forged[index..index + index_len]].concat());
                forged[208..212].copy_from_slice(&sum.to_le_bytes());
                let header_len = u32_at(12);
                let sum = crc32fast::hash(&forged[..header_len - 4]);
                forged[header_len - 4..header_len].copy_from_slice(&sum.to_le_bytes());
                let file = XfmFile::from_storage(Box::new(forged), "x.xfm").unwrap();
                let report = verify(&file, |_| {});
                if report.is_ok() {
                    let mut forest = unnumbered(&file.read_forest().unwrap());
                    assert_eq!(forest.base, original.base);
                    for (order, node) in &mut forest.nodes {
                        let was = &original.nodes[order];
                        // On which side a single child hangs is for the mesh to contradict.
                        let links = |mut links: [Option<u32>; 3]| {
                            links[..2].sort_unstable();
                            links
                        };
                        assert_eq!(links(node.links), links(was.links));
                        // Another half-edge that is there; another place within all bounds.
                        node.adjacent = was.adjacent;
                        node.position = was.position;
                        node.normal = was.normal;
                    }
                    assert_eq!(forest.nodes.len(), original.nodes.len());
                }
                let words = |message: &str| {
                    message
                        .split(' ')
                        .filter(|w| !w.starts_with(|c: char| c.is_ascii_digit()))
                        .collect::<Vec<_>>()
                        .join(" ")
                };
                found.extend(report.errors.iter().map(|error| words(&error.message)));
            }
        }
    }
    for expected in [
        "which does not name it",
        "is a child of node",
        "hangs under no node",
        "has shape",
        "do not make",
        "sphere that reaches outside",
        "cone that reaches outside",
        "larger deviation",
        "has order",
        "as another node",
        "which is not there",
        "collapsed before",
        "names a half-edge that cannot be",
        "names a child block that cannot be",
        "bounding box",
        "does not unpack",
        "unknown method",
    ] {
        assert!(found.iter().any(|m| m.contains(expected)), "{expected} not in {found:#?}");
    }
}

#[test]
fn forged_roots_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    write(&collapse(&torus(10), 700, 3), &path, &options()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let header_len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let roots = u64_at(144)..u64_at(144) + u64_at(152);
    let mut found = BTreeSet::new();
    for at in roots.clone() {
        for change in 1..=255u8 {
            let mut forged = bytes.clone();
            forged[at] ^= change;
            let sum = crc32fast::hash(&[b"R", &forged[roots.clone()]].concat());
            forged[160..164].copy_from_slice(&sum.to_le_bytes());
            let sum = crc32fast::hash(&forged[..header_len - 4]);
            forged[header_len - 4..header_len].copy_from_slice(&sum.to_le_bytes());
            match XfmFile::from_storage(Box::new(forged), "x.xfm") {
                Err(error) => assert!(matches!(error, Error::Invalid { .. }), "{error}"),
                Ok(file) => {
                    let messages = messages(&verify(&file, |_| {}));
                    found.extend(messages.lines().map(str::to_owned));
                }
            }
        }
    }
    for expected in ["is not in the root list", "is no root", "two vertices have the same tree"] {
        assert!(found.iter().any(|m| m.contains(expected)), "{expected} not in {found:#?}");
    }
}

/// Changes every byte of every compact page, with the checksums made right. Nearly all that can be said of it is that it is
/// said, that nothing panics, and that what is left is a forest.
#[test]
fn forged_compact_pages_are_borne() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    write(&coloured(collapse(&torus(18), 4000, 3)), &path, &compact_options()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (index, index_len) = (u64_at(192), u64_at(200));
    let mut found = BTreeSet::new();
    for page in 0..index_len / 32 {
        let entry = index + 32 * page;
        let range = u64_at(entry + 8)..u64_at(entry + 8) + u32_at(entry + 16);
        for at in range.clone() {
            for change in [1, 0x80] {
                let mut forged = bytes.clone();
                forged[at] ^= change;
                let sum = crc32fast::hash(
                    &[b"P", &(page as u64).to_le_bytes()[..], &forged[range.clone()]].concat(),
                );
                forged[entry + 28..entry + 32].copy_from_slice(&sum.to_le_bytes());
                let sum = crc32fast::hash(&[b"I", &forged[index..index + index_len]].concat());
                forged[208..212].copy_from_slice(&sum.to_le_bytes());
                let header_len = u32_at(12);
                let sum = crc32fast::hash(&forged[..header_len - 4]);
                forged[header_len - 4..header_len].copy_from_slice(&sum.to_le_bytes());
                let file = XfmFile::from_storage(Box::new(forged), "x.xfm").unwrap();
                let report = verify(&file, |_| {});
                let forest = file.read_forest();
                if report.is_ok() {
                    let forest = forest.unwrap();
                    let mut front = Front::new(&forest, Dependencies::Order).unwrap();
                    let mut forest = forest;
                    let limits = UpdateLimits::with_tolerance(0.0);
                    front.update(&mut forest, |_| 1.0, &limits);
                    front.validate(&forest).unwrap();
                }
                found.extend(report.errors.iter().map(|error| error.message.clone()));
            }
        }
    }
    for expected in [
        "has symbols that lead nowhere",
        "has fewer symbols or bits than nodes need",
        "has bits too many",
        "has a table",
        "names a half-edge that cannot be",
        "sphere that reaches outside",
        "do not make",
        "has a colour that cannot be",
    ] {
        assert!(found.iter().any(|m| m.contains(expected)), "{expected} not in {found:#?}");
    }
}

fn compact_options() -> WriteOptions {
    let mut options = options();
    options.encoding = Encoding::Compact;
    options.position_error = PositionError::Units(0.01);
    options
}

/// A file as the first writer of its version wrote it. Made by `golden_forest` and `options`.
fn golden(version: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/version-{version}.xfm"))
}

fn golden_forest() -> Forest {
    collapse(&sheet(12), 1500, 1)
}

#[test]
fn files_of_every_version_stay_readable() {
    let file = XfmFile::open(golden("2")).unwrap();
    assert_eq!(file.header().version, 2);
    assert!(verify(&file, |_| {}).is_ok());
    let forest = golden_forest();
    let back = file.read_forest().unwrap();
    let by_order = |order: u32| forest.nodes.iter().find(|node| node.order == order).unwrap();
    assert_eq!(back.nodes.len(), forest.nodes.len());
    assert_eq!(back.base.faces, forest.base.faces);
    for node in &back.nodes {
        let expected = by_order(node.order);
        // The test's sines and cosines may differ in the last place from one machine to another.
        assert!(node.position.distance(expected.position) < 1e-5);
        let kind = |h| match forest.base.names().resolve(h) {
            HalfEdgeName::Base(h) => (None, h),
            HalfEdgeName::Node(id, k) => (Some(forest.nodes[id.index()].order), k),
        };
        let back_kind = |h| match back.base.names().resolve(h) {
            HalfEdgeName::Base(h) => (None, h),
            HalfEdgeName::Node(id, k) => (Some(back.nodes[id.index()].order), k),
        };
        assert_eq!(node.adjacent.map(|h| h.map(back_kind)), expected.adjacent.map(|h| h.map(kind)));
    }
}

#[test]
fn compact_files_of_every_version_stay_readable() {
    let path = golden("2-compact");
    let file = XfmFile::open(&path).unwrap();
    assert_eq!((file.header().version, file.header().encoding), (2, Encoding::Compact));
    assert_eq!(file.header().rounding.error(), 0.01);
    assert!(verify(&file, |_| {}).is_ok());
    let forest = golden_forest();
    let back = file.read_forest().unwrap();
    assert_eq!(back.nodes.len(), forest.nodes.len());
    assert_eq!(back.base.faces, forest.base.faces);
    // Refined it is the sheet.
    let refined = |mut forest: Forest| {
        let mut front = Front::new(&forest, Dependencies::Order).unwrap();
        front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
        let (positions, triangles) = front.to_mesh();
        let mut corners: Vec<[[i32; 2]; 3]> = triangles
            .iter()
            .map(|t| t.map(|v| positions[v as usize].truncate().round().as_ivec2().to_array()))
            .collect();
        corners.iter_mut().for_each(|t| t.sort_unstable());
        corners.sort_unstable();
        corners
    };
    assert_eq!(refined(back), refined(forest));
}

/// Colours that are the same on every machine, by the order of the collapse.
fn golden_colour(order: u32) -> Colour {
    [(3 * order) as u8, (7 * order) as u8, 99, 255 - (order % 3) as u8]
}

fn golden_coloured_forest() -> Forest {
    let mut forest = golden_forest();
    forest.colours = forest.nodes.iter().map(|node| golden_colour(node.order)).collect();
    let base = 0..forest.base.vertices.len() as u32;
    forest.base.colours = base.map(|v| golden_colour(1000 + v)).collect();
    forest
}

#[test]
fn coloured_files_of_every_version_stay_readable() {
    let names = ["2-colour", "2-compact-colour"];
    for (name, options) in names.into_iter().zip([options(), compact_options()]) {
        let forest = golden_coloured_forest();
        let file = XfmFile::open(golden(name)).unwrap();
        assert_eq!((file.header().version, file.header().encoding), (2, options.encoding));
        assert!(file.header().has_colour());
        assert!(verify(&file, |_| {}).is_ok());
        let back = file.read_forest().unwrap();
        assert_eq!(back.base.colours, forest.base.colours);
        // Down the trees, side by side.
        let roots = std::iter::zip(&forest.base.vertices, &back.base.vertices);
        let mut stack: Vec<_> = roots.filter_map(|(a, b)| a.root.zip(b.root)).collect();
        let mut seen = 0;
        while let Some((a, b)) = stack.pop() {
            assert_eq!(back.colours[b.index()], forest.colours[a.index()]);
            let [a, b] = [&forest.nodes[a.index()], &back.nodes[b.index()]];
            stack.extend([a.left.zip(b.left), a.right.zip(b.right)].into_iter().flatten());
            seen += 1;
        }
        assert_eq!(seen, forest.nodes.len());
    }
}
