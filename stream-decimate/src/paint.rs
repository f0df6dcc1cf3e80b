//! Colours of vertices, and what collapses do to the colour of the surface.
//!
//! A vertex stands for the part of the surface that it and all vertices it has taken had in the input. The error of its colour
//! there is the integral of the squared difference to the colour that was: a quadric in the space of colours, which is added
//! and moved as those of positions are. Components are 0 to 1, alpha is one of four.
//!
//! # Sources
//! Garland and Heckbert, *Simplifying Surfaces with Color and Texture using Quadric Error Metrics*, 1998, for errors of colours as
//! quadrics; here colour is one constant for each vertex, since vertices stay where they are.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use mesh_io::Colour;

/// The colour of a vertex, and of what it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Paint {
    /// Its own.
    pub(crate) colour: Colour,
    /// Area, of each triangle for each of its corners, as in the quadrics of positions.
    area: f32,
    /// The integral of the difference to its own colour.
    sum: [f32; 4],
    /// The integral of the square of that.
    squares: f32,
}

fn difference(to: Colour, from: Colour) -> Vec4 {
    let component = |i: usize| (f32::from(to[i]) - f32::from(from[i])) / 255.0;
    Vec4::new(component(0), component(1), component(2), component(3))
}

impl Paint {
    /// A vertex of this colour that stands for nothing yet.
    pub(crate) fn new(colour: Colour) -> Self {
        Self { colour, ..Self::default() }
    }

    /// Adds a part of the surface of the vertex' own colour.
    #[inline]
    pub(crate) fn add_area(&mut self, area: f32) {
        if area.is_finite() {
            self.area += area;
        }
    }

    /// The same vertex that stands for nothing.
    pub(crate) fn without_area(self) -> Self {
        Self::new(self.colour)
    }

    /// The error if all of it had this colour.
    #[inline]
    pub(crate) fn error_as(&self, colour: Colour) -> f32 {
        let moved = difference(colour, self.colour);
        let cross = moved.dot(Vec4::from_array(self.sum));
        (self.area * moved.length_squared() - 2.0 * cross + self.squares).max(0.0)
    }

    /// The error as it is.
    #[inline]
    pub(crate) fn error(&self) -> f32 {
        self.squares
    }

    /// Takes what another one stands for.
    pub(crate) fn take(&mut self, other: &Self) {
        let step = difference(other.colour, self.colour);
        let sum = Vec4::from_array(other.sum);
        self.squares += other.squares + 2.0 * step.dot(sum) + other.area * step.length_squared();
        self.sum = (Vec4::from_array(self.sum) + sum + other.area * step).to_array();
        self.area += other.area;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_the_sums_over_all_that_was_taken() {
        let parts: [(Colour, f32); 5] = [
            ([0, 0, 0, 255], 1.0),
            ([255, 0, 51, 255], 0.5),
            ([10, 20, 30, 0], 2.0),
            ([255; 4], 0.25),
            ([0, 255, 0, 128], 3.0),
        ];
        let naive = |colour: Colour, parts: &[(Colour, f32)]| -> f32 {
            parts.iter().map(|&(c, area)| area * difference(c, colour).length_squared()).sum()
        };
        let paint = |(colour, area): (Colour, f32)| {
            let mut paint = Paint::new(colour);
            paint.add_area(area);
            paint
        };
        let [mut left, mut right] = [paint(parts[0]), paint(parts[2])];
        left.take(&paint(parts[1]));
        right.take(&paint(parts[3]));
        right.take(&paint(parts[4]));
        assert!((right.error() - naive(parts[2].0, &parts[2..])).abs() < 1e-4);
        assert!((left.error_as(parts[2].0) - naive(parts[2].0, &parts[..2])).abs() < 1e-4);
        let expected = right.error() + left.error_as(right.colour);
        right.take(&left);
        assert!((right.error() - expected).abs() < 1e-4);
        for colour in [[3, 200, 7, 9], [0, 0, 0, 255]] {
            assert!((right.error_as(colour) - naive(colour, &parts)).abs() < 1e-4);
        }
        assert_eq!(Paint::new([1; 4]).error_as([9; 4]), 0.0);
    }
}
