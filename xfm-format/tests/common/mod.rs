//! Small forests to test on, of random legal collapses.
#![allow(dead_code, reason = "every test file uses a part")]

use std::collections::BTreeMap;

use glam::Vec3;
use halfedge::{HalfEdgeId, HalfEdgeMesh};
use mergetree::{CollapseRecord, Colour, Forest, HalfEdgeName, NodeId, OctNormal, StarBounds};

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
        (self.next() % end as u64) as usize
    }
}

/// Positions and triangles.
pub type Soup = (Vec<Vec3>, Vec<[u32; 3]>);

/// A closed torus of `n × n` quads.
pub fn torus(n: u32) -> Soup {
    let angle = |i: u32| std::f32::consts::TAU * i as f32 / n as f32;
    let positions = (0..n * n).map(|i| {
        let (u, v) = (angle(i % n), angle(i / n));
        let r = 2.0 + 0.7 * v.cos();
        Vec3::new(r * u.cos(), r * u.sin(), 0.7 * v.sin())
    });
    let id = |x: u32, y: u32| (y % n) * n + x % n;
    (positions.collect(), quads(n, n, id))
}

/// An open, wavy sheet of `n × n` quads.
pub fn sheet(n: u32) -> Soup {
    let m = n + 1;
    let positions = (0..m * m).map(|i| {
        let (x, y) = ((i % m) as f32, (i / m) as f32);
        Vec3::new(x, y, (0.7 * x).sin() * (0.5 * y).cos())
    });
    (positions.collect(), quads(n, n, |x, y| y * m + x))
}

fn quads(nx: u32, ny: u32, id: impl Fn(u32, u32) -> u32) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// Collapses a mesh at random, up to `tries` times.
pub fn collapse((positions, triangles): &Soup, tries: usize, seed: u64) -> Forest {
    let mut mesh = HalfEdgeMesh::from_triangles(positions.len(), triangles).unwrap();
    let mut random = Random(seed);
    let mut records = Vec::new();
    let mut deviation = 0.0;
    for _ in 0..tries {
        let h = HalfEdgeId::from_index(random.below(3 * mesh.face_capacity()));
        let Ok(collapse) = mesh.check_collapse(h) else { continue };
        let at = |v: halfedge::VertexId| positions[v.index()];
        let v = collapse.removed;
        let radius = mesh.one_ring(v).map(|w| at(v).distance(at(w))).fold(0.0, f32::max);
        deviation += 0.001;
        let cone_angle = 0.01 * random.below(30) as f32;
        records.push(CollapseRecord::new(&collapse, StarBounds { radius, cone_angle, deviation }));
        mesh.apply(&collapse);
    }
    let normals: Vec<_> = positions.iter().map(|&p| OctNormal::new(p)).collect();
    Forest::from_records(&records, &mesh, positions, &normals).unwrap()
}

/// The same with colours: smooth ones with some noise, and now and then a clear vertex.
pub fn coloured(mut forest: Forest) -> Forest {
    let colour = |at: Vec3| {
        let mut random = Random(at.to_array().map(|c| u64::from(c.to_bits())).iter().sum());
        let mut byte = |c: f32| (120.0 + 40.0 * c) as u8 ^ random.next() as u8 & 3;
        [byte(at.x), byte(at.y), byte(at.z), if at.x > 1.0 { 255 } else { byte(0.0) }]
    };
    forest.colours = forest.nodes.iter().map(|node| colour(node.position)).collect();
    forest.base.colours = forest.base.vertices.iter().map(|v| colour(v.position)).collect();
    forest
}

/// A forest without the names of its nodes: every link by the order of the node it leads to.
#[derive(Clone, Debug, PartialEq)]
pub struct Unnumbered {
    pub base: Vec<([u32; 3], OctNormal, Option<u32>)>,
    pub base_colours: Vec<Colour>,
    pub faces: Vec<[u32; 3]>,
    pub nodes: BTreeMap<u32, UnnumberedNode>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct UnnumberedNode {
    pub position: [u32; 3],
    pub normal: OctNormal,
    pub links: [Option<u32>; 3],
    pub colour: Option<Colour>,
    /// A half-edge of the coarsest mesh, or order and number of a node's.
    pub adjacent: [Option<(Option<u32>, u32)>; 4],
}

pub fn unnumbered(forest: &Forest) -> Unnumbered {
    let names = forest.base.names();
    let order = |id: NodeId| forest.nodes[id.index()].order;
    let bits = |p: Vec3| p.to_array().map(f32::to_bits);
    let vertices = forest.base.vertices.iter();
    Unnumbered {
        base: vertices.map(|v| (bits(v.position), v.normal, v.root.map(order))).collect(),
        base_colours: forest.base.colours.clone(),
        faces: forest.base.faces.clone(),
        nodes: forest
            .nodes
            .iter()
            .enumerate()
            .map(|(index, node)| {
                let adjacent = node.adjacent.map(|h| {
                    Some(match names.resolve(h?) {
                        HalfEdgeName::Base(h) => (None, h),
                        HalfEdgeName::Node(id, k) => (Some(order(id)), k),
                    })
                });
                let links = [node.left, node.right, node.parent].map(|link| link.map(order));
                let node_without_names = UnnumberedNode {
                    position: bits(node.position),
                    normal: node.normal,
                    colour: forest.colours.get(index).copied(),
                    links,
                    adjacent,
                };
                (node.order, node_without_names)
            })
            .collect(),
    }
}
