//! Small meshes to test on: closed, open and with handles.
#![allow(dead_code, reason = "every test file uses a part")]

/// A triangle list and the number of its vertices.
#[derive(Clone, Debug)]
pub struct Shape {
    pub name: &'static str,
    pub num_vertices: usize,
    pub triangles: Vec<[u32; 3]>,
    /// Vertices − edges + faces.
    pub euler: i64,
}

fn shape(name: &'static str, num_vertices: usize, triangles: Vec<[u32; 3]>, euler: i64) -> Shape {
    Shape { name, num_vertices, triangles, euler }
}

/// A grid of `nx × ny` quads; `wrap` joins its opposite sides.
pub fn grid(nx: u32, ny: u32, wrap_x: bool, wrap_y: bool) -> (usize, Vec<[u32; 3]>) {
    let cols = if wrap_x { nx } else { nx + 1 };
    let rows = if wrap_y { ny } else { ny + 1 };
    let id = |x: u32, y: u32| (y % rows) * cols + x % cols;
    let mut triangles = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            if (x + y) % 2 == 0 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    ((cols * rows) as usize, triangles)
}

pub fn octahedron() -> Shape {
    let t = vec![
        [0, 1, 2],
        [0, 2, 3],
        [0, 3, 4],
        [0, 4, 1],
        [5, 2, 1],
        [5, 3, 2],
        [5, 4, 3],
        [5, 1, 4],
    ];
    shape("octahedron", 6, t, 2)
}

/// An octahedron with every triangle cut into four, `times` times.
pub fn sphere(times: u32) -> Shape {
    let mut s = octahedron();
    for _ in 0..times {
        let mut middle = std::collections::BTreeMap::new();
        let mut next = s.num_vertices as u32;
        let mut mid = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                next += 1;
                next - 1
            })
        };
        let mut finer = Vec::new();
        for &[a, b, c] in &s.triangles {
            let [ab, bc, ca] = [mid(a, b), mid(b, c), mid(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        s = shape("sphere", next as usize, finer, 2);
    }
    s
}

pub fn all() -> Vec<Shape> {
    let (n, t) = grid(7, 5, true, true);
    let torus = shape("torus", n, t, 0);
    let (n, t) = grid(6, 6, false, false);
    let sheet = shape("sheet", n, t.clone(), 1);
    let (m, mut holed) = (n, t);
    // The two triangles of an inner quad go: an annulus.
    holed.drain(2 * (2 * 6 + 2)..2 * (2 * 6 + 2) + 2);
    let annulus = shape("annulus", m, holed, 0);
    let (n, t) = grid(8, 4, true, false);
    let tube = shape("tube", n, t, 0);
    // Two tori joined by cutting one triangle out of each and identifying the corners, one of them turned over.
    let (n, t) = grid(6, 6, true, true);
    let [a, b, c] = t[0];
    let mut double: Vec<[u32; 3]> = t[1..].to_vec();
    let joined = |v: u32| match v {
        v if v == a => a,
        v if v == b => b,
        v if v == c => c,
        v => v + n as u32,
    };
    double.extend(t[1..].iter().map(|&[x, y, z]| [joined(x), joined(z), joined(y)]));
    let double_torus = shape("double torus", 2 * n, double, -2);
    vec![octahedron(), sphere(2), torus, sheet, annulus, tube, double_torus]
}
