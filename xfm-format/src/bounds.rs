//! Radius, cone and deviation in 16 bits each, always rounded up, and still enclosing those of the children.

use mergetree::Node;

/// Largest code of a finite number.
pub(crate) const MAX_CODE: u64 = 0xfeff;
/// Code of the number 1.
pub(crate) const ONE_CODE: u64 = 0x7f00;

/// Slack for the trigonometric functions, which differ between machines by a few units in the last place.
const ANGLE_SLACK: f64 = 1e-6;

/// The number a code stands for: the upper 16 of the 31 bits below the sign of an `f32`.
#[inline]
pub(crate) fn decode(code: u16) -> f32 {
    f32::from_bits(u32::from(code) << 15)
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

/// Radius that a sphere about `parent` needs to hold the sphere of `child`.
pub(crate) fn enclosing_radius(parent: &Node, child: &Node, child_radius: f32) -> f64 {
    parent.position.as_dvec3().distance(child.position.as_dvec3()) + f64::from(child_radius)
}

/// Half-angle that a cone about the normal of `parent` needs to hold the cone of `child`.
pub(crate) fn enclosing_angle(parent: &Node, child: &Node, child_sine: f32) -> f64 {
    let [a, b] = [parent, child].map(|node| node.normal.to_vec3().as_dvec3());
    a.cross(b).length().atan2(a.dot(b)) + half_angle(child_sine)
}

fn half_angle(sine: f32) -> f64 {
    if sine >= 1.0 { std::f64::consts::PI } else { f64::from(sine).asin() }
}

/// Whether a cone of this sine has this half-angle at least.
pub(crate) fn cone_holds(sine: f32, angle: f64) -> bool {
    sine >= 1.0 || half_angle(sine) + ANGLE_SLACK >= angle
}

/// Codes of radius, cone sine and deviation of a node, not below its own and enclosing those of its children, which come
/// with their codes. `None` when a bound is not finite.
pub(crate) fn codes<'a>(
    node: &Node,
    children: impl Iterator<Item = (&'a Node, [u16; 3])>,
) -> Option<[u16; 3]> {
    let bounds = [node.radius, node.cone_sine, node.deviation];
    if !bounds.iter().all(|bound| bound.is_finite()) {
        return None;
    }
    let [mut radius, mut sine, mut deviation] = bounds.map(f64::from);
    for (child, codes) in children {
        let [child_radius, child_sine, child_deviation] = codes.map(decode);
        radius = radius.max(enclosing_radius(node, child, child_radius));
        let angle = enclosing_angle(node, child, child_sine);
        let needed = if angle < std::f64::consts::FRAC_PI_2 { angle.sin() } else { 1.0 };
        sine = sine.max(needed);
        deviation = deviation.max(f64::from(child_deviation));
    }
    Some([encode_up(radius)?, encode_up(sine.min(1.0))?, encode_up(deviation)?])
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
    }
}
