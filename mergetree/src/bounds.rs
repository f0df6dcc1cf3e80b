//! Radius, cone and deviation in 16 bits each, always rounded up, and still enclosing those of the children.

use glam::{DVec3, Vec3};

use crate::{Node, OctNormal};

/// Radius, cone sine and deviation of a node in 16 bits each, rounded up: the numbers that a forest and its file have.
///
/// A code is the upper 16 of the 31 bits below the sign of an `f32`, so that it is less than 1.004 times what it stands
/// for (from 2^−126 on).
///
/// ```
/// use mergetree::{BoundCodes, Node};
///
/// let codes = BoundCodes::enclosing(&Node { radius: 0.1, ..Node::BLANK }, []).unwrap();
/// let mut node = Node::BLANK;
/// codes.store(&mut node);
/// assert!(node.radius >= 0.1 && node.radius < 0.1004);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct BoundCodes {
    /// Code of the radius.
    pub radius: u16,
    /// Code of the cone sine.
    pub cone_sine: u16,
    /// Code of the deviation.
    pub deviation: u16,
}

/// What a parent must know of a child to enclose it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// Its position.
    pub position: Vec3,
    /// Its normal.
    pub normal: OctNormal,
    /// Its bounds.
    pub codes: BoundCodes,
}

impl BoundCodes {
    /// Largest code of a finite number.
    pub const MAX: u16 = 0xfeff;
    /// Code of the number 1.
    pub const ONE: u16 = 0x7f00;

    /// The number a code stands for.
    #[inline]
    pub fn decode(code: u16) -> f32 {
        f32::from_bits(u32::from(code) << 15)
    }

    /// The least code whose number is not below `value`; `None` when there is none. Negative numbers count as zero.
    #[inline]
    pub fn encode_up(value: f64) -> Option<u16> {
        if value.is_nan() {
            return None;
        }
        let value = value.max(0.0);
        let mut single = value as f32;
        if f64::from(single) < value {
            single = single.next_up();
        }
        let code = (u64::from(single.to_bits()) + 0x7fff) >> 15;
        (code <= u64::from(Self::MAX)).then_some(code as u16)
    }

    /// The code of a number that has one.
    #[inline]
    pub fn exact(value: f32) -> Option<u16> {
        let code = (value.to_bits() >> 15) as u16;
        (value.to_bits() == u32::from(code) << 15 && code <= Self::MAX).then_some(code)
    }

    /// The codes of a node all of whose bounds have one.
    pub fn of_node(node: &Node) -> Option<Self> {
        Some(Self {
            radius: Self::exact(node.radius)?,
            cone_sine: Self::exact(node.cone_sine)?,
            deviation: Self::exact(node.deviation)?,
        })
    }

    /// Codes of bounds that are not below those of the node itself and enclose those of its children, as the format
    /// demands; `None` when one of them is not finite.
    pub fn enclosing(node: &Node, children: impl IntoIterator<Item = Bounded>) -> Option<Self> {
        let bounds = [node.radius, node.cone_sine, node.deviation];
        if !bounds.iter().all(|bound| bound.is_finite()) {
            return None;
        }
        let [mut radius, mut sine, mut deviation] = bounds.map(f64::from);
        let axis = node.normal.to_vec3().as_dvec3();
        for child in children {
            let [reach, cone, moved] =
                [child.codes.radius, child.codes.cone_sine, child.codes.deviation]
                    .map(Self::decode);
            radius = radius.max(enclosing_radius(node.position, child.position, reach));
            sine = sine.max(enclosing_sine(axis, child.normal, cone));
            deviation = deviation.max(f64::from(moved));
        }
        Some(Self {
            radius: Self::encode_up(radius)?,
            cone_sine: Self::encode_up(sine.min(1.0))?,
            deviation: Self::encode_up(deviation)?,
        })
    }

    /// Sets the bounds of a node to what the codes stand for.
    pub fn store(self, node: &mut Node) {
        node.radius = Self::decode(self.radius);
        node.cone_sine = Self::decode(self.cone_sine);
        node.deviation = Self::decode(self.deviation);
    }

    /// What a parent must know of a node that has these bounds.
    pub fn of(self, node: &Node) -> Bounded {
        Bounded { position: node.position, normal: node.normal, codes: self }
    }
}

/// Radius that a sphere about `parent` needs to hold the sphere of this radius about `child`.
fn enclosing_radius(parent: Vec3, child: Vec3, radius: f32) -> f64 {
    parent.as_dvec3().distance(child.as_dvec3()) + f64::from(radius)
}

/// Sine of the half-angle that a cone about `axis` needs to hold the cone of this sine about `child`; 1 for a right angle and
/// more. The angles are added by their sines and cosines.
fn enclosing_sine(axis: DVec3, child: OctNormal, sine: f32) -> f64 {
    if sine >= 1.0 {
        return 1.0;
    }
    let direction = child.to_vec3().as_dvec3();
    let (sin_between, cos_between) = (axis.cross(direction).length(), axis.dot(direction));
    let sin = f64::from(sine);
    let cos = (1.0 - sin * sin).sqrt();
    if cos_between * cos <= sin_between * sin {
        return 1.0;
    }
    // The directions are unit vectors up to the rounding of single precision.
    let scale = (sin_between * sin_between + cos_between * cos_between).sqrt();
    (sin_between * cos + cos_between * sin) / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_up_by_less_than_half_a_percent() {
        let mut value = 1e-30f64;
        while value < 1e30 {
            let code = BoundCodes::encode_up(value).unwrap();
            let back = f64::from(BoundCodes::decode(code));
            assert!(back >= value && back < value * 1.004, "{value} {back}");
            assert_eq!(BoundCodes::encode_up(back), Some(code));
            assert_eq!(BoundCodes::exact(BoundCodes::decode(code)), Some(code));
            assert_eq!(BoundCodes::exact(BoundCodes::decode(code).next_up()), None);
            value *= 1.37;
        }
    }

    #[test]
    fn zero_and_one_are_exact_and_the_infinite_has_no_code() {
        assert_eq!(BoundCodes::encode_up(0.0), Some(0));
        assert_eq!(BoundCodes::encode_up(-0.0), Some(0));
        assert_eq!(BoundCodes::encode_up(-3.0), Some(0));
        assert_eq!(BoundCodes::encode_up(1.0), Some(BoundCodes::ONE));
        assert_eq!(BoundCodes::decode(BoundCodes::ONE), 1.0);
        assert!(BoundCodes::decode(BoundCodes::MAX).is_finite());
        assert_eq!(BoundCodes::encode_up(f64::from(f32::MAX)), None);
        assert_eq!(BoundCodes::encode_up(f64::NAN), None);
        assert!(BoundCodes::decode(BoundCodes::encode_up(1e-45).unwrap()) > 0.0);
        for none in [-0.0, -1.0, f32::INFINITY, f32::NAN] {
            assert_eq!(BoundCodes::exact(none), None);
        }
    }

    #[test]
    fn children_are_enclosed() {
        let bounds = |x: f32, radius: f32, deviation: f32| Node {
            position: Vec3::new(x, 0.0, 0.0),
            normal: OctNormal::new(Vec3::new(x, 0.0, 1.0)),
            radius,
            cone_sine: 0.1,
            deviation,
            ..Node::BLANK
        };
        let [parent, left, right] =
            [bounds(0.0, 1.0, 0.5), bounds(0.5, 2.0, 0.75), bounds(-0.25, 0.1, 0.1)];
        let alone = |node: &Node| BoundCodes::enclosing(node, []).unwrap().of(node);
        let codes = BoundCodes::enclosing(&parent, [alone(&left), alone(&right)]).unwrap();
        let mut stored = parent;
        codes.store(&mut stored);
        assert!(stored.radius >= 2.5 && stored.radius < 2.55);
        assert!(stored.deviation >= 0.75 && stored.deviation < 0.76);
        let angle = f64::from(stored.cone_sine).asin();
        let needed = 0.5f64.atan() + f64::from(0.1f32).asin();
        assert!(angle >= needed - 1e-4 && angle < needed * 1.01);
        assert_eq!(BoundCodes::enclosing(&Node { radius: f32::NAN, ..parent }, []), None);
    }

    #[test]
    fn cones_hold_cones_up_to_a_right_angle_and_all_beyond() {
        for step in 0..=180 {
            let between = f64::from(step).to_radians();
            let child = OctNormal::new(Vec3::new(between.sin() as f32, 0.0, between.cos() as f32));
            let exact = child.to_vec3().as_dvec3().angle_between(DVec3::Z);
            for half in [0.0f32, 0.01, 0.3, 1.0, 1.5, 1.57] {
                let sine = enclosing_sine(DVec3::Z, child, half.sin());
                let sum = exact + f64::from(half.sin()).asin();
                let expected = if sum < std::f64::consts::FRAC_PI_2 { sum.sin() } else { 1.0 };
                assert!((sine - expected).abs() < 1e-12, "{step} {half} {sine} {expected}");
            }
            assert_eq!(enclosing_sine(DVec3::Z, child, 1.0), 1.0);
        }
    }

    #[test]
    fn bounds_that_have_codes_stay_as_they_are() {
        let mut node = Node {
            position: Vec3::new(0.3, 0.7, -2.0),
            normal: OctNormal::new(Vec3::new(0.2, 0.9, 0.1)),
            radius: 0.123,
            cone_sine: 0.456,
            deviation: 1e-7,
            ..Node::BLANK
        };
        let child = Node { position: Vec3::ONE, normal: OctNormal::new(Vec3::Y), ..node };
        let child = BoundCodes::enclosing(&child, []).unwrap().of(&child);
        let codes = BoundCodes::enclosing(&node, [child]).unwrap();
        codes.store(&mut node);
        assert_eq!(BoundCodes::of_node(&node), Some(codes));
        assert_eq!(BoundCodes::enclosing(&node, [child]), Some(codes));
        assert_eq!(BoundCodes::of_node(&Node { radius: 0.123, ..node }), None);
    }
}
