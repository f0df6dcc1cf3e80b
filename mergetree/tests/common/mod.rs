//! Small meshes with positions: closed, open, with handles.
#![allow(dead_code, reason = "every test file uses a part")]

use glam::{Vec3, vec3};
use halfedge::{HalfEdgeMesh, VertexId};
use mergetree::{
    CollapseRecord, Forest, OctNormal, RankAccount, Records, StarBounds, vertex_normals,
};

/// A mesh with positions.
#[derive(Clone, Debug)]
pub struct Shape {
    pub name: &'static str,
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    pub fn mesh(&self) -> HalfEdgeMesh {
        HalfEdgeMesh::from_triangles(self.positions.len(), &self.triangles).unwrap()
    }

    pub fn normals(&self) -> Vec<OctNormal> {
        vertex_normals(&self.mesh(), &self.positions)
    }
}

/// A grid of `nx × ny` quads through `place`, which takes shares of 0 to 1; `wrap` joins opposite sides.
pub fn grid(
    name: &'static str,
    [nx, ny]: [u32; 2],
    [wrap_x, wrap_y]: [bool; 2],
    place: impl Fn(f32, f32) -> Vec3,
) -> Shape {
    let cols = if wrap_x { nx } else { nx + 1 };
    let rows = if wrap_y { ny } else { ny + 1 };
    let id = |x: u32, y: u32| (y % rows) * cols + x % cols;
    let mut positions = Vec::new();
    for y in 0..rows {
        for x in 0..cols {
            positions.push(place(x as f32 / nx as f32, y as f32 / ny as f32));
        }
    }
    let mut triangles = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Shape { name, positions, triangles }
}

pub fn torus(nx: u32, ny: u32) -> Shape {
    grid("torus", [nx, ny], [true, true], |s, t| {
        let [a, b] = [s, t].map(|v| v * std::f32::consts::TAU);
        let r = 1.0 + (0.4 + 0.02 * (5.0 * a).sin() * (3.0 * b).cos()) * b.cos();
        vec3(r * a.cos(), r * a.sin(), 0.4 * b.sin())
    })
}

pub fn sheet(nx: u32, ny: u32) -> Shape {
    grid("sheet", [nx, ny], [false, false], |s, t| {
        vec3(s, t, 0.1 * (7.0 * s).sin() * (6.0 * t).cos())
    })
}

pub fn tube(nx: u32, ny: u32) -> Shape {
    grid("tube", [nx, ny], [true, false], |s, t| {
        let a = s * std::f32::consts::TAU;
        vec3(a.cos(), a.sin(), 3.0 * t) * (1.0 + 0.1 * (8.0 * t).sin())
    })
}

pub fn holed(n: u32) -> Shape {
    let mut s = sheet(n, n);
    s.name = "holed";
    let at = (2 * (n / 2 * n + n / 2)) as usize;
    s.triangles.drain(at..at + 2);
    s
}

pub fn sphere(times: u32) -> Shape {
    let mut positions = vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 1, 2],
        [1, 3, 2],
        [3, 4, 2],
        [4, 0, 2],
        [1, 0, 5],
        [3, 1, 5],
        [4, 3, 5],
        [0, 4, 5],
    ];
    for _ in 0..times {
        let mut middle = std::collections::BTreeMap::new();
        let mut mid = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let p = (positions[a as usize] + positions[b as usize]).normalize();
                positions.push(p);
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [mid(a, b), mid(b, c), mid(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Shape { name: "sphere", positions, triangles }
}

pub fn small() -> Vec<Shape> {
    vec![torus(9, 7), sheet(7, 6), tube(8, 6), holed(7), sphere(2)]
}

/// Collapses in a random order, as far as it goes: nothing but topology decides.
pub fn random_records(shape: &Shape, picks: &[prop::sample::Index]) -> Records {
    use halfedge::HalfEdgeId;
    let mut mesh = shape.mesh();
    let mut records = Vec::new();
    let mut ranks = RankAccount::default();
    let n = 3 * mesh.face_capacity();
    let mut perform = |mesh: &mut HalfEdgeMesh, h: HalfEdgeId| {
        if let Ok(c) = mesh.check_collapse(h) {
            let v = shape.positions[c.removed.index()];
            let radius = mesh
                .one_ring(c.removed)
                .map(|r| shape.positions[r.index()].distance(v))
                .fold(0.0, f32::max);
            let star = StarBounds { radius, cone_angle: 1.0, deviation: records.len() as f32 };
            let rank = Some(ranks.next(mesh, &c));
            records.push(CollapseRecord { rank, ..CollapseRecord::new(&c, star) });
            mesh.apply(&c);
        }
    };
    for pick in picks {
        perform(&mut mesh, HalfEdgeId::from_index(pick.index(n)));
    }
    for h in 0..n {
        perform(&mut mesh, HalfEdgeId::from_index(h));
    }
    Records { records, coarse: mesh }
}

use proptest::prelude::prop;

pub fn forest(shape: &Shape, records: &Records) -> Forest {
    Forest::from_records(&records.records, &records.coarse, &shape.positions, &shape.normals())
        .unwrap()
}

/// The specification of a front: the input's triangles with every vertex replaced by what it was merged into by the
/// collapses that are not split.
pub fn naive_mesh(shape: &Shape, records: &[CollapseRecord], split: &[bool]) -> Vec<[Vec3; 3]> {
    let mut merged: Vec<u32> = (0..shape.positions.len() as u32).collect();
    for (record, _) in records.iter().zip(split).filter(|(_, split)| !**split) {
        merged[record.removed.index()] = record.kept.get();
    }
    let find = |mut v: u32| {
        while merged[v as usize] != v {
            v = merged[v as usize];
        }
        v
    };
    let mut triangles: Vec<_> = shape
        .triangles
        .iter()
        .map(|t| t.map(find))
        .filter(|&[a, b, c]| a != b && b != c && c != a)
        .map(|t| canonical(t.map(|v| shape.positions[v as usize])))
        .collect();
    triangles.sort_by_key(|t| t.map(|p| p.to_array().map(f32::to_bits)));
    triangles
}

/// The triangles of a front, as [`naive_mesh`] gives them.
pub fn sorted_triangles((positions, triangles): (Vec<Vec3>, Vec<[u32; 3]>)) -> Vec<[Vec3; 3]> {
    let mut triangles: Vec<_> =
        triangles.iter().map(|t| canonical(t.map(|v| positions[v as usize]))).collect();
    triangles.sort_by_key(|t| t.map(|p| p.to_array().map(f32::to_bits)));
    triangles
}

fn canonical(t: [Vec3; 3]) -> [Vec3; 3] {
    let [a, b, c] = t;
    [[a, b, c], [b, c, a], [c, a, b]]
        .into_iter()
        .min_by_key(|t| t.map(|p| p.to_array().map(f32::to_bits)))
        .unwrap()
}

pub fn vertex(v: u32) -> VertexId {
    VertexId::new(v)
}
