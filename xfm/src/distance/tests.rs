//! The fast measurement against slow and obvious ones, and against distances known by construction.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use proptest::prelude::*;

use super::frame::Frame;
use super::tree::Tree;
use super::triangle::{distance_squared, double_area};
use super::*;

/// The nearest of a dense grid of a triangle's points, and how far apart grid points are: a bound from above, no cleverness.
fn gridded_distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> (f64, f64) {
    const STEPS: usize = 64;
    let mut nearest = f64::INFINITY;
    for i in 0..=STEPS {
        for j in 0..=STEPS - i {
            let (u, v) = (i as f64 / STEPS as f64, j as f64 / STEPS as f64);
            nearest = nearest.min(p.distance(a + (b - a) * u + (c - a) * v));
        }
    }
    let spacing = (b - a).length().max((c - a).length()).max((c - b).length()) / STEPS as f64;
    (nearest, spacing)
}

/// The nearest over all triangles, one by one.
fn naive_nearest(p: DVec3, tree: &Tree) -> f64 {
    (0..tree.triangles.len())
        .map(|triangle| distance_squared(p, tree.corners(triangle)))
        .fold(f64::INFINITY, f64::min)
}

fn options(samples: usize) -> DistanceOptions {
    DistanceOptions { samples, seed: 7 }
}

/// A square of side 1 at height `z`, cut into `2 · n²` triangles.
fn square(n: u32, z: f64) -> Surface {
    height_field(n, |_, _| z)
}

fn height_field(n: u32, height: impl Fn(f64, f64) -> f64) -> Surface {
    let mut positions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            positions.push(DVec3::new(x, y, height(x, y)));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let at = j * (n + 1) + i;
            triangles.push([at, at + 1, at + n + 2]);
            triangles.push([at, at + n + 2, at + n + 1]);
        }
    }
    Surface::new(positions, triangles).expect("a grid is a surface")
}

/// A sphere of radius 1 from a cube's faces, `12 · n²` triangles.
fn sphere(n: u32, radius: f64) -> Surface {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let first = positions.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                let mut point = [0.0; 3];
                point[axis] = sign;
                point[(axis + 1) % 3] = 2.0 * u - 1.0;
                point[(axis + 2) % 3] = 2.0 * v - 1.0;
                positions.push(DVec3::from_array(point).normalize() * radius);
            }
        }
        for j in 0..n {
            for i in 0..n {
                let at = first + j * (n + 1) + i;
                triangles.push([at, at + 1, at + n + 2]);
                triangles.push([at, at + n + 2, at + n + 1]);
            }
        }
    }
    Surface::new(positions, triangles).expect("a sphere is a surface")
}

fn point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array)
}

/// Corners on a coarse lattice: equal corners, collinear corners and coplanar triangles are frequent.
fn lattice_point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-2..=2_i32).prop_map(|p| DVec3::from_array(p.map(f64::from)) * 0.5)
}

fn soup(
    corner: impl Strategy<Value = DVec3>,
    most: usize,
) -> impl Strategy<Value = (Vec<DVec3>, Vec<[u32; 3]>)> {
    prop::collection::vec(prop::array::uniform3(corner), 1..most).prop_map(|soup| {
        let positions: Vec<DVec3> = soup.iter().flatten().copied().collect();
        let triangles = (0..soup.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        (positions, triangles)
    })
}

fn one_triangle() -> impl Strategy<Value = [DVec3; 3]> {
    prop_oneof![prop::array::uniform3(point()), prop::array::uniform3(lattice_point())]
}

proptest! {
    #[test]
    fn distance_to_a_triangle_is_that_to_its_nearest_point(
        p in prop_oneof![point(), lattice_point()],
        corners in one_triangle(),
    ) {
        let exact = distance_squared(p, corners).sqrt();
        let (sampled, spacing) = gridded_distance(p, corners);
        prop_assert!(exact <= sampled + 1e-12, "{exact} > {sampled}");
        prop_assert!(exact >= sampled - spacing, "{exact} far below {sampled}");
    }

    #[test]
    fn distance_to_a_triangle_ignores_the_order_of_its_corners(
        p in point(),
        [a, b, c] in one_triangle(),
    ) {
        let reference = distance_squared(p, [a, b, c]).sqrt();
        for corners in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
            prop_assert!((distance_squared(p, corners).sqrt() - reference).abs() < 1e-9);
        }
    }

    #[test]
    fn tree_finds_the_exact_minimum_from_any_hint(
        (positions, triangles) in prop_oneof![soup(point(), 70), soup(lattice_point(), 70)],
        queries in prop::collection::vec(prop_oneof![point(), lattice_point()], 1..20),
        hint in any::<prop::sample::Index>(),
    ) {
        let surface = Surface::new(positions, triangles).expect("drawn surfaces are valid");
        let frame = Frame::around(&surface, &surface);
        let tree = Tree::new(&surface, &frame);
        for query in queries {
            let query = frame.enter(query.clamp(surface.min, surface.max));
            let hint = hint.index(tree.triangles.len()) as u32;
            let found = tree.nearest(query, hint);
            prop_assert_eq!(found.distance_squared, naive_nearest(query, &tree));
            let named = tree.corners(found.triangle as usize);
            prop_assert_eq!(distance_squared(query, named), found.distance_squared);
        }
    }

    #[test]
    fn tree_keeps_every_triangle_once((positions, triangles) in soup(lattice_point(), 200)) {
        let surface = Surface::new(positions, triangles).expect("drawn surfaces are valid");
        let frame = Frame::around(&surface, &surface);
        let tree = Tree::new(&surface, &frame);
        let sorted = |mut soup: Vec<[[f64; 3]; 3]>| {
            soup.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            soup
        };
        let kept = (0..tree.triangles.len()).map(|t| tree.corners(t).map(|p| p.to_array()));
        let given = surface.triangles.iter().map(|triangle| {
            triangle.map(|v| frame.enter(surface.positions[v as usize]).to_array())
        });
        prop_assert_eq!(sorted(kept.collect()), sorted(given.collect()));
    }
}

#[test]
fn tree_is_exact_on_a_large_surface() {
    let surface = sphere(40, 1.0);
    let frame = Frame::around(&surface, &surface);
    let tree = Tree::new(&surface, &frame);
    let mut hint = 0;
    for i in 0..200 {
        let angle = f64::from(i) * 2.4;
        let height = f64::from(i) / 100.0 - 1.0;
        let radius = 0.5 + 0.5 * f64::from(i % 7) / 6.0;
        let query = DVec3::new(angle.cos() * radius, angle.sin() * radius, height);
        let found = tree.nearest(query, hint);
        hint = found.triangle;
        assert_eq!(found.distance_squared, naive_nearest(query, &tree), "query {i}");
    }
}

#[test]
fn parallel_squares_are_their_offset_apart() {
    let report = measure(&square(3, 0.0), &square(17, 0.25), &options(5000)).expect("surfaces");
    for side in [report.a_to_b, report.b_to_a] {
        for value in [side.max, side.mean, side.rms] {
            assert!((value - 0.25).abs() < 1e-12, "{value}");
        }
    }
    assert!((report.diagonal - 2.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_tilted_square_has_the_integrals_of_its_height() {
    // z = x over the unit square against the plane z = 0 extended beyond it: the distance is x, evenly distributed.
    let tilted = height_field(8, |x, _| x);
    let plane = Surface::new(
        vec![DVec3::new(-9.0, -9.0, 0.0), DVec3::new(30.0, -9.0, 0.0), DVec3::new(-9.0, 30.0, 0.0)],
        vec![[0, 1, 2]],
    )
    .expect("a triangle is a surface");
    let report = measure(&tilted, &plane, &options(20_000)).expect("surfaces");
    assert!((report.a_to_b.mean - 0.5).abs() < 1e-4, "{}", report.a_to_b.mean);
    assert!((report.a_to_b.rms - (1.0_f64 / 3.0).sqrt()).abs() < 1e-4, "{}", report.a_to_b.rms);
    assert!((report.a_to_b.max - 1.0).abs() < 1e-12, "vertices count for the maximum");
}

#[test]
fn samples_are_even_within_one_large_triangle() {
    // z = x over a right triangle: x has the density 2 (1 - x), so the mean is 1/3 and the mean square 1/6.
    let corner = |x: f64, y: f64| DVec3::new(x, y, x);
    let tilted =
        Surface::new(vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)], vec![[0, 1, 2]])
            .expect("a triangle is a surface");
    let plane = square_around_origin(20.0);
    let report = measure(&tilted, &plane, &options(10_000)).expect("surfaces");
    assert!((report.a_to_b.mean - 1.0 / 3.0).abs() < 1e-4, "{}", report.a_to_b.mean);
    assert!((report.a_to_b.rms - (1.0_f64 / 6.0).sqrt()).abs() < 1e-4, "{}", report.a_to_b.rms);
}

fn square_around_origin(half: f64) -> Surface {
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    let positions = corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
    Surface::new(positions, vec![[0, 1, 2], [0, 2, 3]]).expect("a square is a surface")
}

#[test]
fn concentric_spheres_are_their_radii_apart() {
    let report = measure(&sphere(40, 1.0), &sphere(40, 1.1), &options(20_000)).expect("surfaces");
    for side in [report.a_to_b, report.b_to_a] {
        assert!((side.mean - 0.1).abs() < 2e-3, "{}", side.mean);
        assert!((side.rms - 0.1).abs() < 2e-3, "{}", side.rms);
        assert!(side.max < 0.102 && side.max > 0.099, "{}", side.max);
    }
}

#[test]
fn a_surface_is_at_no_distance_from_itself() {
    let report = measure(&sphere(20, 3.0), &sphere(20, 3.0), &options(10_000)).expect("surfaces");
    assert!(report.a_to_b.max < 1e-14 * report.diagonal);
    assert_eq!(report.a_to_b, report.b_to_a);
}

#[test]
fn a_hole_shows_from_one_side_only() {
    let whole = square(10, 0.0);
    let mut triangles = whole.triangles.clone();
    // The two triangles of the cell at (5, 5), half a cell's side from any point of the rest at their middle.
    triangles.drain(2 * (5 * 10 + 5)..2 * (5 * 10 + 5) + 2);
    let holed = Surface::new(whole.positions.clone(), triangles).expect("a surface");
    let report = measure(&whole, &holed, &options(100_000)).expect("surfaces");
    assert!(report.b_to_a.max < 1e-12);
    assert!(report.a_to_b.max > 0.045 && report.a_to_b.max <= 0.05, "{}", report.a_to_b.max);
}

#[test]
fn coordinates_far_from_the_origin_keep_their_digits() {
    let far = DVec3::new(4_500_000.0, 5_400_000.0, 300.0);
    let shifted = |surface: Surface| {
        let positions = surface.positions.iter().map(|&p| p + far).collect();
        Surface::new(positions, surface.triangles).expect("a surface")
    };
    let report =
        measure(&shifted(square(4, 0.0)), &shifted(square(4, 0.125)), &options(1000)).expect("ok");
    assert!((report.a_to_b.max - 0.125).abs() < 1e-9, "{}", report.a_to_b.max);
}

#[test]
fn any_scale_is_measured_alike() {
    let reference = measure(&sphere(9, 1.0), &sphere(5, 1.0), &options(3000)).expect("surfaces");
    for scale in [1e-60, 1e-3, 1e60] {
        let report = measure(&sphere(9, scale), &sphere(5, scale), &options(3000)).expect("ok");
        let relative = report.a_to_b.rms / scale / reference.a_to_b.rms;
        assert!((relative - 1.0).abs() < 1e-6, "at {scale}: {relative}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let (a, b) = (sphere(30, 1.0), sphere(11, 1.0));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| measure(&a, &b, &options(50_000))).expect("surfaces")
    };
    let reference = on(1);
    for threads in [2, 3, 8] {
        assert_eq!(on(threads), reference, "{threads} threads");
    }
}

#[test]
fn degenerate_triangles_are_the_segments_and_points_they_are() {
    let mut positions = square(2, 0.0).positions;
    let mut triangles = square(2, 0.0).triangles;
    let spike = positions.len() as u32;
    positions.extend([DVec3::new(0.5, 0.5, 1.0), DVec3::new(f64::NAN, 0.0, 0.0)]);
    let centre = 4;
    assert_eq!(positions[centre as usize], DVec3::new(0.5, 0.5, 0.0));
    triangles.extend([[centre, spike, spike], [spike, spike, spike], [0, centre, 8]]);
    let spiked = Surface::new(positions, triangles).expect("an unused NaN does not matter");
    let report = measure(&spiked, &square(2, 0.0), &options(2000)).expect("surfaces");
    assert!((report.a_to_b.max - 1.0).abs() < 1e-12, "the spike's tip is a vertex");
    assert!(report.a_to_b.rms < 1e-12, "and has no area");
    let hover = Surface::new(
        vec![DVec3::new(0.6, 0.5, 0.7), DVec3::new(0.6, 0.5, 0.8), DVec3::new(0.6, 0.51, 0.7)],
        vec![[0, 1, 2]],
    )
    .expect("a triangle is a surface");
    let report = measure(&hover, &spiked, &options(2000)).expect("surfaces");
    assert!((report.a_to_b.max - 0.01_f64.hypot(0.1)).abs() < 1e-12, "the spike is a segment");
}

#[test]
fn surfaces_that_cannot_be_measured_say_why() {
    let p = DVec3::ZERO;
    assert_eq!(Surface::new(vec![p; 3], vec![]), Err(DistanceError::Empty));
    assert_eq!(
        Surface::new(vec![p; 3], vec![[0, 1, 2], [0, 1, 3]]),
        Err(DistanceError::IndexOutOfRange { triangle: 1, vertex: 3, vertices: 3 })
    );
    assert_eq!(
        Surface::new(vec![p, p, DVec3::splat(f64::INFINITY)], vec![[0, 1, 2]]),
        Err(DistanceError::NotFinite { triangle: 0, vertex: 2 })
    );
    let point = Surface::new(vec![p; 3], vec![[0, 1, 2]]).expect("a point is a surface");
    assert_eq!(
        measure(&square(1, 0.0), &point, &options(10)),
        Err(DistanceError::NoArea { side: Side::B, triangles: 1 })
    );
}

#[test]
fn an_observer_sees_every_point_and_can_stop() {
    struct Counter {
        expected: AtomicU64,
        seen: AtomicU64,
        stop_after: u64,
    }
    impl Observer for Counter {
        fn begin(&self, total_points: u64) {
            self.expected.store(total_points, Ordering::Relaxed);
        }
        fn advance(&self, points: u64) {
            self.seen.fetch_add(points, Ordering::Relaxed);
        }
        fn is_cancelled(&self) -> bool {
            self.seen.load(Ordering::Relaxed) > self.stop_after
        }
    }
    let counter = |stop_after| Counter { expected: 0.into(), seen: AtomicU64::new(0), stop_after };
    let (a, b) = (sphere(10, 1.0), sphere(6, 1.0));
    let patient = counter(u64::MAX);
    measure_observed(&a, &b, &options(10_000), &patient).expect("not cancelled");
    assert_eq!(patient.expected.into_inner(), patient.seen.into_inner());
    let impatient = counter(3000);
    let stopped = measure_observed(&a, &b, &options(10_000), &impatient);
    assert_eq!(stopped, Err(DistanceError::Cancelled));
}

#[test]
fn areas_are_those_of_the_triangles() {
    assert_eq!(double_area([DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 2.0]), 6.0);
}
