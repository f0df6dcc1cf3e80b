//! File formats and packings, by name.

use std::path::Path;

use crate::Error;

/// A mesh file format; for input the variants of one family (`StlBinary` and `StlAscii`, say) mean the same, since the
/// content tells which it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Binary STL, always little-endian.
    StlBinary,
    /// STL as text.
    StlAscii,
    /// Binary PLY, little-endian.
    PlyBinaryLittle,
    /// Binary PLY, big-endian.
    PlyBinaryBig,
    /// PLY as text.
    PlyAscii,
    /// Wavefront OBJ.
    Obj,
    /// glTF 2.0 as JSON with its data embedded.
    Gltf,
    /// glTF 2.0 in its binary container.
    Glb,
}

impl Format {
    /// The format that a file's extension asks for, after `.gz` or `.zst` is taken off; letter case does not matter.
    ///
    /// `.stl` and `.ply` give the binary (little-endian) variant.
    ///
    /// ```
    /// use mesh_io::Format;
    /// assert_eq!(Format::from_path("scan.PLY.gz".as_ref()), Some(Format::PlyBinaryLittle));
    /// assert_eq!(Format::from_path("scan.gz".as_ref()), None);
    /// ```
    pub fn from_path(path: &Path) -> Option<Self> {
        let stem = match Packing::from_path(path) {
            Packing::None => path.to_path_buf(),
            Packing::Gzip | Packing::Zstd => path.with_extension(""),
        };
        match stem.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::StlBinary),
            "ply" => Some(Self::PlyBinaryLittle),
            "obj" => Some(Self::Obj),
            "gltf" => Some(Self::Gltf),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// The format of a short name: `stl`, `stla` (text), `ply`, `plyb` (big-endian), `plya` (text), `obj`, `gltf`, `glb`.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::StlBinary),
            "stla" => Some(Self::StlAscii),
            "ply" => Some(Self::PlyBinaryLittle),
            "plyb" => Some(Self::PlyBinaryBig),
            "plya" => Some(Self::PlyAscii),
            "obj" => Some(Self::Obj),
            "gltf" => Some(Self::Gltf),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// The short name; [`Format::from_name`] takes it back.
    pub fn name(self) -> &'static str {
        match self {
            Self::StlBinary => "stl",
            Self::StlAscii => "stla",
            Self::PlyBinaryLittle => "ply",
            Self::PlyBinaryBig => "plyb",
            Self::PlyAscii => "plya",
            Self::Obj => "obj",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
        }
    }

    /// Whether a file of this format can hold coordinates in double precision, as those of a [`Frame`](crate::Frame) far
    /// from zero need it: PLY, OBJ and STL as text do; binary STL and glTF round them to `f32`.
    pub fn holds_doubles(self) -> bool {
        !matches!(self, Self::StlBinary | Self::Gltf | Self::Glb)
    }

    /// Whether a file of this format can hold colours of vertices: all but STL do.
    pub fn holds_colours(self) -> bool {
        !matches!(self, Self::StlBinary | Self::StlAscii)
    }

    /// Every format, in the order of the declaration.
    pub const ALL: [Self; 8] = [
        Self::StlBinary,
        Self::StlAscii,
        Self::PlyBinaryLittle,
        Self::PlyBinaryBig,
        Self::PlyAscii,
        Self::Obj,
        Self::Gltf,
        Self::Glb,
    ];
}

/// Formats that one reader takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    Stl,
    Ply,
    Obj,
    Gltf,
}

impl Format {
    pub(crate) fn family(self) -> Family {
        match self {
            Self::StlBinary | Self::StlAscii => Family::Stl,
            Self::PlyBinaryLittle | Self::PlyBinaryBig | Self::PlyAscii => Family::Ply,
            Self::Obj => Family::Obj,
            Self::Gltf | Self::Glb => Family::Gltf,
        }
    }
}

impl Family {
    /// What the first bytes of a file without a telling name show.
    #[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
    pub(crate) fn from_content(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            Some(Self::Ply)
        } else if bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{") {
            Some(Self::Gltf)
        } else if bytes.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) {
            Some(Self::Stl)
        } else if [b"v ", b"# ", b"o ", b"g "].iter().any(|&word| bytes.starts_with(word)) {
            Some(Self::Obj)
        } else {
            None
        }
    }

    /// The error for a family that this build leaves out.
    pub(crate) fn disabled(self, name: &str) -> Error {
        let (what, feature) = match self {
            Self::Stl => ("STL", "stl"),
            Self::Ply => ("PLY", "ply"),
            Self::Obj => ("OBJ", "obj"),
            Self::Gltf => ("glTF", "gltf"),
        };
        Error::FeatureDisabled { name: name.to_owned(), what, feature }
    }
}

/// How a file is packed as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Packing {
    /// Not packed.
    None,
    /// gzip, `.gz`.
    Gzip,
    /// Zstandard, `.zst`.
    Zstd,
}

impl Packing {
    /// The packing that a file's extension asks for.
    pub fn from_path(path: &Path) -> Self {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some(extension) if extension.eq_ignore_ascii_case("gz") => Self::Gzip,
            Some(extension) if extension.eq_ignore_ascii_case("zst") => Self::Zstd,
            _ => Self::None,
        }
    }

    /// The packing that the first bytes of a file show.
    pub fn from_magic(bytes: &[u8]) -> Self {
        if bytes.starts_with(&[0x1f, 0x8b, 0x08]) {
            Self::Gzip
        } else if bytes.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
            Self::Zstd
        } else {
            Self::None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_back() {
        for format in Format::ALL {
            assert_eq!(Format::from_name(format.name()), Some(format));
        }
        assert_eq!(Format::from_name("step"), None);
    }

    #[test]
    fn packed_paths_tell_the_inner_format() {
        assert_eq!(Format::from_path("a.b/x.OBJ.ZST".as_ref()), Some(Format::Obj));
        assert_eq!(Format::from_path("x.glb".as_ref()), Some(Format::Glb));
        assert_eq!(Format::from_path("x".as_ref()), None);
        assert_eq!(Packing::from_path("x.stl.gz".as_ref()), Packing::Gzip);
    }
}
