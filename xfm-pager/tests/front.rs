//! A front over a pager: the mesh is whole whatever is resident.

mod common;

use std::sync::atomic::Ordering::Relaxed;

use common::Unreliable;
use mergetree::{Dependencies, Forest, Front, NodeStore, UpdateLimits};
use xfm_format::XfmFile;
use xfm_pager::{Error, Pager, PagerOptions};

fn refine(pager: &mut Pager, front: &mut Front, tolerance: f32) {
    pager.begin_frame();
    front.update(pager, |node| node.deviation, &UpdateLimits::with_tolerance(tolerance));
    front.validate(pager).unwrap();
    pager.validate().unwrap();
}

/// A front with everything that the store gives.
fn full(store: &mut impl NodeStore) -> Front {
    let mut front = Front::new(store, Dependencies::Order).unwrap();
    front.update(store, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
    front
}

#[test]
fn full_refinement_gives_the_whole_mesh() {
    let mut forest = common::torus(40);
    let file = common::open(&common::bytes(&forest, 96));
    let mut pager = Pager::new(file, PagerOptions::default()).unwrap();
    let front = full(&mut pager);
    front.validate(&pager).unwrap();
    assert_eq!(front.num_triangles(), 2 * 40 * 40);
    assert_eq!(front.num_triangles(), full(&mut forest).num_triangles());
    let stats = pager.stats();
    assert_eq!(stats.resident_nodes, forest.nodes.len());
    assert_eq!(stats.total.loads + stats.total.read_ahead, pager.file().num_blocks() as u64);
    // Those with roots once more, at the beginning.
    assert!(stats.total.pages_inflated <= 2 * pager.file().num_pages() as u64);
}

#[test]
fn a_tight_quota_costs_detail_and_nothing_else() {
    let forest = common::torus(60);
    for forest in [common::coloured(forest.clone()), forest] {
        tighten(&forest);
    }
}

/// That every vertex in use has the colour that belongs to its place, if there are colours.
fn check_colours(front: &Front, has_colours: bool) {
    let (positions, _) = front.to_mesh();
    let expected: Vec<_> = match has_colours {
        true => positions.into_iter().map(common::colour_at).collect(),
        false => Vec::new(),
    };
    assert_eq!(front.to_colours(), expected);
}

fn tighten(forest: &Forest) {
    let has_colours = !forest.colours.is_empty();
    let bytes = common::bytes(forest, 96);
    let minimum = match Pager::new(common::open(&bytes), PagerOptions::with_quotas(0, 0)) {
        Err(Error::QuotaTooSmall { minimum, .. }) => minimum,
        other => panic!("{other:?}"),
    };
    let mut last = 0;
    for room in [0, 20_000, 60_000, 200_000, 1_000_000] {
        let options = PagerOptions::with_quotas(minimum + room / 2, minimum + room);
        let mut pager = Pager::new(common::open(&bytes), options).unwrap();
        let mut front = Front::new(&pager, Dependencies::Order).unwrap();
        for _ in 0..4 {
            refine(&mut pager, &mut front, 0.0);
        }
        check_colours(&front, has_colours);
        let fine = front.num_triangles();
        assert!(fine >= last, "{fine} triangles with {room} bytes, {last} with fewer");
        last = fine;
        // Back to the coarsest: what was used goes down to the soft quota, then up again to the same.
        for _ in 0..4 {
            refine(&mut pager, &mut front, f32::INFINITY);
        }
        assert!(pager.used_bytes() <= minimum + room / 2);
        for _ in 0..6 {
            refine(&mut pager, &mut front, 0.0);
        }
        assert!(front.num_triangles() * 10 >= fine * 9, "{} of {fine}", front.num_triangles());
        check_colours(&front, has_colours);
    }
    assert_eq!(last, 2 * 60 * 60);
}

#[test]
fn a_still_view_settles_and_loads_no_more() {
    let forest = common::torus(60);
    let bytes = common::bytes(&forest, 96);
    let options = PagerOptions::with_quotas(0, usize::MAX);
    let mut pager = Pager::new(common::open(&bytes), options).unwrap();
    let mut front = Front::new(&pager, Dependencies::Order).unwrap();
    for _ in 0..5 {
        refine(&mut pager, &mut front, 0.01);
    }
    for _ in 0..5 {
        refine(&mut pager, &mut front, 0.01);
        assert_eq!(pager.stats().frame.loads, 0);
        assert_eq!(pager.stats().frame.evictions, 0);
    }
}

fn damaged(forest: &Forest, page: usize) -> (Vec<u8>, XfmFile) {
    let mut bytes = common::bytes(forest, 96);
    let file = common::open(&bytes);
    let before: u64 = (0..page).map(|page| file.page_bytes(page).unwrap()).sum();
    let pages_at = u64::from_le_bytes(bytes[168..176].try_into().unwrap());
    bytes[(pages_at + before) as usize + 10] ^= 1;
    let file = common::open(&bytes);
    (bytes, file)
}

#[test]
fn a_damaged_page_costs_its_own_detail_and_is_named_once() {
    let forest = common::torus(40);
    let whole = 2 * 40 * 40;
    let num_pages = common::open(&common::bytes(&forest, 96)).num_pages();
    for page in 0..num_pages {
        let (_, file) = damaged(&forest, page);
        let mut pager = Pager::new(file, PagerOptions::default()).unwrap();
        let mut front = full(&mut pager);
        for _ in 0..3 {
            refine(&mut pager, &mut front, 0.0);
        }
        assert!(front.num_triangles() < whole);
        let pages: Vec<_> = pager.problems().iter().map(|problem| problem.page).collect();
        assert_eq!(pages, [page]);
        assert!(pager.problems()[0].error.to_string().contains(&format!("page {page} is damaged")));
    }
}

#[test]
fn storage_that_fails_for_a_while_is_tried_again_and_then_given_up() {
    let forest = common::torus(40);
    let storage = Unreliable::new(common::bytes(&forest, 96));
    let open = || XfmFile::from_storage(Box::new(storage.clone()), "x.xfm").unwrap();
    let mut pager = Pager::new(open(), PagerOptions::default()).unwrap();
    let mut front = Front::new(&pager, Dependencies::Order).unwrap();
    storage.fails.store(true, Relaxed);
    refine(&mut pager, &mut front, 0.0);
    assert!(pager.problems().is_empty());
    storage.fails.store(false, Relaxed);
    refine(&mut pager, &mut front, 0.0);
    assert_eq!(front.num_triangles(), 2 * 40 * 40);

    let mut pager = Pager::new(open(), PagerOptions::default()).unwrap();
    let mut front = Front::new(&pager, Dependencies::Order).unwrap();
    storage.fails.store(true, Relaxed);
    for _ in 0..5 {
        refine(&mut pager, &mut front, 0.0);
    }
    assert!(!pager.problems().is_empty());
    let reads = storage.reads.load(Relaxed);
    for problem in 0..pager.problems().len() {
        assert!(pager.problems()[problem].error.to_string().contains("cannot read"));
    }
    refine(&mut pager, &mut front, 0.0);
    assert_eq!(storage.reads.load(Relaxed), reads);
}

#[test]
fn roots_that_cannot_be_read_leave_the_coarsest_mesh() {
    let forest = common::torus(40);
    let storage = Unreliable::new(common::bytes(&forest, 96));
    let file = XfmFile::from_storage(Box::new(storage.clone()), "x.xfm").unwrap();
    storage.fails.store(true, Relaxed);
    let mut pager = Pager::new(file, PagerOptions::default()).unwrap();
    let mut front = Front::new(&pager, Dependencies::Order).unwrap();
    refine(&mut pager, &mut front, 0.0);
    assert_eq!(front.num_triangles(), forest.base.faces.len());
    storage.fails.store(false, Relaxed);
    refine(&mut pager, &mut front, 0.0);
    assert_eq!(front.num_triangles(), 2 * 40 * 40);
}
