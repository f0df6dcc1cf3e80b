//! The triangles around a vertex that has taken another one: are they turned over, and how far are they from where the
//! two have been?

use glam::Vec3;
use wide::f32x8;

/// Triangles looked at together.
const LANES: usize = 8;

/// The star of the vertex at the origin, triangle by triangle.
pub(crate) struct NewStar<const MEASURED: usize> {
    /// Where the two vertices have been.
    old: [Vec3; 2],
    /// The second and third corners of some triangles, and where the first has been: x, y, z each.
    rows: [[f32; LANES]; 9],
    len: usize,
    /// The squared distance of either from the star so far.
    least: [f32x8; 2],
    turned: bool,
    /// Square of the least cosine of the angle by which a triangle may be turned.
    least_cosine: f32,
}

impl<const MEASURED: usize> NewStar<MEASURED> {
    /// Without triangles. The two vertices have been there; a triangle may be turned by an angle of this cosine at most.
    #[inline]
    pub(crate) fn new(old: [Vec3; 2], least_cosine: f32) -> Self {
        Self {
            old,
            rows: [[0.0; LANES]; 9],
            len: 0,
            least: [f32x8::splat(f32::INFINITY); 2],
            turned: false,
            least_cosine: least_cosine * least_cosine,
        }
    }

    /// Adds the triangle of the origin, `a` and `b`, which had one of the two vertices as its first corner.
    #[inline]
    pub(crate) fn push(&mut self, a: Vec3, b: Vec3, first: usize) {
        let c = self.old[first];
        for (row, value) in self.rows.iter_mut().zip([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z])
        {
            row[self.len] = value;
        }
        self.len += 1;
        if self.len == LANES {
            self.look();
            self.len = 0;
        }
    }

    /// Whether a triangle is turned over.
    #[inline]
    pub(crate) fn is_turned(&mut self) -> bool {
        if self.len > 0 {
            // The last one again, as often as is needed.
            for row in &mut self.rows {
                let last = row[self.len - 1];
                row[self.len..].fill(last);
            }
            self.look();
            self.len = 0;
        }
        self.turned
    }

    /// As [`finish`](Self::finish), but if there are no triangles they have been so far away.
    #[inline]
    pub(crate) fn finish_or(self, without: f32) -> f32 {
        let is_empty = self.len == 0 && self.least[0].to_array()[0] == f32::INFINITY;
        if is_empty { without } else { self.finish() }
    }

    /// How far the vertices have been from the star at most; infinite if a triangle is turned over, or there is none.
    #[inline]
    pub(crate) fn finish(mut self) -> f32 {
        if self.is_turned() {
            return f32::INFINITY;
        }
        let least =
            self.least.map(|lanes| lanes.to_array().into_iter().fold(f32::INFINITY, f32::min));
        least[..MEASURED].iter().fold(0.0f32, |most, &least| most.max(least)).sqrt()
    }

    #[inline]
    fn look(&mut self) {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = self.rows.map(f32x8::from);
        let dot = |x: [f32x8; 3], y: [f32x8; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        let cross = |x: [f32x8; 3], y: [f32x8; 3]| {
            [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
        };
        let (a, b) = ([ax, ay, az], [bx, by, bz]);
        let before = cross([ax - cx, ay - cy, az - cz], [bx - cx, by - cy, bz - cz]);
        let after = cross(a, b);
        let cosine = dot(before, after);
        let area = dot(after, after);
        let bound = f32x8::splat(self.least_cosine) * dot(before, before) * area;
        let zero = f32x8::splat(0.0);
        let fine = cosine.simd_gt(zero) & (cosine * cosine).simd_gt(bound);
        self.turned |= !fine.all();
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let one = f32x8::splat(1.0);
        let edge = aa + bb - ab - ab;
        let over_area = one / area;
        let over_aa = one / aa;
        let over_edge = one / edge;
        for (least, p) in self.least.iter_mut().zip(self.old).take(MEASURED) {
            let p = p.to_array().map(f32x8::splat);
            let (pp, pa, pb, height) = (dot(p, p), dot(p, a), dot(p, b), dot(p, after));
            // Above the triangle, on the side of its plane.
            let (s, t) = (pa * bb - pb * ab, pb * aa - pa * ab);
            let above = s.simd_ge(zero) & t.simd_ge(zero) & (s + t).simd_le(area);
            let plane = height * height * over_area;
            // On its edge from the origin, and on the one opposite to it; the third one is the next triangle's.
            let k = (pa * over_aa).fast_max(zero).fast_min(one);
            let spoke = pp - k * (pa + pa - k * aa);
            let (q, qe) = (pp - pa - pa + aa, pb - pa - ab + aa);
            let k = (qe * over_edge).fast_max(zero).fast_min(one);
            let rim = q - k * (qe + qe - k * edge);
            *least = least.fast_min(above.select(plane, spoke.fast_min(rim)));
        }
    }
}

/// How far some points are from a star of triangles at most, each from the nearest one of them.
///
/// Where a collapse puts edges, the new triangles may be far from the old ones although no vertex is: two triangulations of
/// one ring are farthest apart in the middle of their edges.
pub(crate) struct Middles {
    /// x, y, z of the points.
    points: [[[f32; LANES]; 3]; 2],
    least: [f32x8; 2],
    len: usize,
}

impl Middles {
    /// Without points.
    #[inline]
    pub(crate) fn new() -> Self {
        Self { points: [[[0.0; LANES]; 3]; 2], least: [f32x8::splat(f32::INFINITY); 2], len: 0 }
    }

    /// Adds a point; those beyond the sixteenth are left out.
    #[inline]
    pub(crate) fn push(&mut self, point: Vec3) {
        if self.len < 2 * LANES {
            let (batch, lane) = (self.len / LANES, self.len % LANES);
            for (row, value) in self.points[batch].iter_mut().zip(point.to_array()) {
                row[lane] = value;
            }
            self.len += 1;
        }
    }

    /// Looks at a triangle, given by one corner and where the others are from there.
    #[inline]
    pub(crate) fn look(&mut self, corner: Vec3, a: Vec3, b: Vec3) {
        let all = |v: Vec3| v.to_array().map(f32x8::splat);
        let dot = |x: &[f32x8; 3], y: &[f32x8; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        let normal = a.cross(b);
        let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
        let (area, edge) = (normal.dot(normal), (b - a).length_squared());
        let splat = f32x8::splat;
        let (zero, one) = (splat(0.0), splat(1.0));
        let (corner, va, vb, normal) = (all(corner), all(a), all(b), all(normal));
        for (points, least) in
            self.points.iter().zip(&mut self.least).take(self.len.div_ceil(LANES))
        {
            let mut p = points.map(f32x8::from);
            for (p, corner) in p.iter_mut().zip(corner) {
                *p -= corner;
            }
            let (pp, pa, pb, height) = (dot(&p, &p), dot(&p, &va), dot(&p, &vb), dot(&p, &normal));
            let (s, t) = (pa * splat(bb) - pb * splat(ab), pb * splat(aa) - pa * splat(ab));
            let above = s.simd_ge(zero) & t.simd_ge(zero) & (s + t).simd_le(splat(area));
            let plane = height * height * splat(1.0 / area);
            let k = (pa * splat(1.0 / aa)).fast_max(zero).fast_min(one);
            let spoke = pp - k * (pa + pa - k * splat(aa));
            let (q, qe) = (pp - pa - pa + splat(aa), pb - pa + splat(aa - ab));
            let k = (qe * splat(1.0 / edge)).fast_max(zero).fast_min(one);
            let rim = q - k * (qe + qe - k * splat(edge));
            *least = least.fast_min(above.select(plane, spoke.fast_min(rim)));
        }
    }

    /// The distance of the point farthest away.
    #[inline]
    pub(crate) fn farthest(&self) -> f32 {
        let least = self.least.iter().flat_map(|lanes| lanes.to_array()).take(self.len);
        least.fold(0.0f32, |most, least| most.max(least)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn hexagon(height: f32) -> impl Iterator<Item = (Vec3, Vec3)> {
        let at = move |i: i32| {
            let angle = i as f32 * std::f32::consts::TAU / 6.0;
            vec3(angle.cos(), angle.sin(), height)
        };
        (0..6).map(move |i| (at(i), at(i + 1)))
    }

    fn finished(old: [Vec3; 2], height: f32) -> f32 {
        let mut star = NewStar::<2>::new(old, 0.2);
        for (i, (a, b)) in hexagon(height).enumerate() {
            star.push(a, b, usize::from(i >= 3));
        }
        star.finish()
    }

    #[test]
    fn the_distance_is_the_farther_one_from_the_nearest_triangle() {
        let distance = finished([vec3(0.1, 0.2, 0.25), vec3(-0.1, 0.0, -0.125)], 0.0);
        assert!((distance - 0.25).abs() < 1e-6, "{distance}");
        // Beyond the rim.
        let distance = finished([vec3(0.1, 0.0, 0.0), vec3(0.0, 0.75f32.sqrt() + 0.5, 0.0)], 0.0);
        assert!((distance - 0.5).abs() < 1e-5 || distance.is_infinite(), "{distance}");
    }

    #[test]
    fn a_triangle_turned_over_is_noticed() {
        assert!(finished([vec3(0.3, 0.0, 0.0), Vec3::ZERO], 0.0) < f32::INFINITY);
        assert_eq!(finished([vec3(3.0, 0.0, 0.0), Vec3::ZERO], 0.0), f32::INFINITY);
        assert_eq!(NewStar::<2>::new([Vec3::ZERO; 2], 0.2).finish(), f32::INFINITY);
    }
}
