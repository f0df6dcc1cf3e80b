//! Files that are cut, flipped, forged: always an error that says what, never a panic, never much memory.

mod common;

use std::io;

use common::{Random, collapse, coloured, sheet, torus};
use mergetree::Forest;
use proptest::prelude::*;
use xfm_format::{Encoding, Error, Place, Storage, WriteOptions, XfmFile, verify, write};

const ENCODINGS: [Encoding; 2] = [Encoding::Exact, Encoding::Compact];

fn bytes_of(forest: &Forest, levels: u32) -> Vec<u8> {
    encoded(forest, levels, Encoding::Exact)
}

fn encoded(forest: &Forest, levels: u32, encoding: Encoding) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.xfm");
    let mut options = WriteOptions::default();
    options.levels = levels;
    options.page_nodes = Some(64);
    options.encoding = encoding;
    write(forest, &path, &options).unwrap();
    std::fs::read(path).unwrap()
}

fn open(bytes: &[u8]) -> Result<XfmFile, Error> {
    XfmFile::from_storage(Box::new(bytes.to_vec()), "x.xfm")
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn set_u32(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Where the sections' offsets stand in the header.
const BASE: usize = 120;
const ROOTS: usize = 144;
const PAGES: usize = 168;
const INDEX: usize = 192;

fn section(bytes: &[u8], field: usize) -> std::ops::Range<usize> {
    let start = u64_at(bytes, field) as usize;
    start..start + u64_at(bytes, field + 8) as usize
}

/// Makes all checksums right again, as a forger would.
fn forge(bytes: &mut [u8]) {
    let header_len = u32_at(bytes, 12) as usize;
    let crc = |parts: &[&[u8]]| crc32fast::hash(&parts.concat());
    let index = section(bytes, INDEX);
    for (number, entry) in index.clone().step_by(32).enumerate() {
        let start = u64_at(bytes, entry + 8) as usize;
        let end = start + u32_at(bytes, entry + 16) as usize;
        if let Some(page) = bytes.get(start..end) {
            let sum = crc(&[b"P", &(number as u64).to_le_bytes(), page]);
            set_u32(bytes, entry + 28, sum);
        }
    }
    for (field, tag) in [(BASE, b"B"), (ROOTS, b"R"), (INDEX, b"I")] {
        let sum = crc(&[tag, &bytes[section(bytes, field)]]);
        set_u32(bytes, field + 16, sum);
    }
    forge_header(bytes, header_len);
}

fn forge_header(bytes: &mut [u8], header_len: usize) {
    let sum = crc32fast::hash(&bytes[..header_len - 4]);
    set_u32(bytes, header_len - 4, sum);
}

#[test]
fn every_truncation_is_found() {
    for encoding in ENCODINGS {
        let bytes = encoded(&coloured(collapse(&sheet(8), 400, 1)), 3, encoding);
        for end in 0..bytes.len() {
            let error = open(&bytes[..end]).unwrap_err();
            assert!(matches!(error, Error::Truncated { .. }), "{end}: {error}");
            assert!(error.to_string().starts_with("x.xfm: "));
        }
    }
}

#[test]
fn a_byte_too_many_is_found() {
    let mut bytes = bytes_of(&collapse(&sheet(4), 100, 1), 3);
    bytes.push(0);
    let error = open(&bytes).unwrap_err();
    assert!(matches!(error, Error::TrailingBytes { .. }), "{error}");
}

#[test]
fn every_flipped_bit_is_found() {
    let forest = collapse(&sheet(7), 300, 5);
    for forest in [coloured(forest.clone()), forest] {
        ENCODINGS.into_iter().for_each(|encoding| flip_every_bit(&forest, encoding));
    }
}

fn flip_every_bit(forest: &Forest, encoding: Encoding) {
    let bytes = encoded(forest, 2, encoding);
    assert!(bytes.len() < 6000, "{} bytes would take long", bytes.len());
    assert!(verify(&open(&bytes).unwrap(), |_| {}).is_ok());
    let index = section(&bytes, INDEX);
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        let Ok(file) = open(&flipped) else { continue };
        let errors = verify(&file, |_| {}).errors;
        let pages = section(&bytes, PAGES);
        assert!(pages.contains(&(bit / 8)), "bit {bit} is not covered: {errors:?}");
        let page = index
            .clone()
            .step_by(32)
            .rposition(|entry| u64_at(&bytes, entry + 8) as usize <= bit / 8)
            .unwrap();
        assert_eq!(errors.len(), 1, "bit {bit}: {errors:?}");
        assert_eq!(errors[0].place, Place::Page(page as u64), "bit {bit}");
    }
}

#[test]
fn pages_that_change_places_are_found() {
    let forest = collapse(&torus(20), 3000, 5);
    let bytes = bytes_of(&forest, 2);
    let index = section(&bytes, INDEX);
    let page = |number: usize| {
        let entry = index.start + 32 * number;
        let start = u64_at(&bytes, entry + 8) as usize;
        start..start + u32_at(&bytes, entry + 16) as usize
    };
    // Page 1 in place of page 0: same bytes and checksum, lengths adjusted by exchanging all of their entries but places.
    let mut swapped = bytes.clone();
    let (first, second) = (page(0), page(1));
    let both = [&bytes[second.clone()], &bytes[first.clone()]].concat();
    swapped[first.start..second.end].copy_from_slice(&both);
    let (a, b) = (index.start, index.start + 32);
    for at in 16..32 {
        swapped.swap(a + at, b + at);
    }
    let blocks = u64::from(u32_at(&swapped, a + 20));
    swapped[b..b + 8].copy_from_slice(&blocks.to_le_bytes());
    let offset = first.start as u64 + second.len() as u64;
    swapped[b + 8..b + 16].copy_from_slice(&offset.to_le_bytes());
    let sum = crc32fast::hash(&[b"I", &swapped[index.clone()]].concat());
    set_u32(&mut swapped, INDEX + 16, sum);
    let header_len = u32_at(&swapped, 12) as usize;
    forge_header(&mut swapped, header_len);
    let file = open(&swapped).unwrap();
    for number in [0, 1] {
        let error = file.read_page(number).unwrap_err();
        assert!(matches!(error, Error::Checksum { .. }), "{error}");
    }
}

/// Sets a field of the header, with the checksum made right, and says what the reader says.
fn with_header(change: impl FnOnce(&mut Vec<u8>)) -> Error {
    let mut bytes = bytes_of(&collapse(&sheet(6), 200, 2), 4);
    let header_len = u32_at(&bytes, 12) as usize;
    change(&mut bytes);
    forge_header(&mut bytes, header_len);
    open(&bytes).unwrap_err()
}

#[test]
fn fields_of_the_header_are_refused_by_name() {
    let error = with_header(|bytes| bytes[0] = b'x');
    assert!(matches!(error, Error::NotXfm { .. }), "{error}");
    let error = with_header(|bytes| bytes[8] = 1);
    assert!(matches!(error, Error::UnsupportedVersion { found: 1, supported: 2, .. }), "{error}");
    let error = with_header(|bytes| bytes[16] = 4);
    assert!(matches!(error, Error::UnsupportedFeatures { flags: 4, .. }), "{error}");
    let error = with_header(|bytes| bytes[24] = 9);
    assert!(matches!(error, Error::UnsupportedEncoding { found: 9, .. }), "{error}");
    let error = with_header(|bytes| bytes[31] = 1);
    assert!(error.to_string().contains("reserved"), "{error}");
    let error = with_header(|bytes| bytes[12] = 1);
    assert!(error.to_string().contains("a length of"), "{error}");
    for (at, message) in [
        (25, "levels per block"),
        (26, "attributes in"),
        (32 + 1, "input triangles"),
        (40 + 1, "nodes in"),
        (48 + 1, "nodes in"),
        (56, "pages in an index"),
        (72 + 4, "claim to hold"),
        (64 + 4, "claim to hold"),
        (80 + 1, "roots for"),
        (88 + 1, "a depth of"),
        (96 + 3, "bounding box"),
        (BASE, "coarsest mesh at byte"),
        (BASE + 8, "root list at byte"),
        (BASE + 20, "reserved"),
        (ROOTS, "root list at byte"),
        (ROOTS + 8, "pages at byte"),
        (PAGES, "pages at byte"),
        (PAGES + 8, "page index at byte"),
        (PAGES + 16, "checksum of all pages"),
        (INDEX, "page index at byte"),
        (INDEX + 8, "bytes of file"),
        (216, "bytes of file"),
        (248, "a precision of number"),
        (249, "reserved"),
        (255, "reserved"),
        (256, "attributes do not begin"),
        (256 + 30, "a coding of number"),
        (256 + 31, "reserved"),
    ] {
        let error = with_header(|bytes| bytes[at] ^= 0x7f);
        assert!(
            matches!(&error, Error::Invalid { place: Place::Header, message: m, .. } if m.contains(message)),
            "byte {at}: {error}"
        );
    }
    for origin in [f64::NAN, f64::INFINITY] {
        let error = with_header(|bytes| bytes[232..240].copy_from_slice(&origin.to_le_bytes()));
        assert!(error.to_string().contains("an origin that is not finite"), "{error}");
    }
    for at in [BASE + 16, ROOTS + 16, INDEX + 16] {
        let error = with_header(|bytes| bytes[at] ^= 1);
        assert!(matches!(error, Error::Checksum { .. }), "byte {at}: {error}");
    }
}

#[test]
fn a_grid_that_cannot_be_is_refused() {
    let valid = encoded(&collapse(&sheet(6), 200, 2), 4, Encoding::Compact);
    let header_len = u32_at(&valid, 12) as usize;
    let grid = header_len - 4 - 32;
    let numbers = [0.0, -1.0, f64::NAN, f64::INFINITY, 1e38];
    let changes = numbers.iter().flat_map(|&number| [(grid, number), (grid + 8, number)]);
    for (at, number) in changes {
        let mut bytes = valid.clone();
        bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
        forge_header(&mut bytes, header_len);
        let error = open(&bytes).unwrap_err();
        assert!(error.to_string().contains("a grid of"), "{error}");
    }
    for at in grid + 16..header_len - 4 {
        let mut bytes = valid.clone();
        bytes[at] = 1;
        forge_header(&mut bytes, header_len);
        assert!(open(&bytes).unwrap_err().to_string().contains("reserved"));
    }
    // The other encoding has no such field.
    let mut bytes = valid.clone();
    bytes[24] = 0;
    forge_header(&mut bytes, header_len);
    assert!(open(&bytes).unwrap_err().to_string().contains("attributes in"));
}

#[test]
fn every_byte_of_the_header_is_under_its_checksum() {
    let bytes = encoded(&collapse(&sheet(6), 200, 2), 4, Encoding::Compact);
    for at in 16..u32_at(&bytes, 12) as usize {
        let mut changed = bytes.clone();
        changed[at] ^= 0x20;
        let error = open(&changed).unwrap_err();
        assert!(matches!(error, Error::Checksum { place: Place::Header, .. }), "{at}: {error}");
    }
}

#[test]
fn hostile_counts_do_not_allocate() {
    for encoding in ENCODINGS {
        let valid = encoded(&collapse(&sheet(6), 200, 2), 4, encoding);
        for field in (32..96).step_by(8) {
            for value in [1 << 20, 1 << 33, 1 << 40, u64::MAX / 2, u64::MAX] {
                let mut bytes = valid.clone();
                bytes[field..field + 8].copy_from_slice(&value.to_le_bytes());
                forge(&mut bytes);
                assert!(open(&bytes).is_err(), "field {field} of {value}");
            }
        }
    }
}

#[test]
fn attributes_and_features_of_later_writers_are_read_over() {
    let plain = collapse(&sheet(6), 200, 2);
    for forest in [coloured(plain.clone()), plain] {
        for encoding in ENCODINGS {
            // A column of width 0; no words, any states, and two bytes of bits.
            let symbols = [0, 1, 2, 3, 4, 5, 6, 7, 8, 2, 77, 78];
            for (coding, of_page) in [(0, &[0][..]), (1, &symbols[..])] {
                add_an_attribute(&encoded(&forest, 4, encoding), coding, of_page);
            }
        }
    }
}

/// Adds an attribute of one component to a file: a column of width 0 for the coarsest mesh, and some bytes for each page.
fn add_an_attribute(valid: &[u8], coding: u8, of_page: &[u8]) {
    let mut bytes = valid.to_vec();
    bytes[16 + 4] = 1;
    let header_len = u32_at(&bytes, 12) as usize;
    forge_header(&mut bytes, header_len);
    assert_eq!(open(&bytes).unwrap().header().features, 1 << 32);

    let [base, pages, index] = [BASE, PAGES, INDEX].map(|field| section(valid, field));
    let num_attributes = valid[26] as usize;
    // The table ends before what the encoding adds to the header.
    let table_end = 256 + 32 * num_attributes;
    let mut bytes = valid[..table_end].to_vec();
    bytes.extend(b"colour\0\0\0\0\0\0\0\0\0\0sRGB\0\0\0\0\0\0\0\0");
    bytes.extend([0x37, 1, coding, 0]);
    bytes.extend(&valid[table_end..base.end]);
    bytes.push(0);
    bytes.extend(&valid[base.end..pages.start]);
    let mut entries = Vec::new();
    for entry in index.step_by(32) {
        let start = u64_at(valid, entry + 8) as usize;
        let length = u32_at(valid, entry + 16);
        let mut changed = valid[entry..entry + 32].to_vec();
        changed[8..16].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        set_u32(&mut changed, 16, length + of_page.len() as u32);
        entries.extend(changed);
        bytes.extend(&valid[start..start + length as usize]);
        bytes.extend(of_page);
    }
    let index_start = bytes.len() as u64;
    let more = entries.len() as u64 / 32 * of_page.len() as u64;
    bytes.extend(entries);
    set_u32(&mut bytes, 12, header_len as u32 + 32);
    bytes[26] += 1;
    let mut change = |at: usize, more: u64| {
        let changed = u64_at(&bytes, at) + more;
        bytes[at..at + 8].copy_from_slice(&changed.to_le_bytes());
    };
    change(BASE, 32);
    change(BASE + 8, 1);
    change(ROOTS, 33);
    change(PAGES, 33);
    change(PAGES + 8, more);
    bytes[INDEX..INDEX + 8].copy_from_slice(&index_start.to_le_bytes());
    let len = bytes.len() as u64;
    bytes[216..224].copy_from_slice(&len.to_le_bytes());
    forge(&mut bytes);
    let file = open(&bytes).unwrap();
    assert_eq!(file.header().attributes[num_attributes].unit, "sRGB");
    assert!(verify(&file, |_| {}).is_ok());
    let original = open(valid).unwrap().read_forest().unwrap();
    assert_eq!(file.read_forest().unwrap(), original);
    // Nothing of it is read beyond its end, and nothing is left.
    let page = file.num_pages() - 1;
    let end = section(&bytes, INDEX).start;
    let entry = bytes.len() - 32;
    for (cut, insert) in [(1, &[][..]), (0, &[0][..])] {
        let mut changed = bytes[..end - cut].to_vec();
        changed.extend(insert);
        changed.extend(&bytes[end..]);
        let shift = insert.len() as u64;
        let mut change = |at: usize| {
            let number = u64_at(&changed, at) + shift - cut as u64;
            changed[at..at + 8].copy_from_slice(&number.to_le_bytes());
        };
        change(PAGES + 8);
        change(INDEX);
        change(216);
        let entry = entry + insert.len() - cut;
        let length = u32_at(&changed, entry + 16) + shift as u32 - cut as u32;
        set_u32(&mut changed, entry + 16, length);
        forge(&mut changed);
        assert!(open(&changed).unwrap().read_page(page).is_err());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn forged_files_never_panic(seed in any::<u64>(), changes in 1usize..6, levels in 1u32..=5) {
        let encoding = ENCODINGS[(seed % 2) as usize];
        let forest = collapse(&torus(9), 500, seed / 2 % 4);
        let forest = if seed / 8 % 2 == 0 { forest } else { coloured(forest) };
        let mut bytes = encoded(&forest, levels, encoding);
        let mut random = Random(seed);
        let header_len = u32_at(&bytes, 12) as usize;
        for _ in 0..changes {
            // Now and then a field of the header.
            let at = match random.below(8) {
                0 => 24 + random.below(200),
                _ => header_len + random.below(bytes.len() - header_len),
            };
            bytes[at] = match random.below(3) {
                0 => random.next() as u8,
                1 => 0xff,
                _ => bytes[at] ^ 1 << random.below(8),
            };
        }
        if !(BASE..=INDEX).step_by(24).all(|field| {
            u64_at(&bytes, field).checked_add(u64_at(&bytes, field + 8)).is_some_and(|end| end <= bytes.len() as u64)
        }) {
            forge_header(&mut bytes, header_len);
            prop_assert!(open(&bytes).is_err());
            return Ok(());
        }
        forge(&mut bytes);
        if let Ok(file) = open(&bytes) {
            let report = verify(&file, |_| {});
            let forest = file.read_forest();
            if report.is_ok() {
                prop_assert!(forest.is_ok());
            }
        }
    }
}

/// Fails, or ends, after so many bytes; gives them in pieces.
struct Unreliable {
    bytes: Vec<u8>,
    piece: usize,
    end: u64,
    kind: Option<io::ErrorKind>,
}

impl Storage for Unreliable {
    fn len(&self) -> io::Result<u64> {
        Ok(self.bytes.len() as u64)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        if offset >= self.end {
            return match self.kind {
                Some(kind) => Err(kind.into()),
                None => Ok(0),
            };
        }
        let count = self.piece.min(buffer.len()).min((self.end - offset) as usize);
        self.bytes.read_at(offset, &mut buffer[..count])
    }
}

#[test]
fn storage_that_fails_or_gives_little_at_a_time_is_borne() {
    let bytes = bytes_of(&collapse(&sheet(8), 400, 1), 3);
    let open = |piece, end, kind| {
        let storage = Unreliable { bytes: bytes.clone(), piece, end, kind };
        XfmFile::from_storage(Box::new(storage), "x.xfm")
    };
    let all = bytes.len() as u64;
    assert!(verify(&open(1, all, None).unwrap(), |_| {}).is_ok());
    assert!(verify(&open(7, all, None).unwrap(), |_| {}).is_ok());
    for end in (0..all).step_by(5) {
        let error = open(64, end, Some(io::ErrorKind::PermissionDenied)).unwrap_err();
        assert!(matches!(error, Error::Io { action: "read", .. }), "{error}");
        let error = open(64, end, None).unwrap_err();
        assert!(matches!(error, Error::Truncated { .. }), "{error}");
    }
}
