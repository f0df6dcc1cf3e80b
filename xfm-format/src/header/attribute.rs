//! The attribute table: what every node has.

use super::{Encoding, defect};
use crate::error::Defect;

/// Length of one entry of the table.
pub(crate) const ATTRIBUTE_LEN: usize = 32;

/// What the numbers of an attribute are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AttributeType {
    /// Single-precision floating point.
    F32,
    /// Two signed 16-bit fractions of an octahedral unit vector.
    Octahedral,
    /// A non-negative floating-point number in 16 bits, rounded up.
    F16Up,
    /// A byte, of which 255 stands for one.
    U8,
    /// A type that this reader does not know; it reads over the attribute.
    Other(u8),
}

impl AttributeType {
    fn code(self) -> u8 {
        match self {
            Self::F32 => 0,
            Self::Octahedral => 1,
            Self::F16Up => 2,
            Self::U8 => 3,
            Self::Other(code) => code,
        }
    }

    fn from_code(code: u8) -> Self {
        match code {
            0 => Self::F32,
            1 => Self::Octahedral,
            2 => Self::F16Up,
            3 => Self::U8,
            code => Self::Other(code),
        }
    }
}

/// How the numbers of an attribute lie in a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AttributeCoding {
    /// As a column for each component; the first five attributes of a compact file as that encoding says.
    Columns,
    /// As symbols and bits of its own, after those of the page.
    Symbols,
}

impl AttributeCoding {
    fn code(self) -> u8 {
        match self {
            Self::Columns => 0,
            Self::Symbols => 1,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Columns),
            1 => Some(Self::Symbols),
            _ => None,
        }
    }

    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Columns => "columns",
            Self::Symbols => "symbols",
        }
    }
}

/// One attribute that every node has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Its name, at most 16 bytes of UTF-8.
    pub name: String,
    /// Unit of its numbers, at most 12 bytes of UTF-8.
    pub unit: String,
    /// What its numbers are.
    pub kind: AttributeType,
    /// How many numbers there are for every node.
    pub components: u8,
    /// How they lie in a page.
    pub coding: AttributeCoding,
}

impl Attribute {
    /// Colours of vertices, as files of this encoding have them.
    pub(crate) fn colour(encoding: Encoding) -> Self {
        Self {
            name: "colour".into(),
            unit: "1/255".into(),
            kind: AttributeType::U8,
            components: 4,
            coding: match encoding {
                Encoding::Exact => AttributeCoding::Columns,
                Encoding::Compact => AttributeCoding::Symbols,
            },
        }
    }

    /// Appends the entry of the table.
    pub(super) fn encode(&self, out: &mut Vec<u8>) {
        let at = out.len();
        out.extend(self.name.as_bytes());
        out.resize(at + 16, 0);
        out.extend(self.unit.as_bytes());
        out.resize(at + 28, 0);
        out.extend([self.kind.code(), self.components, self.coding.code(), 0]);
    }

    /// Reads an entry of the table.
    pub(super) fn decode(entry: &[u8; ATTRIBUTE_LEN]) -> Result<Self, Defect> {
        let (name, rest) = entry.split_at(16);
        let (unit, &[kind, components, coding, reserved]) =
            rest.split_last_chunk().ok_or_else(|| defect("the attribute table is cut short"))?;
        let (name, unit) = (text(name)?, text(unit)?);
        if reserved != 0 {
            return Err(defect(format!("reserved bytes of attribute {name} are not zero")));
        }
        let coding = AttributeCoding::from_code(coding)
            .ok_or_else(|| defect(format!("a coding of number {coding} for attribute {name}")))?;
        Ok(Self { name, unit, kind: AttributeType::from_code(kind), components, coding })
    }
}

/// How many attributes every file begins with.
pub(crate) const NUM_STANDARD: usize = 5;

/// The attributes that every file begins with.
pub(crate) fn standard_attributes() -> Vec<Attribute> {
    let standard: [_; NUM_STANDARD] = [
        ("position", "model", AttributeType::F32, 3),
        ("normal", "unit vector", AttributeType::Octahedral, 2),
        ("radius", "model", AttributeType::F16Up, 1),
        ("cone sine", "", AttributeType::F16Up, 1),
        ("deviation", "model", AttributeType::F16Up, 1),
    ];
    let attributes = standard.map(|(name, unit, kind, components)| Attribute {
        name: name.into(),
        unit: unit.into(),
        kind,
        components,
        coding: AttributeCoding::Columns,
    });
    attributes.into()
}

/// An attribute after the standard ones, which are those of all vertices: what there is of it in a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MoreAttribute {
    Colour,
    /// One that this version reads over: so many columns.
    Columns(u8),
    /// One that this version reads over: symbols and bits for so many components.
    Symbols(u8),
}

/// Text padded with zeros.
fn text(bytes: &[u8]) -> Result<String, Defect> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (text, padding) = bytes.split_at(end);
    if padding.iter().any(|&byte| byte != 0) {
        return Err(defect("an attribute's text goes on after its end"));
    }
    String::from_utf8(text.to_vec()).map_err(|_| defect("an attribute's text is not UTF-8"))
}
