//! A mesh as plain lists, read from and written to text without the crates under test.

use std::collections::HashMap;

/// A mesh as OBJ text tells it.
pub struct Mesh {
    pub positions: Vec<[f64; 3]>,
    pub faces: Vec<[usize; 3]>,
}

impl Mesh {
    pub fn parse(obj: &str) -> Self {
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for line in obj.lines() {
            let mut words = line.split_whitespace();
            let kind = words.next();
            let words: Vec<&str> = words.collect();
            match kind {
                Some("v") => positions.push([0, 1, 2].map(|i| words[i].parse().expect("a number"))),
                Some("f") => faces.push([0, 1, 2].map(|i| words[i].parse().expect("an index"))),
                _ => {}
            }
        }
        Self { positions, faces: faces.iter().map(|f: &[usize; 3]| f.map(|v| v - 1)).collect() }
    }

    pub fn read(path: &str) -> Self {
        Self::parse(&std::fs::read_to_string(path).expect("the output is there"))
    }

    /// As binary STL.
    pub fn stl(&self) -> Vec<u8> {
        let mut stl = vec![0; 80];
        stl.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            stl.extend([0; 12]);
            for v in face {
                stl.extend(self.positions[*v].iter().flat_map(|&x| (x as f32).to_le_bytes()));
            }
            stl.extend([0; 2]);
        }
        stl
    }

    pub fn obj(&self) -> String {
        let mut obj = String::new();
        for [x, y, z] in &self.positions {
            obj += &format!("v {x} {y} {z}\n");
        }
        for [a, b, c] in self.faces.iter().map(|face| face.map(|v| v + 1)) {
            obj += &format!("f {a} {b} {c}\n");
        }
        obj
    }

    /// As PLY with doubles.
    pub fn ply(&self) -> String {
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.faces.len()
        );
        for [x, y, z] in &self.positions {
            ply += &format!("{x} {y} {z}\n");
        }
        for [a, b, c] in &self.faces {
            ply += &format!("3 {a} {b} {c}\n");
        }
        ply
    }

    /// The faces in an order without any locality.
    pub fn shuffled(mut self) -> Self {
        let count = self.faces.len();
        let mut state = 1_u64;
        for i in (1..count).rev() {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            self.faces.swap(i, (state >> 33) as usize % (i + 1));
        }
        self
    }

    pub fn moved(mut self, by: [f64; 3]) -> Self {
        for position in &mut self.positions {
            *position = [0, 1, 2].map(|axis| position[axis] + by[axis]);
        }
        self
    }

    /// The Euler number, if each edge has one face on each side.
    pub fn closed_euler(&self) -> Option<i64> {
        let mut edges = HashMap::new();
        for [a, b, c] in &self.faces {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        let closed =
            edges.iter().all(|(&(a, b), &count)| count == 1 && edges.contains_key(&(b, a)));
        let mut used: Vec<usize> = self.faces.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let (v, e, f) = (used.len() as i64, edges.len() as i64 / 2, self.faces.len() as i64);
        closed.then_some(v - e + f)
    }
}
