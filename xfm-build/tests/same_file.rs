//! Linking in a stream gives the file that linking in memory gives, byte for byte.

mod common;

use common::{
    Memory, Sequence, Shape, build, coloured, coloured_forest, forest, independent_sets, plain,
    recycled, sweep,
};
use common::{sheet, sphere, torus, tube};
use mergetree::{Forest, Node, Records};
use proptest::prelude::*;
use xfm_build::LinkOptions;
use xfm_format::{Encoding, PositionError, WriteOptions, XfmFile, verify, write};

fn write_options(levels: u32, page_nodes: usize) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = Some(page_nodes);
    options
}

/// Compares the file of a sequence of collapses, made in every way, with that of the forest in memory.
fn check(shape: &Shape, records: &Records, write_options: &WriteOptions, seed: u64) {
    let (forest, sequence) = (forest(shape, records), plain(shape, records));
    check_same(&forest, &sequence, write_options, seed);
    check_same(&coloured_forest(forest), &coloured(sequence), write_options, seed);
}

fn check_same(forest: &Forest, sequence: &Sequence, write_options: &WriteOptions, seed: u64) {
    let folder = tempfile::tempdir().unwrap();
    let expected_path = folder.path().join("expected.xfm");
    let expected_report = write(forest, &expected_path, write_options).unwrap();
    let expected = std::fs::read(&expected_path).unwrap();
    let file = XfmFile::open(&expected_path).unwrap();
    assert_eq!(verify(&file, |_| {}).errors, []);
    let again = recycled(sequence, seed);
    assert!(again.names.vertices <= sequence.names.vertices);
    for sequence in [sequence, &again] {
        for memory in [Memory::Ample, Memory::Least] {
            let path = folder.path().join("found.xfm");
            let mut options = LinkOptions::new(sequence.names);
            options.write = write_options.clone();
            options.colours = file.header().has_colour();
            let (report, scratch) = build(sequence, &path, options, memory).unwrap();
            assert_eq!(report, expected_report);
            if std::fs::read(&path).unwrap() != expected {
                // Which node is another says more than which byte.
                let found = XfmFile::open(&path).unwrap();
                assert_eq!(found.header(), file.header());
                assert_eq!(found.base(), file.base());
                for page in 0..file.num_pages() {
                    assert_eq!(found.read_page(page).unwrap(), file.read_page(page).unwrap());
                }
                panic!("the files differ, and what is in them does not");
            }
            let chunk = 4096;
            let node_bytes = if file.header().has_colour() { 64 } else { 60 };
            let log = node_bytes * sequence.records.len() as u64;
            match memory {
                Memory::Ample => assert_eq!(scratch, 0),
                Memory::Least => assert!(scratch + 2 * chunk >= log && scratch < log + 40 * chunk),
            }
        }
    }
    // Nothing but the two files is left.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn shapes_of_all_kinds_by_independent_sets() {
    let shapes = [
        torus(60, 50),
        sheet(50, 50),
        tube(40, 50),
        sphere(4),
        torus(20, 30).and(&sheet(30, 20)).and(&sphere(3)),
    ];
    for (shape, levels) in shapes.iter().zip(1..) {
        let records = independent_sets(shape, 8);
        check(shape, &records, &write_options(levels, 64), u64::from(levels));
        check(shape, &records, &WriteOptions::default(), 7);
    }
}

/// In memory bounds are those of a forest first, and rounded after that; so compact files differ in these.
#[test]
fn compact_files_are_the_same_however_they_are_linked() {
    let shape = torus(40, 30).and(&sheet(20, 20));
    let mut write_options = write_options(3, 128);
    write_options.encoding = Encoding::Compact;
    write_options.position_error = PositionError::Units(0.003);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    for records in [independent_sets(&shape, 8), sweep(&shape, 300, 3, 8)] {
        write(&forest(&shape, &records), &path, &write_options).unwrap();
        let in_memory = XfmFile::open(&path).unwrap();
        let sequence = plain(&shape, &records);
        let again = recycled(&sequence, 5);
        let mut first: Option<Vec<u8>> = None;
        for sequence in [&sequence, &again] {
            for memory in [Memory::Ample, Memory::Least] {
                let mut options = LinkOptions::new(sequence.names);
                options.write = write_options.clone();
                build(sequence, &path, options, memory).unwrap();
                let bytes = std::fs::read(&path).unwrap();
                assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes);
            }
        }
        let file = XfmFile::open(&path).unwrap();
        assert_eq!(verify(&file, |_| {}).errors, []);
        assert_eq!(file.base(), in_memory.base());
        for page in 0..file.num_pages() {
            let [found, expected] = [&file, &in_memory].map(|file| file.read_page(page).unwrap());
            for (found, expected) in found.nodes().iter().zip(expected.nodes()) {
                assert!(found.radius <= expected.radius && found.deviation <= expected.deviation);
                let Node { radius, cone_sine, deviation, .. } = *found;
                assert_eq!(*found, Node { radius, cone_sine, deviation, ..*expected });
            }
        }
    }
    // A share of a box that nobody knows yet.
    write_options.position_error = PositionError::default();
    let sequence = plain(&shape, &independent_sets(&shape, 8));
    let mut options = LinkOptions::new(sequence.names);
    options.write = write_options;
    let error = build(&sequence, &path, options, Memory::Ample).unwrap_err();
    assert!(error.to_string().contains("model units"), "{error}");
}

#[test]
fn collapses_that_follow_a_stream_use_few_names() {
    let shape = sheet(100, 100);
    let records = sweep(&shape, 400, 3, 5);
    assert!(records.records.len() > 8000);
    let sequence = recycled(&plain(&shape, &records), 9);
    assert!(sequence.names.vertices < 4000, "{:?}", sequence.names);
    check(&shape, &records, &write_options(4, 256), 9);
}

#[test]
fn a_mesh_without_a_collapse_and_one_without_anything() {
    let shape = sphere(1);
    let none = Records { records: Vec::new(), coarse: shape.mesh() };
    check(&shape, &none, &WriteOptions::default(), 1);
    let shape = Shape { positions: Vec::new(), triangles: Vec::new() };
    let none = Records { records: Vec::new(), coarse: shape.mesh() };
    check(&shape, &none, &WriteOptions::default(), 1);
}

fn shapes() -> impl Strategy<Value = Shape> {
    let size = || (3u32..20, 3u32..20);
    prop_oneof![
        size().prop_map(|(x, y)| torus(x, y)),
        size().prop_map(|(x, y)| sheet(x, y)),
        size().prop_map(|(x, y)| tube(x, y)),
        (0u32..4).prop_map(sphere),
        (size(), size()).prop_map(|((a, b), (c, d))| torus(a, b).and(&sheet(c, d))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_collapses_of_any_shape(
        shape in shapes(),
        window in 1usize..1000,
        tries in 0usize..4,
        seed: u64,
        levels in 1u32..=5,
    ) {
        let records = sweep(&shape, window, tries, seed);
        check(&shape, &records, &write_options(levels, 64), seed);
    }
}
