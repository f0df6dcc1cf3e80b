//! How fast triangles are read, and how fast meshes are decimated to a fiftieth by each of the methods.
//!
//! An element is an input triangle. Meshes lie in memory and the output is thrown away.

use std::env;
use std::f32::consts::TAU;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{BatchSize, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use glam::{Vec3, vec3};
use mesh_io::{Error, IndexedMesh, MeshSource, Triangle, TriangleSink};
use stream_decimate::{
    DecimateOptions, DecimateReport, Placement, Progress, StreamDecimator, Target,
    decimate_clustered, decimate_greedy,
};

const RATIO: f64 = 0.02;

/// What whole runs are measured for.
const SLOW: Duration = Duration::from_secs(4);

/// Triangles pushed at a time.
const BATCH: usize = 1 << 14;

/// The width of a patch with the gap beside it: a tenth of all edges are then on boundaries.
const PATCH: u32 = 13;

/// Throws away what is written.
struct Nowhere;

impl TriangleSink for Nowhere {
    fn write(&mut self, _: &[Triangle]) -> Result<(), Error> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        Ok(())
    }
}

/// Quadrilaterals cut in two, row after row.
fn grid(
    columns: u32,
    rows: u32,
    closed: bool,
    at: impl Fn(u32, u32) -> Vec3,
    there: impl Fn(u32, u32) -> bool,
) -> IndexedMesh {
    let (wide, high) = if closed { (columns, rows) } else { (columns + 1, rows + 1) };
    let number = |i: u32, j: u32| (j % high) * wide + i % wide;
    let mut mesh = IndexedMesh::default();
    mesh.positions.extend((0..wide * high).map(|v| at(v % wide, v / wide)));
    for (j, i) in (0..rows).flat_map(|j| (0..columns).map(move |i| (j, i))) {
        if there(i, j) {
            let [a, b] = [number(i, j), number(i + 1, j)];
            let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// A scanner's noise, from −1 to 1.
fn noise(i: u32, j: u32) -> f32 {
    let mut bits = i.wrapping_mul(0x9e37_79b1) ^ j.wrapping_mul(0x85eb_ca77);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    ((bits ^ (bits >> 15)) >> 8) as f32 / (1 << 23) as f32 - 1.0
}

/// A closed surface of `2 · around · along` triangles with bumps of several sizes and noise of a fiftieth of an edge.
fn torus(around: u32, along: u32) -> IndexedMesh {
    let at = |i: u32, j: u32| {
        let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / along as f32);
        let bumps = 0.08 * (7.0 * u).sin() * (11.0 * v).cos() + 0.02 * (23.0 * u + 31.0 * v).sin();
        let r = 1.0 + bumps + 0.02 * TAU / around as f32 * noise(i, j);
        let ring = 2.0 + r * u.cos();
        vec3(ring * v.cos(), ring * v.sin(), r * u.sin())
    };
    grid(around, along, true, at, |_, _| true)
}

/// A wavy sheet of `1.7 · size²` triangles in square patches that do not touch.
fn patches(size: u32) -> IndexedMesh {
    let at = |i: u32, j: u32| {
        let (x, y) = (i as f32 / size as f32, j as f32 / size as f32);
        let waves = 0.03 * (19.0 * x).sin() * (17.0 * y).cos();
        vec3(x, y, waves + 0.02 / size as f32 * noise(i, j))
    };
    grid(size, size, false, at, |i, j| i % PATCH != 0 && j % PATCH != 0)
}

/// A length along either side of a mesh: a fifth of it where each benchmark is just run once, to see that it works.
fn length(full: u32) -> u32 {
    if env::args().any(|argument| argument == "--bench") { full } else { full / 5 }
}

fn go_on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn options(buffer_triangles: usize) -> DecimateOptions {
    let mut options = DecimateOptions::new(Target::Ratio(RATIO));
    options.buffer_triangles = buffer_triangles;
    options.threads = Some(NonZeroUsize::MIN);
    options
}

fn decimator(options: &DecimateOptions) -> StreamDecimator {
    StreamDecimator::new(options, None).expect("good options")
}

fn push(decimator: &mut StreamDecimator, triangles: &[Triangle]) {
    for batch in triangles.chunks(BATCH) {
        decimator.push(batch, &mut Nowhere).expect("a sorted stream");
    }
}

fn stream(triangles: &[Triangle], options: &DecimateOptions) -> DecimateReport {
    let mut decimator = decimator(options);
    push(&mut decimator, triangles);
    let report = decimator.finish(&mut Nowhere).expect("a sorted stream");
    assert_eq!(report.missed, None);
    report
}

fn insertion(criterion: &mut Criterion) {
    let triangles = torus(length(250), length(400)).to_soup();
    let options = options(2 * triangles.len());
    let mut group = criterion.benchmark_group("insertion");
    group.sample_size(10).throughput(Throughput::Elements(triangles.len() as u64));
    group.bench_function("closed", |b| {
        let into = |decimator: &mut StreamDecimator| push(decimator, &triangles);
        b.iter_batched_ref(|| decimator(&options), into, BatchSize::PerIteration);
    });
    group.finish();
}

fn streams(criterion: &mut Criterion) {
    let closed = torus(length(250), length(400)).to_soup();
    let patches = patches(length(351)).to_soup();
    let whole = options(2 * closed.len());
    let eighth = options(closed.len() / 8);
    let mut two_threads = whole.clone();
    two_threads.threads = NonZeroUsize::new(2);
    let mut subset = whole.clone();
    subset.placement = Placement::Subset;

    let mut group = criterion.benchmark_group("stream");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).measurement_time(SLOW);
    for (name, triangles, options) in [
        ("whole", &closed, &whole),
        ("whole_two_threads", &closed, &two_threads),
        ("whole_subset", &closed, &subset),
        ("whole_patches", &patches, &whole),
        ("buffer_of_an_eighth", &closed, &eighth),
        ("buffer_of_an_eighth_patches", &patches, &eighth),
    ] {
        group.throughput(Throughput::Elements(triangles.len() as u64));
        group.bench_function(name, |b| b.iter(|| stream(triangles, options)));
    }
    group.finish();
}

fn in_core(criterion: &mut Criterion) {
    let mesh = torus(length(125), length(200));
    let options = DecimateOptions::new(Target::Ratio(RATIO));
    let mut group = criterion.benchmark_group("in_core");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).measurement_time(SLOW);
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    group.bench_function("greedy", |b| {
        b.iter(|| decimate_greedy(&mesh, &options, &mut go_on).expect("a mesh"));
    });
    group.bench_function("clustered", |b| {
        let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "torus")) as _);
        b.iter(|| decimate_clustered(&mut open, &options, &mut go_on).expect("a mesh"));
    });
    group.finish();
}

criterion_group!(benches, insertion, streams, in_core);
criterion_main!(benches);
