//! `.xfm` files taken apart and put together again, with every offset, length and checksum right: so that what a reader
//! believes below its checksums can be changed. See `xfm-format/FORMAT.md`.

use crate::mutate::{self, MAX_LEN};
use crate::random::Random;

/// Where the offsets of sections stand in the header.
const BASE: usize = 120;
const ROOTS: usize = 144;
const PAGES: usize = 168;
const INDEX: usize = 192;
const FILE_LEN: usize = 216;
const ENTRY: usize = 32;
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// The parts of a file.
#[derive(Clone, Debug)]
pub struct Parts {
    header: Vec<u8>,
    base: Vec<u8>,
    roots: Vec<u8>,
    pages: Vec<PagePart>,
}

#[derive(Clone, Debug)]
struct PagePart {
    bytes: Vec<u8>,
    blocks: u32,
    nodes: u32,
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|&field| u32::from_le_bytes(field))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().map(|&field| u64::from_le_bytes(field))
}

fn put(bytes: &mut [u8], at: usize, field: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + field.len()) {
        place.copy_from_slice(field);
    }
}

fn crc(parts: &[&[u8]]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    parts.iter().for_each(|part| hasher.update(part));
    hasher.finalize()
}

impl Parts {
    /// Takes a file apart, as far as it has parts.
    pub fn of(file: &[u8]) -> Option<Self> {
        let header_len = u32_at(file, 12)? as usize;
        let header = file.get(..header_len.max(FILE_LEN + 8))?.to_vec();
        let section = |at: usize| {
            let start = usize::try_from(u64_at(file, at)?).ok()?;
            let length = usize::try_from(u64_at(file, at + 8)?).ok()?;
            file.get(start..start.checked_add(length)?)
        };
        let page = |entry: &[u8]| {
            let start = usize::try_from(u64_at(entry, 8)?).ok()?;
            let length = u32_at(entry, 16)? as usize;
            Some(PagePart {
                bytes: file.get(start..start.checked_add(length)?)?.to_vec(),
                blocks: u32_at(entry, 20)?,
                nodes: u32_at(entry, 24)?,
            })
        };
        Some(Self {
            header,
            base: section(BASE)?.to_vec(),
            roots: section(ROOTS)?.to_vec(),
            pages: section(INDEX)?.chunks_exact(ENTRY).map(page).collect::<Option<_>>()?,
        })
    }

    /// Puts the file together, with offsets, lengths and checksums as they must be; counts stay what they are.
    pub fn join(&self) -> Vec<u8> {
        let mut file = self.header.clone();
        let mut index = Vec::new();
        let mut first_block = 0u64;
        let sections = [(BASE, b"B", &self.base), (ROOTS, b"R", &self.roots)];
        for (field, tag, section) in sections {
            let place = Place { at: file.len(), length: section.len(), crc: crc(&[tag, section]) };
            place.put(&mut file, field);
            file.extend_from_slice(section);
        }
        let pages_start = file.len();
        for (number, page) in (0u64..).zip(&self.pages) {
            index.extend(first_block.to_le_bytes());
            index.extend((file.len() as u64).to_le_bytes());
            for field in [
                page.bytes.len() as u32,
                page.blocks,
                page.nodes,
                crc(&[b"P", &number.to_le_bytes(), &page.bytes]),
            ] {
                index.extend(field.to_le_bytes());
            }
            first_block = first_block.wrapping_add(page.blocks.into());
            file.extend_from_slice(&page.bytes);
        }
        let length = file.len() - pages_start;
        Place { at: pages_start, length, crc: 0 }.put(&mut file, PAGES);
        let place = Place { at: file.len(), length: index.len(), crc: crc(&[b"I", &index]) };
        place.put(&mut file, INDEX);
        file.extend(index);
        let length = file.len() as u64;
        put(&mut file, FILE_LEN, &length.to_le_bytes());
        seal_header(&mut file);
        file
    }

    /// Unpacks columns as far as they are packed, so that a change of a byte is one of a value.
    pub fn unpack(&mut self) {
        unpack_columns(&mut self.base);
        unpack_columns(&mut self.roots);
        if self.header.get(24) == Some(&0) {
            self.pages.iter_mut().for_each(|page| unpack_columns(&mut page.bytes));
        }
    }

    fn mutate(&mut self, random: &mut Random, other: &[u8]) {
        let pages = self.pages.len();
        let counted = self.header.len().min(FILE_LEN) - 24;
        match random.below(16) {
            0 => mutate::bytes(random, &mut self.base, other),
            1 => mutate::bytes(random, &mut self.roots, other),
            2 => {
                // A count or a bound.
                let mut fields = self.header[24..24 + counted].to_vec();
                mutate::bytes(random, &mut fields, other);
                fields.resize(counted, 0);
                self.header.splice(24..24 + counted, fields);
            }
            3 if pages > 1 => self.pages.swap(random.below(pages), random.below(pages)),
            4 if pages > 0 => {
                let copied = self.pages[random.below(pages)].clone();
                self.pages[random.below(pages)] = copied;
            }
            5 if pages > 0 => {
                let page = &mut self.pages[random.below(pages)];
                let by = random.below(5) as u32;
                let count = if random.one_in(2) { &mut page.blocks } else { &mut page.nodes };
                *count = count.wrapping_add(by).wrapping_sub(2);
            }
            _ if pages > 0 => {
                let page = &mut self.pages[random.below(pages)];
                mutate::bytes(random, &mut page.bytes, other);
            }
            _ => mutate::bytes(random, &mut self.base, other),
        }
    }
}

struct Place {
    at: usize,
    length: usize,
    crc: u32,
}

impl Place {
    fn put(&self, header: &mut [u8], field: usize) {
        put(header, field, &(self.at as u64).to_le_bytes());
        put(header, field + 8, &(self.length as u64).to_le_bytes());
        put(header, field + 16, &self.crc.to_le_bytes());
    }
}

/// Makes the checksum of the header right.
fn seal_header(file: &mut [u8]) {
    let Some(end) = u32_at(file, 12).and_then(|len| (len as usize).checked_sub(4)) else { return };
    if let Some(covered) = file.get(..end) {
        let sum = crc(&[covered]);
        put(file, end, &sum.to_le_bytes());
    }
}

/// Writes packed planes as plain ones. Plain ones are passed over by the length that planes were found to have; where there is
/// none yet, or it is another, the rest stays what it is.
fn unpack_columns(bytes: &mut Vec<u8>) {
    let mut out = Vec::new();
    let mut rest = &bytes[..];
    let mut length = None;
    // A failure leaves `rest` where the column that failed begins.
    while let Some((column, after)) = unpack_column(rest, &mut length) {
        out.extend(column);
        rest = after;
    }
    out.extend_from_slice(rest);
    *bytes = out;
}

fn unpack_column<'a>(bytes: &'a [u8], length: &mut Option<usize>) -> Option<(Vec<u8>, &'a [u8])> {
    let (&width, mut rest) = bytes.split_first()?;
    let mut out = vec![width];
    for _ in 0..width {
        let (&method, after) = rest.split_first()?;
        rest = after;
        match method {
            0 => {
                out.extend([0, *rest.first()?]);
                rest = &rest[1..];
            }
            1 => {
                let plane = rest.get(..(*length)?)?;
                out.push(1);
                out.extend_from_slice(plane);
                rest = &rest[plane.len()..];
            }
            2 => {
                let (mut size, mut shift) = (0usize, 0);
                loop {
                    let (&byte, after) = rest.split_first()?;
                    rest = after;
                    size |= usize::from(byte & 0x7f) << shift;
                    shift += 7;
                    if byte < 0x80 || shift > 28 {
                        break;
                    }
                }
                let frame = [&ZSTD_MAGIC, rest.get(..size)?].concat();
                let plane = zstd::bulk::decompress(&frame, MAX_LEN).ok()?;
                *length = Some(plane.len());
                out.push(1);
                out.extend(plane);
                rest = &rest[size..];
            }
            _ => return None,
        }
    }
    Some((out, rest))
}

/// Changes a file, mostly below its checksums.
pub fn mutate(random: &mut Random, file: &mut Vec<u8>, other: &[u8]) {
    let Some(mut parts) = Parts::of(file).filter(|_| !random.one_in(12)) else {
        mutate::bytes(random, file, other);
        if random.one_in(2) {
            seal_header(file);
        }
        return;
    };
    if random.one_in(4) {
        parts.unpack();
    }
    for _ in 0..1 << random.below(3) {
        parts.mutate(random, other);
    }
    *file = parts.join();
    file.truncate(MAX_LEN);
}
