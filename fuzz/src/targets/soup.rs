//! Triangle soups from bytes: a shape, and injuries to it. Most bytes make a mesh that most code runs on.

use std::collections::HashMap;
use std::f32::consts::TAU;

use glam::{Vec3, vec3};
use mesh_io::{Error, IndexedMesh, Triangle, TriangleSource};

/// Coordinates that arithmetic may not expect.
const NASTY: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e30,
    -1e30,
    f32::MAX,
    f32::MIN,
    1e-40,
    f32::MIN_POSITIVE,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    16_777_217.0,
    1e-20,
];

/// A mesh and what it was made of.
#[derive(Clone, Debug, Default)]
pub struct Soup {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Numbers for whatever else there is to choose.
    pub choices: [u8; 4],
}

impl Soup {
    /// A bumpy torus of so many triangles or a few more.
    pub fn torus(triangles: usize) -> Self {
        let rows = (triangles / 4).isqrt().max(3);
        let columns = triangles.div_ceil(2 * rows).max(3);
        Self::grid([columns, rows], [true, true])
    }

    fn grid([columns, rows]: [usize; 2], closed: [bool; 2]) -> Self {
        let (nx, ny) = (columns + usize::from(!closed[0]), rows + usize::from(!closed[1]));
        let place = |i: usize| {
            let [u, v] = [(i % nx) as f32 / columns as f32, (i / nx) as f32 / rows as f32];
            let [a, b] = [u * TAU, v * TAU];
            let r = 1.0 + 0.05 * (3.0 * a).sin() * (2.0 * b).cos();
            match closed {
                [true, true] => {
                    vec3((3.0 + r * b.cos()) * a.cos(), (3.0 + r * b.cos()) * a.sin(), r * b.sin())
                }
                [true, false] => vec3(r * a.cos(), r * a.sin(), 4.0 * v),
                _ => vec3(4.0 * u, 3.0 * v, 0.3 * r * a.sin()),
            }
        };
        let id = |x: usize, y: usize| ((y % ny) * nx + x % nx) as u32;
        let mut soup = Self { positions: (0..nx * ny).map(place).collect(), ..Self::default() };
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            soup.triangles.extend([[a, b, c], [a, c, d]]);
        }
        soup
    }

    /// Choices, a shape with its size, and injuries of four bytes each.
    pub fn of(bytes: &[u8]) -> Self {
        let byte = |at: usize| bytes.get(at).copied().unwrap_or(0);
        let size = [usize::from(byte(5) % 40) + 3, usize::from(byte(6) % 24) + 3];
        let mut soup = match byte(4) % 6 {
            0 | 1 => Self::grid(size, [true, true]),
            2 => Self::grid(size, [false, false]),
            3 => Self::grid(size, [true, false]),
            4 => Self { positions: vec![Vec3::ZERO; 8], ..Self::default() },
            _ => {
                let mut two = Self::grid(size, [true, true]);
                two.append(&Self::grid([size[1], 4], [false, false]), 0.25);
                two
            }
        };
        soup.choices = [0, 1, 2, 3].map(byte);
        for &injury in bytes.get(7..).unwrap_or_default().as_chunks::<4>().0.iter().take(600) {
            soup.injure(injury);
        }
        soup.triangles.truncate(6000);
        soup
    }

    fn append(&mut self, other: &Self, shift: f32) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| p + shift));
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    fn injure(&mut self, [what, a, b, c]: [u8; 4]) {
        let (vertices, triangles) = (self.positions.len(), self.triangles.len());
        let wide = usize::from(a) << 8 | usize::from(b);
        let v = wide % vertices.max(1);
        let t = wide % triangles.max(1);
        let axis = usize::from(c % 3);
        let triangle = self.triangles.get(t).copied();
        match (what % 18, triangle) {
            (0, _) => self.positions[v][axis] = NASTY[usize::from(c >> 4)],
            (1, _) => self.positions[v] = self.positions[usize::from(c) % vertices],
            (2, _) => self.positions[v] += f32::from(c as i8) / 32.0,
            (3, Some(triangle)) => self.triangles.push(triangle),
            (4, Some([x, y, z])) => self.triangles.push([x, z, y]),
            (5, Some([x, y, z])) => self.triangles[t] = [x, z, y],
            (6, Some(_)) => drop(self.triangles.swap_remove(t)),
            (7, Some([x, ..])) => {
                // Two vertices become one in name.
                let other = usize::from(c) % vertices;
                self.triangles
                    .iter_mut()
                    .flatten()
                    .filter(|w| **w == x)
                    .for_each(|w| *w = other as u32);
            }
            (8, Some(_)) => self.triangles[t][axis] = v as u32,
            (9, Some(_)) => {
                let middle = t.max(1).min(triangles - 1);
                self.triangles.rotate_left(middle);
            }
            (10, Some(_)) => {
                // As far out of order as can be.
                let step = usize::from(c) + 2;
                let old = std::mem::take(&mut self.triangles);
                for first in 0..step {
                    self.triangles.extend(old.iter().skip(first).step_by(step));
                }
            }
            (11, Some([x, y, _])) => {
                // A third sheet at an edge.
                self.positions.push(vec3(f32::from(a), f32::from(b), f32::from(c)) / 64.0);
                self.triangles.push([x, y, vertices as u32]);
            }
            (12, _) => {
                let by = [1e-30, 1e-20, 1e-3, 1e3, 1e20, 1e30][usize::from(c) % 6];
                self.positions.iter_mut().for_each(|p| *p *= by);
            }
            (13, _) => {
                let by = [1.0, 1e3, 1e6, 1e9, 1e30][usize::from(c) % 5];
                self.positions.iter_mut().for_each(|p| *p += by);
            }
            (14, _) => self.positions.iter_mut().for_each(|p| p[axis] = 0.0),
            (15, _) => {
                let grain = f32::from(b.max(1)) / 16.0;
                self.positions.iter_mut().for_each(|p| *p = (*p / grain).round() * grain);
            }
            (16, Some(_)) if triangles < 2000 => {
                // A fan around one vertex.
                let first = vertices as u32;
                let spokes = u32::from(c) + 3;
                self.positions.extend((0..spokes).map(|i| {
                    let angle = TAU * i as f32 / spokes as f32;
                    vec3(angle.cos(), angle.sin(), 0.1 * (5.0 * angle).sin())
                }));
                let corner = |i: u32| first + i % spokes;
                self.triangles.extend((0..spokes).map(|i| [v as u32, corner(i), corner(i + 1)]));
            }
            _ => {
                let at = |i: u8| u32::from(i) % vertices as u32;
                self.triangles.push([at(a), at(b), at(c)]);
            }
        }
    }

    /// As a mesh whose vertices have numbers.
    pub fn mesh(&self) -> IndexedMesh {
        IndexedMesh {
            positions: self.positions.clone(),
            triangles: self.triangles.clone(),
            ..IndexedMesh::default()
        }
    }

    /// As triangles without numbers.
    pub fn corners(&self) -> Vec<Triangle> {
        self.mesh().to_soup()
    }

    /// Whether it is closed and every edge has exactly one triangle on either side, by the places of vertices; no triangle
    /// is without three places.
    pub fn is_watertight(&self) -> bool {
        is_watertight(&self.corners())
    }
}

/// Whether every directed edge, by the places of its ends, has exactly one reverse.
pub fn is_watertight(triangles: &[Triangle]) -> bool {
    let mut edges: HashMap<[[u32; 3]; 2], [u32; 2]> = HashMap::new();
    for triangle in triangles {
        if !triangle.iter().all(|corner| corner.is_finite()) {
            return false;
        }
        let corners = triangle.map(|c| (c + Vec3::ZERO).to_array().map(f32::to_bits));
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            if a == b {
                return false;
            }
            let sides = edges.entry(if a < b { [a, b] } else { [b, a] }).or_default();
            sides[usize::from(a < b)] += 1;
        }
    }
    edges.values().all(|sides| *sides == [1, 1])
}

/// Triangles that come once, of which nothing is known before.
#[derive(Clone, Debug)]
pub struct Pipe {
    triangles: Vec<Triangle>,
    next: usize,
}

impl Pipe {
    pub fn new(triangles: Vec<Triangle>) -> Self {
        Self { triangles, next: 0 }
    }
}

impl TriangleSource for Pipe {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let end = self.next.saturating_add(max).min(self.triangles.len());
        let batch = &self.triangles[self.next..end];
        out.extend_from_slice(batch);
        self.next = end;
        Ok(batch.len())
    }

    fn triangle_count(&self) -> Option<u64> {
        None
    }
}

/// Cases to begin with: every shape, whole, with choices, and with some injuries.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for shape in 0..6u8 {
        for (choices, size, injuries) in [
            ([0, 3, 40, 0], [20, 10], &[][..]),
            ([1, 9, 200, 5], [37, 21], &[3, 0, 5, 0, 4, 0, 9, 0]),
            ([2, 20, 10, 8], [9, 9], &[11, 0, 3, 77, 1, 0, 4, 30, 0, 0, 7, 0xd1]),
            ([3, 1, 90, 77], [30, 4], &[10, 0, 0, 6, 17, 1, 2, 3, 17, 3, 2, 1]),
            ([7, 4, 60, 33], [12, 12], &[16, 0, 5, 90, 6, 0, 90, 0, 6, 0, 40, 0]),
        ] {
            seeds.push([&choices[..], &[shape], &size, injuries].concat());
        }
    }
    seeds
}
