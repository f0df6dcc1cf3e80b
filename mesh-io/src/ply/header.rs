//! The header of a PLY file: which elements follow, with which properties, in which encoding.

use std::io::Read;

use crate::Error;
use crate::codec::input::{Input, LineEnd};
use crate::codec::quote::quote;
use crate::codec::text::Tokens;
use crate::mesh::colour_byte;

const REMEDY: &str = "export the mesh again";

/// How the rows after the header are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Ascii,
    Little,
    Big,
}

/// The type of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &[u8]) -> Option<Self> {
        match name {
            b"char" | b"int8" => Some(Self::I8),
            b"uchar" | b"uint8" => Some(Self::U8),
            b"short" | b"int16" => Some(Self::I16),
            b"ushort" | b"uint16" => Some(Self::U16),
            b"int" | b"int32" => Some(Self::I32),
            b"uint" | b"uint32" => Some(Self::U32),
            b"float" | b"float32" => Some(Self::F32),
            b"double" | b"float64" => Some(Self::F64),
            _ => None,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Bytes in a binary file.
    #[inline]
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value at the start of `bytes`, of which there must be [`Scalar::size`]; missing ones count as zero.
    #[inline]
    pub(super) fn integer(self, bytes: &[u8], big: bool) -> i64 {
        match self {
            Self::I8 => i64::from(i8::from_le_bytes(head(bytes, big))),
            Self::U8 => i64::from(u8::from_le_bytes(head(bytes, big))),
            Self::I16 => i64::from(i16::from_le_bytes(head(bytes, big))),
            Self::U16 => i64::from(u16::from_le_bytes(head(bytes, big))),
            Self::I32 => i64::from(i32::from_le_bytes(head(bytes, big))),
            Self::U32 => i64::from(u32::from_le_bytes(head(bytes, big))),
            Self::F32 | Self::F64 => self.real(bytes, big) as i64,
        }
    }

    /// As [`Scalar::integer`]; every type's values are exact in `f64`.
    #[inline]
    pub(super) fn real(self, bytes: &[u8], big: bool) -> f64 {
        match self {
            Self::F32 => f32::from_le_bytes(head(bytes, big)).into(),
            Self::F64 => f64::from_le_bytes(head(bytes, big)),
            _ => self.integer(bytes, big) as f64,
        }
    }

    /// A value of this type as a byte of a colour: that of a floating-point type is a fraction.
    #[inline]
    pub(super) fn colour_byte(self, value: f64) -> u8 {
        match self {
            Self::F32 | Self::F64 => colour_byte(value as f32),
            Self::U16 => (value / 257.0).round() as u8,
            _ => value as u8,
        }
    }

    /// Whether it has values that `f32` has not.
    pub(super) fn exceeds_single(self) -> bool {
        matches!(self, Self::F64 | Self::I32 | Self::U32)
    }
}

/// The first `N` bytes in little-endian order.
#[inline]
pub(super) fn head<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
    let mut head = bytes.first_chunk().copied().unwrap_or([0; N]);
    if big {
        head.reverse();
    }
    head
}

/// A single value, or a list that begins with its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { length: Scalar, item: Scalar },
}

#[derive(Debug, PartialEq)]
pub(super) struct Property {
    name: Vec<u8>,
    pub(super) kind: Kind,
}

/// The properties of vertices that matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct VertexPlaces {
    /// Those that are x, y and z.
    pub(super) axes: [usize; 3],
    /// Those that are components of the colour, if the vertices have one.
    pub(super) colour: Option<Components<usize>>,
}

/// What belongs to the components of a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Components<T> {
    /// Red, green, blue.
    pub(super) rgb: [T; 3],
    pub(super) alpha: Option<T>,
}

impl<T> Components<T> {
    pub(super) fn map<U>(self, f: impl Fn(T) -> U) -> Components<U> {
        Components { rgb: self.rgb.map(&f), alpha: self.alpha.map(f) }
    }
}

impl VertexPlaces {
    /// The last one of them.
    pub(super) fn last(&self) -> usize {
        let colour = self.colour.iter().flat_map(|c| c.rgb.iter().chain(&c.alpha));
        self.axes.iter().chain(colour).copied().max().unwrap_or(0)
    }

    /// Which component of the colour a property is.
    #[inline]
    pub(super) fn component(&self, place: usize) -> Option<usize> {
        let Components { rgb, alpha } = self.colour?;
        match rgb.iter().position(|&p| p == place) {
            None if alpha == Some(place) => Some(3),
            component => component,
        }
    }
}

/// What an element is to us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Positions and colours.
    Vertices(VertexPlaces),
    /// Polygons; the property that lists the corners.
    Faces(usize),
    /// Triangle strips, −1 between them; the property that lists the corners.
    Strips(usize),
    /// Passed over.
    Other,
}

/// `count` rows of these properties.
#[derive(Debug, PartialEq)]
pub(super) struct Element {
    name: Vec<u8>,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    pub(super) role: Role,
}

impl Element {
    pub(super) fn name(&self) -> String {
        quote(&self.name)
    }

    /// Bytes per row where no list makes that vary.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |sum, property| match property.kind {
            Kind::One(scalar) => Some(sum + scalar.size()),
            Kind::List { .. } => None,
        })
    }

    /// Bytes that a row takes at least.
    pub(super) fn min_row_bytes(&self, coding: Coding) -> u64 {
        let sizes = self.properties.iter().map(|property| match (coding, property.kind) {
            (Coding::Ascii, _) => 2,
            (_, Kind::One(scalar)) => scalar.size() as u64,
            (_, Kind::List { length, .. }) => length.size() as u64,
        });
        sizes.sum()
    }

    fn position_of(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| names.iter().any(|name| p.name == name.as_bytes()))
    }
}

#[derive(Debug, PartialEq)]
pub(super) struct Header {
    pub(super) coding: Coding,
    pub(super) elements: Vec<Element>,
}

impl Header {
    /// Reads up to and including `end_header`.
    pub(super) fn read<R: Read>(input: &mut Input<R>) -> Result<Self, Error> {
        if input.fill(4)? == 0 {
            return Err(input.empty());
        }
        if !matches!(input.window(), [b'p', b'l', b'y', b'\r' | b'\n' | b' ' | b'\t', ..]) {
            return if b"ply".starts_with(input.window()) {
                Err(input.truncated("the PLY header is complete"))
            } else {
                Err(input.malformed(
                    crate::Place::Byte(0),
                    "a PLY file begins with a line `ply`, this one does not".to_owned(),
                    "check what the file is, or name its format",
                ))
            };
        }
        input.next_line()?;
        let first_end = input.line_end();
        let mut coding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let Some(line) = input.next_line()? else {
                return Err(input.truncated_line("`end_header`"));
            };
            match Statement::parse(input.text(line)) {
                Ok(Statement::Nothing) => {}
                Ok(Statement::Format(format)) => coding = Some(format),
                Ok(Statement::Element(element)) => elements.push(element),
                Ok(Statement::Property(property)) => match elements.last_mut() {
                    Some(element) => element.properties.push(property),
                    None => {
                        let problem = "a property before the first element".to_owned();
                        return Err(input.malformed_line(problem, REMEDY));
                    }
                },
                Ok(Statement::End) => break,
                Err(problem) if input.line_end() == LineEnd::None => {
                    return Err(input.truncated_line(format!("the header is complete: {problem}")));
                }
                Err(problem) => return Err(input.malformed_line(problem, REMEDY)),
            }
        }
        // Where lines end in a lone carriage return, a line feed after the last one is data.
        if first_end == LineEnd::Cr {
            input.give_back_line_feed();
        }
        let Some(coding) = coding else {
            return Err(input.malformed_line("a header without a format line".to_owned(), REMEDY));
        };
        if let Err(problem) = assign_roles(&mut elements) {
            return Err(input.malformed_line(problem, REMEDY));
        }
        Ok(Self { coding, elements })
    }
}

fn assign_roles(elements: &mut [Element]) -> Result<(), String> {
    let mut has_vertices = false;
    for element in elements.iter_mut() {
        element.role = match element.name.as_slice() {
            b"vertex" if !has_vertices => {
                has_vertices = true;
                let (axes, colour) = (coordinates(element)?, colour(element));
                Role::Vertices(VertexPlaces { axes, colour })
            }
            b"face" => Role::Faces(corner_list(element)?),
            b"tristrips" => Role::Strips(corner_list(element)?),
            _ => Role::Other,
        };
        if element.count == 0 && !matches!(element.role, Role::Vertices(_)) {
            element.role = Role::Other;
        }
    }
    let has_faces = elements.iter().any(|e| matches!(e.role, Role::Faces(_) | Role::Strips(_)));
    if has_faces && !has_vertices {
        return Err("faces but no element `vertex`".to_owned());
    }
    Ok(())
}

fn coordinates(element: &Element) -> Result<[usize; 3], String> {
    let mut places = [0; 3];
    for (place, axis) in places.iter_mut().zip(["x", "y", "z"]) {
        *place = element
            .position_of(&[axis])
            .filter(|&p| matches!(element.properties[p].kind, Kind::One(_)))
            .ok_or_else(|| format!("the vertices have no property `{axis}`"))?;
    }
    Ok(places)
}

/// Where the colour is, if there is one.
fn colour(element: &Element) -> Option<Components<usize>> {
    let place = |names: [&str; 3]| {
        let place = element.position_of(&names)?;
        matches!(element.properties[place].kind, Kind::One(_)).then_some(place)
    };
    let rgb = [
        place(["red", "diffuse_red", "r"])?,
        place(["green", "diffuse_green", "g"])?,
        place(["blue", "diffuse_blue", "b"])?,
    ];
    Some(Components { rgb, alpha: place(["alpha", "diffuse_alpha", "a"]) })
}

/// The list of corners; an element without rows may lack it.
fn corner_list(element: &Element) -> Result<usize, String> {
    let Some(place) = element.position_of(&["vertex_indices", "vertex_index"]) else {
        if element.count == 0 {
            return Ok(0);
        }
        return Err(format!("the element `{}` has no list `vertex_indices`", element.name()));
    };
    match element.properties[place].kind {
        Kind::List { item, .. } if item.is_integer() => Ok(place),
        _ => Err("`vertex_indices` is not a list of integers".to_owned()),
    }
}

/// One line of the header.
enum Statement {
    Nothing,
    Format(Coding),
    Element(Element),
    Property(Property),
    End,
}

impl Statement {
    fn parse(line: &[u8]) -> Result<Self, String> {
        let mut tokens = Tokens::new(line);
        let Some(keyword) = tokens.word() else { return Ok(Self::Nothing) };
        let quote = |word: Option<&[u8]>| match word {
            Some(word) => format!("`{}`", quote(word)),
            None => "the end of the line".to_owned(),
        };
        match keyword {
            b"comment" | b"obj_info" => Ok(Self::Nothing),
            b"end_header" => Ok(Self::End),
            b"format" => match tokens.word() {
                Some(b"ascii") => Ok(Self::Format(Coding::Ascii)),
                Some(b"binary_little_endian") => Ok(Self::Format(Coding::Little)),
                Some(b"binary_big_endian") => Ok(Self::Format(Coding::Big)),
                word => Err(format!("{} is not a PLY encoding", quote(word))),
            },
            b"element" => {
                let name = tokens.word().ok_or("an element without a name")?.to_vec();
                let word = tokens.word();
                let count = word
                    .and_then(|word| std::str::from_utf8(word).ok()?.parse().ok())
                    .ok_or_else(|| format!("{} is not a count of rows", quote(word)))?;
                Ok(Self::Element(Element {
                    name,
                    count,
                    properties: Vec::new(),
                    role: Role::Other,
                }))
            }
            b"property" => {
                let mut scalar = || {
                    let word = tokens.word();
                    match word {
                        Some(b"list") => Ok(None),
                        _ => word
                            .and_then(Scalar::from_name)
                            .map(Some)
                            .ok_or_else(|| format!("{} is not a PLY type", quote(word))),
                    }
                };
                let kind = match scalar()? {
                    Some(one) => Kind::One(one),
                    None => match (scalar()?, scalar()?) {
                        (Some(length), Some(item)) if length.is_integer() => {
                            Kind::List { length, item }
                        }
                        _ => return Err("a list whose length is not an integer".to_owned()),
                    },
                };
                let name = tokens.word().ok_or("a property without a name")?.to_vec();
                Ok(Self::Property(Property { name, kind }))
            }
            _ => Err(format!("{} has no place in a PLY header", quote(Some(keyword)))),
        }
    }
}
