//! The common frame of two surfaces: origin at the centre of both, coordinates within [-1, 1].
//!
//! Distances far from the origin keep their digits, bounding boxes fit single precision, and the scale is a power of two,
//! so that going back is exact.

use glam::DVec3;

use super::surface::Surface;

/// A translation and a scaling by a power of two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    centre: DVec3,
    scale: f64,
}

impl Frame {
    /// The frame in which both surfaces lie within [-1, 1] on every axis.
    pub(super) fn around(a: &Surface, b: &Surface) -> Self {
        let (min, max) = (a.min.min(b.min), a.max.max(b.max));
        // Halved first: the sum of two large coordinates may overflow.
        let (centre, half) = (min * 0.5 + max * 0.5, max * 0.5 - min * 0.5);
        let extent = half.max_element();
        let scale =
            if extent > 0.0 { extent.log2().ceil().clamp(-900.0, 900.0).exp2() } else { 1.0 };
        Self { centre, scale }
    }

    /// A point of the model, in the frame.
    pub(super) fn enter(&self, point: DVec3) -> DVec3 {
        (point - self.centre) / self.scale
    }

    /// A length in the frame, in model units.
    pub(super) fn length_outside(&self, length: f64) -> f64 {
        length * self.scale
    }
}
