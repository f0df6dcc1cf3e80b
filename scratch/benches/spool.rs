//! How fast records go into a spool and come out of it, in memory and by way of a file, and how fast checkpoints are written
//! and read.
//!
//! An element is a record of 32 bytes, an item of a table, or 32 bytes of a checkpoint. The file is in the system's cache.

use std::env;
use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use scratch::{
    CheckpointReader, CheckpointWriter, Piece, Scratch, Spool, Store, StoreOptions, Table,
    TableOptions,
};

type Record = [u32; 8];

/// Has no divisor in common with the number of items of a table; steps of it lead all over.
const STRIDE: u64 = 370_879;

/// Records written and read; fewer where each benchmark is just run once, to see that it works.
fn records() -> u32 {
    if env::args().any(|argument| argument == "--bench") { 1 << 18 } else { 1 << 14 }
}

/// A store and a spool in it that is full.
struct Full {
    store: Store,
    spool: Spool<Record>,
    piece: Piece<Record>,
}

fn filled(scratch: &Scratch, memory_bytes: u64) -> Full {
    let mut options = StoreOptions::default();
    options.memory_bytes = memory_bytes;
    let mut store = Store::new(scratch, &options);
    let mut spool = Spool::new(&store);
    for i in 0..records() {
        spool.push(&mut store, &black_box([i; 8])).expect("room for it");
    }
    Full { store, spool, piece: Piece::default() }
}

/// Takes everything out, from the beginning or the end.
fn drain(full: &mut Full, first: bool) -> u32 {
    let Full { store, spool, piece } = full;
    let mut sum = 0u32;
    loop {
        let more =
            if first { spool.take_first(store, piece) } else { spool.take_last(store, piece) };
        if !more.expect("the file is there") {
            return sum;
        }
        sum = piece.items().iter().fold(sum, |sum, record| sum.wrapping_add(record[0]));
    }
}

fn spools(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let scratch = Scratch::new(folder.path());
    let mut group = criterion.benchmark_group("spool");
    group.sample_size(20).throughput(Throughput::Elements(records().into()));
    for (place, memory_bytes) in [("memory", u64::MAX), ("file", 0)] {
        group.bench_function(format!("push/{place}"), |b| {
            b.iter_with_large_drop(|| filled(&scratch, memory_bytes));
        });
        for (end, first) in [("first", true), ("last", false)] {
            group.bench_function(format!("take_{end}/{place}"), |b| {
                let full = || filled(&scratch, memory_bytes);
                b.iter_batched_ref(full, |full| drain(full, first), BatchSize::PerIteration);
            });
        }
    }
    group.finish();
}

/// Items asked for all over the table, as many as it has: all are in memory, or a half.
fn tables(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let scratch = Scratch::new(folder.path());
    let len = u64::from(records());
    let mut group = criterion.benchmark_group("table");
    group.sample_size(20).throughput(Throughput::Elements(len));
    // Near each other, as the items of a mesh are.
    let near = |i: u64| (i / 64 * STRIDE + i % 64) % len;
    for (name, share) in [("memory", 1), ("half_in_a_file", 2)] {
        let mut options = TableOptions::default();
        options.memory_bytes = len * size_of::<Record>() as u64 / share;
        let mut table = Table::<Record>::new(&scratch, len, &options);
        for i in 0..len {
            table.get_mut(i).expect("room for it")[0] = i as u32;
        }
        group.bench_function(name, |b| {
            b.iter(|| {
                let sum = |sum: u64, i| sum + u64::from(table.get(near(i)).expect("read")[0]);
                (0..len).fold(0, sum)
            });
        });
    }
    group.finish();
}

fn checkpoints(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let scratch = Scratch::new(folder.path());
    let items: Vec<Record> = (0..records()).map(|i| [i; 8]).collect();
    let write = || {
        let mut writer = CheckpointWriter::create(&scratch, "checkpoint").expect("a folder");
        writer.put("records", &items).expect("room for it");
        writer.finish().expect("room for it");
    };
    let read = || -> Vec<Record> {
        let reader = CheckpointReader::open(&scratch, "checkpoint").expect("a sound file");
        let mut reader = reader.expect("it is there");
        let mut items = Vec::new();
        reader.take("records", records().into(), &mut items).expect("a sound file");
        reader.finish().expect("a sound file");
        items
    };
    let mut group = criterion.benchmark_group("checkpoint");
    group.sample_size(10).throughput(Throughput::Elements(records().into()));
    group.bench_function("write", |b| b.iter(write));
    assert_eq!(read(), items);
    group.bench_function("read", |b| b.iter(read));
    group.finish();
}

criterion_group!(benches, spools, tables, checkpoints);
criterion_main!(benches);
