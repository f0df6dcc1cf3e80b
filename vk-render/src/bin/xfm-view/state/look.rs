//! How the model is coloured.

use clap::ValueEnum;
use vk_render::Shading;

use crate::model::Paint;

/// A shading with what its colours mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Look {
    /// Clay, lit by the vertices' normals
    #[default]
    Smooth,
    /// Clay, lit face by face
    Flat,
    /// Every edge
    Wireframe,
    /// Coarse (blue) to fine (red)
    Lod,
    /// Each block of the file in a colour
    Blocks,
    /// What could be refined at once, what has to be loaded, what is finest
    Residency,
    /// Directions as colours
    Normals,
    /// The model's own colours, where it has any
    #[value(name = "colours")]
    Own,
}

impl Look {
    pub(crate) const ALL: [Self; 8] = [
        Self::Smooth,
        Self::Flat,
        Self::Wireframe,
        Self::Lod,
        Self::Blocks,
        Self::Residency,
        Self::Normals,
        Self::Own,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Smooth => "Smooth",
            Self::Flat => "Flat",
            Self::Wireframe => "Wireframe",
            Self::Lod => "Level of detail",
            Self::Blocks => "Blocks",
            Self::Residency => "In memory",
            Self::Normals => "Normals",
            Self::Own => "Own colours",
        }
    }

    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Smooth => "Clay, lit by the vertices' normals",
            Self::Flat => "Clay, lit face by face",
            Self::Wireframe => "Every edge of every triangle",
            Self::Lod => "By level in the tree: coarse is blue, fine is red",
            Self::Blocks => "Each block of the file in a colour of its own",
            Self::Residency => "Finer detail is in memory, has to be loaded, or does not exist",
            Self::Normals => "x, y, z of the normals as red, green, blue",
            Self::Own => "The model's own colours",
        }
    }

    pub(crate) fn shading(self) -> Shading {
        match self {
            Self::Smooth => Shading::Smooth,
            Self::Flat => Shading::Flat,
            Self::Wireframe => Shading::Wireframe,
            Self::Lod => Shading::LevelOfDetail,
            Self::Blocks | Self::Residency => Shading::Patches,
            Self::Normals => Shading::Normals,
            Self::Own => Shading::Coloured,
        }
    }

    pub(crate) fn paint(self) -> Paint {
        match self {
            Self::Blocks => Paint::Block,
            Self::Residency => Paint::Residency,
            Self::Own => Paint::Own,
            _ => Paint::Nothing,
        }
    }

    /// The next one; the model's own colours only where it has any.
    pub(crate) fn next(self, has_colours: bool) -> Self {
        let at = Self::ALL.iter().position(|&look| look == self).unwrap_or(0);
        let next = Self::ALL[(at + 1) % Self::ALL.len()];
        if next == Self::Own && !has_colours { Self::ALL[0] } else { next }
    }
}
