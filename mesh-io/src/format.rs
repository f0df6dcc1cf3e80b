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
    /// Bytes that show what a file is: those of a binary STL's header and first triangle.
    #[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
    pub(crate) const TELLING_BYTES: usize = 134;

    /// What the first [`TELLING_BYTES`](Self::TELLING_BYTES) of a file without a telling name show, or all of a shorter one.
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
        } else if is_binary_stl(bytes) {
            Some(Self::Stl)
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

/// Binary STL has no magic number, but its first triangle has finite corners, not all in the origin, and a normal of length 1 or, where the writer
/// left it out, 0.
#[cfg(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]
fn is_binary_stl(bytes: &[u8]) -> bool {
    let Some(record) = bytes.get(84..Family::TELLING_BYTES) else { return false };
    let numbers: Vec<f32> =
        record.as_chunks().0.iter().map(|&number: &[u8; 4]| f32::from_le_bytes(number)).collect();
    let length = numbers[..3].iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    let has_normal = length == 0.0 || (0.99..1.01).contains(&length);
    let is_somewhere = numbers[3..].iter().any(|&x| x != 0.0);
    has_normal && is_somewhere && numbers.iter().all(|number| number.is_finite())
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
    fn a_binary_stl_shows_in_its_first_triangle() {
        let with_normal = |normal: [f32; 3]| {
            let mut bytes = b"written by a scanner".to_vec();
            bytes.resize(84, 0);
            let corners = [1.0e3_f32, -2.5, 0.0, 1.0, 2.0, 3.0, 1e-9, 5.0, 6.0];
            bytes.extend(normal.iter().chain(&corners).flat_map(|x| x.to_le_bytes()));
            bytes.extend([0, 0]);
            bytes
        };
        for normal in [[0.0; 3], [0.6, 0.0, -0.8]] {
            assert_eq!(Family::from_content(&with_normal(normal)), Some(Family::Stl));
        }
        for normal in [[0.6, 0.6, 0.6], [f32::NAN, 0.0, 0.0]] {
            assert_eq!(Family::from_content(&with_normal(normal)), None);
        }
        assert_eq!(Family::from_content(&with_normal([0.0; 3])[..133]), None);
        assert_eq!(Family::from_content(&[b'a'; 200]), None, "a text");
        assert_eq!(Family::from_content(&[0xff; 200]), None);
        assert_eq!(Family::from_content(&[0; 200]), None);
    }

    #[test]
    fn packed_paths_tell_the_inner_format() {
        assert_eq!(Format::from_path("a.b/x.OBJ.ZST".as_ref()), Some(Format::Obj));
        assert_eq!(Format::from_path("x.glb".as_ref()), Some(Format::Glb));
        assert_eq!(Format::from_path("x".as_ref()), None);
        assert_eq!(Packing::from_path("x.stl.gz".as_ref()), Packing::Gzip);
    }
}
