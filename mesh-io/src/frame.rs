//! Where the coordinates handed out have their origin.

use glam::DVec3;

/// The frame of a stream's coordinates: what is handed out is the file's coordinate less `origin`, as `f32`.
///
/// `origin` is zero unless a file's coordinates lie so far out that `f32` would crush them.
///
/// # Units
///
/// The file's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Frame {
    /// Where the handed-out zero lies in the file's own frame.
    pub origin: DVec3,
    /// Whether the file's coordinates need double precision.
    pub double: bool,
}
