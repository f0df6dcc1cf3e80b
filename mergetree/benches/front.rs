//! How fast a front moves: splits and collapses, and the view tests of all its nodes.
//!
//! An element is one split or collapse, or one node tested.

mod common;

use std::hint::black_box;

use common::torus;
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::vec3;
use mergetree::{Camera, Dependencies, Front, UpdateLimits, View};

/// To a deviation and back to twice as much.
fn updates(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    for (name, dependencies) in [("order", Dependencies::Order), ("links", Dependencies::Links)] {
        let mut forest = torus(400, 200);
        let mut front = Front::new(&forest, dependencies).expect("a manifold");
        let mut there_and_back = |tolerance: f32| {
            let mut moved = 0;
            for tolerance in [tolerance, 2.0 * tolerance] {
                let limits = UpdateLimits::with_tolerance(tolerance);
                let stats = front.update(&mut forest, |node| node.deviation, &limits);
                moved += stats.splits + stats.collapses;
            }
            moved
        };
        there_and_back(2e-4);
        group.throughput(Throughput::Elements(there_and_back(2e-4) as u64));
        group.bench_function(name, |b| b.iter(|| there_and_back(black_box(2e-4))));
    }
    group.finish();
}

/// Nothing but tests: the front is where it should be.
fn tests(c: &mut Criterion) {
    let mut forest = torus(400, 200);
    let mut front = Front::new(&forest, Dependencies::Order).expect("a manifold");
    let camera = Camera { eye: vec3(2.0, -2.0, 2.0), ..Camera::default() };
    let view = View::new(&camera);
    let limits = UpdateLimits::with_tolerance(0.05);
    front.update_view(&mut forest, &view, &limits);
    let tests = front.update_view(&mut forest, &view, &limits).tests;
    let mut group = c.benchmark_group("view test");
    group.throughput(Throughput::Elements(tests as u64));
    group.bench_function("front", |b| {
        b.iter(|| front.update_view(&mut forest, black_box(&view), &limits).tests);
    });
    group.finish();
}

/// From the coarsest mesh to the finest.
fn refinement(c: &mut Criterion) {
    let forest = torus(400, 200);
    let mut group = c.benchmark_group("refine");
    group.sample_size(10);
    group.throughput(Throughput::Elements(forest.nodes.len() as u64));
    group.bench_function("all", |b| {
        b.iter_batched(
            || forest.clone(),
            |mut forest| {
                let mut front = Front::new(&forest, Dependencies::Order).expect("a manifold");
                front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
                front
            },
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(benches, updates, tests, refinement);
criterion_main!(benches);
