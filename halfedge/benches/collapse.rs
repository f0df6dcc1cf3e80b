//! How fast half-edge collapses are checked, applied and taken back, all over a mesh of 200,000 triangles.
//!
//! Of the checks, an element is a half-edge; of the rest, a triangle that goes or comes back.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use halfedge::{Collapse, HalfEdgeId, HalfEdgeMesh};

const AROUND: u32 = 250;
const ALONG: u32 = 400;

/// Half-edges checked at a time.
const CHECKED: usize = 50_000;

/// Has no divisor in common with the number of half-edges; steps of it lead all over the mesh.
const STRIDE: usize = 370_879;

/// A torus of regular vertices.
fn torus() -> HalfEdgeMesh {
    let number = |i: u32, j: u32| (j % ALONG) * AROUND + i % AROUND;
    let cells = (0..ALONG).flat_map(|j| (0..AROUND).map(move |i| (i, j)));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|(i, j)| {
            let [a, b] = [number(i, j), number(i + 1, j)];
            let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    HalfEdgeMesh::from_triangles((AROUND * ALONG) as usize, &triangles).expect("a manifold")
}

/// All half-edges once, those of removed faces too, each far from the one before.
fn scattered(mesh: &HalfEdgeMesh) -> impl Iterator<Item = HalfEdgeId> + Clone + use<> {
    let len = 3 * mesh.face_capacity();
    (0..len).map(move |i| HalfEdgeId::from_index(i * STRIDE % len))
}

/// Collapses in the order they are met until `faces` are left, and returns them.
fn wear(mesh: &mut HalfEdgeMesh, faces: usize) -> Vec<Collapse> {
    let mut collapses = Vec::new();
    for h in scattered(mesh).cycle() {
        if mesh.num_faces() <= faces {
            break;
        }
        if let Ok(collapse) = mesh.check_collapse(h) {
            mesh.apply(&collapse);
            collapses.push(collapse);
        }
    }
    collapses
}

fn legal(mesh: &HalfEdgeMesh, half_edges: &[HalfEdgeId]) -> usize {
    half_edges.iter().filter(|&&h| mesh.check_collapse(h).is_ok()).count()
}

fn collapse(criterion: &mut Criterion) {
    let whole = torus();
    let mut worn = whole.clone();
    let collapses = wear(&mut worn, whole.num_faces() / 4);

    let mut group = criterion.benchmark_group("collapse");
    group.sample_size(20);
    for (name, mesh) in [("check_regular", &whole), ("check_irregular", &worn)] {
        let half_edges: Vec<HalfEdgeId> =
            scattered(mesh).filter(|h| mesh.has_face(h.face())).take(CHECKED).collect();
        group.throughput(Throughput::Elements(half_edges.len() as u64));
        group.bench_function(name, |b| b.iter(|| legal(black_box(mesh), &half_edges)));
    }
    group.throughput(Throughput::Elements((whole.num_faces() - worn.num_faces()) as u64));
    group.bench_function("apply", |b| {
        let apply = |mesh: &mut HalfEdgeMesh| collapses.iter().for_each(|c| mesh.apply(c));
        b.iter_batched_ref(|| whole.clone(), apply, BatchSize::LargeInput);
    });
    group.bench_function("undo", |b| {
        let undo = |mesh: &mut HalfEdgeMesh| collapses.iter().rev().for_each(|c| mesh.undo(c));
        b.iter_batched_ref(|| worn.clone(), undo, BatchSize::LargeInput);
    });
    group.finish();
}

criterion_group!(benches, collapse);
criterion_main!(benches);
