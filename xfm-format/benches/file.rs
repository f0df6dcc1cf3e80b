//! How fast files are written, opened, unpacked and verified, in both encodings.
//!
//! An element is one node. The file lies in memory, but where it is written.

#[path = "../../mergetree/benches/common/mod.rs"]
mod common;

use std::env;
use std::fs;
use std::hint::black_box;
use std::path::Path;

use common::torus;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use mergetree::Forest;
use xfm_format::{Encoding, Page, WriteOptions, XfmFile, verify, write};

const ENCODINGS: [(&str, Encoding); 2] =
    [("exact", Encoding::Exact), ("compact", Encoding::Compact)];

/// The forest of a torus of 90,000 triangles; of fewer where each benchmark is just run once, to see that it works.
fn forest() -> Forest {
    let bench = env::args().any(|argument| argument == "--bench");
    if bench { torus(300, 150) } else { torus(60, 30) }
}

fn write_to(path: &Path, forest: &Forest, encoding: Encoding) {
    let mut options = WriteOptions::default();
    options.encoding = encoding;
    write(forest, path, &options).expect("room for it");
}

fn open(bytes: &[u8]) -> XfmFile {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "x.xfm").expect("a sound file")
}

fn files(criterion: &mut Criterion) {
    let forest = forest();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    for (name, encoding) in ENCODINGS {
        let path = folder.path().join(name);
        write_to(&path, &forest, encoding);
        let bytes = fs::read(&path).expect("it was written");
        let file = open(&bytes);
        let nodes = file.header().nodes;

        let mut group = criterion.benchmark_group("file");
        group.sample_size(20).throughput(Throughput::Elements(nodes));
        group.bench_function(format!("write/{name}"), |b| {
            b.iter(|| write_to(&path, &forest, encoding));
        });
        // Header, coarsest mesh and index of pages, all checked.
        group.bench_function(format!("open/{name}"), |b| {
            b.iter(|| XfmFile::open(black_box(&path)).expect("a sound file"));
        });
        group.bench_function(format!("verify/{name}"), |b| {
            b.iter(|| assert!(verify(black_box(&file), |_| {}).is_ok()));
        });
        // What reading costs at least: the checksum of every byte.
        group.bench_function(format!("checksum/{name}"), |b| {
            b.iter(|| crc32fast::hash(black_box(&bytes)));
        });
        group.finish();
    }
}

/// One page after another, each far from the one before: read from memory, its checksum checked, unpacked.
fn inflate(criterion: &mut Criterion) {
    let forest = forest();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("x.xfm");
    let mut group = criterion.benchmark_group("inflate");
    for (name, encoding) in ENCODINGS {
        write_to(&path, &forest, encoding);
        let file = open(&fs::read(&path).expect("it was written"));
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

criterion_group!(benches, files, inflate);
criterion_main!(benches);
