//! Files written page by page.

mod common;

use std::path::Path;

use common::{collapse, sheet, torus};
use glam::{DVec3, Vec3};
use halfedge::HalfEdgeId;
use mergetree::{Forest, Node, NodeId};
use proptest::prelude::*;
use xfm_format::{
    BlockId, Error, FileWriter, Page, Precision, Totals, WriteOptions, WriteReport, XfmFile,
    verify, write,
};

fn options(levels: u32) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = Some(64);
    options
}

fn written(forest: &Forest, path: &Path, levels: u32) -> XfmFile {
    write(forest, path, &options(levels)).unwrap();
    XfmFile::open(path).unwrap()
}

fn totals_of(file: &XfmFile) -> Totals {
    let header = file.header();
    Totals {
        nodes: header.nodes,
        blocks: header.blocks,
        pages: header.pages,
        input_triangles: header.input_triangles,
        tree_depth: header.tree_depth,
        bounds: header.bounds,
    }
}

fn pages_of(file: &XfmFile) -> Vec<Page> {
    (0..file.num_pages()).map(|number| file.read_page(number).unwrap()).collect()
}

/// Writes pages so many at a time.
fn write_pages(
    path: &Path,
    file: &XfmFile,
    totals: &Totals,
    pages: &[Page],
    at_once: usize,
) -> Result<WriteReport, Error> {
    let options = options(file.header().levels);
    let mut writer = FileWriter::create(path, &options, totals, file.base())?;
    for pages in pages.chunks(at_once) {
        writer.write_pages(pages)?;
    }
    writer.finish()
}

fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() })]

    #[test]
    fn pages_give_the_same_bytes_however_they_come(
        open in any::<bool>(),
        size in 3u32..24,
        tries in 0usize..4000,
        seed in any::<u64>(),
        levels in 1u32..=5,
        at_once in 1usize..200,
        threads in 1usize..4,
    ) {
        let soup = if open { sheet(size) } else { torus(size) };
        let forest = collapse(&soup, tries, seed);
        let folder = tempfile::tempdir().unwrap();
        let [whole, paged] = ["whole.xfm", "paged.xfm"].map(|name| folder.path().join(name));
        let file = written(&forest, &whole, levels);
        let pages = pages_of(&file);
        let report = with_threads(threads, || {
            write_pages(&paged, &file, &totals_of(&file), &pages, at_once)
        });
        let bytes = std::fs::read(&whole).unwrap();
        prop_assert!(bytes == std::fs::read(&paged).unwrap());
        prop_assert_eq!(report.unwrap().bytes, file.field_bytes().unwrap());
        prop_assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}

#[test]
fn a_file_does_not_depend_on_the_number_of_threads() {
    let forest = collapse(&torus(60), 100_000, 11);
    let folder = tempfile::tempdir().unwrap();
    let bytes = |threads: usize| {
        let path = folder.path().join(format!("{threads}.xfm"));
        with_threads(threads, || written(&forest, &path, 4));
        std::fs::read(path).unwrap()
    };
    let one = bytes(1);
    for threads in 2..6 {
        assert!(bytes(threads) == one, "{threads} threads");
    }
}

#[test]
fn origin_and_precision_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let forest = collapse(&sheet(5), 100, 1);
    assert_eq!(written(&forest, &path, 4).header().origin, DVec3::ZERO);
    let mut options = options(4);
    options.origin = DVec3::new(512_345.0, -5_403_210.5, 0.0);
    options.precision = Precision::Double;
    write(&forest, &path, &options).unwrap();
    let file = XfmFile::open(&path).unwrap();
    assert_eq!(file.header().origin, options.origin);
    assert_eq!(file.header().precision, Precision::Double);
    assert!(verify(&file, |_| {}).is_ok());
    options.origin.x = f64::INFINITY;
    let error = write(&forest, &path, &options).unwrap_err();
    assert!(error.to_string().contains("an origin that is not finite"), "{error}");
    assert_eq!(XfmFile::open(&path).unwrap().header().origin, file.header().origin);
}

#[test]
fn what_is_not_finished_leaves_nothing_and_the_old_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let file = written(&collapse(&torus(12), 1500, 3), &path, 3);
    let before = std::fs::read(&path).unwrap();
    let pages = pages_of(&file);
    let options = options(3);
    let create = || FileWriter::create(&path, &options, &totals_of(&file), file.base()).unwrap();
    let mut writer = create();
    writer.write_pages(&pages[..1]).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    drop(writer);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);

    let mut writer = create();
    writer.write_pages(&pages[..1]).unwrap();
    let error = writer.finish().unwrap_err();
    assert!(
        matches!(error, Error::WrongTotals { what: "pages", written: 1, stated, .. } if stated == pages.len() as u64),
        "{error}"
    );
    let mut writer = create();
    assert!(writer.write_pages(&pages[1..]).is_err());
    assert!(writer.write_pages(&pages).is_ok());
    let error = writer.finish().unwrap_err();
    assert!(error.to_string().contains("before failed"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert!(std::fs::read(&path).unwrap() == before);
}

#[test]
fn totals_that_are_not_those_of_the_pages_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let file = written(&collapse(&torus(12), 1500, 3), &path, 3);
    let pages = pages_of(&file);
    type Change = fn(&mut Totals);
    let changes: [(&str, Change); 9] = [
        ("blocks", |t| t.blocks += 1),
        ("blocks", |t| t.blocks -= 1),
        ("nodes", |t| t.nodes += 1),
        ("nodes", |t| t.nodes -= 1),
        ("pages", |t| t.pages += 1),
        ("pages", |t| t.pages -= 1),
        ("triangles", |t| t.input_triangles += 1),
        ("a depth of", |t| t.tree_depth = 0),
        ("a bounding box", |t| t.bounds[0].x = f32::NAN),
    ];
    for (message, change) in changes {
        let mut totals = totals_of(&file);
        change(&mut totals);
        let error = write_pages(&folder.path().join("y.xfm"), &file, &totals, &pages, 100);
        let error = error.unwrap_err().to_string();
        // With one node or block fewer than there are, a root or an order may be too large.
        let refused = ["root", "an order", "cannot be"].iter().any(|m| error.contains(m));
        assert!(error.contains(message) || refused, "{message}: {error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

/// The nodes of a page by block, to be changed and put together again.
fn rebuilt(page: &Page, change: impl FnOnce(&mut [Vec<Node>])) -> Page {
    let mut blocks: Vec<Vec<Node>> = page.blocks().map(|block| block.nodes.to_vec()).collect();
    change(&mut blocks);
    let mut page = Page::starting_at(page.first_block());
    for block in &blocks {
        page.push_block(block);
    }
    page
}

#[test]
fn pages_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let file = written(&collapse(&torus(12), 1500, 3), &path, 3);
    let page = file.read_page(0).unwrap();
    let numbering = file.numbering();
    let id = |block: usize, slot: u32| Some(numbering.node(BlockId::from_index(block), slot));
    // A block that hangs under another one of the page, and where; a block with more than one node.
    let below = page.blocks().position(|block| block.parent().is_some()).unwrap();
    let parent = page.blocks().nth(below).unwrap().parent().unwrap();
    let (above, slot) = (numbering.block(parent).index(), numbering.slot(parent) as usize);
    let inner = page.blocks().position(|block| block.nodes.len() > 1).unwrap();
    type Change<'a> = Box<dyn Fn(&mut [Vec<Node>]) + 'a>;
    let changes: Vec<(&str, Change<'_>)> = vec![
        ("no or too many nodes", Box::new(|b| b[0].clear())),
        ("no or too many nodes", Box::new(|b| b[0] = vec![b[0][0]; 8])),
        ("has a child that cannot be", Box::new(|b| b[1][0].left = id(0, 0))),
        ("has a child that cannot be", Box::new(|b| b[1][0].left = id(4000, 0))),
        ("has a child that cannot be", Box::new(|b| b[above][slot].left = id(below, 1))),
        ("does not know it", Box::new(|b| b[below][0].parent = id(0, 6))),
        ("does not come before", Box::new(|b| b[0][0].parent = id(0, 0))),
        ("does not come before", Box::new(|b| b[below][0].parent = id(below + 1, 0))),
        (
            "lacks a child inside it",
            Box::new(|b| {
                b[inner].pop();
            }),
        ),
        ("in the place", Box::new(|b| b[inner][1].parent = id(inner, 1))),
        (
            "does not know it",
            Box::new(|b| {
                let node = &mut b[above][slot];
                for link in [&mut node.left, &mut node.right] {
                    *link = link.filter(|&link| numbering.block(link).index() != below);
                }
            }),
        ),
        ("does not know its parent", Box::new(|b| b[below][0].parent = None)),
        ("not finite", Box::new(|b| b[0][0].position.y = f32::NAN)),
        ("no code", Box::new(|b| b[0][0].radius = b[0][0].radius.next_up())),
        ("no code", Box::new(|b| b[0][0].cone_sine = 2.0)),
        ("no code", Box::new(|b| b[0][0].deviation = -1.0)),
        ("an order", Box::new(|b| b[below][0].order = 100_000)),
        ("half-edge", Box::new(|b| b[0][0].adjacent[0] = Some(HalfEdgeId::new(2_000_000_000)))),
    ];
    let options = options(3);
    for (number, (message, change)) in changes.into_iter().enumerate() {
        let changed = rebuilt(&page, change);
        let mut totals = totals_of(&file);
        totals.nodes += 100;
        let out = folder.path().join("y.xfm");
        let mut writer = FileWriter::create(&out, &options, &totals, file.base()).unwrap();
        let error = writer.write_pages(&[changed]).unwrap_err();
        assert!(
            matches!(&error, Error::InvalidForest { message: m, .. } if m.contains(message)),
            "{number}: {error}"
        );
    }
}

#[test]
fn a_coarsest_mesh_or_a_size_that_cannot_be_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let file = written(&collapse(&torus(12), 1500, 3), &path, 3);
    let options = options(3);
    let totals = totals_of(&file);
    let mut base = file.base().clone();
    base.vertices[0].position = Vec3::INFINITY;
    let error = FileWriter::create(&path, &options, &totals, &base).unwrap_err();
    assert!(matches!(error, Error::InvalidBase { .. }), "{error}");
    for root in [1, 1 << 20] {
        let mut base = file.base().clone();
        base.vertices[0].root = Some(NodeId::new(root));
        let error = FileWriter::create(&path, &options, &totals, &base).unwrap_err();
        assert!(error.to_string().contains("does not begin a block"), "{error}");
    }
    let totals = Totals { blocks: 1 << 28, ..totals };
    let error = FileWriter::create(&path, &options, &totals, file.base()).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
}
