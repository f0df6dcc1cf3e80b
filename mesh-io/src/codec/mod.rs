//! What the formats share: windows over input, numbers in text, welding, polygons, output that appears whole.

pub(crate) mod input;
pub(crate) mod output;
pub(crate) mod packing;
pub(crate) mod quote;

#[cfg(any(feature = "ply", feature = "obj"))]
pub(crate) mod indexed;
#[cfg(any(feature = "stl", feature = "ply", feature = "obj"))]
pub(crate) mod plain;
#[cfg(any(feature = "ply", feature = "obj"))]
pub(crate) mod polygon;
#[cfg(any(feature = "stl", feature = "ply", feature = "obj"))]
pub(crate) mod text;
pub(crate) mod weld;
