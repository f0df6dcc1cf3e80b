//! Reading OBJ.

use std::io::Read;

use glam::Vec3;

use crate::codec::indexed::IndexedReader;
use crate::codec::input::{Input, LineEnd};
use crate::codec::plain::Plain;
use crate::codec::polygon::triangulate;
use crate::codec::text::{Fault, Tokens, is_blank, trim_start};
use crate::frame::Framing;
use crate::mesh::{WHITE, colour_byte};
use crate::{Colour, Error, Frame, IndexedMesh, Place, Triangle};

const EXPORT_AGAIN: &str = "correct that line or export the mesh again";

/// First words that tell an OBJ from some other text.
const KEYWORDS: [&[u8]; 24] = [
    b"v",
    b"vt",
    b"vn",
    b"vp",
    b"f",
    b"fo",
    b"l",
    b"p",
    b"g",
    b"o",
    b"s",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"shadow_obj",
    b"trace_obj",
    b"lod",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"cstype",
    b"deg",
];

/// Streams the faces of an OBJ; the positions so far are in memory.
pub(crate) struct ObjReader<R> {
    input: Input<R>,
    model: Model,
    /// Lines put together that end in a backslash each.
    joined: Vec<u8>,
    ended: bool,
}

/// What was read so far.
struct Model {
    positions: Vec<Vec3>,
    /// As many, if the first position has one; else none.
    colours: Vec<Colour>,
    framing: Framing,
    /// Chosen with the first position.
    frame: Frame,
    recognized: bool,
    corners: Vec<i64>,
    polygon: Vec<u32>,
    later: Later,
}

/// Faces whose vertices had not come yet: corners from zero, and for each face its line and where its corners end.
#[derive(Default)]
struct Later {
    corners: Vec<i64>,
    faces: Vec<(u64, usize)>,
}

/// What is wrong with a line.
enum Problem {
    Fault(Fault),
    Index { written: i64 },
    ZeroIndex,
    TooManyVertices,
}

impl From<Fault> for Problem {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl<R: Read> ObjReader<R> {
    /// Reads up to and including the first position.
    pub(crate) fn new(mut input: Input<R>, framing: Framing) -> Result<Self, Error> {
        if input.fill(3)? == 0 {
            return Err(input.empty());
        }
        if input.window().starts_with(b"\xef\xbb\xbf") {
            input.consume(3);
        }
        let model = Model::new(framing);
        let mut reader = Self { input, model, joined: Vec::new(), ended: false };
        // Faces before it wait for their vertices.
        let mut none = Vec::new();
        while reader.model.positions.is_empty() && reader.take_line(&mut none)? {}
        Ok(reader)
    }

    /// Takes one line, or several that belong together; says whether there was one.
    fn take_line(&mut self, out: &mut Vec<[u32; 3]>) -> Result<bool, Error> {
        let Some(line) = self.input.next_line()? else { return Ok(false) };
        let text = self.input.text(line.clone());
        // A path in a comment may end in a backslash and goes on nowhere.
        let taken = if text.ends_with(b"\\") && !trim_start(text).starts_with(b"#") {
            self.join_lines(line)?;
            self.model.take_line(&self.joined, self.input.line(), out)
        } else {
            self.model.take_line(text, self.input.line(), out)
        };
        let num_corners = taken.map_err(|problem| self.explain(problem))?;
        if matches!(num_corners, 1 | 2) && self.input.line_end() == LineEnd::None {
            return Err(self.input.truncated_line("the face has three corners"));
        }
        Ok(true)
    }

    /// Takes lines as almost all are straight from the window, until there are `max` triangles more or so; says whether
    /// there was one.
    fn take_plain_lines(&mut self, out: &mut Vec<[u32; 3]>, max: usize) -> bool {
        let limit = out.len().saturating_add(max);
        let mut text = Plain::new(self.input.window());
        let (mut lines, mut taken) = (0, 0);
        while out.len() < limit && self.model.take_plain_line(&mut text, out).is_some() {
            lines += 1;
            taken = text.at();
        }
        self.input.consume_lines(taken, lines);
        lines > 0
    }

    /// Adds following lines to `self.joined` for as long as they end in a backslash.
    #[cold]
    fn join_lines(&mut self, first: std::ops::Range<usize>) -> Result<(), Error> {
        self.joined.clear();
        let mut line = first;
        loop {
            let text = self.input.text(line);
            let Some(text) = text.strip_suffix(b"\\") else {
                self.joined.extend_from_slice(text);
                return Ok(());
            };
            self.joined.extend_from_slice(text);
            self.joined.push(b' ');
            match self.input.next_line()? {
                Some(next) => line = next,
                None => return Err(self.input.truncated_line("the line that `\\` announces")),
            }
        }
    }

    fn explain(&self, problem: Problem) -> Error {
        match problem {
            Problem::Fault(Fault::Missing) if self.input.line_end() == LineEnd::None => {
                self.input.truncated_line("the line is complete")
            }
            Problem::Fault(Fault::Missing) => self
                .input
                .malformed_line("a vertex with fewer than three coordinates".into(), EXPORT_AGAIN),
            Problem::Fault(Fault::BadNumber(token)) => self
                .input
                .malformed_line(format!("`{token}` is not a number that fits here"), EXPORT_AGAIN),
            Problem::Index { written } => self.input.out_of_range(
                Place::Line(self.input.line()),
                written,
                self.model.positions.len() as u64,
            ),
            Problem::ZeroIndex => self.input.malformed_line(
                "vertex index 0, but OBJ counts from one".into(),
                "export the mesh again with indices from one",
            ),
            Problem::TooManyVertices => Error::TooLarge {
                name: self.input.name().to_owned(),
                what: "vertices",
                limit: u64::from(u32::MAX),
            },
        }
    }

    /// Everything is read: the faces that had to wait, and whether this was an OBJ at all.
    fn end(&mut self, out: &mut Vec<[u32; 3]>) -> Result<(), Error> {
        self.ended = true;
        if !self.model.recognized {
            return Err(self.input.malformed(
                Place::File,
                "not one line of an OBJ in it".into(),
                "check what the file is, or name its format",
            ));
        }
        let later = std::mem::take(&mut self.model.later);
        let mut start = 0;
        for (line, stop) in later.faces {
            let corners = later.corners.get(start..stop).unwrap_or_default();
            if let Err(index) = self.model.emit(corners, out) {
                let count = self.model.positions.len() as u64;
                return Err(self.input.out_of_range(Place::Line(line), index + 1, count));
            }
            start = stop;
        }
        Ok(())
    }
}

impl Model {
    fn new(framing: Framing) -> Self {
        Self {
            positions: Vec::new(),
            colours: Vec::new(),
            framing,
            frame: Frame::default(),
            recognized: false,
            corners: Vec::new(),
            polygon: Vec::new(),
            later: Later::default(),
        }
    }

    /// Takes one line if it is a position after the first, or one that does not matter, or a face of known vertices;
    /// changes nothing otherwise.
    #[inline]
    fn take_plain_line(&mut self, text: &mut Plain<'_>, out: &mut Vec<[u32; 3]>) -> Option<()> {
        let count = self.positions.len();
        if text.skip(b"v ").is_some() {
            if count == 0 || count >= u32::MAX as usize {
                return None;
            }
            let position = text.point(&self.frame)?;
            if !self.colours.is_empty() {
                let rgb = [text.real::<f32>()?, text.real()?, text.real()?];
                plain_rest(text)?;
                self.colours.push(colour_of(rgb));
            } else {
                plain_rest(text)?;
            }
            self.positions.push(position);
        } else if text.skip(b"f ").is_some() {
            self.polygon.clear();
            while text.line_end().is_none() {
                let corner = text.integer_before_slash()?.checked_sub(1)?;
                if corner >= count as u64 {
                    return None;
                }
                self.polygon.push(corner as u32);
            }
            let positions = &self.positions;
            triangulate(&self.polygon, |v| positions[v as usize], out);
        } else if text.skip(b"vn ").is_some() || text.skip(b"vt ").is_some() {
            plain_rest(text)?;
        } else {
            return None;
        }
        self.recognized = true;
        Some(())
    }

    /// Takes one line and gives the number of a face's corners, zero for any other line.
    #[inline]
    fn take_line(
        &mut self,
        text: &[u8],
        line: u64,
        out: &mut Vec<[u32; 3]>,
    ) -> Result<usize, Problem> {
        match trim_start(text) {
            [b'v', next, rest @ ..] if is_blank(*next) => {
                let mut tokens = Tokens::new(rest);
                if self.positions.is_empty() {
                    self.frame = self.framing.choose(tokens.clone().exact_point()?);
                }
                let position = tokens.point(&self.frame)?;
                if self.positions.len() >= u32::MAX as usize {
                    return Err(Problem::TooManyVertices);
                }
                self.recognized = true;
                let mut fraction = || tokens.real::<f32>().ok();
                let rgb = fraction().zip(fraction()).zip(fraction());
                let colour = rgb.map(|((r, g), b)| colour_of([r, g, b]));
                if !self.colours.is_empty() {
                    self.colours.push(colour.unwrap_or(WHITE));
                } else if self.positions.is_empty() {
                    self.colours.extend(colour);
                }
                self.positions.push(position);
                Ok(0)
            }
            [b'f', next, rest @ ..] if is_blank(*next) => self.take_face(rest, line, out),
            [b'f', b'o', next, rest @ ..] if is_blank(*next) => self.take_face(rest, line, out),
            [] => Ok(0),
            [b'v'] => Err(Fault::Missing.into()),
            other => {
                if !self.recognized {
                    let word = Tokens::new(other).word();
                    self.recognized =
                        other[0] == b'#' || word.is_some_and(|word| KEYWORDS.contains(&word));
                }
                Ok(0)
            }
        }
    }

    #[inline]
    fn take_face(
        &mut self,
        rest: &[u8],
        line: u64,
        out: &mut Vec<[u32; 3]>,
    ) -> Result<usize, Problem> {
        self.recognized = true;
        self.corners.clear();
        let count = self.positions.len() as i64;
        let mut waits = false;
        let mut tokens = Tokens::new(rest);
        while !tokens.is_at_end() {
            let written = tokens.integer_until(b'/')?;
            // Texture coordinate and normal.
            tokens.skip_token_rest();
            let corner = match written {
                0 => return Err(Problem::ZeroIndex),
                1.. => written - 1,
                _ => count + written,
            };
            if corner < 0 {
                return Err(Problem::Index { written });
            }
            waits |= corner >= count;
            self.corners.push(corner);
        }
        if waits {
            self.later.corners.extend_from_slice(&self.corners);
            self.later.faces.push((line, self.later.corners.len()));
            return Ok(self.corners.len());
        }
        let corners = std::mem::take(&mut self.corners);
        let emitted = self.emit(&corners, out);
        self.corners = corners;
        emitted.map_err(|index| Problem::Index { written: index + 1 })?;
        Ok(self.corners.len())
    }

    /// Triangles of a polygon; the error is the index that does not exist.
    #[inline]
    fn emit(&mut self, corners: &[i64], out: &mut Vec<[u32; 3]>) -> Result<(), i64> {
        self.polygon.clear();
        for &corner in corners {
            match u32::try_from(corner) {
                Ok(vertex) if (vertex as usize) < self.positions.len() => self.polygon.push(vertex),
                _ => return Err(corner),
            }
        }
        let positions = &self.positions;
        triangulate(&self.polygon, |v| positions[v as usize], out);
        Ok(())
    }
}

impl<R: Read> IndexedReader for ObjReader<R> {
    fn read_indices(&mut self, out: &mut Vec<[u32; 3]>, max: usize) -> Result<usize, Error> {
        let before = out.len();
        while out.len() - before < max && !self.ended {
            if !self.take_plain_lines(out, max - (out.len() - before)) && !self.take_line(out)? {
                self.end(out)?;
            }
        }
        Ok(out.len() - before)
    }

    fn look_up(&self, triangles: &[[u32; 3]], out: &mut Vec<Triangle>) {
        let positions = &self.model.positions;
        let position = |v: u32| positions.get(v as usize).copied().unwrap_or(Vec3::NAN);
        out.extend(triangles.iter().map(|&[a, b, c]| [position(a), position(b), position(c)]));
    }

    fn has_colours(&self) -> bool {
        !self.model.colours.is_empty()
    }

    fn look_up_colours(&self, triangles: &[[u32; 3]], out: &mut Vec<[Colour; 3]>) {
        let colours = &self.model.colours;
        if !colours.is_empty() {
            let colour = |v: u32| colours.get(v as usize).copied().unwrap_or(WHITE);
            out.extend(triangles.iter().map(|triangle| triangle.map(colour)));
        }
    }

    fn triangle_count(&self) -> Option<u64> {
        None
    }

    fn triangle_hint(&self) -> Option<u64> {
        None
    }

    fn frame(&self) -> Frame {
        self.model.frame
    }
}

/// The colour after a position: three fractions.
#[inline]
fn colour_of(rgb: [f32; 3]) -> Colour {
    let [r, g, b] = rgb.map(colour_byte);
    [r, g, b, 255]
}

/// The rest of a line that does not go on in the next one.
#[inline]
fn plain_rest(text: &mut Plain<'_>) -> Option<()> {
    let rest = text.rest_of_line()?;
    (rest.last() != Some(&b'\\')).then_some(())
}

/// The whole mesh.
pub(crate) fn read_mesh<R: Read>(
    input: Input<R>,
    framing: Framing,
) -> Result<(IndexedMesh, Frame), Error> {
    let mut reader = ObjReader::new(input, framing)?;
    let mut triangles = Vec::new();
    while reader.read_indices(&mut triangles, 1 << 16)? > 0 {}
    let Model { positions, colours, frame, .. } = reader.model;
    Ok((IndexedMesh { positions, triangles, colours }, frame))
}
