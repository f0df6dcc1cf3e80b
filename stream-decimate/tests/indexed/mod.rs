//! Meshes in memory, and what is asked of the result.
#![allow(dead_code, reason = "every test file uses some of these")]

use std::collections::HashMap;
use std::f32::consts::TAU;

use glam::{Vec3, vec3};
use halfedge::HalfEdgeMesh;
use mesh_io::IndexedMesh;

/// What decimation has to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topology {
    pub euler: i64,
    pub boundary_loops: usize,
}

impl Topology {
    /// Of a mesh that has to be a manifold, whose every vertex is used.
    pub fn of(mesh: &IndexedMesh) -> Self {
        let count = mesh.positions.len();
        let halfedge = HalfEdgeMesh::from_triangles(count, &mesh.triangles).expect("a manifold");
        assert_eq!(halfedge.num_vertices(), count, "every vertex is used");
        let boundary: HashMap<u32, u32> = halfedge
            .half_edges()
            .filter(|&h| halfedge.reverse(h).is_none())
            .map(|h| (halfedge.start(h).get(), halfedge.end(h).get()))
            .collect();
        let edges = (3 * mesh.triangles.len() + boundary.len()) / 2;
        let mut open = boundary.clone();
        let mut boundary_loops = 0;
        while let Some(mut at) = open.keys().next().copied() {
            boundary_loops += 1;
            while let Some(next) = open.remove(&at) {
                at = next;
            }
        }
        let euler = count as i64 - edges as i64 + mesh.triangles.len() as i64;
        Self { euler, boundary_loops }
    }
}

/// Quadrilaterals cut in two, over a grid that closes on itself or does not.
fn grid(columns: u32, rows: u32, closed: bool, at: impl Fn(u32, u32) -> Vec3) -> IndexedMesh {
    let (wide, high) = if closed { (columns, rows) } else { (columns + 1, rows + 1) };
    let positions = (0..high).flat_map(|j| (0..wide).map(move |i| (i, j))).map(|(i, j)| at(i, j));
    let number = |i: u32, j: u32| (j % high) * wide + i % wide;
    let cells = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        let [a, b] = [number(i, j), number(i + 1, j)];
        let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    IndexedMesh {
        positions: positions.collect(),
        triangles: triangles.collect(),
        ..Default::default()
    }
}

/// A bumpy torus of `2 · around · along` triangles.
pub fn torus(around: u32, along: u32) -> IndexedMesh {
    grid(around, along, true, |i, j| {
        let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / along as f32);
        let r = 0.35 + 0.03 * (7.0 * u).sin();
        vec3((1.0 + r * v.cos()) * u.cos(), (1.0 + r * v.cos()) * u.sin(), r * v.sin())
    })
}

/// A bumpy square of `2 · size²` triangles, with a boundary.
pub fn bumpy_square(size: u32) -> IndexedMesh {
    grid(size, size, false, |i, j| {
        let (x, y) = (i as f32 / size as f32, j as f32 / size as f32);
        vec3(x, y, 0.1 * (5.0 * x).sin() * (4.0 * y).cos())
    })
}

/// The cube from −1 to 1, `2 · size²` triangles to a face; `size` has to be a power of two.
pub fn cube(size: u32) -> IndexedMesh {
    let face = grid(size, size, false, |i, j| {
        vec3(2.0 * i as f32 / size as f32 - 1.0, 2.0 * j as f32 / size as f32 - 1.0, 1.0)
    });
    let turn: [fn(Vec3) -> Vec3; 6] = [
        |p| p,
        |p| vec3(p.x, -p.y, -p.z),
        |p| vec3(p.z, p.x, p.y),
        |p| vec3(-p.z, p.x, -p.y),
        |p| vec3(p.y, p.z, p.x),
        |p| vec3(-p.y, -p.z, p.x),
    ];
    let mut number = HashMap::new();
    let mut mesh = IndexedMesh::default();
    for turn in turn {
        for triangle in &face.triangles {
            mesh.triangles.push(triangle.map(|v| {
                let p = turn(face.positions[v as usize]) + Vec3::ZERO;
                *number.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                    mesh.positions.push(p);
                    mesh.positions.len() as u32 - 1
                })
            }));
        }
    }
    mesh
}

/// The bits of all positions, sorted.
pub fn sorted_bits(positions: &[Vec3]) -> Vec<[u32; 3]> {
    let mut bits: Vec<_> = positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
    bits.sort_unstable();
    bits
}

/// The greatest distance from points spread over either surface to the other one.
pub fn distance_both_ways(a: &IndexedMesh, b: &IndexedMesh) -> f32 {
    farthest(a, b).max(farthest(b, a))
}

fn farthest(from: &IndexedMesh, to: &IndexedMesh) -> f32 {
    let to = to.to_soup();
    let mut most = 0.0f32;
    for [a, b, c] in from.to_soup() {
        // Corners, and for large triangles points between them.
        let size = (b - a).length().max((c - a).length());
        let n = (size / 0.1).ceil().clamp(1.0, 16.0) as u32;
        for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
            let p = a + (b - a) * (i as f32 / n as f32) + (c - a) * (j as f32 / n as f32);
            let nearest = to.iter().map(|&t| distance_to_triangle(p, t));
            most = most.max(nearest.fold(f32::INFINITY, f32::min));
        }
    }
    most
}

fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let normal = (b - a).cross(c - a);
    let inside = |from: Vec3, to: Vec3| (to - from).cross(p - from).dot(normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) && normal.length() > 0.0 {
        return ((p - a).dot(normal) / normal.length()).abs();
    }
    let to_segment = |a: Vec3, b: Vec3| {
        let length = (b - a).length_squared();
        let t = if length > 0.0 { ((p - a).dot(b - a) / length).clamp(0.0, 1.0) } else { 0.0 };
        p.distance(a + t * (b - a))
    };
    to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a))
}
