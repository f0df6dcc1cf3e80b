//! The distance from a point to one triangle.

use glam::DVec3;

/// A triangle whose height is below this fraction of its longest edge (10⁻¹², squared) is measured as its edges: its
/// normal is noise, while its edges are off by no more than that height.
const SLIVER: f64 = 1e-24;

/// The squared distance from `p` to the nearest point of the closed triangle, whatever its shape: corners on one line
/// make it a segment, equal corners a point.
pub(super) fn distance_squared(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let (ap, bp, cp) = (p - a, p - b, p - c);
    let normal = bc.cross(ab);
    let area = normal.length_squared();
    let (ab2, bc2, ca2) = (ab.length_squared(), bc.length_squared(), ca.length_squared());
    let longest = ab2.max(bc2).max(ca2);
    if area <= SLIVER * longest * longest {
        let nearest = to_segment(ap, ab, ab2).min(to_segment(bp, bc, bc2));
        return nearest.min(to_segment(cp, ca, ca2));
    }
    // Which edges have p on their outer side, looking along the normal? With none, p projects into the triangle; else the
    // nearest point lies on one of those edges.
    let (beyond_ab, beyond_bc, beyond_ca) = (
        ab.cross(normal).dot(ap) < 0.0,
        bc.cross(normal).dot(bp) < 0.0,
        ca.cross(normal).dot(cp) < 0.0,
    );
    if !(beyond_ab || beyond_bc || beyond_ca) {
        let height = normal.dot(ap);
        return height * height / area;
    }
    let mut nearest = f64::INFINITY;
    if beyond_ab {
        nearest = nearest.min(to_segment(ap, ab, ab2));
    }
    if beyond_bc {
        nearest = nearest.min(to_segment(bp, bc, bc2));
    }
    if beyond_ca {
        nearest = nearest.min(to_segment(cp, ca, ca2));
    }
    nearest
}

/// The squared distance to a segment from the point at `offset` from its start.
fn to_segment(offset: DVec3, direction: DVec3, length_squared: f64) -> f64 {
    let along = offset.dot(direction);
    if along <= 0.0 {
        offset.length_squared()
    } else if along >= length_squared {
        (offset - direction).length_squared()
    } else {
        (offset - direction * (along / length_squared)).length_squared()
    }
}

/// Twice the area of a triangle.
pub(super) fn double_area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}
