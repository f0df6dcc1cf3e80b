//! Radius, cone and deviation in 16 bits each: the rules that a file's have to keep.

use glam::Vec3;
use mergetree::OctNormal;
pub use mergetree::{BoundCodes, Bounded};

/// Slack for the trigonometric functions, which differ between machines by a few units in the last place.
const ANGLE_SLACK: f64 = 1e-6;

/// Largest code of a finite number.
pub(crate) const MAX_CODE: u64 = BoundCodes::MAX as u64;
/// Code of the number 1.
pub(crate) const ONE_CODE: u64 = BoundCodes::ONE as u64;

#[inline]
pub(crate) fn decode(code: u16) -> f32 {
    BoundCodes::decode(code)
}

#[inline]
pub(crate) fn exact_code(value: f32) -> Option<u16> {
    BoundCodes::exact(value)
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
