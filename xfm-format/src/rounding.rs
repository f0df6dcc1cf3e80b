//! The numbers that the encoding `compact` has, and how others are rounded to them.

use glam::Vec3;
use mergetree::{BoundCodes, Bounded, Node, OctNormal};

/// Largest coordinate in steps of the grid: beyond it an f32 does not hold them well.
pub(crate) const MAX_STEPS: i32 = 1 << 22;
/// Half-sides of the square that normals are rounded on.
pub(crate) const NORMAL_STEPS: i32 = 255;
/// Bits that codes of radius, cone sine and deviation lack at their end.
pub(crate) const RADIUS_SHIFT: u32 = 3;
pub(crate) const CONE_SHIFT: u32 = 4;
pub(crate) const DEVIATION_SHIFT: u32 = 5;

/// What numbers of nodes are rounded to before they are written: nothing for [`Encoding::Exact`](crate::Encoding::Exact), a
/// grid for [`Encoding::Compact`](crate::Encoding::Compact).
///
/// Whoever hands pages to a [`FileWriter`](crate::FileWriter) rounds nodes first, children before parents, as
/// [`write`](crate::write()) does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    /// Side of the grid's cells; zero where nothing is rounded.
    step: f64,
    error: f64,
}

impl Rounding {
    /// Nothing is rounded but the bounds, as codes are.
    pub const EXACT: Self = Self { step: 0.0, error: 0.0 };

    /// Positions move by no more than `error`, in model units.
    pub(crate) fn with_error(error: f64) -> Self {
        // A thousandth is left for the rounding of coordinates to 24 bits.
        Self { step: 0.999 * 2.0 / 3f64.sqrt() * error, error }
    }

    /// What a file says; `None` if that cannot be.
    pub(crate) fn from_file(step: f64, error: f64) -> Option<Self> {
        // So that no corner of the grid is infinite.
        let possible = step > 0.0 && error >= 0.866 * step && error < 1e30;
        possible.then_some(Self { step, error })
    }

    /// Side of the grid's cells, in model units; zero where positions stay as they are.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// How far a position may move, in model units.
    pub fn error(&self) -> f64 {
        self.error
    }

    pub(crate) fn is_exact(&self) -> bool {
        self.step == 0.0
    }

    /// The corner of the grid next to a position; `None` where it is too far off.
    pub(crate) fn corner(&self, position: Vec3) -> Option<[i32; 3]> {
        let scaled = position.to_array().map(|c| (f64::from(c) / self.step).round());
        let inside = scaled.iter().all(|c| c.abs() <= f64::from(MAX_STEPS));
        inside.then(|| scaled.map(|c| c as i32))
    }

    /// Where a corner of the grid lies.
    #[inline]
    pub(crate) fn at(&self, corner: [i32; 3]) -> Vec3 {
        Vec3::from_array(corner.map(|c| (f64::from(c) * self.step) as f32))
    }

    /// The position that is written for this one; `None` where the grid does not reach.
    pub fn position(&self, position: Vec3) -> Option<Vec3> {
        if self.is_exact() { Some(position) } else { Some(self.at(self.corner(position)?)) }
    }

    /// The normal that is written for this one.
    pub fn normal(&self, normal: OctNormal) -> OctNormal {
        if self.is_exact() { normal } else { normal_at(normal_steps(normal)) }
    }

    /// Whether both are what rounding makes of them.
    pub(crate) fn is_rounded(&self, position: Vec3, normal: OctNormal) -> bool {
        self.position(position) == Some(position) && self.normal(normal) == normal
    }

    /// Whether the bounds of a node have such codes as are written; each of them has a code.
    pub(crate) fn has_bounds(&self, node: &Node) -> bool {
        self.is_exact()
            || [
                (node.radius, RADIUS_SHIFT),
                (node.cone_sine, CONE_SHIFT),
                (node.deviation, DEVIATION_SHIFT),
            ]
            .into_iter()
            .all(|(bound, zeros)| {
                BoundCodes::exact(bound).is_some_and(|code| code.trailing_zeros() >= zeros)
            })
    }

    /// Sets position, normal and bounds of a node to those that are written: bounds enclose what they did before, wherever
    /// vertices move, and those of the children, which were rounded before. `None` where the grid does not reach, or a bound
    /// is not finite.
    ///
    /// The cone holds the normals of triangles as they were before their corners moved.
    pub fn round(
        &self,
        node: &mut Node,
        children: impl IntoIterator<Item = Bounded>,
    ) -> Option<BoundCodes> {
        let codes = if self.is_exact() {
            BoundCodes::enclosing(node, children)?
        } else {
            let error = self.error();
            let before = Bounded {
                position: node.position,
                normal: node.normal,
                codes: BoundCodes {
                    radius: BoundCodes::encode_up(f64::from(node.radius) + error)?,
                    cone_sine: BoundCodes::encode_up(node.cone_sine.min(1.0).into())?,
                    deviation: BoundCodes::encode_up(f64::from(node.deviation) + error)?,
                },
            };
            node.position = self.position(node.position)?;
            node.normal = self.normal(node.normal);
            (node.radius, node.cone_sine, node.deviation) = (0.0, 0.0, 0.0);
            let codes = BoundCodes::enclosing(node, children.into_iter().chain([before]))?;
            BoundCodes {
                radius: up(codes.radius, RADIUS_SHIFT)?,
                cone_sine: up(codes.cone_sine, CONE_SHIFT)?,
                deviation: up(codes.deviation, DEVIATION_SHIFT)?,
            }
        };
        codes.store(node);
        Some(codes)
    }
}

/// The next code that ends in so many zeros.
fn up(code: u16, zeros: u32) -> Option<u16> {
    let code = code.checked_add((1 << zeros) - 1)? >> zeros << zeros;
    (code <= BoundCodes::MAX).then_some(code)
}

/// The components of a normal in steps, −[`NORMAL_STEPS`] to [`NORMAL_STEPS`].
pub(crate) fn normal_steps(normal: OctNormal) -> [i32; 2] {
    normal.0.map(|c| divide(i32::from(c).max(-32767) * NORMAL_STEPS, 32767))
}

/// The normal of so many steps.
#[inline]
pub(crate) fn normal_at(steps: [i32; 2]) -> OctNormal {
    OctNormal(steps.map(|c| COMPONENTS[(c + NORMAL_STEPS) as usize]))
}

/// Components of normals by their steps from the least one on.
const COMPONENTS: [i16; 2 * NORMAL_STEPS as usize + 1] = {
    let mut components = [0; 2 * NORMAL_STEPS as usize + 1];
    let mut steps = -NORMAL_STEPS;
    while steps <= NORMAL_STEPS {
        components[(steps + NORMAL_STEPS) as usize] = divide(steps * 32767, NORMAL_STEPS) as i16;
        steps += 1;
    }
    components
};

/// A quotient rounded to the nearest integer, halves away from zero; the divisor is positive.
const fn divide(a: i32, b: i32) -> i32 {
    (2 * a.abs() + b) / (2 * b) * a.signum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_normals_stay_and_are_near() {
        for a in -NORMAL_STEPS..=NORMAL_STEPS {
            assert_eq!(normal_steps(normal_at([a, -a])), [a, -a]);
        }
        let mut worst = 0f32;
        for i in 0..200 {
            for j in 0..400 {
                let (theta, phi) = (i as f32 * 0.0157, j as f32 * 0.0157);
                let (t, p) = (theta.sin_cos(), phi.sin_cos());
                let v = Vec3::new(t.0 * p.1, t.0 * p.0, t.1);
                let normal = OctNormal::new(v);
                let rounded = Rounding::with_error(0.1).normal(normal);
                worst = worst.max(v.angle_between(rounded.to_vec3()).to_degrees());
            }
        }
        assert!(worst < 0.5, "{worst}");
    }

    #[test]
    fn positions_move_no_farther_than_the_error() {
        let rounding = Rounding::with_error(1e-3);
        let mut x = 0.01f32;
        for _ in 0..2000 {
            x = (x * 1.7 + 0.123) % 7.0;
            let p = Vec3::new(x, 3.0 - x, x * x - 20.0);
            let q = rounding.position(p).unwrap();
            assert!(f64::from(p.distance(q)) <= 1e-3);
            assert_eq!(rounding.position(q), Some(q));
        }
        assert_eq!(rounding.position(Vec3::splat(1e5)), None);
    }
}
