//! How fast collapses become a file: linking, numbering and writing.
//!
//! An element is a collapse. The collapses are those of a stream, and lie in memory; log and buckets do too.

#[path = "../tests/common/mod.rs"]
mod common;

use std::ops::ControlFlow;
use std::path::Path;

use common::{Sequence, link, plain, recycled, sweep, torus};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use xfm_build::{LinkOptions, Linked, NumberOptions, Numbered};

/// Quadrilaterals along each side; about as many collapses as quadrilaterals in all.
const SIDE: u32 = 200;

fn sequence() -> Sequence {
    let shape = torus(SIDE, SIDE);
    recycled(&plain(&shape, &sweep(&shape, 10_000, 4, 1)), 1)
}

fn linked(sequence: &Sequence, folder: &Path) -> Linked {
    link(sequence, folder, &LinkOptions::new(sequence.names)).expect("collapses of a mesh")
}

fn numbered(linked: Linked) -> Numbered {
    let go_on = &mut |_| ControlFlow::Continue(());
    linked.number(&NumberOptions::default(), go_on).expect("collapses of a mesh")
}

fn benches(criterion: &mut Criterion) {
    let sequence = sequence();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let folder = folder.path();
    let mut group = criterion.benchmark_group("link");
    group.throughput(Throughput::Elements(sequence.records.len() as u64));
    group.bench_function("link", |bencher| bencher.iter(|| linked(&sequence, folder)));
    group.bench_function("number", |bencher| {
        bencher.iter_batched(|| linked(&sequence, folder), numbered, BatchSize::LargeInput);
    });
    group.bench_function("write", |bencher| {
        bencher.iter_batched(
            || numbered(linked(&sequence, folder)),
            |numbered| numbered.write(folder.join("a.xfm"), &mut |_| ControlFlow::Continue(())),
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(link_group, benches);
criterion_main!(link_group);
