//! How fast collapses are rated: eight sums of quadrics at once, and one after the other.
//!
//! An element is one sum of two quadrics with its minimum's cost.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{Vec3, vec3};
use qem::{Batch, ErrorMetric, LANES, Quadric};

/// Few enough to stay in the innermost cache, too many to be learnt by heart by a branch predictor.
const STARS: usize = 64;

/// A vertex's quadric, and those of its neighbours with where they lie as seen from it.
struct Star {
    center: Quadric,
    neighbours: [(Quadric, Vec3); LANES],
}

/// Stars of bumpy, nearly flat surfaces, every one another.
fn stars() -> Vec<Star> {
    let mut seed = 1u32;
    let mut number = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut point = move || vec3(number(), number(), 0.1 * number());
    let mut quadric = move || {
        let mut sum = Quadric::default();
        for _ in 0..6 {
            sum.merge(&Quadric::from_triangle([Vec3::ZERO, point(), point()]));
        }
        (sum, point())
    };
    (0..STARS)
        .map(|_| Star { center: quadric().0, neighbours: std::array::from_fn(|_| quadric()) })
        .collect()
}

fn at_once(stars: &[Star]) -> f32 {
    let mut least = f32::INFINITY;
    let mut batch = Batch::default();
    for star in stars {
        batch.clear();
        for (quadric, at) in &star.neighbours {
            batch.push(quadric, *at, 0.5 * *at);
        }
        least = batch.least_costs(&star.center).into_iter().fold(least, f32::min);
    }
    least
}

fn one_by_one(stars: &[Star]) -> f32 {
    let mut least = f32::INFINITY;
    for star in stars {
        for (quadric, at) in &star.neighbours {
            let mut sum = quadric.about(-*at);
            sum.merge(&star.center);
            least = least.min(sum.cost(sum.optimum(0.5 * *at)));
        }
    }
    least
}

fn rating(criterion: &mut Criterion) {
    let stars = stars();
    let mut group = criterion.benchmark_group("rating");
    group.throughput(Throughput::Elements((STARS * LANES) as u64));
    group.bench_function("at_once", |b| b.iter(|| at_once(black_box(&stars))));
    group.bench_function("one_by_one", |b| b.iter(|| one_by_one(black_box(&stars))));
    group.finish();
}

criterion_group!(benches, rating);
criterion_main!(benches);
