//! The rows of a PLY file in binary, wanted or passed over.

use std::fmt;
use std::io::Read;

use glam::DVec3;

use super::header::{Coding, Element, Kind, Property, Scalar, VertexPlaces, head};
use super::positions::{Layout, Vertices};
use crate::codec::input::Input;
use crate::frame::Framing;
use crate::mesh::WHITE;
use crate::{Error, Frame, Place};

pub(super) const EXPORT_AGAIN: &str = "correct that place or export the mesh again";

/// What a file lacks that ends within an element.
#[derive(Clone, Copy)]
pub(super) struct MissingRows<'a>(pub(super) &'a Element);

impl fmt::Display for MissingRows<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the last of its {} rows of `{}`", self.0.count, self.0.name())
    }
}

pub(super) fn binary_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    layout: Layout,
    framing: Framing,
) -> Result<(Vertices, Frame), Error> {
    let stride = layout.stride;
    let mut vertices = Vertices::default();
    let room = input.plausible(element.count, stride as u64);
    vertices.positions.reserve_exact(room);
    vertices.colours.reserve_exact(if layout.has_colour() { room } else { 0 });
    let mut chosen = None;
    let mut left = element.count;
    while left > 0 {
        if input.fill(stride)? < stride {
            return Err(input.truncated(MissingRows(element)));
        }
        let most = usize::try_from(left).unwrap_or(usize::MAX);
        let rows = input.window().chunks_exact(stride).take(most);
        let count = rows.len();
        let frame = *chosen.get_or_insert_with(|| layout.frame(input.window(), framing));
        if layout.has_colour() {
            vertices.colours.extend(rows.clone().map(|row| layout.colour(row)));
        }
        vertices.positions.extend(rows.map(|row| layout.position(row, &frame)));
        input.consume(count * stride);
        left -= count as u64;
    }
    Ok((vertices, chosen.unwrap_or_default()))
}

/// Vertices with a list among their properties, so that rows vary in size.
pub(super) fn ragged_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    places: VertexPlaces,
    big: bool,
    framing: Framing,
) -> Result<(Vertices, Frame), Error> {
    let row_bytes = element.min_row_bytes(Coding::Little);
    let mut vertices = Vertices::default();
    vertices.positions.reserve_exact(input.plausible(element.count, row_bytes));
    let mut chosen = None;
    for _ in 0..element.count {
        let missing = MissingRows(element);
        // What decides about the frame: coordinates of types that exceed single precision.
        let (mut position, mut wide) = (DVec3::ZERO, DVec3::ZERO);
        let mut colour = WHITE;
        for (place, property) in element.properties.iter().enumerate() {
            let axis = places.axes.iter().position(|&axis| axis == place);
            let component = places.component(place);
            match property.kind {
                Kind::One(scalar) if axis.is_some() || component.is_some() => {
                    if input.fill(scalar.size())? < scalar.size() {
                        return Err(input.truncated(missing));
                    }
                    let value = scalar.real(input.window(), big);
                    if let Some(axis) = axis {
                        position[axis] = value;
                        wide[axis] = if scalar.exceeds_single() { value } else { 0.0 };
                    }
                    if let Some(component) = component {
                        colour[component] = scalar.colour_byte(value);
                    }
                    input.consume(scalar.size());
                }
                _ => skip_properties(input, std::slice::from_ref(property), big, missing)?,
            }
        }
        let frame = chosen.get_or_insert_with(|| framing.choose(wide));
        vertices.positions.push(frame.from_file(position));
        if places.colour.is_some() {
            vertices.colours.push(colour);
        }
    }
    Ok((vertices, chosen.unwrap_or_default()))
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
    big: bool,
}

impl TriangleRow {
    /// `None` if other lists make rows vary in size.
    pub(super) fn new(element: &Element, list: usize, big: bool) -> Option<Self> {
        let Kind::List { length, item } = element.properties.get(list)?.kind else { return None };
        let (mut before, mut bytes) = (0, length.size() + 3 * item.size());
        for (place, property) in element.properties.iter().enumerate().filter(|&(p, _)| p != list) {
            let Kind::One(scalar) = property.kind else { return None };
            bytes += scalar.size();
            before += if place < list { scalar.size() } else { 0 };
        }
        Some(Self { bytes, before, length, item, big })
    }

    /// Appends the corners of rows whose list has three, all below `num_vertices`; returns how many rows there were
    /// before the first other one.
    pub(super) fn take(
        &self,
        rows: std::slice::ChunksExact<'_, u8>,
        num_vertices: u64,
        out: &mut Vec<[u32; 3]>,
    ) -> usize {
        let limit = i64::try_from(num_vertices).unwrap_or(i64::MAX);
        let before = out.len();
        let is_plain = self.before == 0
            && self.length.size() == 1
            && matches!(self.item, Scalar::I32 | Scalar::U32);
        for row in rows {
            let corners = match row {
                [3, list @ ..] if is_plain => match list.as_chunks::<4>().0 {
                    // Negative ones become too large.
                    [a, b, c, ..] => {
                        [a, b, c].map(|v| u32::from_le_bytes(head(v, self.big)).into())
                    }
                    _ => break,
                },
                _ => match self.corners(row) {
                    Some(corners) => corners,
                    None => break,
                },
            };
            if corners.iter().any(|&corner| corner < 0 || corner >= limit) {
                break;
            }
            out.push(corners.map(|corner| corner as u32));
        }
        out.len() - before
    }

    /// The corners if the row's list has three.
    #[inline]
    fn corners(&self, row: &[u8]) -> Option<[i64; 3]> {
        let list = row.get(self.before..)?;
        if self.length.integer(list, self.big) != 3 {
            return None;
        }
        let items = list.get(self.length.size()..)?;
        let size = self.item.size();
        Some([
            self.item.integer(items, self.big),
            self.item.integer(items.get(size..)?, self.big),
            self.item.integer(items.get(2 * size..)?, self.big),
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
