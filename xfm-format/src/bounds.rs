//! Radius, cone and deviation in 16 bits each, always rounded up, and still enclosing those of the children.

use glam::Vec3;
use mergetree::{Node, OctNormal};

/// Largest code of a finite number.
pub(crate) const MAX_CODE: u64 = 0xfeff;
/// Code of the number 1.
pub(crate) const ONE_CODE: u64 = 0x7f00;

/// Slack for the trigonometric functions, which differ between machines by a few units in the last place.
const ANGLE_SLACK: f64 = 1e-6;

/// Radius, cone sine and deviation of a node as a file stores them: 16 bits each, rounded up.
///
/// ```
/// use mergetree::Node;
/// use xfm_format::BoundCodes;
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
    /// Codes of bounds that are not below those of the node itself and enclose those of its children, as the format
    /// demands; `None` when one of them is not finite.
    pub fn enclosing(node: &Node, children: impl IntoIterator<Item = Bounded>) -> Option<Self> {
        let bounds = [node.radius, node.cone_sine, node.deviation];
        if !bounds.iter().all(|bound| bound.is_finite()) {
            return None;
        }
        let [mut radius, mut sine, mut deviation] = bounds.map(f64::from);
        for child in children {
            let reach = decode(child.codes.radius);
            radius = radius.max(enclosing_radius(node.position, child.position, reach));
            let cone = decode(child.codes.cone_sine);
            let angle = enclosing_angle(node.normal, child.normal, cone);
            let needed = if angle < std::f64::consts::FRAC_PI_2 { angle.sin() } else { 1.0 };
            sine = sine.max(needed);
            deviation = deviation.max(f64::from(decode(child.codes.deviation)));
        }
        Some(Self {
            radius: encode_up(radius)?,
            cone_sine: encode_up(sine.min(1.0))?,
            deviation: encode_up(deviation)?,
        })
    }

    /// Sets the bounds of a node to what the codes stand for.
    pub fn store(self, node: &mut Node) {
        node.radius = decode(self.radius);
        node.cone_sine = decode(self.cone_sine);
        node.deviation = decode(self.deviation);
    }

    /// What a parent must know of a node that has these bounds.
    pub fn of(self, node: &Node) -> Bounded {
        Bounded { position: node.position, normal: node.normal, codes: self }
    }
}

/// The number a code stands for: the upper 16 of the 31 bits below the sign of an `f32`.
#[inline]
pub(crate) fn decode(code: u16) -> f32 {
    f32::from_bits(u32::from(code) << 15)
}

/// The code of a number that has one.
#[inline]
pub(crate) fn exact_code(value: f32) -> Option<u16> {
    let code = (value.to_bits() >> 15) as u16;
    (value.to_bits() == u32::from(code) << 15 && u64::from(code) <= MAX_CODE).then_some(code)
}

/// The least code whose number is not below `value`; `None` when there is none. Negative numbers count as zero.
pub(crate) fn encode_up(value: f64) -> Option<u16> {
    if value.is_nan() {
        return None;
    }
    let value = value.max(0.0);
    let mut single = value as f32;
    if f64::from(single) < value {
        single = single.next_up();
    }
    let code = (u64::from(single.to_bits()) + 0x7fff) >> 15;
    (code <= MAX_CODE).then_some(code as u16)
}

/// Radius that a sphere about `parent` needs to hold the sphere of this radius about `child`.
pub(crate) fn enclosing_radius(parent: Vec3, child: Vec3, radius: f32) -> f64 {
    parent.as_dvec3().distance(child.as_dvec3()) + f64::from(radius)
}

/// Half-angle that a cone about `parent` needs to hold the cone of this sine about `child`.
pub(crate) fn enclosing_angle(parent: OctNormal, child: OctNormal, sine: f32) -> f64 {
    let [a, b] = [parent, child].map(|normal| normal.to_vec3().as_dvec3());
    a.cross(b).length().atan2(a.dot(b)) + half_angle(sine)
}

fn half_angle(sine: f32) -> f64 {
    if sine >= 1.0 { std::f64::consts::PI } else { f64::from(sine).asin() }
}

/// Whether a cone of this sine has this half-angle at least.
pub(crate) fn cone_holds(sine: f32, angle: f64) -> bool {
    sine >= 1.0 || half_angle(sine) + ANGLE_SLACK >= angle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_up_by_less_than_half_a_percent() {
        let mut value = 1e-30f64;
        while value < 1e30 {
            let code = encode_up(value).unwrap();
            let back = f64::from(decode(code));
            assert!(back >= value && back < value * 1.004, "{value} {back}");
            assert_eq!(encode_up(back), Some(code));
            assert_eq!(exact_code(decode(code)), Some(code));
            assert_eq!(exact_code(decode(code).next_up()), None);
            value *= 1.37;
        }
    }

    #[test]
    fn zero_and_one_are_exact_and_the_infinite_has_no_code() {
        assert_eq!(encode_up(0.0), Some(0));
        assert_eq!(encode_up(-0.0), Some(0));
        assert_eq!(encode_up(-3.0), Some(0));
        assert_eq!(encode_up(1.0), Some(ONE_CODE as u16));
        assert_eq!(decode(ONE_CODE as u16), 1.0);
        assert!(decode(MAX_CODE as u16).is_finite());
        assert_eq!(encode_up(f64::from(f32::MAX)), None);
        assert_eq!(encode_up(f64::NAN), None);
        assert!(decode(encode_up(1e-45).unwrap()) > 0.0);
        for none in [-0.0, -1.0, f32::INFINITY, f32::NAN] {
            assert_eq!(exact_code(none), None);
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
        assert!(cone_holds(stored.cone_sine, 0.5f64.atan() + 0.1f64.asin()));
        assert_eq!(BoundCodes::enclosing(&Node { radius: f32::NAN, ..parent }, []), None);
    }
}
