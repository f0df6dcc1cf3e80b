//! The example of FORMAT.md is a file, and what its text says of it is so.

use std::collections::BTreeMap;

use glam::Vec3;
use mergetree::BoundCodes;
use xfm_format::{
    Encoding, FileWriter, Numbering, Page, PositionError, Rounding, Totals, WriteOptions, XfmFile,
    verify,
};

/// The bytes that stand in FORMAT.md under a heading: in lines of an offset and bytes, up to two spaces.
fn bytes_under(heading: &str) -> Vec<u8> {
    let text = include_str!("../FORMAT.md");
    let example = &text[text.find(heading).unwrap() + heading.len()..];
    let mut bytes = Vec::new();
    for line in example.lines().take_while(|line| !line.starts_with('#')) {
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
    let bytes = bytes_under("## 10. A whole file");
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

/// The nodes of a page rounded, children before their parents.
fn rounded(page: &Page, rounding: Rounding, levels: u32) -> Page {
    let numbering = Numbering::new(levels);
    let mut nodes: BTreeMap<_, _> = page
        .blocks()
        .flat_map(|block| (0..).zip(block.nodes).map(move |(slot, node)| (block.id, slot, *node)))
        .map(|(block, slot, node)| (numbering.node(block, slot), node))
        .collect();
    let ids: Vec<_> = nodes.keys().copied().collect();
    for id in ids.into_iter().rev() {
        let mut node = nodes[&id];
        let bounded = |child| BoundCodes::of_node(&nodes[&child]).unwrap().of(&nodes[&child]);
        let children: Vec<_> = node.children().map(bounded).collect();
        rounding.round(&mut node, children).unwrap();
        nodes.insert(id, node);
    }
    let mut compact = Page::starting_at(page.first_block());
    for block in page.blocks() {
        let slots = 0..block.nodes.len() as u32;
        let of_block: Vec<_> = slots.map(|slot| nodes[&numbering.node(block.id, slot)]).collect();
        compact.push_block(&of_block);
    }
    compact
}

#[test]
fn the_bytes_of_the_compact_example_are_its_page() {
    let exact = bytes_under("## 10. A whole file");
    let file = XfmFile::from_storage(Box::new(exact), "example.xfm").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("example.xfm");
    let mut options = WriteOptions::default();
    options.levels = 2;
    options.encoding = Encoding::Compact;
    options.position_error = PositionError::Units(0.1);
    let rounding = options.rounding().unwrap();
    let page = rounded(&file.read_page(0).unwrap(), rounding, 2);
    let mut base = file.base().clone();
    for vertex in &mut base.vertices {
        vertex.position = rounding.position(vertex.position).unwrap();
        vertex.normal = rounding.normal(vertex.normal);
    }
    let header = file.header();
    let totals = Totals {
        nodes: 5,
        blocks: 2,
        pages: 1,
        input_triangles: 6,
        tree_depth: 3,
        bounds: header.bounds.map(|corner| rounding.position(corner).unwrap()),
    };
    let mut writer = FileWriter::create(&path, &options, &totals, &base).unwrap();
    writer.write_pages(std::slice::from_ref(&page)).unwrap();
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let compact = XfmFile::open(&path).unwrap();
    assert!(verify(&compact, |_| {}).is_ok());
    assert_eq!(compact.read_page(0).unwrap(), page);
    let end = bytes.len() - 32;
    let length = compact.page_bytes(0).unwrap() as usize;
    let found = &bytes[end - length..end];
    assert!(found == bytes_under("### The same page, compact"), "{}", in_lines(found));
}

fn in_lines(bytes: &[u8]) -> String {
    let line = |(at, bytes): (usize, &[u8])| {
        let bytes: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("    {:<5} {}\n", 16 * at, bytes.join(" "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}
