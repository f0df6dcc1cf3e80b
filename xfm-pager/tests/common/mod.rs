//! Small files to page.
#![allow(dead_code, reason = "every test file uses a part")]

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use glam::Vec3;
use halfedge::HalfEdgeMesh;
use mergetree::{BuildOptions, Colour, Forest};
use xfm_format::{Encoding, Storage, WriteOptions, XfmFile};

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

/// The forest of a torus of `n × n` quads.
pub fn torus(n: u32) -> Forest {
    let angle = |i: u32| std::f32::consts::TAU * i as f32 / n as f32;
    let positions: Vec<Vec3> = (0..n * n)
        .map(|i| {
            let (u, v) = (angle(i % n), angle(i / n));
            let r = 2.0 + 0.7 * v.cos() + 0.05 * (9.0 * u).sin();
            Vec3::new(r * u.cos(), r * u.sin(), 0.7 * v.sin())
        })
        .collect();
    let id = |x: u32, y: u32| (y % n) * n + x % n;
    let triangles: Vec<[u32; 3]> = (0..n * n)
        .flat_map(|i| {
            let (x, y) = (i % n, i / n);
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles).unwrap();
    mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ()).unwrap()
}

/// A colour that tells where it belongs.
pub fn colour_at(p: Vec3) -> Colour {
    let mix = |hash: u32, c: &f32| (hash ^ c.to_bits()).wrapping_mul(0x9e37_79b1).rotate_left(9);
    p.to_array().iter().fold(7, mix).to_le_bytes()
}

/// The same forest with colours.
pub fn coloured(mut forest: Forest) -> Forest {
    forest.colours = forest.nodes.iter().map(|node| colour_at(node.position)).collect();
    forest.base.colours = forest.base.vertices.iter().map(|v| colour_at(v.position)).collect();
    forest
}

/// A forest as a file's bytes, in pages of so many nodes.
pub fn bytes(forest: &Forest, page_nodes: usize) -> Vec<u8> {
    encoded(forest, page_nodes, Encoding::Exact)
}

/// The same in the encoding compact.
pub fn compact_bytes(forest: &Forest, page_nodes: usize) -> Vec<u8> {
    encoded(forest, page_nodes, Encoding::Compact)
}

fn encoded(forest: &Forest, page_nodes: usize, encoding: Encoding) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let mut options = WriteOptions::default();
    options.page_nodes = Some(page_nodes);
    options.encoding = encoding;
    xfm_format::write(forest, &path, &options).unwrap();
    std::fs::read(path).unwrap()
}

pub fn open(bytes: &[u8]) -> XfmFile {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "x.xfm").unwrap()
}

/// Bytes that can be made to fail.
#[derive(Clone)]
pub struct Unreliable {
    bytes: Arc<Vec<u8>>,
    pub fails: Arc<AtomicBool>,
    pub reads: Arc<AtomicU64>,
}

impl Unreliable {
    pub fn new(bytes: Vec<u8>) -> Self {
        Self { bytes: Arc::new(bytes), fails: Arc::default(), reads: Arc::default() }
    }
}

impl Storage for Unreliable {
    fn len(&self) -> io::Result<u64> {
        Storage::len(&*self.bytes)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        self.reads.fetch_add(1, Relaxed);
        if self.fails.load(Relaxed) {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.bytes.read_at(offset, buffer)
    }
}
