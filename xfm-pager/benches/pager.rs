//! How fast blocks come into memory: a page read and inflated, and blocks handed over.
//!
//! An element is one node.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::{Vec3, vec3};
use halfedge::HalfEdgeMesh;
use mergetree::{BuildOptions, Dependencies, Front, NodeId, NodeStore, UpdateLimits};
use xfm_format::{Encoding, Page, WriteOptions, XfmFile};
use xfm_pager::{Pager, PagerOptions};

/// The file of a torus of 2 · 300 · 150 bumpy triangles.
fn bytes(encoding: Encoding) -> Vec<u8> {
    let (n, m) = (300, 150);
    let positions: Vec<Vec3> = (0..n * m)
        .map(|i| {
            let [a, b] =
                [(i % n, n), (i / n, m)].map(|(i, n)| i as f32 / n as f32 * std::f32::consts::TAU);
            let r = 1.0 + (0.4 + 0.02 * (15.0 * a).sin() * (9.0 * b).cos()) * b.cos();
            vec3(r * a.cos(), r * a.sin(), 0.4 * b.sin())
        })
        .collect();
    let at = |x: u32, y: u32| (y % m) * n + x % n;
    let triangles: Vec<[u32; 3]> = (0..n * m)
        .flat_map(|i| {
            let (x, y) = (i % n, i / n);
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles).expect("a torus");
    let forest =
        mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ()).expect("few nodes");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.xfm");
    let mut options = WriteOptions::default();
    options.encoding = encoding;
    xfm_format::write(&forest, &path, &options).expect("written");
    std::fs::read(path).expect("read")
}

fn open(bytes: &[u8]) -> XfmFile {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "x.xfm").expect("a sound file")
}

fn inflate(c: &mut Criterion) {
    let mut group = c.benchmark_group("inflate");
    for (name, encoding) in [("exact", Encoding::Exact), ("compact", Encoding::Compact)] {
        let file = open(&bytes(encoding));
        let mut reader = file.page_reader().expect("a reader");
        let mut page = Page::new();
        let mut number = 0;
        group.throughput(Throughput::Elements(file.header().nodes / file.num_pages() as u64));
        group.bench_function(name, |b| {
            b.iter(|| {
                number = (number + 7) % file.num_pages();
                file.read_page_into(black_box(number), &mut reader, &mut page).expect("sound");
                page.nodes().len()
            });
        });
    }
    group.finish();
}

fn request(c: &mut Criterion) {
    let bytes = bytes(Encoding::Exact);
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
    let mut pager =
        Pager::new(open(&bytes(Encoding::Exact)), PagerOptions::default()).expect("room");
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

criterion_group!(benches, inflate, request, updates);
criterion_main!(benches);
