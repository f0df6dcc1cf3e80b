//! Points picked on the surface.

use glam::{DVec3, Vec3};

/// One point, or two with the distance between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Measure {
    pub(crate) on: bool,
    pub(crate) points: Vec<Vec3>,
}

impl Measure {
    /// Adds a point; a third one begins anew.
    pub(crate) fn pick(&mut self, point: Vec3) {
        if self.points.len() >= 2 {
            self.points.clear();
        }
        self.points.push(point);
    }

    /// Between the two, in model units.
    pub(crate) fn distance(&self) -> Option<f64> {
        match self.points[..] {
            [a, b] => Some(a.as_dvec3().distance(b.as_dvec3())),
            _ => None,
        }
    }
}

/// A point in the frame of the input, with as many digits as a model of this radius has meaning for.
pub(crate) fn position_text(point: Vec3, origin: DVec3, radius: f32) -> String {
    let digits = digits_for(radius);
    let DVec3 { x, y, z } = origin + point.as_dvec3();
    format!("{x:.digits$}, {y:.digits$}, {z:.digits$}")
}

/// A length in model units.
pub(crate) fn length_text(length: f64, radius: f32) -> String {
    format!("{length:.0$}", digits_for(radius))
}

/// Digits after the point so that a hundred-thousandth of the radius shows.
fn digits_for(radius: f32) -> usize {
    (5.0 - f64::from(radius).log10().floor()).clamp(0.0, 12.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_points_have_a_distance_and_a_third_begins_anew() {
        let mut measure = Measure::default();
        assert_eq!(measure.distance(), None);
        measure.pick(Vec3::ZERO);
        measure.pick(Vec3::new(3.0, 4.0, 0.0));
        assert_eq!(measure.distance(), Some(5.0));
        measure.pick(Vec3::ONE);
        assert_eq!(measure.points, [Vec3::ONE]);
    }

    #[test]
    fn positions_keep_the_digits_of_their_origin() {
        let origin = DVec3::new(500_000.0, 5_800_000.0, 100.0);
        assert_eq!(
            position_text(Vec3::new(0.125, -1.0, 0.0), origin, 40.0),
            "500000.1250, 5799999.0000, 100.0000"
        );
        assert_eq!(length_text(0.000_123_456_7, 0.001), "0.00012346");
    }
}
