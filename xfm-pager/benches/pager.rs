//! How fast blocks come into memory, and how fast a front moves over them.
//!
//! An element is one node, or one split or collapse.

#[path = "../../mergetree/benches/common/mod.rs"]
mod common;

use std::hint::black_box;

use common::torus;
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use mergetree::{Dependencies, Front, NodeId, NodeStore, UpdateLimits};
use xfm_format::{WriteOptions, XfmFile};
use xfm_pager::{Pager, PagerOptions};

/// The file of a torus of 90,000 triangles.
fn bytes() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.xfm");
    xfm_format::write(&torus(300, 150), &path, &WriteOptions::default()).expect("written");
    std::fs::read(path).expect("read")
}

fn open(bytes: &[u8]) -> XfmFile {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "x.xfm").expect("a sound file")
}

fn request(c: &mut Criterion) {
    let bytes = bytes();
    let file = open(&bytes);
    let ids: Vec<NodeId> = (0..file.num_blocks() as u32)
        .map(|block| file.numbering().node(xfm_format::BlockId::new(block), 0))
        .collect();
    let mut group = c.benchmark_group("request");
    group.sample_size(20);
    group.throughput(Throughput::Elements(file.header().nodes));
    group.bench_function("every block", |b| {
        b.iter_batched(
            || Pager::new(open(&bytes), PagerOptions::default()).expect("room enough"),
            |mut pager| {
                ids.iter().for_each(|&id| assert!(pager.request(id, 1.0)));
                pager
            },
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

fn updates(c: &mut Criterion) {
    let mut pager = Pager::new(open(&bytes()), PagerOptions::default()).expect("room");
    let mut front = Front::new(&pager, Dependencies::Order).expect("a manifold");
    let mut there_and_back = |tolerance: f32| {
        let mut moved = 0;
        for tolerance in [tolerance, 2.0 * tolerance] {
            pager.begin_frame();
            let limits = UpdateLimits::with_tolerance(tolerance);
            let stats = front.update(&mut pager, |node| node.deviation, &limits);
            moved += stats.splits + stats.collapses;
        }
        moved
    };
    there_and_back(2e-4);
    let mut group = c.benchmark_group("update");
    group.throughput(Throughput::Elements(there_and_back(2e-4) as u64));
    group.bench_function("paged", |b| b.iter(|| there_and_back(black_box(2e-4))));
    group.finish();
}

criterion_group!(benches, request, updates);
criterion_main!(benches);
