//! The parts of a file besides its pages: coarsest mesh, root list, page index.

use std::io;

use glam::Vec3;
use mergetree::{BaseMesh, BaseVertex, Colour, OctNormal};

use crate::codec::{colour_difference, colour_from_difference};

use crate::column::{
    ColumnDecoder, ColumnEncoder, Cursor, float_difference, float_from_difference,
    short_difference, short_from_difference, unzigzag, zigzag,
};
use crate::error::{Defect, Place};
use crate::header::{Header, INDEX_ENTRY_LEN, MAX_EXPANSION, MoreAttribute, check_expansion};
use crate::numbering::{BlockId, Numbering};

/// First byte of what the checksum of each part covers, so that one cannot stand in for another.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Tag {
    Base,
    Roots,
    Index,
    Page(u64),
}

impl Tag {
    /// CRC-32 (IEEE) over the tag, for a page also its number, and the bytes.
    pub fn checksum(self, bytes: &[u8]) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        match self {
            Self::Base => hasher.update(b"B"),
            Self::Roots => hasher.update(b"R"),
            Self::Index => hasher.update(b"I"),
            Self::Page(number) => {
                hasher.update(b"P");
                hasher.update(&number.to_le_bytes());
            }
        }
        hasher.update(bytes);
        hasher.finalize()
    }
}

/// One entry of the page index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IndexEntry {
    pub first_block: u64,
    pub offset: u64,
    pub length: u32,
    pub blocks: u32,
    pub nodes: u32,
    pub crc: u32,
}

pub(crate) fn encode_index(entries: &[IndexEntry]) -> Vec<u8> {
    let mut out = Vec::with_capacity(entries.len() * INDEX_ENTRY_LEN as usize);
    for entry in entries {
        out.extend(entry.first_block.to_le_bytes());
        out.extend(entry.offset.to_le_bytes());
        for field in [entry.length, entry.blocks, entry.nodes, entry.crc] {
            out.extend(field.to_le_bytes());
        }
    }
    out
}

/// Reads the page index and checks that pages follow each other without gap and hold what the header counts.
pub(crate) fn decode_index(bytes: &[u8], header: &Header) -> Result<Vec<IndexEntry>, Defect> {
    let defect = |message: String| Defect::new(Place::Index, message);
    let mut entries = Vec::with_capacity(bytes.len() / INDEX_ENTRY_LEN as usize);
    let (mut block, mut offset, mut nodes) = (0u64, header.page_data.offset, 0u64);
    for chunk in bytes.chunks_exact(INDEX_ENTRY_LEN as usize) {
        let number = entries.len();
        let u64_at = |at| chunk[at..].first_chunk().map_or(0, |&bytes| u64::from_le_bytes(bytes));
        let u32_at = |at| chunk[at..].first_chunk().map_or(0, |&bytes| u32::from_le_bytes(bytes));
        let entry = IndexEntry {
            first_block: u64_at(0),
            offset: u64_at(8),
            length: u32_at(16),
            blocks: u32_at(20),
            nodes: u32_at(24),
            crc: u32_at(28),
        };
        if entry.first_block != block {
            return Err(defect(format!(
                "page {number} begins at block {}, not {block}",
                entry.first_block
            )));
        }
        if entry.offset != offset {
            return Err(defect(format!(
                "page {number} lies at byte {}, not {offset}",
                entry.offset
            )));
        }
        if entry.blocks == 0 || entry.nodes < entry.blocks {
            return Err(defect(format!(
                "page {number} has {} nodes in {} blocks",
                entry.nodes, entry.blocks
            )));
        }
        check_expansion(
            u64::from(entry.nodes) * header.node_bytes(),
            entry.length.into(),
            Place::Page(number as u64),
        )?;
        // None of these can overflow before it exceeds what the header says.
        block += u64::from(entry.blocks);
        offset += u64::from(entry.length);
        nodes += u64::from(entry.nodes);
        if block > header.blocks || nodes > header.nodes || offset > header.index.offset {
            return Err(defect(format!("page {number} ends beyond what the header counts")));
        }
        entries.push(entry);
    }
    if (block, nodes, offset) != (header.blocks, header.nodes, header.index.offset) {
        return Err(defect(format!(
            "the pages end at block {block}, node {nodes} and byte {offset}, not {}, {} and {}",
            header.blocks, header.nodes, header.index.offset
        )));
    }
    Ok(entries)
}

/// The coarsest mesh without its roots.
pub(crate) fn encode_base(base: &BaseMesh) -> io::Result<Vec<u8>> {
    let [vertices, faces, colours] = [base.vertices.len(), base.faces.len(), base.colours.len()];
    let memory = (24 * vertices + 12 * faces + 4 * colours) as u64;
    let mut columns = ColumnEncoder::new()?;
    let packed = encode_base_with(base, &mut columns);
    if memory <= packed.len() as u64 * MAX_EXPANSION {
        return Ok(packed);
    }
    columns.plain = true;
    Ok(encode_base_with(base, &mut columns))
}

fn encode_base_with(base: &BaseMesh, columns: &mut ColumnEncoder) -> Vec<u8> {
    let mut out = Vec::new();
    let mut values: Vec<u64> = Vec::with_capacity(base.vertices.len().max(base.faces.len()));
    for axis in 0..3 {
        let mut last = 0.0;
        values.clear();
        values.extend(base.vertices.iter().map(|vertex| {
            let coordinate = vertex.position[axis];
            float_difference(coordinate, std::mem::replace(&mut last, coordinate))
        }));
        columns.column(&mut out, &values);
    }
    for axis in 0..2 {
        let mut last = 0;
        values.clear();
        values.extend(base.vertices.iter().map(|vertex| {
            let coordinate = vertex.normal.0[axis];
            short_difference(coordinate, std::mem::replace(&mut last, coordinate))
        }));
        columns.column(&mut out, &values);
    }
    for corner in 0..3 {
        let mut last = 0;
        values.clear();
        values.extend(base.faces.iter().map(|face| {
            let from = if corner == 0 { std::mem::replace(&mut last, face[0]) } else { face[0] };
            zigzag(i64::from(face[corner]) - i64::from(from))
        }));
        columns.column(&mut out, &values);
    }
    if !base.colours.is_empty() {
        for component in 0..4 {
            let mut last = [0; 4];
            values.clear();
            values.extend(base.colours.iter().map(|&colour| {
                let difference = colour_difference(colour, std::mem::replace(&mut last, colour));
                zigzag(difference[component].into())
            }));
            columns.column(&mut out, &values);
        }
    }
    out
}

/// Reads the coarsest mesh without its roots. The header's counts have been checked against the length of `bytes`.
pub(crate) fn decode_base(bytes: &[u8], header: &Header) -> Result<BaseMesh, Defect> {
    let mut cursor = Cursor::new(bytes, Place::Base);
    let mut columns = ColumnDecoder::new().map_err(|why| cursor.defect(why.to_string()))?;
    let num_vertices = header.base_vertices as usize;
    let num_faces = header.base_faces as usize;
    let mut values = Vec::new();
    let blank = BaseVertex { position: Vec3::ZERO, normal: OctNormal([0, 0]), root: None };
    let mut base = BaseMesh {
        vertices: vec![blank; num_vertices],
        faces: vec![[0; 3]; num_faces],
        colours: Vec::new(),
    };
    for axis in 0..3 {
        columns.column(&mut cursor, "position", num_vertices, 4, &mut values)?;
        let mut last = 0.0;
        for (vertex, &value) in base.vertices.iter_mut().zip(&values) {
            last = float_from_difference(value, last);
            vertex.position[axis] = last;
        }
    }
    if !base.vertices.iter().all(|vertex| vertex.position.is_finite()) {
        return Err(cursor.defect("a position is not finite"));
    }
    for axis in 0..2 {
        columns.column(&mut cursor, "normal", num_vertices, 2, &mut values)?;
        let mut last = 0;
        for (vertex, &value) in base.vertices.iter_mut().zip(&values) {
            last = short_from_difference(value, last);
            vertex.normal.0[axis] = last;
        }
    }
    for corner in 0..3 {
        columns.column(&mut cursor, "face", num_faces, 8, &mut values)?;
        let mut last = 0u32;
        for (index, (face, &value)) in base.faces.iter_mut().zip(&values).enumerate() {
            let from = if corner == 0 { last } else { face[0] };
            let vertex = i64::from(from)
                .checked_add(unzigzag(value))
                .filter(|&vertex| vertex >= 0 && (vertex as u64) < header.base_vertices)
                .ok_or_else(|| {
                    cursor.defect(format!("face {index} names a vertex that is not there"))
                })?;
            face[corner] = vertex as u32;
            last = face[0];
        }
    }
    for attribute in header.more_attributes() {
        match attribute {
            MoreAttribute::Colour => {
                base.colours = decode_colours(&mut cursor, &mut columns, num_vertices)?;
            }
            MoreAttribute::Columns(components) | MoreAttribute::Symbols(components) => {
                for _ in 0..components {
                    ColumnDecoder::skip(&mut cursor, "unknown attribute", num_vertices)?;
                }
            }
        }
    }
    cursor.finish()?;
    Ok(base)
}

fn decode_colours(
    cursor: &mut Cursor<'_>,
    columns: &mut ColumnDecoder,
    count: usize,
) -> Result<Vec<Colour>, Defect> {
    let mut values = Vec::new();
    let mut differences = vec![[0; 4]; count];
    for component in 0..4 {
        columns.column(cursor, "colour", count, 1, &mut values)?;
        for (difference, &value) in differences.iter_mut().zip(&values) {
            difference[component] = unzigzag(value) as i8;
        }
    }
    let mut last = [0; 4];
    let colour = |difference| {
        last = colour_from_difference(difference, last);
        last
    };
    Ok(differences.into_iter().map(colour).collect())
}

/// The vertices with a tree and the blocks that the trees begin in.
pub(crate) fn encode_roots(base: &BaseMesh, numbering: Numbering) -> io::Result<Vec<u8>> {
    let roots: Vec<(u64, u64)> = (0..)
        .zip(&base.vertices)
        .filter_map(|(vertex, v)| Some((vertex, numbering.block(v.root?).get().into())))
        .collect();
    let mut columns = ColumnEncoder::new()?;
    let packed = encode_roots_with(&roots, &mut columns);
    if 8 * roots.len() as u64 <= packed.len() as u64 * MAX_EXPANSION {
        return Ok(packed);
    }
    columns.plain = true;
    Ok(encode_roots_with(&roots, &mut columns))
}

fn encode_roots_with(roots: &[(u64, u64)], columns: &mut ColumnEncoder) -> Vec<u8> {
    let mut out = Vec::new();
    let mut last = 0;
    let vertices: Vec<u64> =
        roots.iter().map(|&(vertex, _)| vertex - std::mem::replace(&mut last, vertex)).collect();
    columns.column(&mut out, &vertices);
    let mut last = 0;
    let blocks: Vec<u64> = roots
        .iter()
        .map(|&(_, block)| zigzag(block as i64 - std::mem::replace(&mut last, block as i64)))
        .collect();
    columns.column(&mut out, &blocks);
    out
}

/// Reads the root list into the vertices of the coarsest mesh.
pub(crate) fn decode_roots(
    bytes: &[u8],
    header: &Header,
    base: &mut BaseMesh,
) -> Result<(), Defect> {
    let mut cursor = Cursor::new(bytes, Place::Roots);
    let mut columns = ColumnDecoder::new().map_err(|why| cursor.defect(why.to_string()))?;
    let (mut vertices, mut blocks) = (Vec::new(), Vec::new());
    columns.column(&mut cursor, "vertex", header.roots as usize, 8, &mut vertices)?;
    columns.column(&mut cursor, "block", header.roots as usize, 8, &mut blocks)?;
    let (mut vertex, mut block) = (0u64, 0i64);
    for (&step, &code) in vertices.iter().zip(&blocks) {
        vertex = vertex
            .checked_add(step)
            .filter(|&vertex| vertex < header.base_vertices)
            .ok_or_else(|| cursor.defect("names a vertex that is not there"))?;
        block = block
            .checked_add(unzigzag(code))
            .filter(|&block| block >= 0 && (block as u64) < header.blocks)
            .ok_or_else(|| cursor.defect("names a block that is not there"))?;
        let root = &mut base.vertices[vertex as usize].root;
        if root.is_some() {
            return Err(cursor.defect(format!("vertex {vertex} has two trees")));
        }
        *root = Some(header.numbering().node(BlockId::new(block as u32), 0));
    }
    cursor.finish()
}
