//! Columns of integers as byte planes: one plane of lowest bytes, one of the next, as many as the largest value needs.
//!
//! Every plane is packed by itself, because the bytes of one plane are alike and those of two are not: noise in the low
//! ones, a few values in the middle, zeros above.

use zstd::bulk::{Compressor, Decompressor};

use crate::error::{Defect, Place};

const CONSTANT: u8 = 0;
const PLAIN: u8 = 1;
const ZSTD: u8 = 2;

/// First bytes of every Zstandard frame, left out in the file: with several frames for each page they would be one byte in
/// a hundred of it.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Small and alternating differences become small numbers.
#[inline]
pub(crate) fn zigzag(difference: i64) -> u64 {
    (difference << 1 ^ difference >> 63) as u64
}

/// The inverse of [`zigzag`].
#[inline]
pub(crate) fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// Difference of two `f32` as integers in the order of the numbers, so that near numbers differ by little.
#[inline]
pub(crate) fn float_difference(value: f32, predicted: f32) -> u64 {
    let difference = float_key(value).wrapping_sub(float_key(predicted)) as i32;
    u64::from((difference << 1 ^ difference >> 31) as u32)
}

/// The inverse of [`float_difference`], bit for bit. Uses the lower 32 bits of `code`.
#[inline]
pub(crate) fn float_from_difference(code: u64, predicted: f32) -> f32 {
    let code = code as u32;
    let difference = code >> 1 ^ (code & 1).wrapping_neg();
    let key = float_key(predicted).wrapping_add(difference);
    f32::from_bits(if key >> 31 == 1 { key ^ 1 << 31 } else { !key })
}

#[inline]
fn float_key(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The same for one component of an octahedral normal.
#[inline]
pub(crate) fn short_difference(value: i16, predicted: i16) -> u64 {
    let difference = value.wrapping_sub(predicted);
    u64::from((difference << 1 ^ difference >> 15) as u16)
}

/// The inverse of [`short_difference`]. Uses the lower 16 bits of `code`.
#[inline]
pub(crate) fn short_from_difference(code: u64, predicted: i16) -> i16 {
    let code = code as u16;
    predicted.wrapping_add((code >> 1 ^ (code & 1).wrapping_neg()) as i16)
}

/// Packs columns.
pub(crate) struct ColumnEncoder {
    zstd: Compressor<'static>,
    plane: Vec<u8>,
    packed: Vec<u8>,
    /// Leave all planes unpacked.
    pub plain: bool,
}

impl ColumnEncoder {
    pub fn new() -> std::io::Result<Self> {
        let mut zstd = Compressor::new(1)?;
        zstd.include_checksum(false)?;
        zstd.include_contentsize(false)?;
        Ok(Self { zstd, plane: Vec::new(), packed: Vec::new(), plain: false })
    }

    /// Appends a column to `out`.
    pub fn column(&mut self, out: &mut Vec<u8>, values: &[u64]) {
        let all = values.iter().fold(0, |all, value| all | value);
        let width = (64 - all.leading_zeros()).div_ceil(8);
        out.push(width as u8);
        for byte in 0..width {
            self.plane.clear();
            self.plane.extend(values.iter().map(|value| (value >> (8 * byte)) as u8));
            self.append_plane(out);
        }
    }

    fn append_plane(&mut self, out: &mut Vec<u8>) {
        let plane = &self.plane;
        if !self.plain {
            if let Some(&first) = plane.first()
                && plane.iter().all(|&byte| byte == first)
            {
                out.extend([CONSTANT, first]);
                return;
            }
            // The room given decides how zstd goes about it. Always as much, whatever was packed before, or the bytes of a
            // page would depend on those that the encoder had before it.
            let room = zstd::zstd_safe::compress_bound(plane.len());
            self.packed.resize(room.max(self.packed.len()), 0);
            let packed = &mut self.packed[..room];
            if let Ok(length) = self.zstd.compress_to_buffer(plane, packed)
                && let Some(packed) = packed[..length].strip_prefix(&ZSTD_MAGIC)
                && packed.len() + varint_len(packed.len() as u64) < plane.len()
            {
                out.push(ZSTD);
                push_varint(out, packed.len() as u64);
                out.extend_from_slice(packed);
                return;
            }
        }
        out.push(PLAIN);
        out.extend_from_slice(plane);
    }
}

pub(crate) fn push_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn varint_len(value: u64) -> usize {
    (64 - (value | 1).leading_zeros()).div_ceil(7) as usize
}

/// Unpacks columns; holds what can be used again from one page to the next.
pub(crate) struct ColumnDecoder {
    zstd: Decompressor<'static>,
    /// The planes of a column, one after another.
    planes: Vec<u8>,
    frame: Vec<u8>,
}

/// The bytes still to be read of a part of a file.
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    place: Place,
}

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8], place: Place) -> Self {
        Self { bytes, place }
    }

    pub fn defect(&self, message: impl Into<String>) -> Defect {
        Defect::new(self.place, message)
    }

    pub fn remaining(&self) -> usize {
        self.bytes.len()
    }

    /// That nothing is left.
    pub fn finish(self) -> Result<(), Defect> {
        match self.bytes.len() {
            0 => Ok(()),
            rest => Err(self.defect(format!("{rest} bytes too many"))),
        }
    }

    fn byte(&mut self, field: &str) -> Result<u8, Defect> {
        Ok(self.take(1, field)?[0])
    }

    pub fn take(&mut self, count: usize, field: &str) -> Result<&'a [u8], Defect> {
        match self.bytes.split_at_checked(count) {
            Some((taken, rest)) => {
                self.bytes = rest;
                Ok(taken)
            }
            None => Err(self.defect(format!("{field} is cut short"))),
        }
    }

    /// A length that is no larger than memory.
    pub fn length(&mut self, field: &str) -> Result<usize, Defect> {
        Ok(usize::try_from(self.varint(field)?).unwrap_or(usize::MAX))
    }

    fn varint(&mut self, field: &str) -> Result<u64, Defect> {
        let mut value = 0u64;
        for shift in (0..63).step_by(7) {
            let byte = self.byte(field)?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(self.defect(format!("{field} has a length of more than 63 bits")))
    }
}

impl ColumnDecoder {
    pub fn new() -> std::io::Result<Self> {
        Ok(Self { zstd: Decompressor::new()?, planes: Vec::new(), frame: Vec::new() })
    }

    /// Reads a column of `count` values of at most `max_width` bytes into `values`, from their start on.
    ///
    /// The caller has checked `count` against the size of the file: it is allocated here.
    pub fn column(
        &mut self,
        cursor: &mut Cursor<'_>,
        field: &str,
        count: usize,
        max_width: u32,
        values: &mut Vec<u64>,
    ) -> Result<(), Defect> {
        let width = usize::from(cursor.byte(field)?);
        if width > max_width as usize {
            return Err(cursor.defect(format!("{field} has values of {width} bytes")));
        }
        self.planes.resize(width * count, 0);
        for byte in 0..width {
            self.plane(cursor, field, byte * count..(byte + 1) * count)?;
        }
        values.clear();
        if count > 0 {
            join(&self.planes, count, values);
        }
        values.resize(count, 0);
        Ok(())
    }

    /// Unpacks a plane into a part of the planes.
    fn plane(
        &mut self,
        cursor: &mut Cursor<'_>,
        field: &str,
        into: std::ops::Range<usize>,
    ) -> Result<(), Defect> {
        let plane = &mut self.planes[into];
        match cursor.byte(field)? {
            CONSTANT => plane.fill(cursor.byte(field)?),
            PLAIN => plane.copy_from_slice(cursor.take(plane.len(), field)?),
            ZSTD => {
                let length = cursor.length(field)?;
                let packed = cursor.take(length, field)?;
                self.frame.clear();
                self.frame.extend_from_slice(&ZSTD_MAGIC);
                self.frame.extend_from_slice(packed);
                match self.zstd.decompress_to_buffer(&self.frame, plane) {
                    Ok(unpacked) if unpacked == plane.len() => {}
                    Ok(_) => return Err(cursor.defect(format!("{field} is too short"))),
                    Err(why) => {
                        return Err(cursor.defect(format!("{field} does not unpack: {why}")));
                    }
                }
            }
            method => {
                let message = format!("{field} is packed by unknown method {method}");
                return Err(cursor.defect(message));
            }
        }
        Ok(())
    }

    /// Reads over a column without unpacking it.
    pub fn skip(cursor: &mut Cursor<'_>, field: &str, count: usize) -> Result<(), Defect> {
        for _ in 0..cursor.byte(field)? {
            let length = match cursor.byte(field)? {
                CONSTANT => 1,
                PLAIN => count,
                ZSTD => cursor.length(field)?,
                method => {
                    return Err(
                        cursor.defect(format!("{field} is packed by unknown method {method}"))
                    );
                }
            };
            cursor.take(length, field)?;
        }
        Ok(())
    }
}

/// Appends what planes of `count` bytes hold, one byte from each together, the lowest first. Nothing where there is no plane.
fn join(planes: &[u8], count: usize, values: &mut Vec<u64>) {
    let mut planes = planes.chunks_exact(count);
    // Two planes at a time: nearly all columns have one to four.
    let mut shift = 0;
    while let Some(low) = planes.next() {
        let pair = |(&low, &high): (&u8, &u8)| u64::from(u16::from(low) | u16::from(high) << 8);
        match (planes.next(), shift) {
            (Some(high), 0) => values.extend(low.iter().zip(high).map(pair)),
            (None, 0) => values.extend(low.iter().map(|&low| u64::from(low))),
            (Some(high), _) => {
                let pairs = low.iter().zip(high).map(pair);
                values.iter_mut().zip(pairs).for_each(|(value, pair)| *value |= pair << shift);
            }
            (None, _) => {
                let low = low.iter().map(|&low| u64::from(low));
                values.iter_mut().zip(low).for_each(|(value, low)| *value |= low << shift);
            }
        }
        shift += 16;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn round_trip(values: &[u64], plain: bool) -> Vec<u64> {
        let mut encoder = ColumnEncoder::new().unwrap();
        encoder.plain = plain;
        let mut bytes = Vec::new();
        encoder.column(&mut bytes, values);
        let mut back = Vec::new();
        let mut cursor = Cursor::new(&bytes, Place::File);
        let mut decoder = ColumnDecoder::new().unwrap();
        decoder.column(&mut cursor, "test", values.len(), 8, &mut back).unwrap();
        cursor.finish().unwrap();
        let mut cursor = Cursor::new(&bytes, Place::File);
        ColumnDecoder::skip(&mut cursor, "test", values.len()).unwrap();
        cursor.finish().unwrap();
        for end in 0..bytes.len() {
            let mut cursor = Cursor::new(&bytes[..end], Place::File);
            assert!(decoder.column(&mut cursor, "test", values.len(), 8, &mut Vec::new()).is_err());
        }
        back
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

        #[test]
        fn columns_come_back(values in prop::collection::vec(any::<u64>(), 0..40), shift in 0u32..64) {
            let values: Vec<u64> = values.iter().map(|value| value >> shift).collect();
            prop_assert_eq!(&round_trip(&values, false), &values);
            prop_assert_eq!(&round_trip(&values, true), &values);
        }

        #[test]
        fn differences_are_inverted_bit_for_bit(a in any::<u32>(), b in any::<u32>(), d in any::<i64>()) {
            let (x, y) = (f32::from_bits(a), f32::from_bits(b));
            prop_assert_eq!(float_from_difference(float_difference(x, y), y).to_bits(), a);
            let (s, t) = (a as i16, b as i16);
            prop_assert_eq!(short_from_difference(short_difference(s, t), t), s);
            prop_assert_eq!(unzigzag(zigzag(d)), d);
        }
    }

    #[test]
    fn what_was_packed_before_makes_no_difference() {
        let mut state = 1u64;
        // Of all lengths, and on the verge of being packed or not: random bytes of few different values.
        let mut column = |length: usize, values: u64| -> Vec<u64> {
            let mut next = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 33) % values
            };
            (0..length).map(|_| next()).collect()
        };
        let mut used = ColumnEncoder::new().unwrap();
        for round in 0..2000 {
            let column = column(1 + round * 7 % 900, [16, 100, 200, 256][round % 4]);
            let [mut fresh, mut again] = [Vec::new(), Vec::new()];
            ColumnEncoder::new().unwrap().column(&mut fresh, &column);
            used.column(&mut again, &column);
            assert!(fresh == again, "round {round}");
        }
    }

    #[test]
    fn near_numbers_have_small_differences() {
        for x in [0.0f32, 1.0, -1.0, 3e7] {
            assert!(float_difference(x.next_up(), x) <= 3);
            assert!(float_difference(x.next_down(), x) <= 3);
        }
    }

    #[test]
    fn long_repetitive_columns_shrink() {
        let values: Vec<u64> = (0..4000).map(|i| i % 5).collect();
        let mut bytes = Vec::new();
        ColumnEncoder::new().unwrap().column(&mut bytes, &values);
        assert!(bytes.len() < 200, "{}", bytes.len());
        assert_eq!(round_trip(&values[..300], false), &values[..300]);
    }
}
