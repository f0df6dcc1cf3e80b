//! What is written comes back.

mod common;

use std::collections::BTreeMap;

use common::{Soup, collapse, coloured, sheet, torus, unnumbered};
use glam::Vec3;
use halfedge::HalfEdgeId;
use mergetree::{BaseMesh, Forest, HalfEdgeName, NodeId, OctNormal};
use proptest::prelude::*;
use xfm_format::{BlockId, Encoding, Error, PositionError, WriteOptions, XfmFile, verify, write};

fn options(levels: u32, page_nodes: usize) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = Some(page_nodes);
    options
}

fn check(forest: &Forest, options: &WriteOptions) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("forest.xfm");
    let report = write(forest, &path, options).unwrap();
    let file = XfmFile::open(&path).unwrap();
    let header = file.header();
    prop_assert_eq!(header.nodes, forest.nodes.len() as u64);
    prop_assert_eq!(header.input_triangles, forest.num_input_faces() as u64);
    prop_assert_eq!(header.tree_depth, forest.depth() as u64);
    prop_assert_eq!(header.fill(), report.fill);
    prop_assert_eq!(report.file_bytes, std::fs::metadata(&path).unwrap().len());
    prop_assert_eq!(report.bytes.total(), report.file_bytes);
    prop_assert_eq!(file.field_bytes().unwrap(), report.bytes);
    let verified = verify(&file, |_| {});
    prop_assert!(verified.is_ok(), "{:?}", verified.errors);

    let back = file.read_forest().unwrap();
    prop_assert_eq!(unnumbered(&back), unnumbered(forest));
    let mut by_order: Vec<_> = forest.nodes.iter().collect();
    by_order.sort_by_key(|node| node.order);
    for node in &back.nodes {
        let original = by_order[node.order as usize];
        prop_assert!(node.radius >= original.radius && node.radius < original.radius * 1.3);
        prop_assert!(node.cone_sine >= original.cone_sine);
        prop_assert!(node.deviation >= original.deviation);
        prop_assert!(node.deviation <= original.deviation * 1.004);
    }

    // Pages hold the blocks that the index says, and nodes know their place. No page comes before one that it hangs under, nor a
    // block.
    let numbering = file.numbering();
    let mut next = 0;
    for number in 0..file.num_pages() {
        let page = file.read_page(number).unwrap();
        for block in page.blocks() {
            prop_assert_eq!(block.id, BlockId::new(next));
            prop_assert_eq!(file.block_page(block.id), Some(number));
            prop_assert_eq!(page.block(block.id), Some(block));
            let first = block.node(0).unwrap();
            prop_assert_eq!(first.parent, block.parent());
            let parent = first.parent.map(|parent| numbering.block(parent));
            prop_assert!(parent.is_none_or(|parent| parent < block.id));
            prop_assert!(block.nodes.len() <= numbering.slots() as usize);
            for slot in 0..32 {
                prop_assert_eq!(block.node(slot), block.nodes.get(slot as usize));
            }
            next += 1;
        }
        prop_assert!(page.nodes().len() <= options.page_nodes());
    }
    prop_assert_eq!(file.block_page(BlockId::new(next)), None);
    prop_assert_eq!(numbering.levels(), options.levels);

    // Writing what was read gives the same bytes.
    let again = folder.path().join("again.xfm");
    write(&back, &again, options).unwrap();
    prop_assert!(std::fs::read(&path).unwrap() == std::fs::read(&again).unwrap());
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn a_forest_comes_back_equal_up_to_numbering(
        open in any::<bool>(),
        size in 3u32..24,
        tries in 0usize..4000,
        seed in any::<u64>(),
        levels in 1u32..=5,
        page_nodes in 64usize..300,
    ) {
        let soup: Soup = if open { sheet(size) } else { torus(size) };
        let forest = collapse(&soup, tries, seed);
        let forest = if seed % 2 == 0 { forest } else { coloured(forest) };
        check(&forest, &options(levels, page_nodes))?;
    }
}

/// Pairs of nodes of two forests that stand in the same place.
fn pairs(a: &Forest, b: &Forest) -> Vec<(NodeId, NodeId)> {
    let mut pairs = Vec::new();
    let mut stack: Vec<_> = std::iter::zip(&a.base.vertices, &b.base.vertices)
        .filter_map(|(a, b)| {
            assert_eq!(a.root.is_some(), b.root.is_some());
            a.root.zip(b.root)
        })
        .collect();
    while let Some((of_a, of_b)) = stack.pop() {
        pairs.push((of_a, of_b));
        let [a, b] = [&a.nodes[of_a.index()], &b.nodes[of_b.index()]];
        for (a, b) in [(a.left, b.left), (a.right, b.right)] {
            assert_eq!(a.is_some(), b.is_some());
            stack.extend(a.zip(b));
        }
    }
    pairs
}

fn check_compact(forest: &Forest, options: &WriteOptions) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("forest.xfm");
    let report = write(forest, &path, options).unwrap();
    let file = XfmFile::open(&path).unwrap();
    let header = file.header();
    prop_assert_eq!(header.encoding, Encoding::Compact);
    prop_assert_eq!(header.nodes, forest.nodes.len() as u64);
    prop_assert_eq!(report.file_bytes, std::fs::metadata(&path).unwrap().len());
    prop_assert_eq!(report.bytes.total(), report.file_bytes);
    prop_assert_eq!(file.field_bytes().unwrap(), report.bytes);
    let verified = verify(&file, |_| {});
    prop_assert!(verified.is_ok(), "{:?}", verified.errors);

    let back = file.read_forest().unwrap();
    let error = header.rounding.error();
    let near = |a: Vec3, b: Vec3| f64::from(a.distance(b)) <= error;
    let alike = |a: OctNormal, b: OctNormal| a.to_vec3().angle_between(b.to_vec3()) < 0.00873;
    prop_assert_eq!(&back.base.faces, &forest.base.faces);
    prop_assert_eq!(back.base.vertices.len(), forest.base.vertices.len());
    prop_assert_eq!(&back.base.colours, &forest.base.colours);
    prop_assert_eq!(back.colours.len(), forest.colours.len());
    for (a, b) in std::iter::zip(&forest.base.vertices, &back.base.vertices) {
        prop_assert!(near(a.position, b.position) && alike(a.normal, b.normal));
    }
    let pairs = pairs(forest, &back);
    prop_assert_eq!(pairs.len(), forest.nodes.len());
    let twin: BTreeMap<_, _> = pairs.iter().copied().collect();
    let ranks = mergetree::ranks(forest).unwrap();
    for &(a, b) in &pairs {
        let [was, is] = [&forest.nodes[a.index()], &back.nodes[b.index()]];
        prop_assert_eq!(is.order, ranks[a.index()]);
        prop_assert_eq!(forest.colours.get(a.index()), back.colours.get(b.index()));
        prop_assert!(near(was.position, is.position));
        prop_assert!(alike(was.normal, is.normal));
        // Bounds hold what they held, with all that moved.
        let moved = f64::from(was.position.distance(is.position));
        prop_assert!(f64::from(is.radius) >= f64::from(was.radius) + moved);
        prop_assert!(is.cone_sine >= was.cone_sine);
        prop_assert!(f64::from(is.deviation) >= f64::from(was.deviation) + error);
        prop_assert!(f64::from(is.deviation) <= 1.13 * (f64::from(was.deviation) + error));
        for (was, is) in std::iter::zip(was.adjacent, is.adjacent) {
            let name = |h: Option<HalfEdgeId>, f: &Forest| h.map(|h| f.base.names().resolve(h));
            let expected = name(was, forest).map(|name| match name {
                HalfEdgeName::Node(id, k) => HalfEdgeName::Node(twin[&id], k),
                base => base,
            });
            prop_assert_eq!(name(is, &back), expected);
        }
    }
    Ok(())
}

fn compact(levels: u32, page_nodes: usize, position_error: PositionError) -> WriteOptions {
    let mut options = options(levels, page_nodes);
    options.encoding = Encoding::Compact;
    options.position_error = position_error;
    options
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn a_compact_forest_comes_back_within_its_bounds(
        open in any::<bool>(),
        size in 3u32..24,
        tries in 0usize..4000,
        seed in any::<u64>(),
        levels in 1u32..=5,
        page_nodes in 64usize..300,
        digits in 1i32..7,
    ) {
        let soup: Soup = if open { sheet(size) } else { torus(size) };
        let error = PositionError::OfDiagonal(10f64.powi(-digits));
        let forest = collapse(&soup, tries, seed);
        let forest = if seed % 2 == 0 { forest } else { coloured(forest) };
        check_compact(&forest, &compact(levels, page_nodes, error))?;
    }
}

#[test]
fn what_has_no_colour_pays_nothing_and_one_colour_little() {
    let plain = collapse(&torus(60), 100_000, 11);
    let mut grey = plain.clone();
    grey.colours = vec![[128, 128, 128, 255]; grey.nodes.len()];
    grey.base.colours = vec![[128, 128, 128, 255]; grey.base.vertices.len()];
    let folder = tempfile::tempdir().unwrap();
    for options in [WriteOptions::default(), compact(4, 1024, PositionError::default())] {
        let size = |forest: &Forest| {
            let report = write(forest, folder.path().join("x.xfm"), &options).unwrap();
            (report.bytes.colour, report.file_bytes, report.pages, report.bytes.header)
        };
        let (of_plain, of_grey) = (size(&plain), size(&grey));
        assert_eq!(of_plain.0, 0);
        assert_eq!(of_grey.3, of_plain.3 + 32);
        let more = of_grey.1 - of_plain.1;
        assert!(more <= 80 + 60 * of_grey.2, "{of_grey:?} {of_plain:?}");
    }
}

#[test]
fn smooth_colours_take_few_bits_where_they_are_compact() {
    let forest = coloured(collapse(&torus(100), 300_000, 7));
    let folder = tempfile::tempdir().unwrap();
    let options = compact(4, 1024, PositionError::default());
    let report = write(&forest, folder.path().join("x.xfm"), &options).unwrap();
    // Six bits of them are noise, eight where alpha is noise, too.
    let bits = 8.0 * report.bytes.colour as f64 / forest.nodes.len() as f64;
    assert!(bits < 19.0, "{bits}");
}

#[test]
fn colours_for_some_vertices_only_are_refused() {
    let forest = coloured(collapse(&torus(8), 500, 3));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let spoiled = [
        Forest { colours: forest.colours[1..].to_vec(), ..forest.clone() },
        Forest { base: BaseMesh { colours: Vec::new(), ..forest.base.clone() }, ..forest.clone() },
        Forest {
            base: BaseMesh { colours: vec![[0; 4]], ..forest.base.clone() },
            ..forest.clone()
        },
    ];
    for forest in spoiled {
        let error = write(&forest, &path, &WriteOptions::default()).unwrap_err();
        assert!(error.to_string().contains("colours"), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn errors_for_positions_are_taken_as_they_are_or_refused() {
    let forest = collapse(&torus(20), 2000, 3);
    check_compact(&forest, &compact(4, 1024, PositionError::Units(0.01))).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    for error in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for error in [PositionError::Units(error), PositionError::OfDiagonal(error)] {
            let error = write(&forest, &path, &compact(4, 1024, error)).unwrap_err();
            assert!(matches!(error, Error::PositionError { .. }), "{error}");
        }
    }
    // An f32 has no such grid.
    let error = write(&forest, &path, &compact(4, 1024, PositionError::OfDiagonal(1e-9)));
    assert!(error.unwrap_err().to_string().contains("too far from zero"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_same_forest_gives_the_same_compact_bytes() {
    let forest = collapse(&torus(60), 100_000, 11);
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, threads: usize| {
        let path = folder.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = compact(4, 1024, PositionError::default());
        pool.install(|| write(&forest, &path, &options)).unwrap();
        std::fs::read(path).unwrap()
    };
    assert!(bytes("a", 1) == bytes("b", 3));
}

#[test]
fn an_empty_forest_comes_back() {
    check(&Forest::default(), &WriteOptions::default()).unwrap();
    check_compact(&Forest::default(), &compact(4, 1024, PositionError::default())).unwrap();
}

#[test]
fn a_larger_forest_has_full_pages_and_short_paths() {
    let forest = collapse(&torus(100), 300_000, 7);
    assert!(forest.nodes.len() > 8_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("torus.xfm");
    let report = write(&forest, &path, &WriteOptions::default()).unwrap();
    assert!(report.pages <= forest.nodes.len() as u64 / 440, "{report:?}");
    let file = XfmFile::open(&path).unwrap();
    let pages_above = |mut block: BlockId| {
        let mut pages = vec![file.block_page(block).unwrap()];
        while let Some(parent) =
            file.read_page(pages[pages.len() - 1]).unwrap().block(block).unwrap().parent()
        {
            block = file.numbering().block(parent);
            let page = file.block_page(block).unwrap();
            if page != pages[pages.len() - 1] {
                pages.push(page);
            }
        }
        pages.len()
    };
    let deepest = (0..file.num_blocks()).step_by(97).map(|b| pages_above(BlockId::from_index(b)));
    let deepest = deepest.max().unwrap();
    assert!(deepest <= 12, "{deepest}");
}

#[test]
fn options_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    for bad in [options(0, 1024), options(6, 1024), options(4, 63), options(4, 65537)] {
        let error = write(&Forest::default(), &path, &bad).unwrap_err();
        assert!(matches!(error, Error::Option { .. }), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_is_no_forest_is_refused_and_leaves_the_old_file_alone() {
    let forest = collapse(&torus(8), 500, 3);
    let last = forest.nodes.len() - 1;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    std::fs::write(&path, "old").unwrap();
    type Spoil = fn(&mut Forest, usize);
    let spoils: [Spoil; 9] = [
        |f, last| f.nodes[last].position.x = f32::NAN,
        |f, last| f.nodes[last].radius = f32::INFINITY,
        |f, last| f.nodes[last].order = 0,
        |f, last| f.nodes[last].order = last as u32 + 1,
        |f, last| f.nodes[last].left = Some(mergetree::NodeId::from_index(last)),
        |f, last| f.nodes[last].right = Some(mergetree::NodeId::from_index(last + 1)),
        |f, _| f.base.vertices.iter_mut().for_each(|v| v.root = None),
        |f, last| f.nodes[last].adjacent[0] = Some(halfedge::HalfEdgeId::new(4_000_000_000)),
        |f, _| {
            let root = f.base.roots().next();
            f.base.vertices.iter_mut().for_each(|v| v.root = root);
        },
    ];
    for (number, spoil) in spoils.into_iter().enumerate() {
        let mut spoiled = forest.clone();
        spoil(&mut spoiled, last);
        let error = write(&spoiled, &path, &WriteOptions::default()).unwrap_err();
        assert!(matches!(error, Error::InvalidForest { .. }), "{number}: {error}");
    }
    let mut spoiled = forest.clone();
    spoiled.base.faces[0][1] = 10_000;
    let error = write(&spoiled, &path, &WriteOptions::default()).unwrap_err();
    assert!(matches!(error, Error::InvalidBase { .. }), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    write(&forest, &path, &WriteOptions::default()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    XfmFile::open(&path).unwrap();
}

#[test]
fn a_folder_that_is_not_there_is_an_error_of_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing").join("x.xfm");
    let error = write(&Forest::default(), &path, &WriteOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    let error = XfmFile::open(&path).unwrap_err();
    assert!(matches!(error, Error::Io { action: "open", .. }), "{error}");
}

#[test]
fn the_same_forest_gives_the_same_bytes() {
    let forest = collapse(&torus(60), 100_000, 11);
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str| {
        let path = folder.path().join(name);
        write(&forest, &path, &WriteOptions::default()).unwrap();
        std::fs::read(path).unwrap()
    };
    assert!(bytes("a") == bytes("b"));
}
