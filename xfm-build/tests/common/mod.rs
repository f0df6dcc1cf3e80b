//! Small meshes, collapses of them, and ways to name their vertices and faces.
#![allow(dead_code, reason = "every test file uses a part")]

use std::ops::ControlFlow;
use std::path::Path;

use glam::{Vec3, vec3};
use halfedge::{FaceId, HalfEdgeId, HalfEdgeMesh, VertexId};
use mergetree::{
    BuildOptions, CollapseRecord, Colour, Forest, OctNormal, RankAccount, Records, StarBounds,
    collapse_in_independent_sets, vertex_normals,
};
use scratch::Scratch;
use xfm_build::{
    CoarseFace, CoarseMesh, CoarseVertex, Error, LinkOptions, Linked, Linker, NameBounds,
    NumberOptions,
};
use xfm_format::WriteReport;

/// Numbers that look random and are the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

/// A mesh with positions.
#[derive(Clone, Debug)]
pub struct Shape {
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

    /// Both, without anything in common.
    pub fn and(mut self, other: &Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| p + 10.0));
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        self
    }
}

/// A grid of `nx × ny` quads through `place`, which takes shares of 0 to 1; `wrap` joins opposite sides.
fn grid([nx, ny]: [u32; 2], wrap: [bool; 2], place: impl Fn(f32, f32) -> Vec3) -> Shape {
    let cols = nx + u32::from(!wrap[0]);
    let rows = ny + u32::from(!wrap[1]);
    let id = |x: u32, y: u32| (y % rows) * cols + x % cols;
    let at = |i: u32| place((i % cols) as f32 / nx as f32, (i / cols) as f32 / ny as f32);
    let quads = (0..nx * ny).map(|q| (q % nx, q / nx));
    let triangles = quads.flat_map(|(x, y)| {
        let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    Shape { positions: (0..cols * rows).map(at).collect(), triangles: triangles.collect() }
}

pub fn torus(nx: u32, ny: u32) -> Shape {
    grid([nx, ny], [true, true], |s, t| {
        let [a, b] = [s, t].map(|v| v * std::f32::consts::TAU);
        let r = 1.0 + (0.4 + 0.02 * (5.0 * a).sin() * (3.0 * b).cos()) * b.cos();
        vec3(r * a.cos(), r * a.sin(), 0.4 * b.sin())
    })
}

pub fn sheet(nx: u32, ny: u32) -> Shape {
    grid([nx, ny], [false, false], |s, t| vec3(s, t, 0.1 * (7.0 * s).sin() * (6.0 * t).cos()))
}

pub fn tube(nx: u32, ny: u32) -> Shape {
    grid([nx, ny], [true, false], |s, t| {
        let a = s * std::f32::consts::TAU;
        vec3(a.cos(), a.sin(), 3.0 * t) * (1.0 + 0.1 * (8.0 * t).sin())
    })
}

/// A subdivided octahedron.
pub fn sphere(times: u32) -> Shape {
    let mut positions = vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for [a, b] in [[0, 1], [1, 3], [3, 4], [4, 0]] {
        triangles.extend([[a, b, 2], [b, a, 5]]);
    }
    for _ in 0..times {
        let mut middle = std::collections::BTreeMap::new();
        let mut mid = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        let parts = triangles.iter().flat_map(|&[a, b, c]| {
            let [ab, bc, ca] = [mid(a, b), mid(b, c), mid(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        });
        triangles = parts.collect();
    }
    Shape { positions, triangles }
}

/// Collapses by independent sets, down to so many faces.
pub fn independent_sets(shape: &Shape, base_faces: usize) -> Records {
    let mut options = BuildOptions::default();
    options.base_faces = base_faces;
    collapse_in_independent_sets(
        shape.mesh(),
        &shape.positions,
        &shape.normals(),
        &options,
        &|_| (),
    )
}

/// Collapses at random places within a window that moves over the faces, as those of a stream: so many tries at each.
pub fn sweep(shape: &Shape, window: usize, tries: usize, seed: u64) -> Records {
    let mut mesh = shape.mesh();
    let mut random = Random(seed);
    let mut ranks = RankAccount::default();
    let mut records = Vec::new();
    for face in 0..mesh.face_capacity() {
        for _ in 0..tries {
            let of = face.saturating_sub(random.below(window));
            let h = FaceId::from_index(of).half_edge(random.below(3) as u32);
            let Ok(collapse) = mesh.check_collapse(h) else { continue };
            let at = |v: VertexId| shape.positions[v.index()];
            let v = collapse.removed;
            let radius = mesh.one_ring(v).map(|w| at(v).distance(at(w))).fold(0.0, f32::max);
            let cone_angle = 0.01 * random.below(30) as f32;
            let deviation = 0.001 * random.below(1000) as f32;
            let star = StarBounds { radius, cone_angle, deviation };
            let rank = Some(ranks.next(&mesh, &collapse));
            records.push(CollapseRecord { rank, ..CollapseRecord::new(&collapse, star) });
            mesh.apply(&collapse);
        }
    }
    Records { records, coarse: mesh }
}

/// What a linker is fed with.
#[derive(Clone, Debug)]
pub struct Sequence {
    pub names: NameBounds,
    pub records: Vec<(CollapseRecord, Vec3, OctNormal)>,
    /// Of the vertices that are removed, or none.
    pub colours: Vec<Colour>,
    pub coarse: CoarseMesh,
}

/// Names that are the numbers of the input.
pub fn plain(shape: &Shape, records: &Records) -> Sequence {
    let normals = shape.normals();
    let Records { records, coarse } = records;
    let of = |record: &CollapseRecord| {
        let v = record.removed.index();
        (*record, shape.positions[v], normals[v])
    };
    let vertices = coarse.vertices().map(|name| CoarseVertex {
        name,
        position: shape.positions[name.index()],
        normal: normals[name.index()],
    });
    let faces =
        coarse.faces().map(|name| CoarseFace { name, corners: coarse.corners(name).unwrap() });
    Sequence {
        names: NameBounds {
            vertices: coarse.vertex_capacity() as u32,
            faces: coarse.face_capacity() as u32,
        },
        records: records.iter().map(of).collect(),
        colours: Vec::new(),
        coarse: CoarseMesh {
            vertices: vertices.collect(),
            faces: faces.collect(),
            colours: Vec::new(),
        },
    }
}

/// Gives things names, and uses those again that are free.
#[derive(Default)]
struct Names {
    of: std::collections::BTreeMap<u32, u32>,
    free: Vec<u32>,
    bound: u32,
}

impl Names {
    fn of(&mut self, thing: u32, random: &mut Random) -> u32 {
        let Self { of, free, bound } = self;
        *of.entry(thing).or_insert_with(|| {
            if free.is_empty() {
                *bound += 1;
                *bound - 1
            } else {
                free.swap_remove(random.below(free.len()))
            }
        })
    }

    fn end(&mut self, thing: u32) {
        self.free.extend(self.of.remove(&thing));
    }
}

fn half_edges(record: &CollapseRecord) -> [Option<HalfEdgeId>; 6] {
    let [w, x, y, z] = record.adjacent;
    [Some(record.half_edge), record.reverse, w, x, y, z]
}

/// The same sequence with names that are used again: a vertex or face gets one when it is first spoken of, and loses it when
/// it is removed. Faces are turned as well, so that their first half-edge is another one; those that are left are not, as a
/// file shows how they are turned.
pub fn recycled(sequence: &Sequence, seed: u64) -> Sequence {
    let mut random = Random(seed);
    let (mut vertices, mut faces) = (Names::default(), Names::default());
    let left: std::collections::BTreeSet<u32> =
        sequence.coarse.faces.iter().map(|face| face.name.get()).collect();
    let turn = |f: u32| match left.contains(&f) {
        true => 0,
        false => (f.wrapping_mul(2_654_435_761) >> 16) % 3,
    };
    let rename_face = |h: HalfEdgeId, faces: &mut Names, random: &mut Random| {
        let f = h.face().get();
        FaceId::new(faces.of(f, random)).half_edge((h.corner() + turn(f)) % 3)
    };
    let mut records = Vec::new();
    for &(record, position, normal) in &sequence.records {
        let mut new = record;
        new.removed = VertexId::new(vertices.of(record.removed.get(), &mut random));
        new.kept = VertexId::new(vertices.of(record.kept.get(), &mut random));
        let [h, reverse, w, x, y, z] =
            half_edges(&record).map(|h| h.map(|h| rename_face(h, &mut faces, &mut random)));
        (new.half_edge, new.reverse) = (h.unwrap(), reverse);
        new.adjacent = [w, x, y, z];
        records.push((new, position, normal));
        vertices.end(record.removed.get());
        faces.end(record.half_edge.face().get());
        if let Some(reverse) = record.reverse {
            faces.end(reverse.face().get());
        }
    }
    let mut coarse = sequence.coarse.clone();
    for vertex in &mut coarse.vertices {
        vertex.name = VertexId::new(vertices.of(vertex.name.get(), &mut random));
    }
    for face in &mut coarse.faces {
        face.corners = face.corners.map(|v| VertexId::new(vertices.of(v.get(), &mut random)));
        face.name = FaceId::new(faces.of(face.name.get(), &mut random));
    }
    let names = NameBounds { vertices: vertices.bound, faces: faces.bound };
    Sequence { names, records, colours: sequence.colours.clone(), coarse }
}

/// A colour that tells where it belongs.
pub fn colour_at(p: Vec3) -> Colour {
    let mix = |hash: u32, c: &f32| (hash ^ c.to_bits()).wrapping_mul(0x9e37_79b1).rotate_left(9);
    p.to_array().iter().fold(7, mix).to_le_bytes()
}

/// The same sequence with colours.
pub fn coloured(mut sequence: Sequence) -> Sequence {
    sequence.colours = sequence.records.iter().map(|&(_, p, _)| colour_at(p)).collect();
    let vertices = &sequence.coarse.vertices;
    sequence.coarse.colours = vertices.iter().map(|v| colour_at(v.position)).collect();
    sequence
}

/// The same forest with colours.
pub fn coloured_forest(mut forest: Forest) -> Forest {
    forest.colours = forest.nodes.iter().map(|node| colour_at(node.position)).collect();
    forest.base.colours = forest.base.vertices.iter().map(|v| colour_at(v.position)).collect();
    forest
}

/// The forest of these records.
pub fn forest(shape: &Shape, records: &Records) -> Forest {
    Forest::from_records(&records.records, &records.coarse, &shape.positions, &shape.normals())
        .unwrap()
}

/// Links a sequence.
pub fn link(sequence: &Sequence, folder: &Path, options: &LinkOptions) -> Result<Linked, Error> {
    let mut linker = Linker::new(&Scratch::new(folder), options)?;
    for (i, (record, position, normal)) in sequence.records.iter().enumerate() {
        let colour = sequence.colours.get(i).copied();
        linker.push_with(record, *position, *normal, colour)?;
    }
    linker.finish(&sequence.coarse)
}

/// How much memory is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// So that nothing goes to the disk.
    Ample,
    /// As little as is possible at all.
    Least,
}

/// Links, numbers and writes a sequence. Returns what was written and the scratch space it took.
pub fn build(
    sequence: &Sequence,
    path: &Path,
    mut options: LinkOptions,
    memory: Memory,
) -> Result<(WriteReport, u64), Error> {
    let folder = path.parent().unwrap();
    if memory == Memory::Least {
        options.memory_bytes = options.least_memory_bytes();
    }
    let linked = link(sequence, folder, &options)?;
    let mut number = NumberOptions::default();
    if memory == Memory::Least {
        number.memory_bytes = linked.least_memory_bytes();
    }
    let numbered = linked.number(&number, &mut |_| ControlFlow::Continue(()))?;
    let scratch = numbered.scratch_bytes();
    Ok((numbered.write(path, &mut |_| ControlFlow::Continue(()))?, scratch))
}
