//! How fast changes of a mesh reach the device, and how fast a frame of 1280 × 720 pixels is drawn, by a driver that draws on
//! the processor: what is measured is the same on every machine. Where there is none, a line says so.
//!
//! Of an update, an element is a vertex or triangle that travels; of a frame, a triangle.

#[path = "../tests/common/mod.rs"]
mod common;

use std::env;
use std::ops::Range;

use common::{Chance, ball, camera, mesh_of, whole};
use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use vk_render::{
    Context, ContextOptions, DeviceChoice, MeshUpdate, Offscreen, Scene, Shading, Vertex,
};

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 720;

/// Ranges that change at once, and elements of each at most: about what a frame of a moving camera changes.
const RANGES: u32 = 500;
const LONGEST: u32 = 16;

/// Rings of the ball: 102,400 triangles, and fewer where each benchmark is just run once, to see that it works.
fn rings() -> u32 {
    if env::args().any(|argument| argument == "--bench") { 160 } else { 40 }
}

fn context() -> Option<Context> {
    let mut options = ContextOptions::default();
    options.device = DeviceChoice::Software;
    options.max_samples = 1;
    Context::new(&options)
        .inspect_err(|error| eprintln!("skipped, nothing can be drawn: {error}"))
        .ok()
}

/// Ranges all over an array, and how many elements are in them once those that overlap are one.
fn scattered(chance: &mut Chance, len: usize) -> (Vec<Range<u32>>, u64) {
    let ranges: Vec<Range<u32>> = (0..RANGES)
        .map(|_| {
            let start = chance.below(len as u32 - LONGEST);
            start..start + 1 + chance.below(LONGEST)
        })
        .collect();
    let mut changed = vec![false; len];
    ranges.iter().for_each(|r| changed[r.start as usize..r.end as usize].fill(true));
    let count = changed.iter().filter(|&&changed| changed).count();
    (ranges, count as u64)
}

fn updates(
    criterion: &mut Criterion,
    context: &Context,
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
) {
    let mut mesh = mesh_of(context, vertices, triangles);
    let mut chance = Chance::new(1);
    let (vertex_ranges, moved) = scattered(&mut chance, vertices.len());
    let (triangle_ranges, switched) = scattered(&mut chance, triangles.len());
    let all = [0..vertices.len() as u32, 0..triangles.len() as u32];
    let (all_vertices, all_triangles) = (&all[..1], &all[1..]);

    let mut group = criterion.benchmark_group("upload");
    group.sample_size(20);
    for (name, vertex_ranges, triangle_ranges, elements) in [
        ("scattered", &vertex_ranges[..], &triangle_ranges[..], moved + switched),
        ("all", all_vertices, all_triangles, (vertices.len() + triangles.len()) as u64),
    ] {
        let update = MeshUpdate { vertex_ranges, triangle_ranges, ..whole(vertices, triangles) };
        group.throughput(Throughput::Elements(elements));
        group.bench_function(name, |b| b.iter(|| mesh.update(&update).expect("an update")));
    }
    group.finish();
}

fn pictures(
    criterion: &mut Criterion,
    context: &Context,
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
) {
    let mesh = mesh_of(context, vertices, triangles);
    let mut group = criterion.benchmark_group("draw");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.throughput(Throughput::Elements(triangles.len() as u64));
    let mut target = Offscreen::new(context, WIDTH, HEIGHT).expect("a target");
    for (name, shading) in
        [("smooth", Shading::Smooth), ("level_of_detail", Shading::LevelOfDetail)]
    {
        let mut scene = Scene::new(&mesh, camera(WIDTH, HEIGHT));
        scene.shading = shading;
        group.bench_function(name, |b| b.iter(|| target.draw(&scene).expect("a picture")));
    }
    group.finish();
}

fn frame(criterion: &mut Criterion) {
    let Some(context) = context() else { return };
    let (vertices, triangles) = ball(rings());
    updates(criterion, &context, &vertices, &triangles);
    pictures(criterion, &context, &vertices, &triangles);
}

criterion_group!(benches, frame);
criterion_main!(benches);
