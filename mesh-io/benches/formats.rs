//! How fast triangles stream out of files of every format and into them, and how fast whole meshes are read and written.
//!
//! An element is a triangle. Files are read through the system's cache; what is written is thrown away.

use std::env;
use std::f32::consts::TAU;
use std::fs;
use std::io;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::vec3;
use mesh_io::{
    Format, IndexedMesh, Triangle, open_source_with, read_mesh, sink_to, write_mesh_as,
    write_mesh_to,
};

/// Triangles read or written at a time.
const BATCH: usize = 1 << 14;

const FORMATS: [(&str, Format); 6] = [
    ("stl", Format::StlBinary),
    ("stl_text", Format::StlAscii),
    ("ply", Format::PlyBinaryLittle),
    ("ply_text", Format::PlyAscii),
    ("obj", Format::Obj),
    ("glb", Format::Glb),
];

/// A torus of `2 · around · along` triangles, all of whose coordinates have as many digits as there are.
fn torus(around: u32, along: u32) -> IndexedMesh {
    let mut mesh = IndexedMesh::default();
    let number = |i: u32, j: u32| (j % along) * around + i % around;
    for (j, i) in (0..along).flat_map(|j| (0..around).map(move |i| (j, i))) {
        let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / along as f32);
        let ring = 2.0 + u.cos();
        mesh.positions.push(vec3(ring * v.cos(), ring * v.sin(), u.sin()));
        let [a, b] = [number(i, j), number(i + 1, j)];
        let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// 100,000 triangles; fewer where each benchmark is just run once, to see that it works.
fn mesh() -> IndexedMesh {
    if env::args().any(|argument| argument == "--bench") { torus(200, 250) } else { torus(20, 25) }
}

fn stream_out_of(file: &Path, format: Format, batch: &mut Vec<Triangle>) -> usize {
    let mut source = open_source_with(file, Some(format)).expect("a sound file");
    let mut triangles = 0;
    loop {
        batch.clear();
        match source.read(batch, BATCH).expect("a sound file") {
            0 => return triangles,
            count => triangles += count,
        }
    }
}

fn stream_into(format: Format, triangles: &[Triangle]) {
    let mut sink = sink_to(io::sink(), format).expect("a sink");
    for batch in triangles.chunks(BATCH) {
        sink.write(batch).expect("room for it");
    }
    sink.finish().expect("room for it");
}

fn streams(criterion: &mut Criterion) {
    let mesh = mesh();
    let triangles = mesh.to_soup();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let mut group = criterion.benchmark_group("read");
    group.sample_size(20).throughput(Throughput::Elements(triangles.len() as u64));
    for (name, format) in FORMATS {
        let file = folder.path().join(name);
        write_mesh_as(&file, Some(format), &mesh).expect("room for it");
        let mut batch = Vec::with_capacity(BATCH);
        assert_eq!(stream_out_of(&file, format, &mut batch), triangles.len());
        group.bench_function(name, |b| b.iter(|| stream_out_of(&file, format, &mut batch)));
    }
    group.finish();
    let mut group = criterion.benchmark_group("write");
    group.sample_size(20).throughput(Throughput::Elements(triangles.len() as u64));
    for (name, format) in FORMATS {
        group.bench_function(name, |b| b.iter(|| stream_into(format, &triangles)));
    }
    group.finish();
}

/// Meshes as a whole: corners are welded where the format has no vertices, unpacking and packing.
fn wholes(criterion: &mut Criterion) {
    let mesh = mesh();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let mut group = criterion.benchmark_group("whole");
    group.sample_size(20).throughput(Throughput::Elements(mesh.triangles.len() as u64));
    for name in ["read.stl", "read.ply", "read.obj.gz", "read.ply.zst"] {
        let file = folder.path().join(name);
        write_mesh_as(&file, None, &mesh).expect("room for it");
        assert!(fs::metadata(&file).is_ok_and(|file| file.len() > 0));
        group.bench_function(name, |b| b.iter(|| read_mesh(&file).expect("a sound file")));
    }
    for (name, format) in [("write.ply", Format::PlyBinaryLittle), ("write.obj", Format::Obj)] {
        group.bench_function(name, |b| {
            b.iter(|| write_mesh_to(io::sink(), format, &mesh).expect("room for it"));
        });
    }
    group.finish();
}

criterion_group!(benches, streams, wholes);
criterion_main!(benches);
