//! Triangles from polygons.

use glam::{DVec2, DVec3, Vec3};

/// Polygons with more corners than this become a fan whatever their shape, since ear clipping takes quadratic time.
const MAX_CLIPPED: usize = 2048;

/// Appends the `corners.len() − 2` triangles of a polygon: a fan from its first corner if it is convex, ear clipping in
/// the plane of its Newell normal otherwise. Fewer than three corners give none.
///
/// # Complexity
///
/// Linear for convex polygons, quadratic in the number of corners for others, up to [`MAX_CLIPPED`] of them.
pub(crate) fn triangulate(
    corners: &[u32],
    position: impl Fn(u32) -> Vec3,
    out: &mut Vec<[u32; 3]>,
) {
    match *corners {
        [] | [_] | [_, _] => {}
        [a, b, c] => out.push([a, b, c]),
        _ if corners.len() > MAX_CLIPPED => fan(corners, out),
        _ => {
            let points = flatten(corners, position);
            if is_convex(&points) { fan(corners, out) } else { clip(corners, &points, out) }
        }
    }
}

fn fan(corners: &[u32], out: &mut Vec<[u32; 3]>) {
    if let [first, rest @ ..] = corners {
        out.extend(rest.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
}

/// The corners in the plane of the polygon, counter-clockwise.
fn flatten(corners: &[u32], position: impl Fn(u32) -> Vec3) -> Vec<DVec2> {
    let points: Vec<DVec3> = corners.iter().map(|&v| position(v).as_dvec3()).collect();
    let origin = points.first().copied().unwrap_or(DVec3::ZERO);
    let mut normal = DVec3::ZERO;
    let mut previous = points.last().copied().unwrap_or(DVec3::ZERO) - origin;
    for point in &points {
        let point = *point - origin;
        normal += previous.cross(point);
        previous = point;
    }
    let size = normal.abs();
    points
        .iter()
        .map(|&point| {
            let p = point - origin;
            // Drop the axis that the normal points along most, and mirror where it points the other way.
            let (u, v, n) = if size.x >= size.y && size.x >= size.z {
                (p.y, p.z, normal.x)
            } else if size.y >= size.z {
                (p.z, p.x, normal.y)
            } else {
                (p.x, p.y, normal.z)
            };
            if n < 0.0 { DVec2::new(v, u) } else { DVec2::new(u, v) }
        })
        .collect()
}

/// Positive where the turn a→b→c is to the left.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// No corner turns right; coordinates that are not finite count as convex.
fn is_convex(points: &[DVec2]) -> bool {
    let n = points.len();
    !(0..n).any(|i| turn(points[i], points[(i + 1) % n], points[(i + 2) % n]) < 0.0)
}

/// Ear clipping (G. H. Meisters, *Polygons have ears*, 1975). A polygon that crosses itself may have no ear; then the
/// corner at hand is cut off all the same, so that the number of triangles is always the same.
fn clip(corners: &[u32], points: &[DVec2], out: &mut Vec<[u32; 3]>) {
    let n = points.len();
    let mut next: Vec<usize> = (0..n).map(|i| (i + 1) % n).collect();
    let mut previous: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
    let mut left = n;
    let mut at = 0;
    let mut misses = 0;
    while left > 3 {
        let (a, b, c) = (previous[at], at, next[at]);
        if misses < left && !is_ear(points, &next, &previous, [a, b, c]) {
            misses += 1;
            at = c;
            continue;
        }
        out.push([corners[a], corners[b], corners[c]]);
        next[a] = c;
        previous[c] = a;
        left -= 1;
        misses = 0;
        // Going on two corners further spreads the cuts instead of making one long fan.
        at = next[c];
    }
    out.push([corners[previous[at]], corners[at], corners[next[at]]]);
}

fn is_ear(points: &[DVec2], next: &[usize], previous: &[usize], ear: [usize; 3]) -> bool {
    let [a, b, c] = ear.map(|i| points[i]);
    let convex = turn(a, b, c) > 0.0;
    if !convex {
        return false;
    }
    let mut at = next[ear[2]];
    while at != ear[0] {
        let p = points[at];
        // Only a corner that turns right can be the nearest one inside.
        let convex = turn(points[previous[at]], p, points[next[at]]) > 0.0;
        let inside = turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
        if !convex && inside && p != a && p != b && p != c {
            return false;
        }
        at = next[at];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(points: &[[f32; 3]]) -> Vec<[u32; 3]> {
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        let mut out = Vec::new();
        triangulate(&corners, |v| Vec3::from(points[v as usize]), &mut out);
        out
    }

    fn area(points: &[[f32; 3]], triangle: &[u32; 3]) -> Vec3 {
        let [a, b, c] = triangle.map(|v| Vec3::from(points[v as usize]));
        (b - a).cross(c - a) / 2.0
    }

    #[test]
    fn convex_polygons_are_fans() {
        let square = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        assert_eq!(run(&square), [[0, 1, 2], [0, 2, 3]]);
        assert!(run(&square[..2]).is_empty());
    }

    #[test]
    fn concave_polygons_are_covered_once_with_their_own_winding() {
        let arrow = [[0., 0.], [4., -2.], [1., 0.], [4., 2.]];
        let comb = [[0., 0.], [5., 0.], [5., 3.], [4., 3.], [4., 1.], [3., 1.], [3., 3.], [2., 3.]];
        let comb: Vec<_> =
            comb.into_iter().chain([[2., 1.], [1., 1.], [1., 3.], [0., 3.]]).collect();
        for (shape, total) in [(&arrow[..], 2.0), (&comb[..], 11.0)] {
            for shift in 0..shape.len() {
                for tilt in 0..6 {
                    let mut flat = shape.to_vec();
                    flat.rotate_left(shift);
                    if tilt % 2 == 1 {
                        flat.reverse();
                    }
                    let points: Vec<[f32; 3]> = flat
                        .iter()
                        .map(|&[x, y]| match tilt / 2 {
                            0 => [x, y, 2.0],
                            1 => [2.0, x, y],
                            _ => [y, x + y, x],
                        })
                        .collect();
                    let triangles = run(&points);
                    assert_eq!(triangles.len(), points.len() - 2);
                    let whole: Vec3 = triangles.iter().map(|t| area(&points, t)).sum();
                    let sum: f32 = triangles.iter().map(|t| area(&points, t).length()).sum();
                    assert!((whole.length() - sum).abs() < 1e-4, "no triangle is turned over");
                    if tilt / 2 < 2 {
                        assert!((sum - total).abs() < 1e-4);
                    }
                }
            }
        }
    }

    #[test]
    fn odd_shapes_still_give_the_full_number() {
        let bow = [[0., 0., 0.], [1., 1., 0.], [1., 0., 0.], [0., 1., 0.]];
        assert_eq!(run(&bow).len(), 2);
        let point = [[1., 1., 1.]; 7];
        assert_eq!(run(&point).len(), 5);
        let mut broken = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.5, 0.5, 0.]];
        broken[3][0] = f32::NAN;
        assert_eq!(run(&broken).len(), 3);
        let ring: Vec<[f32; 3]> = (0..MAX_CLIPPED as u32 + 9)
            .map(|i| {
                let angle = i as f32 * 0.003;
                let radius = if i % 2 == 0 { 1.0 } else { 2.0 };
                [radius * angle.cos(), radius * angle.sin(), 0.0]
            })
            .collect();
        assert_eq!(run(&ring).len(), ring.len() - 2);
    }
}
