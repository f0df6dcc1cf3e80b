//! Reading STL: which of the two it is, and its triangles.

use std::io::Read;

use glam::Vec3;

use super::{HEADER_BYTES, RECORD_BYTES};
use crate::codec::input::{Input, LineEnd};
use crate::codec::plain::Plain;
use crate::codec::quote::quote;
use crate::codec::text::{Fault, Tokens, is_blank, trim_start};
use crate::codec::weld::Welder;
use crate::frame::Framing;
use crate::{Error, Frame, IndexedMesh, Place, Triangle, TriangleSource};

/// How many bytes are looked at to tell text from binary.
const PROBE_BYTES: usize = 1024;

/// What some editors put at the front of a text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

const EXPORT_AGAIN: &str = "correct that place or export the mesh again";

/// From `facet` to `endfacet`.
const LINES_OF_FACET: usize = 7;

enum Content {
    /// Records from here on; `declared` is the header's count, `exact` says that the file's size agrees with it.
    Binary {
        declared: u32,
        exact: bool,
        done: u64,
    },
    Ascii(Solid),
}

/// Where in the text we are.
struct Solid {
    framing: Framing,
    /// Chosen with the first vertex.
    frame: Option<Frame>,
    inside: bool,
    /// Corners so far of the facet begun.
    facet: Option<usize>,
    corners: Triangle,
}

/// Streams the triangles of an STL.
pub(crate) struct StlReader<R> {
    input: Input<R>,
    content: Content,
}

impl<R: Read> StlReader<R> {
    /// Tells binary from text by size and content, whatever the file begins with; reads text up to the first vertex.
    pub(crate) fn new(mut input: Input<R>, framing: Framing) -> Result<Self, Error> {
        let there = input.fill(PROBE_BYTES)?;
        if there == 0 {
            return Err(input.empty());
        }
        if begins_with_solid(input.window()) && !is_binary(&input) {
            if input.window().starts_with(BYTE_ORDER_MARK) {
                input.consume(BYTE_ORDER_MARK.len());
            }
            let corners = [Vec3::ZERO; 3];
            let solid = Solid { framing, frame: None, inside: false, facet: None, corners };
            let mut reader = Self { input, content: Content::Ascii(solid) };
            // No triangle is complete before its first vertex.
            while reader.is_frame_open() && reader.take_line()?.is_some() {}
            return Ok(reader);
        }
        let Some(&count) =
            input.window().get(..HEADER_BYTES).and_then(|header| header.last_chunk())
        else {
            return Err(input.truncated("the header of a binary STL is complete (84 bytes)"));
        };
        let declared = u32::from_le_bytes(count);
        let expected = HEADER_BYTES as u64 + RECORD_BYTES as u64 * u64::from(declared);
        match input.length() {
            Some(length) if length < expected => {
                return Err(Error::Truncated {
                    name: input.name().to_owned(),
                    place: Place::Byte(length),
                    missing: format!(
                        "the last of its {declared} triangles, which takes {expected} bytes"
                    ),
                });
            }
            Some(length) if length > expected => {
                return Err(input.malformed(
                    Place::Byte(expected),
                    format!(
                        "{} bytes follow the {declared} triangles that the header counts",
                        length - expected
                    ),
                    "export it again, or pipe it in: from a pipe it is read to the end",
                ));
            }
            _ => {}
        }
        let exact = input.length().is_some();
        input.consume(HEADER_BYTES);
        Ok(Self { input, content: Content::Binary { declared, exact, done: 0 } })
    }

    fn read_binary(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let Content::Binary { declared, done, .. } = &mut self.content else { return Ok(0) };
        let there = self.input.fill(RECORD_BYTES)?;
        if there < RECORD_BYTES {
            if there > 0 {
                return Err(self.input.truncated("the triangle is complete"));
            }
            // A count written into a pipe beforehand may be too small or a placeholder; too large means loss.
            if *done < u64::from(*declared) && *declared != u32::MAX {
                let missing = format!("the last of its {declared} triangles, there are {done}");
                return Err(self.input.truncated(missing));
            }
            return Ok(0);
        }
        let count = (there / RECORD_BYTES).min(max);
        let records = &self.input.window()[..count * RECORD_BYTES];
        out.extend(records.as_chunks::<RECORD_BYTES>().0.iter().map(triangle_of));
        self.input.consume(count * RECORD_BYTES);
        *done += count as u64;
        Ok(count)
    }

    fn is_frame_open(&self) -> bool {
        matches!(&self.content, Content::Ascii(solid) if solid.frame.is_none())
    }

    /// Takes one line of text: the triangle that it completes, if any, or the end.
    #[inline]
    fn take_line(&mut self) -> Result<Option<Option<Triangle>>, Error> {
        let Content::Ascii(solid) = &mut self.content else { return Ok(None) };
        let Some(line) = self.input.next_line()? else {
            return match solid.missing() {
                None => Ok(None),
                Some(missing) => Err(self.input.truncated_line(missing)),
            };
        };
        solid.take_line(self.input.text(line)).map(Some).map_err(|problem| match solid.missing() {
            // The last line is cut off, whatever it looks like.
            Some(missing) if self.input.line_end() == LineEnd::None => {
                self.input.truncated_line(missing)
            }
            _ => self.input.malformed_line(problem, EXPORT_AGAIN),
        })
    }

    fn read_ascii(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        let before = out.len();
        loop {
            self.take_plain_facets(out, max - (out.len() - before));
            if out.len() - before == max {
                break;
            }
            match self.take_line()? {
                Some(triangle) => out.extend(triangle),
                None => break,
            }
        }
        Ok(out.len() - before)
    }

    /// Takes facets as almost all are written straight from the window, at most `max`.
    fn take_plain_facets(&mut self, out: &mut Vec<Triangle>, max: usize) {
        let Content::Ascii(Solid { frame: Some(frame), inside: true, facet: None, .. }) =
            &self.content
        else {
            return;
        };
        let mut text = Plain::new(self.input.window());
        let (mut facets, mut taken) = (0, 0);
        while facets < max
            && let Some(triangle) = plain_facet(&mut text, frame)
        {
            out.push(triangle);
            facets += 1;
            taken = text.at();
        }
        self.input.consume_lines(taken, (facets * LINES_OF_FACET) as u64);
    }
}

impl<R: Read> TriangleSource for StlReader<R> {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        if max == 0 {
            return Ok(0);
        }
        match self.content {
            Content::Binary { .. } => self.read_binary(out, max),
            Content::Ascii(_) => self.read_ascii(out, max),
        }
    }

    fn triangle_count(&self) -> Option<u64> {
        match self.content {
            Content::Binary { declared, exact: true, .. } => Some(u64::from(declared)),
            _ => None,
        }
    }

    fn triangle_hint(&self) -> Option<u64> {
        match self.content {
            Content::Binary { declared, .. } if declared != 0 && declared != u32::MAX => {
                Some(u64::from(declared))
            }
            _ => None,
        }
    }

    fn frame(&self) -> Frame {
        match &self.content {
            Content::Ascii(solid) => solid.frame.unwrap_or_default(),
            Content::Binary { .. } => Frame::default(),
        }
    }
}

impl Solid {
    /// What must follow before the file may end.
    fn missing(&self) -> Option<&'static str> {
        match (self.inside, self.facet) {
            (false, _) => None,
            (true, None) => Some("`endsolid`"),
            (true, Some(_)) => Some("`endfacet`"),
        }
    }

    /// Takes one line; gives the triangle that it completes, or what is wrong with it.
    #[inline]
    fn take_line(&mut self, line: &[u8]) -> Result<Option<Triangle>, String> {
        let mut tokens = Tokens::new(line);
        let Some(word) = tokens.word() else { return Ok(None) };
        let is = |keyword: &str| word.eq_ignore_ascii_case(keyword.as_bytes());
        match (self.inside, self.facet) {
            (true, Some(corners)) => {
                if is("vertex") {
                    let Some(corner) = self.corners.get_mut(corners) else {
                        return Err("a facet with more than three vertices".to_owned());
                    };
                    let frame = match self.frame {
                        Some(frame) => frame,
                        None => {
                            let first = tokens.clone().exact_point().map_err(describe)?;
                            *self.frame.insert(self.framing.choose(first))
                        }
                    };
                    *corner = tokens.point(&frame).map_err(describe)?;
                    self.facet = Some(corners + 1);
                    return Ok(None);
                }
                if is("outer") || is("endloop") {
                    return Ok(None);
                }
                if is("endfacet") {
                    if corners != 3 {
                        return Err(format!("a facet with {corners} vertices instead of three"));
                    }
                    self.facet = None;
                    return Ok(Some(self.corners));
                }
            }
            (true, None) => {
                if is("facet") {
                    self.facet = Some(0);
                    return Ok(None);
                }
                if is("endsolid") {
                    self.inside = false;
                    return Ok(None);
                }
                if is("color") || word.starts_with(b"#") {
                    return Ok(None);
                }
            }
            (false, _) => {
                if is("solid") {
                    self.inside = true;
                    return Ok(None);
                }
                if word.starts_with(b"#") {
                    return Ok(None);
                }
            }
        }
        let expected = match (self.inside, self.facet) {
            (false, _) => "`solid`",
            (true, None) => "`facet` or `endsolid`",
            (true, Some(_)) => "`vertex` or `endfacet`",
        };
        let word = quote(word);
        Err(format!("`{word}` where {expected} should be"))
    }
}

/// A facet in seven lines and in small letters.
#[inline]
fn plain_facet(text: &mut Plain<'_>, frame: &Frame) -> Option<Triangle> {
    pass_line(text, b"facet")?;
    pass_line(text, b"outer")?;
    let mut triangle = [Vec3::ZERO; 3];
    for corner in &mut triangle {
        text.skip_blanks()?;
        text.skip(b"vertex ")?;
        *corner = text.point(frame)?;
        text.rest_of_line()?;
    }
    pass_line(text, b"endloop")?;
    pass_line(text, b"endfacet")?;
    Some(triangle)
}

/// Passes over a line that begins with this word.
#[inline]
fn pass_line(text: &mut Plain<'_>, word: &[u8]) -> Option<()> {
    text.skip_blanks()?;
    text.skip(word)?;
    let rest = text.rest_of_line()?;
    rest.first().is_none_or(|&byte| is_blank(byte)).then_some(())
}

fn describe(fault: Fault) -> String {
    match fault {
        Fault::Missing => "a vertex with fewer than three coordinates".to_owned(),
        Fault::BadNumber(token) => format!("`{token}` is not a number"),
    }
}

fn begins_with_solid(window: &[u8]) -> bool {
    let mut text = window.strip_prefix(BYTE_ORDER_MARK).unwrap_or(window);
    loop {
        text = trim_start(text);
        match text {
            [b'\r' | b'\n', tail @ ..] => text = tail,
            _ => break,
        }
    }
    text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

/// For a file that begins with "solid": the size agrees with the count, or there is a byte that text cannot have.
fn is_binary<R: Read>(input: &Input<R>) -> bool {
    let window = input.window();
    let count = window.get(HEADER_BYTES - 4..HEADER_BYTES).and_then(|bytes| bytes.first_chunk());
    let expected = count.map(|&count| {
        HEADER_BYTES as u64 + RECORD_BYTES as u64 * u64::from(u32::from_le_bytes(count))
    });
    (expected.is_some() && expected == input.length())
        || window[..window.len().min(PROBE_BYTES)].contains(&0)
}

fn triangle_of(record: &[u8; RECORD_BYTES]) -> Triangle {
    let real = |at: usize| {
        f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
    };
    let corner = |at: usize| Vec3::new(real(at), real(at + 4), real(at + 8));
    [corner(12), corner(24), corner(36)]
}

/// The whole mesh; corners with the same coordinate bits are one vertex.
pub(crate) fn read_mesh<R: Read>(
    input: Input<R>,
    framing: Framing,
) -> Result<(IndexedMesh, Frame), Error> {
    let mut reader = StlReader::new(input, framing)?;
    let mut mesh = IndexedMesh::default();
    if let Some(count) = reader.triangle_count() {
        mesh.triangles.reserve(usize::try_from(count).unwrap_or(0));
    }
    let mut welder = Welder::exact();
    let mut batch = Vec::new();
    while reader.read(&mut batch, 1 << 12)? > 0 {
        for triangle in batch.drain(..) {
            let mut indices = [0; 3];
            for (index, position) in indices.iter_mut().zip(triangle) {
                let Some((vertex, new)) = welder.weld(position) else {
                    return Err(Error::TooLarge {
                        name: reader.input.name().to_owned(),
                        what: "vertices",
                        limit: welder.num_vertices(),
                    });
                };
                if new {
                    mesh.positions.push(position);
                }
                *index = vertex;
            }
            mesh.triangles.push(indices);
        }
    }
    Ok((mesh, reader.frame()))
}
