//! The rows of a PLY file as text.

use std::io::Read;

use fast_float2::FastFloat;
use glam::Vec3;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::header::{Element, Kind, Property, Scalar, VertexPlaces};
use super::positions::Vertices;
use super::rows::{EXPORT_AGAIN, MissingRows};
use crate::codec::input::{Input, LineEnd};
use crate::codec::plain::Plain;
use crate::codec::text::{Fault, Tokens};
use crate::frame::Framing;
use crate::mesh::WHITE;
use crate::{Colour, Error, Frame};

/// Bytes of text that a thread parses at a time.
const PIECE: usize = 256 << 10;

/// Bytes that most rows of coordinates take at least.
const MIN_ROW: usize = 20;

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

/// The row of a vertex.
struct VertexRow<'a> {
    tokens: Tokens<'a>,
    /// Up to the last one that matters.
    properties: &'a [Property],
    places: VertexPlaces,
}

impl VertexRow<'_> {
    fn coordinates<T: FastFloat + From<f32>>(&self) -> Result<[T; 3], Fault> {
        let mut tokens = self.tokens;
        let mut coordinates = [T::from(0.0); 3];
        for (place, property) in self.properties.iter().enumerate() {
            match self.places.axes.iter().position(|&axis| axis == place) {
                Some(axis) => coordinates[axis] = tokens.real()?,
                None => ascii_skip(&mut tokens, property)?,
            }
        }
        Ok(coordinates)
    }

    fn colour(&self) -> Result<Colour, Fault> {
        let mut tokens = self.tokens;
        let mut colour = WHITE;
        for (place, property) in self.properties.iter().enumerate() {
            match (self.places.component(place), property.kind) {
                (Some(component), Kind::One(scalar)) => {
                    colour[component] = scalar.colour_byte(tokens.real()?);
                }
                _ => ascii_skip(&mut tokens, property)?,
            }
        }
        Ok(colour)
    }

    fn position(&self, frame: &Frame) -> Result<Vec3, Fault> {
        if frame.double {
            Ok(frame.from_file(self.coordinates()?.into()))
        } else {
            Ok(self.coordinates()?.into())
        }
    }
}

/// The vertices, and the frame they are in.
pub(super) fn ascii_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    places: VertexPlaces,
    framing: Framing,
) -> Result<(Vertices, Frame), Error> {
    let mut vertices = Vertices::default();
    vertices.positions.reserve_exact(input.plausible(element.count, 6));
    let properties = &element.properties[..=places.last()];
    let plain = PlainRow::new(properties, places);
    let mut chosen = None;
    while (vertices.positions.len() as u64) < element.count {
        if let Some(frame) = &chosen
            && let Some(plain) = &plain
            && take_plain_vertices(input, plain, frame, element.count, &mut vertices)?
        {
            continue;
        }
        let line = row_line(input, MissingRows(element))?;
        let tokens = Tokens::new(input.text(line));
        let row = VertexRow { tokens, properties, places };
        let explain = |fault| row_fault(input, fault, element);
        let frame = match chosen {
            Some(frame) => frame,
            None => framing.choose(row.coordinates().map_err(explain)?.into()),
        };
        vertices.positions.push(row.position(&frame).map_err(explain)?);
        if places.colour.is_some() {
            vertices.colours.push(row.colour().map_err(explain)?);
        }
        chosen = Some(frame);
    }
    Ok((vertices, chosen.unwrap_or_default()))
}

/// What follows x, y and z in rows that begin with them, up to the last number that matters.
struct PlainRow {
    /// Of each number which component of the colour it is, and its type; empty without colours.
    after: Vec<(Option<usize>, Scalar)>,
}

impl PlainRow {
    /// `None` for rows that are not so simple.
    fn new(properties: &[Property], places: VertexPlaces) -> Option<Self> {
        let true = places.axes == [0, 1, 2] else { return None };
        let after = properties.iter().enumerate().skip(3).map(|(place, property)| {
            let Kind::One(scalar) = property.kind else { return None };
            Some((places.component(place), scalar))
        });
        Some(Self { after: after.collect::<Option<_>>()? })
    }

    #[inline]
    fn colour(&self, text: &mut Plain<'_>) -> Option<Colour> {
        let mut colour = WHITE;
        for &(component, scalar) in &self.after {
            let value = text.real::<f64>()?;
            if let Some(component) = component {
                colour[component] = scalar.colour_byte(value);
            }
        }
        Some(colour)
    }
}

/// Takes rows that begin with plain numbers straight from the window, on all threads of the current pool, up to `count`
/// vertices in all; says whether there was one.
fn take_plain_vertices<R: Read>(
    input: &mut Input<R>,
    row: &PlainRow,
    frame: &Frame,
    count: u64,
    vertices: &mut Vertices,
) -> Result<bool, Error> {
    if input.fill(PIECE)? >= PIECE {
        input.fill(PIECE * rayon::current_num_threads())?;
    }
    let pieces = pieces(input.window());
    let before = vertices.positions.len();
    let parse = |piece: &[u8], max| plain_vertices(piece, row, frame, max);
    let most = usize::try_from(count).unwrap_or(usize::MAX) - before;
    let parsed: Vec<_> = match *pieces {
        [piece] => vec![parse(piece, most)],
        _ => pieces.par_iter().map(|piece| parse(piece, most)).collect(),
    };
    let mut taken = 0;
    for (piece, (mut some, mut bytes)) in pieces.into_iter().zip(parsed) {
        let left = most - (vertices.positions.len() - before);
        if some.positions.len() > left {
            // Other rows follow in this piece, which look like these.
            (some, bytes) = parse(piece, left);
        }
        vertices.positions.extend(some.positions);
        vertices.colours.extend(some.colours);
        taken += bytes;
        if bytes < piece.len() {
            break;
        }
    }
    let rows = vertices.positions.len() - before;
    input.consume_lines(taken, rows as u64);
    Ok(rows > 0)
}

/// Cuts text into pieces that end with a line each, but for the last.
fn pieces(mut text: &[u8]) -> Vec<&[u8]> {
    let mut pieces = Vec::new();
    while text.len() > PIECE
        && let Some(line_end) = memchr::memchr(b'\n', &text[PIECE..])
    {
        let (piece, rest) = text.split_at(PIECE + line_end + 1);
        pieces.push(piece);
        text = rest;
    }
    pieces.push(text);
    pieces
}

/// The vertices of the rows, at most `max`, that come before the first that does not begin with plain numbers, and the
/// bytes these rows take.
fn plain_vertices(rows: &[u8], row: &PlainRow, frame: &Frame, max: usize) -> (Vertices, usize) {
    let mut vertices = Vertices::default();
    vertices.positions.reserve_exact((rows.len() / MIN_ROW).min(max));
    let mut text = Plain::new(rows);
    let mut taken = 0;
    while vertices.positions.len() < max {
        let Some(position) = text.point(frame) else { break };
        if row.after.is_empty() {
            let Some(_) = text.rest_of_line() else { break };
        } else {
            let Some(colour) = row.colour(&mut text) else { break };
            let Some(_) = text.rest_of_line() else { break };
            vertices.colours.push(colour);
        }
        vertices.positions.push(position);
        taken = text.at();
    }
    (vertices, taken)
}

/// Takes rows that begin with a list of three plain indices below `num_vertices` straight from the window, at most `max`;
/// returns how many.
pub(super) fn take_plain_triangles<R: Read>(
    input: &mut Input<R>,
    num_vertices: u64,
    max: usize,
    out: &mut Vec<[u32; 3]>,
) -> usize {
    let mut text = Plain::new(input.window());
    let (mut rows, mut taken) = (0, 0);
    while rows < max {
        let Some(corners) = plain_triangle(&mut text) else { break };
        if corners.iter().any(|&corner| corner >= num_vertices) {
            break;
        }
        // There are fewer than 2³² vertices.
        out.push(corners.map(|corner| corner as u32));
        rows += 1;
        taken = text.at();
    }
    input.consume_lines(taken, rows as u64);
    rows
}

#[inline]
fn plain_triangle(text: &mut Plain<'_>) -> Option<[u64; 3]> {
    let true = text.integer()? == 3 else { return None };
    let corners = [text.integer()?, text.integer()?, text.integer()?];
    text.rest_of_line()?;
    Some(corners)
}
