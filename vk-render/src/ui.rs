//! Panels over the picture, as a user interface's library paints them.

use crate::Texture;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// A corner of a triangle over the picture.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct UiVertex {
    /// In pixels from the picture's upper left corner.
    pub position_px: [f32; 2],
    /// The place in the texture, 0 to 1 from its upper left corner.
    pub uv: [f32; 2],
    /// Red, green, blue in sRGB, multiplied with the opacity, and the opacity; multiplied with the texture's.
    pub rgba: [u8; 4],
}

const _: () = assert!(size_of::<UiVertex>() == 20);

/// Triangles with one texture.
#[derive(Clone, Debug)]
pub struct UiPiece<'a> {
    /// Nothing is drawn outside of it: left, top, right, bottom, in pixels.
    pub clip_px: [f32; 4],
    /// Where the colours come from.
    pub texture: &'a Texture,
    /// Which of [`Ui::indices`]; what reaches past them is left out.
    pub indices: Range<u32>,
}

/// A user interface over the picture: triangles in pixels, later ones before earlier ones.
///
/// # Conventions
/// As egui and its like paint: colours are multiplied with their opacity, and both windings are drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ui<'a> {
    /// The corners.
    pub vertices: &'a [UiVertex],
    /// Three places in `vertices` for each triangle.
    pub indices: &'a [u32],
    /// What is drawn of them, in this order.
    pub pieces: &'a [UiPiece<'a>],
}
