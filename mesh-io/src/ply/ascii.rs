//! The rows of a PLY file as text.

use std::io::Read;

use fast_float2::FastFloat;
use glam::Vec3;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::header::{Element, Kind, Property};
use super::rows::{EXPORT_AGAIN, MissingRows};
use crate::codec::input::{Input, LineEnd};
use crate::codec::plain::Plain;
use crate::codec::text::{Fault, Tokens};
use crate::frame::Framing;
use crate::{Error, Frame};

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
    /// Up to the last coordinate.
    properties: &'a [Property],
    axes: [usize; 3],
}

impl VertexRow<'_> {
    fn coordinates<T: FastFloat + From<f32>>(&self) -> Result<[T; 3], Fault> {
        let mut tokens = self.tokens;
        let mut coordinates = [T::from(0.0); 3];
        for (place, property) in self.properties.iter().enumerate() {
            match self.axes.iter().position(|&axis| axis == place) {
                Some(axis) => coordinates[axis] = tokens.real()?,
                None => ascii_skip(&mut tokens, property)?,
            }
        }
        Ok(coordinates)
    }

    fn position(&self, frame: &Frame) -> Result<Vec3, Fault> {
        if frame.double {
            Ok(frame.from_file(self.coordinates()?.into()))
        } else {
            Ok(self.coordinates()?.into())
        }
    }
}

/// The positions, and the frame they are in.
pub(super) fn ascii_vertices<R: Read>(
    input: &mut Input<R>,
    element: &Element,
    axes: [usize; 3],
    framing: Framing,
) -> Result<(Vec<Vec3>, Frame), Error> {
    let mut positions = Vec::with_capacity(input.plausible(element.count, 6));
    let last = axes.into_iter().max().unwrap_or(0);
    let mut chosen = None;
    while (positions.len() as u64) < element.count {
        if let Some(frame) = &chosen
            && axes == [0, 1, 2]
            && take_plain_points(input, frame, element.count, &mut positions)?
        {
            continue;
        }
        let line = row_line(input, MissingRows(element))?;
        let tokens = Tokens::new(input.text(line));
        let row = VertexRow { tokens, properties: &element.properties[..=last], axes };
        let explain = |fault| row_fault(input, fault, element);
        let frame = match chosen {
            Some(frame) => frame,
            None => framing.choose(row.coordinates().map_err(explain)?.into()),
        };
        positions.push(row.position(&frame).map_err(explain)?);
        chosen = Some(frame);
    }
    Ok((positions, chosen.unwrap_or_default()))
}

/// Takes rows that begin with plain coordinates straight from the window, on all threads of the current pool, up to
/// `count` positions in all; says whether there was one.
fn take_plain_points<R: Read>(
    input: &mut Input<R>,
    frame: &Frame,
    count: u64,
    positions: &mut Vec<Vec3>,
) -> Result<bool, Error> {
    if input.fill(PIECE)? >= PIECE {
        input.fill(PIECE * rayon::current_num_threads())?;
    }
    let pieces = pieces(input.window());
    let before = positions.len();
    let parse = |piece: &[u8], max| plain_points(piece, frame, max);
    let most = usize::try_from(count).unwrap_or(usize::MAX) - before;
    let parsed: Vec<_> = match *pieces {
        [piece] => vec![parse(piece, most)],
        _ => pieces.par_iter().map(|piece| parse(piece, most)).collect(),
    };
    let mut taken = 0;
    for (piece, (mut points, mut bytes)) in pieces.into_iter().zip(parsed) {
        let left = most - (positions.len() - before);
        if points.len() > left {
            // Other rows follow in this piece, which look like these.
            (points, bytes) = parse(piece, left);
        }
        positions.extend(points);
        taken += bytes;
        if bytes < piece.len() {
            break;
        }
    }
    let rows = positions.len() - before;
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

/// The positions of the rows, at most `max`, that come before the first that does not begin with plain coordinates, and
/// the bytes these rows take.
fn plain_points(rows: &[u8], frame: &Frame, max: usize) -> (Vec<Vec3>, usize) {
    let mut positions = Vec::with_capacity((rows.len() / MIN_ROW).min(max));
    let mut text = Plain::new(rows);
    let mut taken = 0;
    while positions.len() < max {
        let Some(position) = text.point(frame) else { break };
        let Some(_) = text.rest_of_line() else { break };
        positions.push(position);
        taken = text.at();
    }
    (positions, taken)
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
