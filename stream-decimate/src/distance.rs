//! Distances from a point to a triangle.

use glam::Vec3;

/// The distance from a point to a triangle, which may have no area.
///
/// # Sources
/// Ericson, *Real-Time Collision Detection*, 2005, §5.1.5 (the regions about a triangle).
#[inline]
pub(crate) fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length();
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        return p.distance(a + ab * (d1 / (d1 - d3)));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
        return p.distance(a + ac * (d2 / (d2 - d6)));
    }
    let (e, f) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e >= 0.0 && f >= 0.0 && e + f > 0.0 {
        return p.distance(b + (c - b) * (e / (e + f)));
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        // Nothing but rounding.
        return ap.length().min(bp.length()).min(cp.length());
    }
    p.distance(a + ab * (vb / sum) + ac * (vc / sum))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0f32..1.0).prop_map(Vec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn agrees_with_a_dense_sampling(p in point(), t in prop::array::uniform3(point())) {
            let n = 60;
            let mut nearest = f32::INFINITY;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (s, u) = (i as f32 / n as f32, j as f32 / n as f32);
                    nearest = nearest.min(p.distance(t[0] + s * (t[1] - t[0]) + u * (t[2] - t[0])));
                }
            }
            let distance = distance_to_triangle(p, t);
            prop_assert!(distance <= nearest + 1e-5);
            prop_assert!(distance >= nearest - 0.06, "{} {}", distance, nearest);
        }
    }

    #[test]
    fn a_triangle_without_area_is_its_longest_edge_or_a_point() {
        let p = Vec3::new(0.5, 1.0, 0.0);
        assert_eq!(distance_to_triangle(p, [Vec3::ZERO, Vec3::X, Vec3::ZERO]), 1.0);
        assert_eq!(distance_to_triangle(p, [Vec3::ZERO, Vec3::ZERO, Vec3::X]), 1.0);
        assert_eq!(distance_to_triangle(p, [Vec3::X, Vec3::ZERO, Vec3::ZERO]), 1.0);
        assert_eq!(distance_to_triangle(Vec3::Y, [Vec3::ZERO; 3]), 1.0);
    }
}
