//! What one picture is made of.

use crate::{Camera, MeshBuffers, Ui};
use glam::Vec3;

/// How the mesh's faces are coloured. All of them are drawn from both sides, the inside in red, so that a flipped face
/// or a crack is seen at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shading {
    /// Clay, lit by the vertices' normals.
    #[default]
    Smooth,
    /// Clay, lit by each face's own normal.
    Flat,
    /// Every edge of every face that is not hidden.
    Wireframe,
    /// Each face in the colour of its finest vertex's level, with faint edges.
    LevelOfDetail,
    /// The vertices' normals as colours: x, y, z as red, green, blue.
    Normals,
    /// The vertices' own colours ([`MeshUpdate::colours`](crate::MeshUpdate::colours)), lit as [`Shading::Smooth`]; that
    /// where the mesh has none.
    Coloured,
    /// Each face in the colour of its finest vertex, with faint edges: for colours that tell where a face comes from.
    /// [`Shading::Smooth`] where the mesh has none.
    Patches,
}

impl Shading {
    /// All of them, in an order to step through.
    pub const ALL: [Self; 7] = [
        Self::Smooth,
        Self::Flat,
        Self::Wireframe,
        Self::LevelOfDetail,
        Self::Normals,
        Self::Coloured,
        Self::Patches,
    ];
}

/// A vertical gradient behind everything, in sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Background {
    /// Red, green, blue at the picture's upper edge.
    pub top: [u8; 3],
    /// Red, green, blue at its lower edge.
    pub bottom: [u8; 3],
}

impl Default for Background {
    /// A soft grey-blue.
    fn default() -> Self {
        Self { top: [88, 97, 109], bottom: [29, 32, 38] }
    }
}

/// A plane that the mesh ends at: what lies beyond it, where `normal · p > offset`, is not drawn, and the view is free on
/// what is behind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Towards what is cut away, in world space; its length does not matter.
    pub normal: Vec3,
    /// How far the plane lies from the origin along `normal`, in model units times the length of `normal`.
    pub offset: f32,
}

/// A straight line in space, hidden by what lies before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end, in world space.
    pub a: Vec3,
    /// The other.
    pub b: Vec3,
    /// Red, green, blue in sRGB, and opacity.
    pub rgba: [u8; 4],
}

/// A block of text over the picture, in a built-in fixed-width font of printable ASCII (other characters show as a box).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Text<'a> {
    /// The lines, divided by `\n`.
    pub text: &'a str,
    /// The block's upper left corner, in pixels from the picture's.
    pub origin_px: [f32; 2],
    /// How many pixels each of the font's dots is wide and high; a character takes 6 x 9 dots.
    pub dot_px: u32,
    /// Red, green, blue in sRGB, and opacity.
    pub rgba: [u8; 4],
    /// A panel behind the text, if any: red, green, blue, opacity.
    pub panel: Option<[u8; 4]>,
}

impl<'a> Text<'a> {
    /// Light text on a dark panel in the upper left corner.
    pub fn new(text: &'a str) -> Self {
        Self {
            text,
            origin_px: [12.0, 12.0],
            dot_px: 2,
            rgba: [235, 238, 242, 255],
            panel: Some([12, 14, 18, 170]),
        }
    }
}

/// One picture's content.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Scene<'a> {
    /// The mesh, as of its last update.
    pub mesh: &'a MeshBuffers,
    /// Where it is seen from.
    pub camera: Camera,
    /// How it is coloured; [`Shading::Smooth`] unless told.
    pub shading: Shading,
    /// What is behind it.
    pub background: Background,
    /// Lines among it; none unless told.
    pub lines: &'a [Line],
    /// The lines' width in pixels, 0.5 to 64; 2.5 unless told.
    pub line_width_px: f32,
    /// Text before it; none unless told.
    pub text: &'a [Text<'a>],
    /// The level that takes the last colour in [`Shading::LevelOfDetail`]; 24 unless told.
    pub max_level: u8,
    /// Whether triangles are clockwise seen from outside and normals point inwards, as some programs write them; false
    /// unless told.
    pub inside_out: bool,
    /// Where the mesh ends; nowhere unless told.
    pub section: Option<Section>,
    /// A user interface before everything; none unless told.
    pub ui: Ui<'a>,
}

impl<'a> Scene<'a> {
    /// The mesh seen by the camera, everything else as its fields say.
    pub fn new(mesh: &'a MeshBuffers, camera: Camera) -> Self {
        Self {
            mesh,
            camera,
            shading: Shading::default(),
            background: Background::default(),
            lines: &[],
            line_width_px: 2.5,
            text: &[],
            max_level: 24,
            inside_out: false,
            section: None,
            ui: Ui::default(),
        }
    }
}

/// A picture in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Red, green, blue (sRGB) and opacity (255) of each pixel, row by row from the upper left.
    pub rgba: Vec<u8>,
}

impl Image {
    /// The pixel at column `x` and row `y`, or `None` outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 4]> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let at = 4 * (y as usize * self.width as usize + x as usize);
        self.rgba.get(at..at + 4)?.try_into().ok()
    }
}
