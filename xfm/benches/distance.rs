//! How fast the distance between two surfaces is measured, on one thread.
//!
//! An element is a point whose distance is taken: a sample, or a vertex.

use std::env;
use std::f64::consts::TAU;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use glam::{DVec3, dvec3};
use rayon::ThreadPoolBuilder;
use xfm::distance::{DistanceOptions, Surface, measure};

/// A torus of `4 · n²` triangles with bumps.
fn torus(n: u32) -> Surface {
    let (around, along) = (n, 2 * n);
    let mut positions: Vec<DVec3> = Vec::new();
    let mut triangles = Vec::new();
    let number = |i: u32, j: u32| (j % along) * around + i % around;
    for (j, i) in (0..along).flat_map(|j| (0..around).map(move |i| (j, i))) {
        let [u, v] = [(i, around), (j, along)].map(|(i, n)| TAU * f64::from(i) / f64::from(n));
        let r = 1.0 + 0.05 * (7.0 * u).sin() * (11.0 * v).cos();
        let ring = 2.0 + r * u.cos();
        positions.push(dvec3(ring * v.cos(), ring * v.sin(), r * u.sin()));
        let [a, b] = [number(i, j), number(i + 1, j)];
        let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    Surface::new(positions, triangles).expect("a surface")
}

/// A mesh and the same shape with a sixteenth of the triangles.
fn distance(criterion: &mut Criterion) {
    let bench = env::args().any(|argument| argument == "--bench");
    let (n, samples) = if bench { (160, 50_000) } else { (40, 1_000) };
    let (fine, coarse) = (torus(n), torus(n / 4));
    let options = DistanceOptions { samples, ..DistanceOptions::default() };
    // There are half as many vertices as triangles.
    let vertices = (fine.num_triangles() + coarse.num_triangles()) / 2;
    let pool = ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = criterion.benchmark_group("distance");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.throughput(Throughput::Elements((2 * samples + vertices) as u64));
    group.bench_function("both_ways", |b| {
        b.iter(|| pool.install(|| measure(&fine, &coarse, &options).expect("surfaces")));
    });
    group.finish();
}

criterion_group!(benches, distance);
criterion_main!(benches);
