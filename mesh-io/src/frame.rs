//! Where the coordinates handed out have their origin.

use glam::{DVec3, Vec3};

/// From here on neighbouring `f32` lie 1/128 and more apart.
const FAR: f64 = 65_536.0;

/// From here on an origin could bring other coordinates beyond the largest `f32`; below it does not change those near that.
const TOO_FAR: f64 = 1e30;

/// The frame of a stream's coordinates: what is handed out is the file's coordinate less `origin`, rounded to `f32`.
///
/// Files whose coordinates are doubles (or 32-bit integers) or decimal text, far from zero, would lose digits as `f32`,
/// georeferenced ones above all. Their first vertex decides: on each axis where it is 65,536 or more from zero, the
/// origin is its coordinate rounded to a whole number; on the others, and in all other files, it is zero, and then
/// coordinates are the nearest `f32` as they stand. So the origin depends on the file alone and is known from the
/// beginning, and a mesh keeps about seven digits of its own size, wherever it lies.
///
/// # Units
///
/// The file's.
///
/// ```
/// # #[cfg(all(feature = "obj", feature = "ply"))] {
/// use glam::DVec3;
/// use mesh_io::{Format, Frame, sink_to_in, source_from};
///
/// let obj = "v 512345.25 5403210.125 3.5\nv 512346.0 5403210.5 3.5\nv 512345.0 5403211.5 4.0\nf 1 2 3\n";
/// let mut source = source_from(obj.as_bytes(), Format::Obj, "tile.obj")?;
/// let frame = source.frame();
/// assert_eq!(frame, Frame { origin: DVec3::new(512345.0, 5403210.0, 0.0), double: true });
///
/// let mut triangles = Vec::new();
/// source.read(&mut triangles, 10)?;
/// assert_eq!(triangles[0][0].to_array(), [0.25, 0.125, 3.5]);
///
/// let mut back = Vec::new();
/// let mut sink = sink_to_in(&mut back, Format::Obj, frame)?;
/// sink.write(&triangles)?;
/// sink.finish()?;
/// assert!(String::from_utf8_lossy(&back).contains("v 512345.25 5403210.125 3.5\n"));
/// # }
/// # Ok::<(), mesh_io::Error>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Frame {
    /// Where the handed-out zero lies in the file's own frame.
    pub origin: DVec3,
    /// Whether the file's coordinates need double precision; a sink in this frame writes doubles where its format has
    /// them.
    pub double: bool,
}

/// Which frame a reader is to hand out.
#[cfg_attr(not(any(feature = "stl", feature = "ply", feature = "obj")), allow(dead_code))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Framing {
    /// The file's own, whatever `f32` makes of it.
    Own,
    /// About the first vertex, where that is far out.
    Local,
}

#[cfg_attr(not(any(feature = "stl", feature = "ply", feature = "obj")), allow(dead_code))]
impl Framing {
    /// The frame for a file that holds more than `f32` can, by its first vertex.
    pub(crate) fn choose(self, first: DVec3) -> Frame {
        match self {
            Self::Own => Frame::default(),
            Self::Local => Frame::around(first),
        }
    }
}

impl Frame {
    #[cfg_attr(not(any(feature = "stl", feature = "ply", feature = "obj")), allow(dead_code))]
    fn around(first: DVec3) -> Self {
        let axis = |c: f64| if (FAR..TOO_FAR).contains(&c.abs()) { c.round() } else { 0.0 };
        let origin = DVec3::from_array(first.to_array().map(axis));
        Self { origin, double: origin != DVec3::ZERO }
    }

    /// From the file's own coordinates to those handed out.
    #[inline]
    pub fn from_file(&self, position: DVec3) -> Vec3 {
        (position - self.origin).as_vec3()
    }

    /// From coordinates handed out to the file's own.
    #[inline]
    pub fn to_file(&self, position: Vec3) -> DVec3 {
        position.as_dvec3() + self.origin
    }

    /// As [`Frame::to_file`], for formats without doubles.
    #[cfg_attr(not(any(feature = "stl", feature = "gltf")), allow(dead_code))]
    #[inline]
    pub(crate) fn to_single(self, position: Vec3) -> Vec3 {
        // As they are, signs of zeros and all, where there is nothing to add.
        if self.double { self.to_file(position).as_vec3() } else { position }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_far_axes_move() {
        let near = DVec3::new(65_535.9, -65_535.9, 0.0);
        assert_eq!(Frame::around(near), Frame::default());
        let far = DVec3::new(65_536.0, -4_567_890.6, 12.5);
        let expected = Frame { origin: DVec3::new(65_536.0, -4_567_891.0, 0.0), double: true };
        assert_eq!(Frame::around(far), expected);
        let odd = DVec3::new(f64::NAN, f64::INFINITY, 1e29);
        assert_eq!(Frame::around(odd).origin, DVec3::new(0.0, 0.0, 1e29));
    }

    #[test]
    fn the_largest_numbers_stay_finite() {
        for first in [3.4e38, -3.4e38, 1e30, 9.9e29] {
            let frame = Frame::around(DVec3::splat(first));
            for other in [f32::MAX, f32::MIN, 0.0] {
                assert!(frame.from_file(DVec3::splat(other.into())).is_finite());
            }
        }
    }

    #[test]
    fn there_and_back_is_exact_near_the_origin() {
        let frame = Frame::around(DVec3::new(512_345.678, 5_403_210.1, -70_000.3));
        for offset in [0.125, -7.0 / 64.0, 1000.5] {
            let position = frame.origin + DVec3::splat(offset);
            assert_eq!(frame.to_file(frame.from_file(position)), position);
        }
    }

    #[test]
    fn without_an_origin_nothing_changes() {
        let frame = Frame::default();
        let position = Vec3::new(-0.0, f32::MIN_POSITIVE, f32::INFINITY);
        let there = frame.to_file(position).as_vec3().to_array().map(f32::to_bits);
        let back = frame.from_file(position.as_dvec3()).to_array().map(f32::to_bits);
        assert_eq!(back, position.to_array().map(f32::to_bits));
        // Minus zero plus zero is zero.
        assert_eq!(there[1..], back[1..]);
    }
}
