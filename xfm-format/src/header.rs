//! The header: what the file holds and where.

mod attribute;

use glam::{DVec3, Vec3};

use crate::error::{Defect, Place};
use crate::numbering::Numbering;
use crate::rounding::Rounding;

use attribute::ATTRIBUTE_LEN;
pub use attribute::{Attribute, AttributeCoding, AttributeType};
pub(crate) use attribute::{MoreAttribute, NUM_STANDARD, standard_attributes};

/// First bytes of every file: a name, a byte above 127 and line ends, so that a transfer as text shows.
pub(crate) const MAGIC: [u8; 8] = *b"XFM\x8f\r\n\x1a\n";
/// The version that is written and read.
pub const VERSION: u32 = 2;
/// Feature flags that a reader must know; the others it may ignore.
pub(crate) const MUST_KNOW: u64 = 0xffff_ffff;
/// Length of the header without attribute table and checksum.
pub(crate) const FIXED_LEN: usize = 256;
/// Length of what the encoding `compact` adds after the attribute table.
pub(crate) const COMPACT_LEN: usize = 32;
/// More attributes than this are not believed.
pub(crate) const MAX_ATTRIBUTES: usize = 256;
/// Length of an entry of the page index.
pub(crate) const INDEX_ENTRY_LEN: u64 = 32;
/// Bytes in memory that one byte of a file may become at most; see [`check_expansion`].
pub(crate) const MAX_EXPANSION: u64 = 256;

/// How the numbers of nodes are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Positions bit for bit, normals as 32 bits; radius, cone and deviation rounded up by less than 0.4 percent.
    #[default]
    Exact,
    /// Positions on a grid, normals and bounds with fewer bits, and all of it predicted; see
    /// [`WriteOptions::position_error`](crate::WriteOptions::position_error).
    Compact,
}

impl Encoding {
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Exact => 0,
            Self::Compact => 1,
        }
    }

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Exact),
            1 => Some(Self::Compact),
            _ => None,
        }
    }

    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Compact => "compact",
        }
    }
}

/// Precision of the coordinates of the input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Precision {
    /// 32-bit floating point.
    #[default]
    Single,
    /// 64-bit floating point, or decimal numbers that need it.
    Double,
}

impl Precision {
    fn code(self) -> u8 {
        match self {
            Self::Single => 0,
            Self::Double => 1,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Single),
            1 => Some(Self::Double),
            _ => None,
        }
    }

    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Double => "double",
        }
    }
}

/// Where a part of the file lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Section {
    pub offset: u64,
    pub length: u64,
    pub crc: u32,
}

impl Section {
    pub fn end(&self) -> Option<u64> {
        self.offset.checked_add(self.length)
    }
}

/// What the header of a file says.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Header {
    /// Version of the format.
    pub version: u32,
    /// Feature flags; none are defined in version 2.
    pub features: u64,
    /// How the numbers of nodes are stored.
    pub encoding: Encoding,
    /// A block holds up to 2^levels − 1 nodes; 1 to 5.
    pub levels: u32,
    /// Triangles of the input mesh: those of the coarsest mesh and all that the nodes bring.
    pub input_triangles: u64,
    /// Number of nodes.
    pub nodes: u64,
    /// Number of blocks.
    pub blocks: u64,
    /// Number of pages.
    pub pages: u64,
    /// Vertices of the coarsest mesh.
    pub base_vertices: u64,
    /// Faces of the coarsest mesh.
    pub base_faces: u64,
    /// Vertices of the coarsest mesh that have a tree.
    pub roots: u64,
    /// Levels of the deepest tree.
    pub tree_depth: u64,
    /// Least and largest coordinates of all vertices of the input mesh, relative to the origin; zeros for an empty one.
    pub bounds: [Vec3; 2],
    /// Where the origin of all positions lies in the frame of the input, in model units.
    pub origin: DVec3,
    /// Precision of the coordinates of the input.
    pub precision: Precision,
    /// What positions and normals were rounded to.
    pub rounding: Rounding,
    /// What every node has, in the order in which it is stored.
    pub attributes: Vec<Attribute>,
    pub(crate) base: Section,
    pub(crate) root_list: Section,
    pub(crate) page_data: Section,
    pub(crate) index: Section,
    pub(crate) file_len: u64,
}

/// What a header can be refused for besides a [`Defect`].
pub(crate) enum HeaderProblem {
    NotXfm,
    Version(u32),
    Features(u64),
    Encoding(u8),
    /// The file must be so long at least.
    Truncated(u64),
    Checksum {
        expected: u32,
        found: u32,
    },
    Defect(Defect),
}

impl From<Defect> for HeaderProblem {
    fn from(defect: Defect) -> Self {
        Self::Defect(defect)
    }
}

impl Header {
    /// How node ids are made of block and slot.
    pub fn numbering(&self) -> Numbering {
        Numbering::new(self.levels)
    }

    /// Part of the places for nodes in all blocks that is taken; 0 without blocks.
    pub fn fill(&self) -> f64 {
        let slots = self.blocks as f64 * f64::from(self.numbering().slots());
        if slots > 0.0 { self.nodes as f64 / slots } else { 0.0 }
    }

    /// Length of the file.
    pub fn file_bytes(&self) -> u64 {
        self.file_len
    }

    /// One more than the largest name of a half-edge, present or not.
    pub(crate) fn num_half_edges(&self) -> u64 {
        let node_ids = self.blocks.saturating_mul(1 << self.levels);
        node_ids.saturating_mul(6).saturating_add(self.base_faces.saturating_mul(3))
    }

    /// That the names of half-edges have 32 bits, or else how many there are and how many there may be.
    pub(crate) fn check_names(&self) -> Result<(), (u64, u64)> {
        // The front adds to names; see `HalfEdgeNames::max_node`.
        let (half_edges, max) = (self.num_half_edges(), u64::from(u32::MAX) - 7);
        if half_edges > max { Err((half_edges, max)) } else { Ok(()) }
    }

    /// Whether vertices have colours.
    pub fn has_colour(&self) -> bool {
        self.more_attributes().any(|attribute| attribute == MoreAttribute::Colour)
    }

    /// The attributes after the standard ones, in their order. Of two that are colours the first one counts.
    pub(crate) fn more_attributes(&self) -> impl Iterator<Item = MoreAttribute> + '_ {
        let colour = Attribute::colour(self.encoding);
        let mut has_colour = false;
        self.attributes.iter().skip(NUM_STANDARD).map(move |attribute| {
            if !has_colour && *attribute == colour {
                has_colour = true;
                return MoreAttribute::Colour;
            }
            match attribute.coding {
                AttributeCoding::Columns => MoreAttribute::Columns(attribute.components),
                AttributeCoding::Symbols => MoreAttribute::Symbols(attribute.components),
            }
        })
    }

    /// Memory that a node takes.
    pub(crate) fn node_bytes(&self) -> u64 {
        64 + self.colour_bytes()
    }

    /// Memory that a vertex of the coarsest mesh takes.
    pub(crate) fn vertex_bytes(&self) -> u64 {
        24 + self.colour_bytes()
    }

    fn colour_bytes(&self) -> u64 {
        if self.has_colour() { 4 } else { 0 }
    }

    /// Length of the header in the file.
    pub(crate) fn encoded_len(&self) -> usize {
        encoded_len(self.encoding, self.attributes.len())
    }

    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.encoded_len());
        out.extend(MAGIC);
        out.extend(self.version.to_le_bytes());
        out.extend((self.encoded_len() as u32).to_le_bytes());
        out.extend(self.features.to_le_bytes());
        out.extend([self.encoding.code(), self.levels as u8]);
        out.extend((self.attributes.len() as u16).to_le_bytes());
        out.extend([0; 4]);
        for count in self.counts() {
            out.extend(count.to_le_bytes());
        }
        for coordinate in self.bounds.iter().flat_map(|corner| corner.to_array()) {
            out.extend(coordinate.to_le_bytes());
        }
        for section in [self.base, self.root_list, self.page_data, self.index] {
            out.extend(section.offset.to_le_bytes());
            out.extend(section.length.to_le_bytes());
            out.extend(section.crc.to_le_bytes());
            out.extend([0; 4]);
        }
        out.extend(self.file_len.to_le_bytes());
        for coordinate in self.origin.to_array() {
            out.extend(coordinate.to_le_bytes());
        }
        out.push(self.precision.code());
        out.resize(FIXED_LEN, 0);
        for attribute in &self.attributes {
            attribute.encode(&mut out);
        }
        if self.encoding == Encoding::Compact {
            let at = out.len();
            out.extend(self.rounding.step().to_le_bytes());
            out.extend(self.rounding.error().to_le_bytes());
            out.resize(at + COMPACT_LEN, 0);
        }
        out.extend(crc32fast::hash(&out).to_le_bytes());
        out
    }

    fn counts(&self) -> [u64; 8] {
        [
            self.input_triangles,
            self.nodes,
            self.blocks,
            self.pages,
            self.base_vertices,
            self.base_faces,
            self.roots,
            self.tree_depth,
        ]
    }

    /// Reads a header of which `bytes` has as much as the file has, but no more than `max_len` bytes.
    pub(crate) fn decode(bytes: &[u8], file_len: u64) -> Result<Self, HeaderProblem> {
        if !bytes.starts_with(&MAGIC) {
            return Err(if MAGIC.starts_with(bytes) {
                HeaderProblem::Truncated(FIXED_LEN as u64)
            } else {
                HeaderProblem::NotXfm
            });
        }
        let mut fields = Fields { bytes, at: MAGIC.len() };
        let version = fields.u32()?;
        if version != VERSION {
            return Err(HeaderProblem::Version(version));
        }
        let len = fields.u32()? as usize;
        let max_len = encoded_len(Encoding::Compact, MAX_ATTRIBUTES);
        if !(FIXED_LEN + 4..=max_len).contains(&len) {
            return Err(defect(format!("a length of {len} bytes")).into());
        }
        let Some(whole) = bytes.get(..len) else {
            return Err(HeaderProblem::Truncated(len as u64));
        };
        let (covered, crc) = whole.split_at(len - 4);
        let expected = Fields { bytes: crc, at: 0 }.u32()?;
        let found = crc32fast::hash(covered);
        if expected != found {
            return Err(HeaderProblem::Checksum { expected, found });
        }
        let mut fields = Fields { bytes: covered, at: fields.at };
        let features = fields.u64()?;
        if features & MUST_KNOW != 0 {
            return Err(HeaderProblem::Features(features & MUST_KNOW));
        }
        let [encoding, levels] = fields.array()?;
        let encoding = Encoding::from_code(encoding).ok_or(HeaderProblem::Encoding(encoding))?;
        let num_attributes = usize::from(u16::from_le_bytes(fields.array()?));
        fields.zeros(4)?;
        let mut counts = [0; 8];
        for count in &mut counts {
            *count = fields.u64()?;
        }
        let [input_triangles, nodes, blocks, pages, base_vertices, base_faces, roots, tree_depth] =
            counts;
        let mut bounds = [Vec3::ZERO; 2];
        for coordinate in bounds.iter_mut().flat_map(|corner| corner.as_mut()) {
            *coordinate = f32::from_le_bytes(fields.array()?);
        }
        let mut sections = [Section::default(); 4];
        for section in &mut sections {
            *section = Section { offset: fields.u64()?, length: fields.u64()?, crc: fields.u32()? };
            fields.zeros(4)?;
        }
        let [base, root_list, page_data, index] = sections;
        let stated_len = fields.u64()?;
        let mut origin = DVec3::ZERO;
        for coordinate in origin.as_mut() {
            *coordinate = f64::from_le_bytes(fields.array()?);
        }
        let [precision] = fields.array()?;
        let precision = Precision::from_code(precision)
            .ok_or_else(|| defect(format!("a precision of number {precision}")))?;
        fields.zeros(FIXED_LEN - fields.at)?;
        if len != encoded_len(encoding, num_attributes) {
            return Err(defect(format!("{num_attributes} attributes in {len} bytes")).into());
        }
        let attributes = (0..num_attributes)
            .map(|_| Ok(Attribute::decode(&fields.array()?)?))
            .collect::<Result<Vec<_>, HeaderProblem>>()?;
        let rounding = match encoding {
            Encoding::Exact => Rounding::EXACT,
            Encoding::Compact => fields.rounding()?,
        };
        let header = Self {
            version,
            features,
            encoding,
            levels: u32::from(levels),
            input_triangles,
            nodes,
            blocks,
            pages,
            base_vertices,
            base_faces,
            roots,
            tree_depth,
            bounds,
            origin,
            precision,
            rounding,
            attributes,
            base,
            root_list,
            page_data,
            index,
            file_len: stated_len,
        };
        header.check(len as u64, file_len)?;
        Ok(header)
    }

    /// That the fields go together, so that everything after can rely on them.
    fn check(&self, len: u64, file_len: u64) -> Result<(), HeaderProblem> {
        if !(1..=5).contains(&self.levels) {
            return Err(defect(format!("{} levels per block, not 1 to 5", self.levels)).into());
        }
        if !self.attributes.starts_with(&standard_attributes()) {
            return Err(defect("the attributes do not begin with those of version 2").into());
        }
        let mut at = len;
        for (section, name) in [
            (self.base, "coarsest mesh"),
            (self.root_list, "root list"),
            (self.page_data, "pages"),
            (self.index, "page index"),
        ] {
            if section.offset != at {
                return Err(defect(format!("{name} at byte {}, not {at}", section.offset)).into());
            }
            at = section.end().ok_or_else(|| defect(format!("{name} without end")))?;
        }
        if self.file_len != at {
            return Err(defect(format!("{} bytes of file, not {at}", self.file_len)).into());
        }
        if file_len < self.file_len {
            return Err(HeaderProblem::Truncated(self.file_len));
        }
        if self.page_data.crc != 0 {
            return Err(defect("a checksum of all pages together").into());
        }
        if Some(self.index.length) != self.pages.checked_mul(INDEX_ENTRY_LEN) {
            return Err(defect(format!(
                "{} pages in an index of {} bytes",
                self.pages, self.index.length
            ))
            .into());
        }
        let slots = u64::from(Numbering::new(self.levels).slots());
        let full = self.blocks.saturating_mul(slots);
        if self.nodes < self.blocks || self.nodes > full {
            return Err(defect(format!("{} nodes in {} blocks", self.nodes, self.blocks)).into());
        }
        if self.pages > self.blocks || (self.pages == 0) != (self.blocks == 0) {
            return Err(defect(format!("{} blocks in {} pages", self.blocks, self.pages)).into());
        }
        if self.roots > self.blocks || self.roots > self.base_vertices {
            return Err(defect(format!(
                "{} roots for {} vertices and {} blocks",
                self.roots, self.base_vertices, self.blocks
            ))
            .into());
        }
        if self.tree_depth > self.nodes || (self.tree_depth == 0) != (self.nodes == 0) {
            return Err(defect(format!(
                "a depth of {} with {} nodes",
                self.tree_depth, self.nodes
            ))
            .into());
        }
        let base_bytes = self
            .base_vertices
            .saturating_mul(self.vertex_bytes())
            .saturating_add(self.base_faces.saturating_mul(12));
        for (bytes, section) in [
            (base_bytes, self.base),
            (self.roots.saturating_mul(8), self.root_list),
            (self.nodes.saturating_mul(self.node_bytes()), self.page_data),
        ] {
            check_expansion(bytes, section.length, Place::Header)?;
        }
        // Faces without nodes and with two for each node are what is possible.
        let least = self.base_faces.saturating_add(self.nodes);
        let most = least.saturating_add(self.nodes);
        if !(least..=most).contains(&self.input_triangles) {
            return Err(defect(format!(
                "{} input triangles with {} base faces and {} nodes",
                self.input_triangles, self.base_faces, self.nodes
            ))
            .into());
        }
        let [min, max] = self.bounds;
        if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
            return Err(defect("a bounding box that is none").into());
        }
        if !self.origin.is_finite() {
            return Err(defect("an origin that is not finite").into());
        }
        Ok(())
    }
}

/// That so many bytes in memory may come out of so many bytes of file: no more than [`MAX_EXPANSION`] times as many.
pub(crate) fn check_expansion(memory: u64, length: u64, place: Place) -> Result<(), Defect> {
    if memory > length.saturating_mul(MAX_EXPANSION) {
        let message = format!("{length} bytes claim to hold {memory}, which is not believed");
        return Err(Defect::new(place, message));
    }
    Ok(())
}

/// Length of a header with its checksum.
pub(crate) const fn encoded_len(encoding: Encoding, attributes: usize) -> usize {
    let compact = match encoding {
        Encoding::Exact => 0,
        Encoding::Compact => COMPACT_LEN,
    };
    FIXED_LEN + ATTRIBUTE_LEN * attributes + compact + 4
}

fn defect(message: impl Into<String>) -> Defect {
    Defect::new(Place::Header, message)
}

/// Reads little-endian fields one after another.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Fields<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], HeaderProblem> {
        let field = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>());
        self.at += N;
        field.copied().ok_or(HeaderProblem::Truncated(FIXED_LEN as u64))
    }

    fn u32(&mut self) -> Result<u32, HeaderProblem> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, HeaderProblem> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn zeros(&mut self, count: usize) -> Result<(), HeaderProblem> {
        let at = self.at;
        for _ in 0..count {
            if self.array::<1>()? != [0] {
                return Err(defect(format!("reserved bytes from {at} on are not zero")).into());
            }
        }
        Ok(())
    }

    fn rounding(&mut self) -> Result<Rounding, HeaderProblem> {
        let [step, error] = [f64::from_le_bytes(self.array()?), f64::from_le_bytes(self.array()?)];
        let rounding = Rounding::from_file(step, error)
            .ok_or_else(|| defect(format!("a grid of {step} with an error of {error}")))?;
        self.zeros(COMPACT_LEN - 16)?;
        Ok(rounding)
    }
}
