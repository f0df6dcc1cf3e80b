//! The example of FORMAT.md is a file, and what its text says of it is so.

use glam::Vec3;
use xfm_format::{FileWriter, Totals, WriteOptions, XfmFile, verify};

/// The bytes that stand in FORMAT.md: in lines of an offset and bytes, up to two spaces.
fn bytes_in_format_md() -> Vec<u8> {
    let text = include_str!("../FORMAT.md");
    let example = &text[text.find("## 9. A whole file").unwrap()..];
    let mut bytes = Vec::new();
    for line in example.lines() {
        let Some((offset, rest)) = line.strip_prefix("    ").and_then(|line| line.split_once(' '))
        else {
            continue;
        };
        let Ok(offset) = offset.parse::<usize>() else { continue };
        assert_eq!(offset, bytes.len(), "{line}");
        let hex = rest.trim_start();
        let hex = hex.split_once("  ").map_or(hex, |(hex, _)| hex);
        bytes.extend(hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()));
    }
    bytes
}

#[test]
fn the_bytes_of_the_example_are_a_file() {
    let bytes = bytes_in_format_md();
    assert_eq!(bytes.len(), 639);
    let file = XfmFile::from_storage(Box::new(bytes.clone()), "example.xfm").unwrap();
    assert!(verify(&file, |_| {}).is_ok());
    let page = file.read_page(0).unwrap();
    let found: Vec<_> = page
        .blocks()
        .flat_map(|block| (0..).zip(block.nodes).map(move |(slot, node)| (block.id, slot, node)))
        .map(|(block, slot, node)| {
            let link = |link: Option<mergetree::NodeId>| link.map(|id| id.get());
            (
                (file.numbering().node(block, slot).get(), node.order, node.position),
                [node.left, node.right, node.parent].map(link),
                node.adjacent.map(|h| h.map(|h| h.get())),
            )
        })
        .collect();
    let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let none = None;
    let expected = [
        ((0, 4, at(0.0, 0.0)), [Some(4), Some(1), none], [none, Some(0), none, none]),
        ((1, 2, at(1.0, 0.0)), [none, none, Some(0)], [Some(3), Some(29), none, none]),
        ((4, 3, at(1.0, 1.0)), [Some(5), Some(6), Some(0)], [none, Some(3), none, none]),
        ((5, 0, at(2.0, 1.0)), [none, none, Some(4)], [Some(10), Some(3), none, none]),
        ((6, 1, at(0.0, 1.0)), [none, none, Some(4)], [none, Some(28), none, none]),
    ];
    assert_eq!(found, expected);

    // And they are what is written.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("example.xfm");
    let mut options = WriteOptions::default();
    options.levels = 2;
    let header = file.header();
    let totals = Totals {
        nodes: 5,
        blocks: 2,
        pages: 1,
        input_triangles: 6,
        tree_depth: 3,
        bounds: header.bounds,
    };
    let mut writer = FileWriter::create(&path, &options, &totals, file.base()).unwrap();
    writer.write_pages(&[page]).unwrap();
    writer.finish().unwrap();
    assert!(std::fs::read(path).unwrap() == bytes);
}
