//! Meshes to decimate, and what is asked of the result.
#![allow(dead_code)]

use std::collections::{HashMap, HashSet};
use std::f32::consts::TAU;

use glam::{Vec3, vec3};
use mesh_io::{Error, Triangle, TriangleSink, TriangleSource};
use stream_decimate::{DecimateOptions, DecimateReport, StreamDecimator, Target};

/// Keeps what is written.
#[derive(Default)]
pub struct Kept(pub Vec<Triangle>);

impl TriangleSink for Kept {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
        self.0.extend_from_slice(triangles);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        Ok(())
    }
}

/// Triangles of which nothing is known before they are read.
pub struct Pipe(pub Vec<Triangle>, pub usize);

impl TriangleSource for Pipe {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let batch = &self.0[self.1..(self.1 + max).min(self.0.len())];
        out.extend_from_slice(batch);
        self.1 += batch.len();
        Ok(batch.len())
    }

    fn triangle_count(&self) -> Option<u64> {
        None
    }
}

/// A grid of quadrilaterals, cut in two each; columns and rows may close on themselves.
pub fn grid(
    columns: usize,
    rows: usize,
    closed: [bool; 2],
    at: impl Fn(usize, usize) -> Vec3,
) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let corner = |i: usize, j: usize| {
                let column = if closed[0] { (column + i) % columns } else { column + i };
                let row = if closed[1] { (row + j) % rows } else { row + j };
                at(column, row)
            };
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    triangles
}

/// A bumpy torus, closed, of genus one, ring after ring.
pub fn torus(around: usize, along: usize) -> Vec<Triangle> {
    grid(around, along, [true, true], |i, j| {
        let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / along as f32);
        let r = 1.0 + 0.05 * (7.0 * u).sin() * (11.0 * v).cos();
        let ring = 3.0 + r * u.cos();
        vec3(ring * v.cos(), ring * v.sin(), r * u.sin())
    })
}

/// A wavy sheet, with square holes if asked for.
pub fn sheet(size: usize, holes: bool) -> Vec<Triangle> {
    let all = grid(size, size, [false, false], |i, j| {
        let (x, y) = (i as f32 / size as f32, j as f32 / size as f32);
        vec3(x, y, 0.03 * (9.0 * x).sin() * (8.0 * y).cos())
    });
    let in_hole = |index: usize| {
        let (column, row) = (index / 2 % size, index / 2 / size);
        holes && (1..4).contains(&(column % 6)) && (1..4).contains(&(row % 6))
    };
    all.into_iter().enumerate().filter(|(i, _)| !in_hole(*i)).map(|(_, t)| t).collect()
}

/// Vertices, edges by their two ends with the triangles on either side, triangles.
pub struct Counted {
    pub vertices: usize,
    pub edges: usize,
    pub triangles: usize,
    pub boundary: usize,
    pub bad_edges: usize,
}

impl Counted {
    pub fn euler(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.triangles as i64
    }
}

/// Counts a soup whose vertices are the places of its corners.
pub fn count(triangles: &[Triangle]) -> Counted {
    let mut vertices = HashSet::new();
    let mut edges: HashMap<[[u32; 3]; 2], [u32; 2]> = HashMap::new();
    for triangle in triangles {
        let corners = triangle.map(|c| (c + Vec3::ZERO).to_array().map(f32::to_bits));
        vertices.extend(corners);
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let sides = edges.entry(if a < b { [a, b] } else { [b, a] }).or_default();
            sides[usize::from(a < b)] += 1;
        }
    }
    Counted {
        vertices: vertices.len(),
        edges: edges.len(),
        triangles: triangles.len(),
        boundary: edges.values().filter(|s| s[0] + s[1] == 1).count(),
        bad_edges: edges.values().filter(|s| s[0] > 1 || s[1] > 1).count(),
    }
}

pub fn options(ratio: f64, buffer: usize) -> DecimateOptions {
    let mut options = DecimateOptions::new(Target::Ratio(ratio));
    options.buffer_triangles = buffer;
    options
}

/// Pushes all triangles, some at a time.
pub fn decimate(
    triangles: &[Triangle],
    options: &DecimateOptions,
) -> (Vec<Triangle>, DecimateReport) {
    let mut kept = Kept::default();
    let mut decimator = StreamDecimator::new(options, None).unwrap();
    for batch in triangles.chunks(777) {
        decimator.push(batch, &mut kept).unwrap();
    }
    let report = decimator.finish(&mut kept).unwrap();
    assert_eq!(report.input_triangles, triangles.len() as u64);
    assert_eq!(report.output_triangles, kept.0.len() as u64);
    (kept.0, report)
}
