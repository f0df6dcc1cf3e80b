//! The rows of a PLY file: as text or in binary, wanted or passed over.

use std::fmt;
use std::io::Read;

use glam::Vec3;

use super::header::{Coding, Element, Kind, Property, Scalar};
use super::positions::Layout;
use crate::codec::input::{Input, LineEnd};
use crate::codec::text::{Fault, Tokens};
use crate::{Error, Place};

const EXPORT_AGAIN: &str = "correct that place or export the mesh again";

/// What a file lacks that ends within an element.
#[derive(Clone, Copy)]
pub(super) struct MissingRows<'a>(pub(super) &'a Element);

impl fmt::Display for MissingRows<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the last of its {} rows of `{}`", self.0.count, self.0.name())
    }
}

/// The next line that is not blank.
#[inline]
pub(super) fn row_line<R: Read>(
    input: &mut Input<R>,
    missing: MissingRows<'_>,
) -> Result<std::ops::Range<usize>, Error> {
    loop {
        let Some(line) = input.next_line()? else { return Err(input.truncated_line(missing)) };
        if !Tokens::new(input.text(line.clone())).is_at_end() {
            return Ok(line);
        }
    }
}

pub(super) fn row_fault<R: Read>(input: &Input<R>, fault: Fault, element: &Element) -> Error {
    let name = element.name();
    match fault {
        Fault::Missing if input.line_end() == LineEnd::None => {
            input.truncated_line(format!("the row of `{name}` is complete"))
        }
        Fault::Missing => input.malformed_line(
            format!("a row of `{name}` with too few values"),
            "put each row on one line of its own",
        ),
        Fault::BadNumber(token) => {
            input.malformed_line(format!("`{token}` is not a number that fits here"), EXPORT_AGAIN)
        }
    }
}

/// Reads the list at place `list`; what comes after it in the row does not matter.
#[inline]
pub(super) fn ascii_list(
    tokens: &mut Tokens<'_>,
    properties: &[Property],
    list: usize,
    out: &mut Vec<i64>,
) -> Result<(), Fault> {
    for property in properties.iter().take(list) {
        ascii_skip(tokens, property)?;
    }
    let count = ascii_length(tokens)?;
    for _ in 0..count {
        out.push(tokens.integer()?);
    }
    Ok(())
}

pub(super) fn ascii_length(tokens: &mut Tokens<'_>) -> Result<i64, Fault> {
    let count = tokens.integer()?;
    if count < 0 { Err(Fault::BadNumber(count.to_string())) } else { Ok(count) }
}

pub(super) fn ascii_skip(tokens: &mut Tokens<'_>, property: &Property) -> Result<(), Fault> {
    let count = match property.kind {
        Kind::One(_) => 1,
        Kind::List { .. } => ascii_length(tokens)?,
    };
    (0..count).try_for_each(|_| tokens.skip_word())
}

pub(super) fn ascii_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    axes: [usize; 3],
) -> Result<Vec<Vec3>, Error> {
    let mut positions = Vec::with_capacity(input.plausible(element.count, 6));
    let plain = axes == [0, 1, 2];
    let last = axes.into_iter().max().unwrap_or(0);
    let missing = MissingRows(element);
    for _ in 0..element.count {
        let line = row_line(input, missing)?;
        let mut tokens = Tokens::new(input.text(line));
        let position = if plain {
            tokens.point()
        } else {
            scattered_point(&mut tokens, &element.properties[..=last], axes)
        };
        positions.push(position.map_err(|fault| row_fault(input, fault, element))?);
    }
    Ok(positions)
}

pub(super) fn scattered_point(
    tokens: &mut Tokens<'_>,
    properties: &[Property],
    axes: [usize; 3],
) -> Result<Vec3, Fault> {
    let mut position = Vec3::ZERO;
    for (place, property) in properties.iter().enumerate() {
        match axes.iter().position(|&axis| axis == place) {
            Some(axis) => position[axis] = tokens.real()?,
            None => ascii_skip(tokens, property)?,
        }
    }
    Ok(position)
}

pub(super) fn binary_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    layout: Layout,
) -> Result<Vec<Vec3>, Error> {
    let stride = layout.stride;
    let mut positions = Vec::with_capacity(input.plausible(element.count, stride as u64));
    let mut left = element.count;
    while left > 0 {
        if input.fill(stride)? < stride {
            return Err(input.truncated(MissingRows(element)));
        }
        let most = usize::try_from(left).unwrap_or(usize::MAX);
        let rows = input.window().chunks_exact(stride).take(most);
        let count = rows.len();
        positions.extend(rows.map(|row| layout.position(row)));
        input.consume(count * stride);
        left -= count as u64;
    }
    Ok(positions)
}

/// Vertices with a list among their properties, so that rows vary in size.
pub(super) fn ragged_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    axes: [usize; 3],
    big: bool,
) -> Result<Vec<Vec3>, Error> {
    let row_bytes = element.min_row_bytes(Coding::Little);
    let mut positions = Vec::with_capacity(input.plausible(element.count, row_bytes));
    for _ in 0..element.count {
        let missing = MissingRows(element);
        let mut position = Vec3::ZERO;
        for (place, property) in element.properties.iter().enumerate() {
            match (axes.iter().position(|&axis| axis == place), property.kind) {
                (Some(axis), Kind::One(scalar)) => {
                    if input.fill(scalar.size())? < scalar.size() {
                        return Err(input.truncated(missing));
                    }
                    position[axis] = scalar.real(input.window(), big);
                    input.consume(scalar.size());
                }
                _ => skip_properties(input, std::slice::from_ref(property), big, missing)?,
            }
        }
        positions.push(position);
    }
    Ok(positions)
}

pub(super) fn list_length<R: Read>(
    input: &mut Input<R>,
    length: Scalar,
    big: bool,
    missing: MissingRows<'_>,
) -> Result<u64, Error> {
    if input.fill(length.size())? < length.size() {
        return Err(input.truncated(missing));
    }
    let count = length.integer(input.window(), big);
    let place = Place::Byte(input.offset());
    input.consume(length.size());
    u64::try_from(count)
        .map_err(|_| input.malformed(place, format!("a list of {count} items"), EXPORT_AGAIN))
}

pub(super) fn skip_properties<R: Read>(
    input: &mut Input<R>,
    properties: &[Property],
    big: bool,
    missing: MissingRows<'_>,
) -> Result<(), Error> {
    for property in properties {
        match property.kind {
            Kind::One(scalar) => input.skip(scalar.size() as u64, missing)?,
            Kind::List { length, item } => {
                let count = list_length(input, length, big, missing)?;
                input.skip(count.saturating_mul(item.size() as u64), missing)?;
            }
        }
    }
    Ok(())
}

/// The bytes of a binary row that holds a triangle.
pub(super) struct TriangleRow {
    pub(super) bytes: usize,
    before: usize,
    length: Scalar,
    item: Scalar,
}

impl TriangleRow {
    /// `None` if other lists make rows vary in size.
    pub(super) fn new(element: &Element, list: usize) -> Option<Self> {
        let Kind::List { length, item } = element.properties.get(list)?.kind else { return None };
        let (mut before, mut bytes) = (0, length.size() + 3 * item.size());
        for (place, property) in element.properties.iter().enumerate().filter(|&(p, _)| p != list) {
            let Kind::One(scalar) = property.kind else { return None };
            bytes += scalar.size();
            before += if place < list { scalar.size() } else { 0 };
        }
        Some(Self { bytes, before, length, item })
    }

    /// The corners if the row's list has three.
    #[inline]
    pub(super) fn corners(&self, row: &[u8], big: bool) -> Option<[i64; 3]> {
        let list = row.get(self.before..)?;
        if self.length.integer(list, big) != 3 {
            return None;
        }
        let items = list.get(self.length.size()..)?;
        let size = self.item.size();
        Some([
            self.item.integer(items, big),
            self.item.integer(items.get(size..)?, big),
            self.item.integer(items.get(2 * size..)?, big),
        ])
    }
}

/// A strip: each corner after the second makes a triangle with the two before it, and every other one is turned round.
#[derive(Default)]
pub(super) struct Strip {
    last: [u32; 2],
    count: u64,
}

impl Strip {
    /// The triangle that this corner completes; those that repeat a corner only stitch the strip.
    pub(super) fn push(&mut self, vertex: u32) -> Option<[u32; 3]> {
        let [a, b] = self.last;
        self.last = [b, vertex];
        self.count += 1;
        if self.count < 3 || a == b || b == vertex || a == vertex {
            return None;
        }
        Some(if self.count % 2 == 1 { [a, b, vertex] } else { [b, a, vertex] })
    }
}
