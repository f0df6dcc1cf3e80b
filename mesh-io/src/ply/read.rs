//! Reading PLY: vertices first into memory (or mapped), then faces as they come.

use std::fs::File;
use std::io::Read;

use super::ascii::{ascii_list, ascii_vertices, row_fault, row_line, take_plain_triangles};
use super::header::{Coding, Element, Header, Kind, Property, Role};
use super::positions::{Layout, MappedPositions, Positions, Vertices};
use super::rows::{
    MissingRows, Strip, TriangleRow, binary_vertices, list_length, ragged_vertices, skip_properties,
};
use crate::codec::indexed::IndexedReader;
use crate::codec::input::Input;
use crate::codec::polygon::triangulate;
use crate::codec::text::Tokens;
use crate::frame::Framing;
use crate::{Colour, Error, Frame, IndexedMesh, Place, Triangle};

/// Opens the same stream once more from its start.
pub(crate) type Reopen<R> = Box<dyn FnOnce() -> Result<Input<R>, Error> + Send>;

/// What can be done with a stream besides reading it once.
pub(crate) struct Origin<R> {
    /// For files with the faces before the vertices: a second pass instead of faces in memory.
    pub(crate) reopen: Option<Reopen<R>>,
    /// The plain file, whose vertices can be read where they lie.
    pub(crate) file: Option<File>,
}

impl<R> Default for Origin<R> {
    fn default() -> Self {
        Self { reopen: None, file: None }
    }
}

/// Faces that came before the vertices: corners, and how many of them make a face each.
#[derive(Default)]
struct Stash {
    lengths: Vec<u32>,
    corners: Vec<i64>,
    strips: Vec<i64>,
}

/// Streams the faces of a PLY file.
pub(crate) struct PlyReader<R> {
    input: Input<R>,
    header: Header,
    /// The element we are in, and how many of its rows are done.
    at: usize,
    row: u64,
    positions: Positions,
    frame: Frame,
    stash: Stash,
    corners: Vec<i64>,
    polygon: Vec<u32>,
    strip: Strip,
    exact_count: Option<u64>,
}

impl<R: Read> PlyReader<R> {
    /// Reads up to and including the vertices.
    pub(crate) fn new(
        mut input: Input<R>,
        origin: Origin<R>,
        framing: Framing,
    ) -> Result<Self, Error> {
        let header = Header::read(&mut input)?;
        check_size(&input, &header)?;
        let mut reader = Self {
            input,
            header,
            at: 0,
            row: 0,
            positions: Positions::Memory(Vertices::default()),
            frame: Frame::default(),
            stash: Stash::default(),
            corners: Vec::new(),
            polygon: Vec::new(),
            strip: Strip::default(),
            exact_count: None,
        };
        reader.reach_faces(origin, framing)?;
        Ok(reader)
    }

    fn reach_faces(&mut self, origin: Origin<R>, framing: Framing) -> Result<(), Error> {
        let is_vertices = |element: &Element| matches!(element.role, Role::Vertices(_));
        let Some(vertices) = self.header.elements.iter().position(is_vertices) else {
            return Ok(());
        };
        let is_face = |e: &Element| matches!(e.role, Role::Faces(_) | Role::Strips(_));
        let faces_first = self.header.elements[..vertices].iter().any(is_face);
        let two_passes = faces_first && origin.reopen.is_some();
        while self.at < vertices {
            match self.header.elements[self.at].role {
                Role::Faces(_) | Role::Strips(_) if !two_passes => self.stash_element()?,
                _ => self.skip_element()?,
            }
        }
        self.load_vertices(origin.file, framing)?;
        if let Some(reopen) = origin.reopen
            && two_passes
        {
            self.input = reopen()?;
            let again = Header::read(&mut self.input)?;
            if again != self.header {
                return Err(self.input.malformed(
                    Place::File,
                    "the header changed between two readings".to_owned(),
                    "wait until nothing writes to the file any more",
                ));
            }
            self.at = 0;
        }
        self.exact_count = self.count_from_size();
        Ok(())
    }

    /// If faces are all that follows and the bytes left are those of as many triangles, then (unless faces of one corner
    /// or none make up for larger ones) there are that many triangles.
    fn count_from_size(&self) -> Option<u64> {
        let mut rest = self.header.elements[self.at..].iter().filter(|e| e.count > 0);
        let (Some(element), None) = (rest.next(), rest.next()) else { return None };
        let (Role::Faces(place), false) = (element.role, self.header.coding == Coding::Ascii)
        else {
            return None;
        };
        let mut row = 0;
        for (index, property) in element.properties.iter().enumerate() {
            row += match property.kind {
                Kind::One(scalar) => scalar.size(),
                Kind::List { length, item } if index == place => length.size() + 3 * item.size(),
                Kind::List { .. } => return None,
            } as u64;
        }
        let expected = element.count.checked_mul(row)?;
        (self.input.remaining()? == expected).then_some(element.count)
    }

    fn element(&self) -> Option<&Element> {
        self.header.elements.get(self.at)
    }

    fn big(&self) -> bool {
        self.header.coding == Coding::Big
    }

    fn next_element(&mut self) {
        self.at += 1;
        self.row = 0;
    }

    fn skip_element(&mut self) -> Result<(), Error> {
        let Some(element) = self.header.elements.get(self.at) else { return Ok(()) };
        let missing = MissingRows(element);
        let big = self.header.coding == Coding::Big;
        match (self.header.coding, element.stride()) {
            // Rows of nothing are not there, however many there are said to be.
            (Coding::Ascii, _) if element.properties.is_empty() => {}
            (Coding::Ascii, _) => {
                for _ in self.row..element.count {
                    row_line(&mut self.input, missing)?;
                }
            }
            (_, Some(stride)) => {
                let bytes = (element.count - self.row).saturating_mul(stride as u64);
                self.input.skip(bytes, missing)?;
            }
            (_, None) => {
                for _ in self.row..element.count {
                    skip_properties(&mut self.input, &element.properties, big, missing)?;
                }
            }
        }
        self.next_element();
        Ok(())
    }

    fn load_vertices(&mut self, file: Option<File>, framing: Framing) -> Result<(), Error> {
        let Some(element) = self.header.elements.get(self.at) else { return Ok(()) };
        let Role::Vertices(places) = element.role else { return Ok(()) };
        if element.count > u64::from(u32::MAX) {
            return Err(Error::TooLarge {
                name: self.input.name().to_owned(),
                what: "vertices",
                limit: u64::from(u32::MAX),
            });
        }
        let big = self.big();
        let layout = Layout::new(element, places, big).filter(|layout| layout.stride > 0);
        let (positions, frame) = match (self.header.coding, layout) {
            (Coding::Ascii, _) => ascii_vertices(&mut self.input, element, places, framing)?,
            (_, Some(layout)) => {
                let start = self.input.offset();
                let mapped = match &file {
                    Some(file) => MappedPositions::new(file, start, element.count, layout, framing)
                        .map_err(|error| Error::io(self.input.name(), "map", error))?,
                    None => None,
                };
                if let Some(mapped) = mapped {
                    self.frame = mapped.frame;
                    self.positions = Positions::Mapped(mapped);
                    return self.skip_element();
                }
                binary_vertices(&mut self.input, element, layout, framing)?
            }
            (_, None) => ragged_vertices(&mut self.input, element, places, big, framing)?,
        };
        self.positions = Positions::Memory(positions);
        self.frame = frame;
        self.next_element();
        Ok(())
    }

    /// Keeps the rows of a face element for later.
    fn stash_element(&mut self) -> Result<(), Error> {
        while self.element().is_some_and(|element| self.row < element.count) {
            self.read_row()?;
            match self.element().map(|element| element.role) {
                Some(Role::Strips(_)) => {
                    self.stash.strips.append(&mut self.corners);
                    self.stash.strips.push(-1);
                }
                _ => {
                    // The list is in memory already, so its length fits by far unless memory has 64 GiB for it.
                    self.stash.lengths.push(u32::try_from(self.corners.len()).unwrap_or(u32::MAX));
                    self.stash.corners.append(&mut self.corners);
                }
            }
        }
        self.next_element();
        Ok(())
    }

    /// Turns faces kept for later into triangles, all at once.
    fn unstash(&mut self, out: &mut Vec<[u32; 3]>) -> Result<(), Error> {
        let stash = std::mem::take(&mut self.stash);
        let mut rest = stash.corners.as_slice();
        for &length in &stash.lengths {
            let (face, tail) = rest.split_at(rest.len().min(length as usize));
            rest = tail;
            self.corners.clear();
            self.corners.extend_from_slice(face);
            self.emit_polygon(out, Place::File)?;
        }
        for corner in stash.strips {
            self.push_strip(corner, out, Place::File)?;
        }
        self.strip = Strip::default();
        Ok(())
    }

    /// Where the row that was just read is.
    fn place(&self) -> Place {
        match self.header.coding {
            Coding::Ascii => Place::Line(self.input.line()),
            _ => Place::Byte(self.input.offset()),
        }
    }

    /// Reads one row of faces or strips; its corners are in `self.corners` then.
    fn read_row(&mut self) -> Result<(), Error> {
        let Some(element) = self.header.elements.get(self.at) else { return Ok(()) };
        let (Role::Faces(list) | Role::Strips(list)) = element.role else { return Ok(()) };
        self.corners.clear();
        let missing = MissingRows(element);
        if self.header.coding == Coding::Ascii {
            let line = row_line(&mut self.input, MissingRows(element))?;
            let mut tokens = Tokens::new(self.input.text(line));
            ascii_list(&mut tokens, &element.properties, list, &mut self.corners)
                .map_err(|fault| row_fault(&self.input, fault, element))?;
        } else {
            let big = self.header.coding == Coding::Big;
            let (before, rest) = element.properties.split_at(list.min(element.properties.len()));
            skip_properties(&mut self.input, before, big, missing)?;
            if let [Property { kind: Kind::List { length, item }, .. }, after @ ..] = rest {
                let count = list_length(&mut self.input, *length, big, missing)?;
                for _ in 0..count {
                    if self.input.fill(item.size())? < item.size() {
                        return Err(self.input.truncated(missing));
                    }
                    self.corners.push(item.integer(self.input.window(), big));
                    self.input.consume(item.size());
                }
                skip_properties(&mut self.input, after, big, missing)?;
            }
        }
        self.row += 1;
        Ok(())
    }

    /// Reads rows that are all plain triangles straight from the window; stops at the first that is not.
    fn read_plain_triangles(&mut self, out: &mut Vec<[u32; 3]>, max: usize) -> Result<(), Error> {
        let Some(element) = self.header.elements.get(self.at) else { return Ok(()) };
        let Role::Faces(list) = element.role else { return Ok(()) };
        let count = self.positions.len();
        let most = usize::try_from(element.count - self.row).unwrap_or(usize::MAX).min(max);
        let done = match self.header.coding {
            Coding::Ascii if list == 0 => take_plain_triangles(&mut self.input, count, most, out),
            Coding::Ascii => 0,
            _ => {
                let big = self.header.coding == Coding::Big;
                let Some(shape) = TriangleRow::new(element, list, big) else { return Ok(()) };
                self.input.fill(shape.bytes)?;
                let rows = self.input.window().chunks_exact(shape.bytes);
                let fits = rows.len().min(most) * shape.bytes;
                let rows = self.input.window()[..fits].chunks_exact(shape.bytes);
                let done = shape.take(rows, count, out);
                self.input.consume(done * shape.bytes);
                done
            }
        };
        self.row += done as u64;
        Ok(())
    }

    fn check(&self, corner: i64, place: Place) -> Result<u32, Error> {
        let count = self.positions.len();
        match u32::try_from(corner) {
            Ok(vertex) if u64::from(vertex) < count => Ok(vertex),
            _ => Err(self.input.out_of_range(place, corner, count)),
        }
    }

    /// Triangles of the polygon in `self.corners`.
    fn emit_polygon(&mut self, out: &mut Vec<[u32; 3]>, place: Place) -> Result<(), Error> {
        let mut polygon = std::mem::take(&mut self.polygon);
        polygon.clear();
        for &corner in &self.corners {
            polygon.push(self.check(corner, place)?);
        }
        triangulate(&polygon, |v| self.positions.get(v), out);
        self.polygon = polygon;
        Ok(())
    }

    fn push_strip(
        &mut self,
        corner: i64,
        out: &mut Vec<[u32; 3]>,
        place: Place,
    ) -> Result<(), Error> {
        if corner < 0 {
            self.strip = Strip::default();
        } else {
            let vertex = self.check(corner, place)?;
            out.extend(self.strip.push(vertex));
        }
        Ok(())
    }

    fn emit_strip(&mut self, out: &mut Vec<[u32; 3]>, place: Place) -> Result<(), Error> {
        self.strip = Strip::default();
        for at in 0..self.corners.len() {
            self.push_strip(self.corners[at], out, place)?;
        }
        Ok(())
    }
}

impl<R: Read> IndexedReader for PlyReader<R> {
    fn read_indices(&mut self, out: &mut Vec<[u32; 3]>, max: usize) -> Result<usize, Error> {
        let before = out.len();
        if !self.stash.lengths.is_empty() || !self.stash.strips.is_empty() {
            self.unstash(out)?;
        }
        while out.len() - before < max {
            let Some(element) = self.element() else {
                self.input.drain()?;
                break;
            };
            if self.row == element.count {
                self.next_element();
                continue;
            }
            match element.role {
                Role::Faces(_) => {
                    let row = self.row;
                    self.read_plain_triangles(out, max - (out.len() - before))?;
                    if self.row == row {
                        let start = self.place();
                        self.read_row()?;
                        let place = if let Place::Byte(_) = start { start } else { self.place() };
                        self.emit_polygon(out, place)?;
                    }
                }
                Role::Strips(_) => {
                    self.read_row()?;
                    let place = self.place();
                    self.emit_strip(out, place)?;
                }
                Role::Vertices(_) | Role::Other => self.skip_element()?,
            }
        }
        Ok(out.len() - before)
    }

    fn look_up(&self, triangles: &[[u32; 3]], out: &mut Vec<Triangle>) {
        self.positions.look_up(triangles, out);
    }

    fn has_colours(&self) -> bool {
        self.positions.has_colours()
    }

    fn look_up_colours(&self, triangles: &[[u32; 3]], out: &mut Vec<[Colour; 3]>) {
        self.positions.look_up_colours(triangles, out);
    }

    fn triangle_count(&self) -> Option<u64> {
        self.exact_count
    }

    fn triangle_hint(&self) -> Option<u64> {
        let is_face = |e: &&Element| matches!(e.role, Role::Faces(_));
        let faces = self.header.elements.iter().filter(is_face).map(|e| e.count);
        Some(faces.fold(0, u64::saturating_add)).filter(|&count| count > 0)
    }

    fn frame(&self) -> Frame {
        self.frame
    }

    fn relax(&mut self) {
        if let Positions::Mapped(mapped) = &self.positions {
            mapped.relax();
        }
    }
}

/// The whole mesh.
pub(crate) fn read_mesh<R: Read>(
    input: Input<R>,
    framing: Framing,
) -> Result<(IndexedMesh, Frame), Error> {
    let mut reader = PlyReader::new(input, Origin::default(), framing)?;
    let count = reader.triangle_hint().unwrap_or(0);
    let item = if reader.header.coding == Coding::Ascii { 8 } else { 4 };
    let mut triangles = Vec::with_capacity(reader.input.plausible(count, item));
    while reader.read_indices(&mut triangles, 1 << 16)? > 0 {}
    let Vertices { positions, colours } = match reader.positions {
        Positions::Memory(vertices) => vertices,
        Positions::Mapped(_) => Vertices::default(),
    };
    Ok((IndexedMesh { positions, triangles, colours }, reader.frame))
}

/// A file too short for its own header is refused before anything is read from it.
fn check_size<R: Read>(input: &Input<R>, header: &Header) -> Result<(), Error> {
    let Some(mut left) = input.remaining() else { return Ok(()) };
    // The last row may lack its line end.
    left += u64::from(header.coding == Coding::Ascii);
    for element in &header.elements {
        let bytes = element.count.saturating_mul(element.min_row_bytes(header.coding));
        if bytes > left {
            return Err(Error::Truncated {
                name: input.name().to_owned(),
                place: Place::Byte(input.length().unwrap_or(0)),
                missing: MissingRows(element).to_string(),
            });
        }
        left -= bytes;
    }
    Ok(())
}
