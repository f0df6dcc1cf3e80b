//! What the bounds of a parent have to be for those of its child.

use glam::Vec3;
use mergetree::OctNormal;

/// Slack for the trigonometric functions, which differ between machines by a few units in the last place.
const ANGLE_SLACK: f64 = 1e-6;

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
