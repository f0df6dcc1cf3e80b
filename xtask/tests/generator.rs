//! Generated meshes are what they promise: closed, manifold, outward, of the asked size, repeatable.

use std::collections::HashMap;

use xtask::generate::{Generator, Options, Shape, Triangle};

type Bits = [u32; 3];

fn mesh(options: &Options) -> Vec<Triangle> {
    let generator = Generator::new(options).expect("valid options");
    let mut triangles = Vec::new();
    generator
        .triangles(&mut |chunk| {
            triangles.extend_from_slice(chunk);
            Ok(())
        })
        .expect("collecting cannot fail");
    assert_eq!(triangles.len() as u64, generator.num_triangles());
    triangles
}

/// What there is to know about a soup whose vertices are identified by their bits.
struct Topology {
    num_vertices: i64,
    num_edges: i64,
    num_boundary_edges: i64,
    num_faces: i64,
    /// Every directed edge at most once, and every vertex one fan of triangles.
    manifold: bool,
}

impl Topology {
    fn of(triangles: &[Triangle]) -> Self {
        let mut ids: HashMap<Bits, usize> = HashMap::new();
        let mut edges: HashMap<[usize; 2], usize> = HashMap::new();
        let mut manifold = true;
        let mut corners_at: HashMap<usize, usize> = HashMap::new();
        for (face, triangle) in triangles.iter().enumerate() {
            let v = triangle.map(|p| {
                let next = ids.len();
                *ids.entry(p.map(f32::to_bits)).or_insert(next)
            });
            for i in 0..3 {
                manifold &= v[i] != v[(i + 1) % 3];
                manifold &= edges.insert([v[i], v[(i + 1) % 3]], 3 * face + i).is_none();
                *corners_at.entry(v[i]).or_default() += 1;
            }
        }
        let boundary = edges.keys().filter(|[a, b]| !edges.contains_key(&[*b, *a])).count() as i64;
        // Each vertex has one fan: as many fans' ends as boundary, else the fan closes; walking the
        // fan of one corner must meet all corners of its vertex.
        let ends: Vec<[usize; 2]> = {
            let mut ends = vec![[0; 2]; 3 * triangles.len()];
            for (&edge, &h) in &edges {
                ends[h] = edge;
            }
            ends
        };
        let mut start: HashMap<usize, usize> = HashMap::new();
        for (h, &[a, b]) in ends.iter().enumerate() {
            if edges.contains_key(&[b, a]) {
                start.entry(a).or_insert(h);
            } else {
                // Nothing on the right of this edge: the fan starts here.
                start.insert(a, h);
            }
        }
        for (vertex, &first) in &start {
            let (mut h, mut met) = (first, 0);
            loop {
                met += 1;
                // The edge that comes into the vertex within the face, and its reverse.
                let previous = if h.is_multiple_of(3) { h + 2 } else { h - 1 };
                let [a, b] = ends[previous];
                match edges.get(&[b, a]) {
                    Some(&next) if next != first && met <= triangles.len() => h = next,
                    _ => break,
                }
            }
            manifold &= Some(&met) == corners_at.get(vertex);
        }
        Self {
            num_vertices: ids.len() as i64,
            num_edges: (edges.len() as i64 + boundary) / 2,
            num_boundary_edges: boundary,
            num_faces: triangles.len() as i64,
            manifold,
        }
    }

    fn euler(&self) -> i64 {
        self.num_vertices - self.num_edges + self.num_faces
    }
}

fn volume(triangles: &[Triangle]) -> f64 {
    let six = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|p| p.map(f64::from));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    six.sum::<f64>() / 6.0
}

fn options(shape: Shape, triangles: u64, seed: u64) -> Options {
    let mut options = Options::new(shape, triangles);
    options.seed = seed;
    options
}

const SHAPES: [Shape; 3] = [Shape::Scan, Shape::Torus, Shape::Isosurface];

#[test]
fn meshes_are_closed_manifold_and_outward() {
    for shape in SHAPES {
        for (triangles, seed) in [(200, 0), (1_000, 0), (5_002, 1), (20_000, 2), (50_000, 3)] {
            let mesh = mesh(&options(shape, triangles, seed));
            let topology = Topology::of(&mesh);
            let what = format!("{shape:?} {triangles}");
            assert!(topology.manifold, "{what}: manifold");
            assert_eq!(topology.num_boundary_edges, 0, "{what}: closed");
            assert!(volume(&mesh) > 0.0, "{what}: outward");
            match shape {
                Shape::Scan => assert_eq!(topology.euler(), 2, "{what}"),
                Shape::Torus => assert_eq!(topology.euler(), 0, "{what}"),
                Shape::Isosurface => assert_eq!(topology.euler() % 2, 0, "{what}"),
            }
        }
    }
}

#[test]
fn counts_are_as_near_as_promised() {
    for triangles in [1_000, 2_345, 10_000, 49_998, 50_000] {
        let count = |shape| {
            Generator::new(&options(shape, triangles, 0)).expect("valid options").num_triangles()
        };
        assert_eq!(count(Shape::Scan), triangles - triangles % 2);
        assert!(count(Shape::Torus).abs_diff(triangles) * 100 <= triangles, "torus of {triangles}");
        let isosurface = count(Shape::Isosurface);
        assert!(isosurface.abs_diff(triangles) * 10 <= triangles, "{isosurface} of {triangles}");
    }
}

#[test]
fn the_same_options_give_the_same_bits_and_another_seed_does_not() {
    for shape in SHAPES {
        let bits = |seed| {
            let mesh = mesh(&options(shape, 5_000, seed));
            mesh.as_flattened().as_flattened().iter().map(|c| c.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(1), bits(1), "{shape:?}");
        assert_ne!(bits(1), bits(2), "{shape:?}");
    }
}

#[test]
fn shuffling_changes_the_order_alone() {
    let sorted_bits = |mesh: &[Triangle]| {
        let mut bits: Vec<[Bits; 3]> =
            mesh.iter().map(|t| t.map(|p| p.map(f32::to_bits))).collect();
        bits.sort_unstable();
        bits
    };
    for shape in SHAPES {
        for holes in [0.0, 0.1] {
            let mut plain = options(shape, 30_000, 4);
            plain.holes = holes;
            let mut shuffled = plain.clone();
            shuffled.shuffle = true;
            let [plain, shuffled] = [mesh(&plain), mesh(&shuffled)];
            assert_ne!(plain, shuffled, "{shape:?}");
            assert_eq!(sorted_bits(&plain), sorted_bits(&shuffled), "{shape:?}");
        }
    }
}

#[test]
fn holes_have_the_share_of_edges_asked_for_and_keep_the_mesh_manifold() {
    for shape in SHAPES {
        for share in [0.01, 0.05, 0.1] {
            let mut options = options(shape, 50_000, 5);
            options.holes = share;
            let topology = Topology::of(&mesh(&options));
            assert!(topology.manifold, "{shape:?} {share}");
            let got = topology.num_boundary_edges as f64 / topology.num_edges as f64;
            assert!((got - share).abs() <= 0.2 * share, "{shape:?}: {got} instead of {share}");
        }
    }
}

#[test]
fn layers_come_in_the_order_of_the_longest_axis() {
    for (shape, axis, ascending) in
        [(Shape::Scan, 1, true), (Shape::Torus, 0, false), (Shape::Isosurface, 1, true)]
    {
        let mesh = mesh(&options(shape, 20_000, 0));
        let places = mesh.iter().map(|t| if ascending { t[0][axis] } else { -t[0][axis] });
        let (low, high) =
            places.clone().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p), h.max(p)));
        let mut farthest = f32::MIN;
        for place in places {
            farthest = farthest.max(place);
            // The torus grows by whole rings, which reach across the tube.
            assert!(farthest - place < 0.3 * (high - low), "{shape:?}: far behind the front");
        }
    }
}

#[test]
fn the_origin_is_added_to_every_position() {
    let mut moved = options(Shape::Scan, 2_000, 0);
    moved.origin = [1.0e6, -2.0e6, 512.0];
    let plain = mesh(&options(Shape::Scan, 2_000, 0));
    for (t, u) in plain.iter().zip(&mesh(&moved)) {
        for (p, q) in t.iter().zip(u) {
            for axis in 0..3 {
                let expected = f64::from(p[axis]) + moved.origin[axis];
                assert!((f64::from(q[axis]) - expected).abs() <= 0.125 + 1e-4);
            }
        }
    }
}

#[test]
fn values_out_of_range_are_errors() {
    let mut many_holes = options(Shape::Scan, 1_000, 0);
    many_holes.holes = 0.9;
    assert!(Generator::new(&many_holes).is_err());
    assert!(Generator::new(&options(Shape::Torus, 3, 0)).is_err());
    assert!(Generator::new(&options(Shape::Torus, 1 << 40, 0)).is_err());
}
