//! The in-core mesh.

use glam::Vec3;

/// Three corners, counter-clockwise seen from the front.
pub type Triangle = [Vec3; 3];

/// Colour of a vertex: red, green, blue and alpha, 255 for one. It is what the file has; no colour space is converted.
pub type Colour = [u8; 4];

/// The colour of a vertex of which nothing is known where others have colours.
pub(crate) const WHITE: Colour = [255; 4];

/// A fraction as a byte of a colour; what is not a number is zero.
#[cfg_attr(not(any(feature = "ply", feature = "obj", feature = "gltf")), allow(dead_code))]
#[inline]
pub(crate) fn colour_byte(fraction: f32) -> u8 {
    // The conversion keeps to the range of a byte.
    (fraction * 255.0).round() as u8
}

/// A triangle mesh in memory: shared positions, and triangles that index them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IndexedMesh {
    /// Vertex positions; not every one has to be used.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Colours of the vertices: as many as there are positions, or none.
    pub colours: Vec<Colour>,
}

impl IndexedMesh {
    /// A mesh with one vertex per corner, in order.
    ///
    /// # Panics
    ///
    /// If there are more than `u32::MAX` corners.
    ///
    /// ```
    /// use glam::Vec3;
    /// let mesh = mesh_io::IndexedMesh::from_soup(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    /// assert_eq!(mesh.triangles, [[0, 1, 2]]);
    /// ```
    pub fn from_soup(soup: &[Triangle]) -> Self {
        assert!(soup.len() <= u32::MAX as usize / 3, "more corners than 32-bit indices can name");
        Self {
            positions: soup.as_flattened().to_vec(),
            triangles: (0..soup.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            colours: Vec::new(),
        }
    }

    /// The smallest and largest coordinates of all finite positions, or `None` if there is none.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.positions.iter().filter(|p| p.is_finite()).fold(None, |bounds, &p| match bounds {
            None => Some((p, p)),
            Some((low, high)) => Some((low.min(p), high.max(p))),
        })
    }

    /// The corners of a triangle.
    ///
    /// # Panics
    ///
    /// If `triangle` or one of its indices is out of range.
    pub fn corners(&self, triangle: usize) -> Triangle {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// All triangles by coordinates, in order.
    ///
    /// # Panics
    ///
    /// If an index is out of range.
    pub fn to_soup(&self) -> Vec<Triangle> {
        (0..self.triangles.len()).map(|t| self.corners(t)).collect()
    }

    /// The first triangle with an index out of range, and that index.
    pub fn first_bad_index(&self) -> Option<(usize, u32)> {
        let count = self.positions.len();
        self.triangles.iter().enumerate().find_map(|(t, triangle)| {
            triangle.iter().find(|&&v| v as usize >= count).map(|&v| (t, v))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_ignore_what_is_not_finite() {
        let mut mesh = IndexedMesh::default();
        assert_eq!(mesh.bounds(), None);
        mesh.positions = vec![Vec3::NAN, Vec3::new(1.0, -2.0, 3.0), Vec3::new(-1.0, 5.0, 0.0)];
        assert_eq!(mesh.bounds(), Some((Vec3::new(-1.0, -2.0, 0.0), Vec3::new(1.0, 5.0, 3.0))));
    }

    #[test]
    fn soup_there_and_back() {
        let soup = [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::X, Vec3::ONE, Vec3::Y]];
        let mesh = IndexedMesh::from_soup(&soup);
        assert_eq!(mesh.positions.len(), 6);
        assert_eq!(mesh.to_soup(), soup);
        assert_eq!(mesh.first_bad_index(), None);
        let bad = IndexedMesh { triangles: vec![[0, 1, 6]], ..mesh };
        assert_eq!(bad.first_bad_index(), Some((0, 6)));
    }
}
