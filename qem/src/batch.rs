//! Many sums of two quadrics rated at once.

use glam::Vec3;
use wide::f32x8;

use crate::Quadric;
use crate::quadric::REGULARISATION;

/// Quadrics that a [`Batch`] holds.
pub const LANES: usize = 8;

/// Rates the sum of one quadric with each of up to [`LANES`] others.
///
/// ```
/// use glam::Vec3;
/// use qem::{Batch, ErrorMetric, Quadric};
///
/// let center = Quadric::from_triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
/// // Of a triangle in the plane z = 2, about a point of it.
/// let other = Quadric::from_triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
/// let mut batch = Batch::default();
/// batch.push(&other, 2.0 * Vec3::Z, Vec3::ZERO);
/// // Midway, one unit from either plane: half a unit of area each.
/// assert!((batch.least_costs(&center)[0] - 1.0).abs() < 1e-3);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// xx, yy, zz, yz, xz, xy, b.x, b.y, b.z, c; where the quadric is (x, y, z), and near where to look (x, y, z).
    rows: [[f32; LANES]; 16],
    len: usize,
}

impl Batch {
    /// Number of quadrics in the batch.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Empties the batch.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds a quadric about the point `at`, to be minimised near the point `near`, both as seen from the center.
    ///
    /// # Panics
    /// When there are [`LANES`] quadrics already.
    #[inline]
    pub fn push(&mut self, quadric: &Quadric, at: Vec3, near: Vec3) {
        let lane = self.len;
        assert!(lane < LANES, "a batch holds {LANES} quadrics");
        let Quadric { diagonal: d, off_diagonal: o, b, c } = *quadric;
        let values = [
            d.x, d.y, d.z, o.x, o.y, o.z, b.x, b.y, b.z, c, at.x, at.y, at.z, near.x, near.y,
            near.z,
        ];
        for (row, value) in self.rows.iter_mut().zip(values) {
            row[lane] = value;
        }
        self.len += 1;
    }

    /// For each quadric, the cost of its sum with `center` at the sum's minimum, as [`optimum`] finds it. What stands
    /// beyond [`len`](Self::len) means nothing.
    ///
    /// [`optimum`]: crate::ErrorMetric::optimum
    #[inline]
    pub fn least_costs(&self, center: &Quadric) -> [f32; LANES] {
        self.minima(center).0
    }

    /// As [`least_costs`](Self::least_costs), with the minimum's x, y and z as seen from the center.
    #[inline]
    pub fn minima(&self, center: &Quadric) -> ([f32; LANES], [[f32; LANES]; 3]) {
        let [xx, yy, zz, yz, xz, xy, bx, by, bz, c, px, py, pz, nx, ny, nz] =
            self.rows.map(f32x8::from);
        let all = f32x8::splat;
        // About the center instead of about `p`.
        let (mx, my, mz) =
            (xx * px + xy * py + xz * pz, xy * px + yy * py + yz * pz, xz * px + yz * py + zz * pz);
        let two = all(2.0);
        let c = c - (px * (two * bx - mx) + py * (two * by - my) + pz * (two * bz - mz));
        let c = c.fast_max(all(0.0)) + all(center.c);
        let (bx, by, bz) =
            (bx - mx + all(center.b.x), by - my + all(center.b.y), bz - mz + all(center.b.z));
        let (d, o) = (center.diagonal, center.off_diagonal);
        let (xx, yy, zz) = (xx + all(d.x), yy + all(d.y), zz + all(d.z));
        let (yz, xz, xy) = (yz + all(o.x), xz + all(o.y), xy + all(o.z));
        // The gradient at `n`, and the step from there to the minimum; scaled, so that tiny models do not underflow.
        let trace = xx + yy + zz;
        let one_over = all(1.0) / trace.fast_max(all(f32::MIN_POSITIVE));
        let pull = all(REGULARISATION) * trace;
        let (ax, ay, az) = ((xx + pull) * one_over, (yy + pull) * one_over, (zz + pull) * one_over);
        let (ayz, axz, axy) = (yz * one_over, xz * one_over, xy * one_over);
        let gx = xx * nx + xy * ny + xz * nz + bx;
        let gy = xy * nx + yy * ny + yz * nz + by;
        let gz = xz * nx + yz * ny + zz * nz + bz;
        let (rx, ry, rz) = (gx * one_over, gy * one_over, gz * one_over);
        let cxx = ay * az - ayz * ayz;
        let cxy = axz * ayz - axy * az;
        let cxz = axy * ayz - axz * ay;
        let cyy = ax * az - axz * axz;
        let cyz = axy * axz - ax * ayz;
        let czz = ax * ay - axy * axy;
        let determinant = ax * cxx + axy * cxy + axz * cxz;
        let scale = all(-1.0) / determinant.fast_max(all(f32::MIN_POSITIVE));
        let sx = nx + (cxx * rx + cxy * ry + cxz * rz) * scale;
        let sy = ny + (cxy * rx + cyy * ry + cyz * rz) * scale;
        let sz = nz + (cxz * rx + cyz * ry + czz * rz) * scale;
        let cost = sx * (xx * sx + xy * sy + xz * sz + two * bx)
            + sy * (xy * sx + yy * sy + yz * sz + two * by)
            + sz * (xz * sx + yz * sy + zz * sz + two * bz)
            + c;
        (cost.fast_max(all(0.0)).to_array(), [sx, sy, sz].map(f32x8::to_array))
    }

    /// For each quadric, the cost of its sum with `center` at the point `near`.
    #[inline]
    pub fn costs_near(&self, center: &Quadric) -> [f32; LANES] {
        use crate::ErrorMetric;
        let mut costs = [0.0; LANES];
        for (lane, cost) in costs.iter_mut().enumerate().take(self.len) {
            let [xx, yy, zz, yz, xz, xy, bx, by, bz, c, px, py, pz, nx, ny, nz] =
                self.rows.map(|row| row[lane]);
            let quadric = Quadric {
                diagonal: Vec3::new(xx, yy, zz),
                off_diagonal: Vec3::new(yz, xz, xy),
                b: Vec3::new(bx, by, bz),
                c,
            };
            let near = Vec3::new(nx, ny, nz);
            *cost = center.cost(near) + quadric.cost(near - Vec3::new(px, py, pz));
        }
        costs
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;
    use crate::ErrorMetric;

    #[test]
    fn a_batch_says_what_one_after_the_other_says() {
        let mut seed = 1u32;
        let mut number = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        for scale in [1e-4f32, 1.0, 1e4] {
            let mut point = || scale * vec3(number(), number(), number());
            let mut gathered = || {
                let mut q = Quadric::default();
                for _ in 0..6 {
                    q.merge(&Quadric::from_triangle([Vec3::ZERO, point(), point()]));
                }
                (q, point())
            };
            let (center, _) = gathered();
            let others: Vec<(Quadric, Vec3)> = (0..LANES).map(|_| gathered()).collect();
            let mut batch = Batch::default();
            for (q, at) in &others {
                batch.push(q, *at, 0.5 * *at);
            }
            let (least, near) = (batch.least_costs(&center), batch.costs_near(&center));
            for (lane, (q, at)) in others.iter().enumerate() {
                let mut sum = q.about(-*at);
                sum.merge(&center);
                let expected = sum.cost(sum.optimum(0.5 * *at));
                let unit = sum.cost(0.5 * *at);
                assert!(
                    (least[lane] - expected).abs() <= 1e-4 * unit,
                    "{expected} {}",
                    least[lane]
                );
                let at = batch.minima(&center).1.map(|row| row[lane]);
                assert!(sum.cost(Vec3::from_array(at)) <= expected + 1e-4 * unit);
                assert!((near[lane] - unit).abs() <= 1e-4 * unit, "{unit} {}", near[lane]);
            }
        }
    }

    #[test]
    fn nothing_costs_nothing() {
        let mut batch = Batch::default();
        batch.push(&Quadric::default(), Vec3::X, Vec3::Y);
        assert_eq!(batch.least_costs(&Quadric::default())[0], 0.0);
    }
}
