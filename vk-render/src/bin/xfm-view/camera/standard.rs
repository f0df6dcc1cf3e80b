//! Which way is up, and the views that have names.

use glam::{Quat, Vec3};

/// The axis that points upwards. Meshes of the graphics world mostly use y, scans and maps z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Up {
    #[default]
    Y,
    Z,
}

impl Up {
    pub(crate) fn axis(self) -> Vec3 {
        match self {
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
        }
    }

    /// Turns a world in which y is up, and +z towards the viewer, into this one.
    pub(crate) fn rotation(self) -> Quat {
        match self {
            Self::Y => Quat::IDENTITY,
            // The front of things then looks towards −y.
            Self::Z => Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
        }
    }

    pub(crate) fn other(self) -> Self {
        match self {
            Self::Y => Self::Z,
            Self::Z => Self::Y,
        }
    }
}

/// A view along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Standard {
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
}

impl Standard {
    pub(crate) const ALL: [Self; 6] =
        [Self::Front, Self::Back, Self::Left, Self::Right, Self::Top, Self::Bottom];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Front => "Front",
            Self::Back => "Back",
            Self::Left => "Left",
            Self::Right => "Right",
            Self::Top => "Top",
            Self::Bottom => "Bottom",
        }
    }

    /// Where the camera stands, as yaw and pitch in radians. From above and below, the front is at the picture's lower
    /// and upper edge.
    pub(crate) fn angles(self) -> (f32, f32) {
        use std::f32::consts::{FRAC_PI_2, PI};
        match self {
            Self::Front => (0.0, 0.0),
            Self::Back => (PI, 0.0),
            Self::Left => (-FRAC_PI_2, 0.0),
            Self::Right => (FRAC_PI_2, 0.0),
            Self::Top => (0.0, FRAC_PI_2),
            Self::Bottom => (0.0, -FRAC_PI_2),
        }
    }
}
