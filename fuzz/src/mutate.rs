//! Changes to files, such as find what a reader believes: bits, numbers, pieces, lines.

use crate::random::Random;

/// Cases do not grow beyond this.
pub const MAX_LEN: usize = 1 << 15;

/// Numbers at the ends of what types hold, and just beyond.
const WHOLE: [i64; 19] = [
    0,
    1,
    -1,
    2,
    3,
    127,
    128,
    255,
    256,
    32767,
    65535,
    65536,
    1 << 24,
    i32::MAX as i64,
    1 << 31,
    u32::MAX as i64,
    1 << 32,
    i64::MAX,
    i64::MIN,
];

/// Numbers that floating-point code may not expect.
const REAL: [f64; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e30,
    -1e30,
    1e-40,
    3.5e38,
    1e300,
    5e-324,
    16_777_217.0,
];

/// Numbers as text may have them.
const TEXT: [&str; 30] = [
    "0",
    "1",
    "-1",
    "-0",
    "2",
    "255",
    "256",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "18446744073709551616",
    "99999999999999999999999999",
    "nan",
    "inf",
    "-inf",
    "1e30",
    "-1e30",
    "1e39",
    "1e-40",
    "1e999",
    "5e-324",
    "16777217",
    "0.1",
    "+1",
    ".",
    "1e",
];

/// Bytes of any kind: a few changes, each in place, or of a piece.
pub fn bytes(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..1 << random.below(4) {
        change(random, bytes, other);
    }
    bytes.truncate(MAX_LEN);
}

fn change(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let at = random.below(bytes.len());
    match random.below(12) {
        0 | 1 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
        2 if !bytes.is_empty() => bytes[at] = random.bits() as u8,
        3 | 4 => whole(random, bytes, at),
        5 | 6 => real(random, bytes, at),
        7 => bytes.truncate(at),
        8 => {
            let end = (at + piece(random)).min(bytes.len());
            bytes.drain(at..end);
        }
        9 => {
            let end = (at + piece(random)).min(bytes.len());
            let copied = bytes[at..end].to_vec();
            insert(bytes, random.below(bytes.len() + 1), &copied);
        }
        10 => {
            let from = random.below(other.len());
            let end = (from + piece(random)).min(other.len());
            insert(bytes, at, &other[from..end]);
        }
        _ => {
            let from = random.below(other.len());
            let length = piece(random).min(other.len() - from).min(bytes.len() - at);
            bytes[at..at + length].copy_from_slice(&other[from..from + length]);
        }
    }
}

fn piece(random: &mut Random) -> usize {
    let most = 1 << random.below(10);
    1 + random.below(most)
}

fn insert(bytes: &mut Vec<u8>, at: usize, piece: &[u8]) {
    bytes.splice(at..at, piece.iter().copied());
}

fn overwrite(bytes: &mut [u8], at: usize, with: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + with.len()) {
        place.copy_from_slice(with);
    }
}

/// A whole number at the end of some type, or near what stands there, or near how much there is.
fn whole(random: &mut Random, bytes: &mut [u8], at: usize) {
    let size = 1 << random.below(4);
    let at = if random.one_in(2) { at & !(size - 1) } else { at };
    let big = random.one_in(4);
    let mut old = [0; 8];
    let there = bytes.get(at..at + size).unwrap_or_default();
    old[..there.len()].copy_from_slice(there);
    if big {
        old[..size].reverse();
    }
    let value = match random.below(4) {
        0 => i64::from_le_bytes(old).wrapping_add(random.below(9) as i64 - 4),
        1 => bytes.len() as i64 + random.below(9) as i64 - 4,
        _ => *random.pick(&WHOLE),
    };
    let mut new = value.to_le_bytes();
    if big {
        new[..size].reverse();
    }
    overwrite(bytes, at, &new[..size]);
}

fn real(random: &mut Random, bytes: &mut [u8], at: usize) {
    let value = *random.pick(&REAL);
    let big = random.one_in(4);
    let at = if random.one_in(2) { at & !3 } else { at };
    if random.one_in(3) {
        overwrite(bytes, at, &if big { value.to_be_bytes() } else { value.to_le_bytes() });
    } else {
        let value = value as f32;
        overwrite(bytes, at, &if big { value.to_be_bytes() } else { value.to_le_bytes() });
    }
}

/// Text: words, lines and numbers change; now and then bytes.
pub fn text(random: &mut Random, text: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..1 << random.below(4) {
        match random.below(8) {
            0 => change(random, text, other),
            1 | 2 => lines(random, text, other),
            _ => word(random, text, other),
        }
        text.truncate(MAX_LEN);
    }
}

/// Bytes between separators: the word, number or mark around a place.
fn word_at(text: &[u8], at: usize) -> std::ops::Range<usize> {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-._\"".contains(byte);
    let before = text[..at].iter().rposition(|byte| !is_word(byte)).map_or(0, |place| place + 1);
    let after = text[at..].iter().position(|byte| !is_word(byte)).map_or(text.len(), |p| at + p);
    before..after.max(before)
}

fn word(random: &mut Random, text: &mut Vec<u8>, other: &[u8]) {
    let place = word_at(text, random.below(text.len()));
    let number = std::str::from_utf8(&text[place.clone()]).ok().and_then(|w| w.parse::<i64>().ok());
    let new = match (random.below(6), number) {
        (0, Some(number)) => {
            number.wrapping_add(random.below(9) as i64 - 4).to_string().into_bytes()
        }
        (1, Some(number)) => number.wrapping_mul(1 << random.below(40)).to_string().into_bytes(),
        (0 | 1, None) | (2, _) => other[word_at(other, random.below(other.len()))].to_vec(),
        (3, _) => Vec::new(),
        _ => random.pick(&TEXT).as_bytes().to_vec(),
    };
    text.splice(place, new);
}

fn line_at(text: &[u8], at: usize) -> std::ops::Range<usize> {
    let start = text[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |place| place + 1);
    let end = text[at..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |p| at + p + 1);
    start..end
}

fn lines(random: &mut Random, text: &mut Vec<u8>, other: &[u8]) {
    let place = line_at(text, random.below(text.len()));
    let to = line_at(text, random.below(text.len())).start;
    match random.below(4) {
        0 => drop(text.drain(place)),
        1 => {
            let line = text[place].to_vec();
            insert(text, to, &line);
        }
        2 => {
            let line = &other[line_at(other, random.below(other.len()))];
            insert(text, to, line);
        }
        _ => {
            // To somewhere else, or many times.
            let times = 1 << random.below(7);
            let line = text[place.clone()].repeat(times.min(MAX_LEN / place.len().max(1)));
            text.splice(place, line);
        }
    }
}
