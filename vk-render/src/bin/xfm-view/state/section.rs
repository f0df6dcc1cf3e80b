//! The plane that the model is cut at.

use glam::Vec3;
use vk_render::Section;

/// Which way the plane looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Axis {
    /// Towards the eye as it was when this was chosen.
    #[default]
    View,
    X,
    Y,
    Z,
}

impl Axis {
    pub(crate) const ALL: [Self; 4] = [Self::View, Self::X, Self::Y, Self::Z];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::View => "View",
            Self::X => "X",
            Self::Y => "Y",
            Self::Z => "Z",
        }
    }
}

/// The tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SectionTool {
    pub(crate) on: bool,
    pub(crate) axis: Axis,
    /// How much of the model is cut away along the axis, 0 to 1.
    pub(crate) depth: f32,
    /// Whether the other side is cut away.
    pub(crate) flipped: bool,
    /// Towards the eye, when that was taken.
    pub(crate) view: Vec3,
}

impl Default for SectionTool {
    fn default() -> Self {
        Self { on: false, axis: Axis::View, depth: 0.5, flipped: false, view: Vec3::Z }
    }
}

impl SectionTool {
    /// The plane, if there is one, for a model in this box.
    pub(crate) fn plane(&self, [min, max]: [Vec3; 2]) -> Option<Section> {
        if !self.on {
            return None;
        }
        let normal = match self.axis {
            Axis::View => self.view.normalize_or(Vec3::Z),
            Axis::X => Vec3::X,
            Axis::Y => Vec3::Y,
            Axis::Z => Vec3::Z,
        };
        let normal = if self.flipped { -normal } else { normal };
        let middle = normal.dot(0.5 * (min + max));
        let half = normal.abs().dot(0.5 * (max - min));
        Some(Section { normal, offset: middle + half * (1.0 - 2.0 * self.depth) })
    }

    /// Whether a point is cut away.
    pub(crate) fn cuts(plane: Option<Section>, point: Vec3) -> bool {
        plane.is_some_and(|plane| plane.normal.dot(point) > plane.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slider_goes_through_the_whole_model() {
        let bounds = [Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 4.0)];
        let mut tool = SectionTool { on: true, axis: Axis::X, ..SectionTool::default() };
        for (depth, offset) in [(0.0, 3.0), (0.5, 1.0), (1.0, -1.0)] {
            tool.depth = depth;
            assert_eq!(tool.plane(bounds).unwrap().offset, offset);
        }
        tool.flipped = true;
        tool.depth = 0.25;
        let plane = tool.plane(bounds);
        assert!(SectionTool::cuts(plane, Vec3::new(-0.5, 0.0, 0.0)));
        assert!(!SectionTool::cuts(plane, Vec3::new(0.5, 0.0, 0.0)));
        tool.on = false;
        assert!(!SectionTool::cuts(tool.plane(bounds), Vec3::NEG_X));
    }
}
