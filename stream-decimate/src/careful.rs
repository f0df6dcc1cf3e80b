//! How far a collapse moves the surface, measured from both sides at more than its vertices.
//!
//! Where triangles change, a surface may be farthest from what it was between the vertices: across a crease that is cut
//! off, for instance. So the midpoints of edges and the middles of triangles are measured, too, those that were against
//! those that will be, and the other way round.

use glam::Vec3;
use wide::f32x8;

const LANES: usize = 8;

/// Triangles about a common corner.
#[derive(Debug)]
pub(crate) struct Patch {
    apex: Vec3,
    rims: Vec<[Vec3; 2]>,
    /// The second and third corners of eight triangles each, as seen from the apex: x, y, z.
    lanes: Vec<[[f32; LANES]; 6]>,
}

impl Patch {
    /// No triangles.
    pub(crate) fn new(apex: Vec3) -> Self {
        Self { apex, rims: Vec::new(), lanes: Vec::new() }
    }

    /// Adds the triangle of the apex, `a` and `b`.
    pub(crate) fn push(&mut self, a: Vec3, b: Vec3) {
        let lane = self.rims.len() % LANES;
        self.rims.push([a, b]);
        let (a, b) = (a - self.apex, b - self.apex);
        if lane == 0 {
            self.lanes.push([[0.0; LANES]; 6]);
        }
        if let Some(rows) = self.lanes.last_mut() {
            for (row, value) in rows.iter_mut().zip([a.x, a.y, a.z, b.x, b.y, b.z]) {
                // The lanes not in use yet hold the same triangle.
                row[lane..].fill(value);
            }
        }
    }

    /// The apex, and the middles of the triangles and of their edges from the apex.
    pub(crate) fn samples(&self) -> impl Iterator<Item = Vec3> + '_ {
        let apex = self.apex;
        std::iter::once(apex).chain(
            self.rims.iter().flat_map(move |&[a, b]| {
                [(apex + a + b) / 3.0, 0.5 * (apex + a), 0.5 * (apex + b)]
            }),
        )
    }

    /// The squared distance of a point.
    pub(crate) fn distance_squared(&self, point: Vec3) -> f32 {
        let all = f32x8::splat;
        let p = (point - self.apex).to_array().map(all);
        let dot = |x: [f32x8; 3], y: [f32x8; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        let (zero, one) = (all(0.0), all(1.0));
        let pp = dot(p, p);
        let mut least = pp;
        for rows in &self.lanes {
            let [ax, ay, az, bx, by, bz] = rows.map(f32x8::from);
            let (a, b) = ([ax, ay, az], [bx, by, bz]);
            let normal = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
            let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
            let (area, edge) = (dot(normal, normal), aa + bb - ab - ab);
            let (pa, pb, height) = (dot(p, a), dot(p, b), dot(p, normal));
            let (s, t) = (pa * bb - pb * ab, pb * aa - pa * ab);
            let above = s.simd_ge(zero) & t.simd_ge(zero) & (s + t).simd_le(area);
            let plane = height * height / area;
            let to_edge = |pe: f32x8, ee: f32x8, from: f32x8| {
                let k = (pe / ee).fast_max(zero).fast_min(one);
                from - k * (pe + pe - k * ee)
            };
            let rim = to_edge(pb - pa - ab + aa, edge, pp - pa - pa + aa);
            let outside = to_edge(pa, aa, pp).fast_min(to_edge(pb, bb, pp)).fast_min(rim);
            least = least.fast_min(above.select(plane, outside));
        }
        least.to_array().into_iter().fold(f32::INFINITY, f32::min).max(0.0)
    }
}

/// The largest distance found between two surfaces of several patches each; infinite if it is more than `most`.
pub(crate) fn distance(before: &[Patch], after: &[Patch], most: f32) -> f32 {
    let mut farthest = 0.0f32;
    for (from, to) in [(before, after), (after, before)] {
        for point in from.iter().flat_map(Patch::samples) {
            let nearest = to.iter().map(|patch| patch.distance_squared(point));
            farthest = farthest.max(nearest.fold(f32::INFINITY, f32::min));
            if farthest > most * most {
                return f32::INFINITY;
            }
        }
    }
    farthest.sqrt()
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_roof_is_as_far_from_its_floor_as_it_is_high() {
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let corner = |i: usize| vec3(square[i % 4][0], square[i % 4][1], 0.0);
        let patch = |apex| {
            let mut patch = Patch::new(apex);
            (0..4).for_each(|i| patch.push(corner(i), corner(i + 1)));
            patch
        };
        let (floor, roof) = (patch(vec3(0.2, 0.1, 0.0)), patch(vec3(0.0, 0.0, 0.5)));
        assert!((distance(&[floor], &[roof], 1.0) - 0.5).abs() < 1e-6);
    }
}
