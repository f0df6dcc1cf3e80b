//! Numbers in text as almost all of them are written, fast.
//!
//! [`Plain`] goes through text that may hold many lines. What it takes it reads exactly as [`Tokens`] does, bit for bit;
//! on anything unusual, and near the end of the text, it gives up with `None`, and the line at hand is to be read the
//! careful way.
//!
//! [`Tokens`]: super::text::Tokens

use fast_float2::FastFloat;
use glam::{DVec3, Vec3};

use super::text::is_blank;
use crate::Frame;

/// A cursor over text.
#[derive(Clone, Copy)]
pub(crate) struct Plain<'a> {
    text: &'a [u8],
    at: usize,
}

const TENS: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

impl<'a> Plain<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0 }
    }

    /// Bytes passed so far.
    #[inline]
    pub(crate) fn at(&self) -> usize {
        self.at
    }

    #[inline]
    fn byte(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    #[inline]
    pub(crate) fn skip_blanks(&mut self) -> Option<()> {
        while is_blank(self.byte()?) {
            self.at += 1;
        }
        Some(())
    }

    /// Passes over these bytes, if they are what follows.
    #[inline]
    pub(crate) fn skip(&mut self, word: &[u8]) -> Option<()> {
        self.text.get(self.at..)?.starts_with(word).then(|| self.at += word.len())
    }

    /// Takes the run of at most eight digits that follows: its value and its length, which may be zero.
    ///
    /// Eight characters at a time in one word; see D. Lemire, *Number parsing at a gigabyte per second*, 2021, §5.
    #[inline]
    fn digits(&mut self) -> Option<(u64, usize)> {
        let characters = self.text.get(self.at..)?.first_chunk()?;
        // Digits become 0 to 9; all else has its high bit set once 0x76 is added (or before).
        let values = u64::from_le_bytes(*characters) ^ 0x3030_3030_3030_3030;
        let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
        let count = others.trailing_zeros() / 8;
        // The digits at the high end, zeros in front of them.
        let digits = values.checked_shl(64 - 8 * count).unwrap_or(0);
        let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
        let high = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(100 + (1_000_000 << 32));
        let low = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(1 + (10_000 << 32));
        let value = high.wrapping_add(low) >> 32;
        self.at += count as usize;
        Some((value, count as usize))
    }

    /// Takes all digits that follow; adds them to `value` and gives their number. With more than 19 digits in all the
    /// value is not to be used.
    #[inline]
    fn run(&mut self, value: &mut u64) -> Option<usize> {
        let mut length = 0;
        loop {
            let (next, count) = self.digits()?;
            *value = value.wrapping_mul(TENS[count]).wrapping_add(next);
            length += count;
            if count < 8 {
                return Some(length);
            }
        }
    }

    /// A token ends here.
    #[inline]
    fn is_between(&self) -> Option<()> {
        let byte = self.byte()?;
        (is_blank(byte) || byte == b'\n' || byte == b'\r').then_some(())
    }

    /// An integer without a sign, of at most 15 digits, that ends at a blank or at the end of the line.
    #[inline]
    pub(crate) fn integer(&mut self) -> Option<u64> {
        let value = self.integer_before_any()?;
        self.is_between()?;
        Some(value)
    }

    /// An integer without a sign, of at most 15 digits; a slash and what follows it in the token are passed over.
    #[inline]
    pub(crate) fn integer_before_slash(&mut self) -> Option<u64> {
        let value = self.integer_before_any()?;
        if self.byte()? == b'/' {
            while self.is_between().is_none() {
                self.at += 1;
                self.byte()?;
            }
        }
        self.is_between()?;
        Some(value)
    }

    #[inline]
    fn integer_before_any(&mut self) -> Option<u64> {
        self.skip_blanks()?;
        let mut value = 0;
        matches!(self.run(&mut value)?, 1..=15).then_some(value)
    }

    /// A decimal number, rounded to the nearest.
    #[inline]
    pub(crate) fn real<T: Real>(&mut self) -> Option<T> {
        self.skip_blanks()?;
        let start = self.at;
        let value = match self.decimal() {
            Some((negative, digits, exponent)) => T::from_decimal(negative, digits, exponent),
            None => None,
        };
        let value = match value {
            Some(value) => value,
            None => {
                let (value, length) = fast_float2::parse_partial(self.text.get(start..)?).ok()?;
                self.at = start + length;
                value
            }
        };
        self.is_between()?;
        Some(value)
    }

    /// A sign, digits with or without a point among them, and an exponent: the number is the digits times ten to the
    /// power of the exponent.
    #[inline]
    fn decimal(&mut self) -> Option<(bool, u64, i32)> {
        let negative = self.byte()? == b'-';
        self.at += usize::from(negative);
        let mut digits = 0;
        let mut length = self.run(&mut digits)?;
        let mut exponent = 0;
        if self.byte()? == b'.' {
            self.at += 1;
            let fraction = self.run(&mut digits)?;
            length += fraction;
            exponent = -i32::try_from(fraction).ok()?;
        }
        if self.byte()? | 0x20 == b'e' {
            self.at += 1;
            let down = self.byte()? == b'-';
            self.at += usize::from(down || self.byte()? == b'+');
            let mut power = 0;
            let true = matches!(self.run(&mut power)?, 1..=4) else { return None };
            exponent += if down { -(power as i32) } else { power as i32 };
        }
        matches!(length, 1..=19).then_some((negative, digits, exponent))
    }

    /// Three numbers as a position in this frame.
    #[inline]
    pub(crate) fn point(&mut self, frame: &Frame) -> Option<Vec3> {
        if frame.double {
            Some(frame.from_file(DVec3::new(self.real()?, self.real()?, self.real()?)))
        } else {
            Some(Vec3::new(self.real()?, self.real()?, self.real()?))
        }
    }

    /// Passes over the end of the line, if this is it.
    #[inline]
    pub(crate) fn line_end(&mut self) -> Option<()> {
        self.skip_blanks()?;
        match self.byte()? {
            b'\n' => self.at += 1,
            b'\r' if *self.text.get(self.at + 1)? == b'\n' => self.at += 2,
            _ => return None,
        }
        Some(())
    }

    /// Passes over the rest of the line and gives it, without its end.
    #[inline]
    pub(crate) fn rest_of_line(&mut self) -> Option<&'a [u8]> {
        let start = self.at;
        // Mostly there is nothing, or a blank.
        if self.line_end().is_some() {
            return Some(&[]);
        }
        let rest = self.text.get(start..)?;
        let length = memchr::memchr2(b'\n', b'\r', rest)?;
        self.at = start + length;
        self.line_end()?;
        rest.get(..length)
    }
}

/// The two kinds of floating-point number.
pub(crate) trait Real: FastFloat {
    /// The nearest value to `±digits · 10^exponent` where simple arithmetic is certain to give that.
    fn from_decimal(negative: bool, digits: u64, exponent: i32) -> Option<Self>;
}

impl Real for f64 {
    /// Both factors are exact, so that there is one rounding (W. Clinger, *How to read floating point numbers
    /// accurately*, 1990, §3).
    #[inline]
    fn from_decimal(negative: bool, digits: u64, exponent: i32) -> Option<Self> {
        const EXACT: [f64; 23] = [
            1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
            1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
        ];
        let power = *EXACT.get(exponent.unsigned_abs() as usize)?;
        if digits > 1 << 53 {
            return None;
        }
        let digits = digits as f64;
        let size = if exponent < 0 { digits / power } else { digits * power };
        Some(if negative { -size } else { size })
    }
}

impl Real for f32 {
    /// By way of the nearest `f64`. Rounding that once more goes wrong only where it lies in the middle between two
    /// `f32`, which is left alone, as are the subnormal ones, whose middles lie elsewhere.
    #[inline]
    fn from_decimal(negative: bool, digits: u64, exponent: i32) -> Option<Self> {
        let value = f64::from_decimal(negative, digits, exponent)?;
        let is_middle = value.to_bits() & 0x1fff_ffff == 0x1000_0000;
        let is_small = value.abs() < f64::from(f32::MIN_POSITIVE) && digits != 0;
        if is_middle || is_small { None } else { Some(value as f32) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::text::Tokens;
    use super::*;

    /// Reads a token in a line the plain way, with more text after the line, and the careful way; whether the plain way
    /// took it, and then both agree.
    fn takes<T: Real + From<f32> + Into<f64>>(token: &str) -> bool {
        let line = format!("  {token} 7 ");
        let text = format!("{line}\r\nnext line of text");
        let mut plain = Plain::new(text.as_bytes());
        let Some(value) = plain.real::<T>() else { return false };
        let expected = Tokens::new(line.as_bytes()).real::<T>().unwrap();
        let bits = |value: T| value.into().to_bits();
        assert_eq!(bits(value), bits(expected), "{token}");
        assert_eq!(plain.integer(), Some(7));
        assert_eq!(plain.line_end(), Some(()));
        assert!(plain.text[plain.at()..].starts_with(b"next"));
        true
    }

    fn compare(token: &str) -> [bool; 2] {
        [takes::<f32>(token), takes::<f64>(token)]
    }

    #[test]
    fn what_is_taken_is_read_as_by_the_careful_way() {
        let taken = [
            "0",
            "-0",
            "-0.0",
            "1",
            "-2.5",
            "0.0503744",
            ".5",
            "6.",
            "1e5",
            "1E-7",
            "2.5e+3",
            "12345678",
            "123456789.123456789",
            "1.00000005960464477540",
            "0.1e-45",
            "3.4028236e38",
            "1e39",
            "-1e-50",
            "18.793134689331055",
            "99999999999999999999999",
            "inf",
            "nan",
            "16777217",
            "16777219",
            "9007199254740993",
            "0.000000000000000000000000000001",
            "1.1754943e-38",
            "1.17549429e-38",
            "4.9e-324",
            "1e22",
            "1e23",
            "123456789012345678",
            "+1",
        ];
        for token in taken {
            assert_eq!(compare(token), [true; 2], "{token}");
        }
        for token in ["1,5", "x", "-", ".", "1.2.3", "1e", "--1", "1.#INF"] {
            assert_eq!(compare(token), [false; 2], "{token}");
        }
    }

    #[test]
    fn integers_and_lines() {
        let text = b" 3 12345678 123456789012345\t0/1/2 5\n6 \x0c\r\n7 more\r\n8 rest\r9\n0 ______________";
        let mut plain = Plain::new(text);
        for expected in [3, 12_345_678, 123_456_789_012_345] {
            assert_eq!(plain.integer(), Some(expected));
        }
        assert_eq!(plain.line_end(), None);
        assert_eq!(plain.integer_before_slash(), Some(0));
        assert_eq!(plain.integer_before_slash(), Some(5));
        assert_eq!(plain.rest_of_line(), Some(&b""[..]));
        assert_eq!(plain.integer(), Some(6));
        assert_eq!(plain.line_end(), Some(()));
        assert_eq!(plain.integer(), Some(7));
        assert_eq!(plain.rest_of_line(), Some(&b" more"[..]));
        assert_eq!(plain.integer(), Some(8));
        assert_eq!(plain.rest_of_line(), None);
    }

    #[test]
    fn what_is_odd_is_left_alone() {
        for text in [
            "-1          ",
            "+1          ",
            "1.0         ",
            "1234567890123456   ",
            "x        ",
            "1",
        ] {
            assert_eq!(Plain::new(text.as_bytes()).integer(), None, "{text}");
        }
        // A lone carriage return ends lines in some files only.
        assert_eq!(Plain::new(b"\rnext line").line_end(), None);
        assert_eq!(Plain::new(b"rest\rnext line").rest_of_line(), None);
        // The text may go on.
        assert_eq!(Plain::new(b"1.5").real::<f32>(), None);
        assert_eq!(Plain::new(b"  ").line_end(), None);
        assert_eq!(Plain::new(b"\r").line_end(), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4096) })]

        #[test]
        fn any_decimal_is_rounded_right(
            sign in "-?", whole in "[0-9]{0,12}", fraction in "[0-9]{0,14}", exponent in "(e-?[0-9]{1,2})?",
        ) {
            let token = format!("{sign}{whole}.{fraction}{exponent}");
            let taken = compare(&token);
            prop_assert_eq!(taken, [!(whole.is_empty() && fraction.is_empty()); 2]);
        }

        #[test]
        fn any_number_comes_back(bits: u32, wide: u64, digits in 0usize..12) {
            let (single, double) = (f32::from_bits(bits), f64::from_bits(wide));
            for token in [
                format!("{single}"), format!("{single:e}"), format!("{single:.digits$e}"), format!("{double}"),
                format!("{double:e}"), format!("{double:.digits$e}"), format!("{:.digits$}", single.clamp(-1e6, 1e6)),
                // The middle between two of them, and a little more and less.
                format!("{:e}", f64::from(single) + f64::from(single.next_up() - single) / 2.0),
                format!("{:.40e}", f64::from(single) + f64::from(single.next_up() - single) / 2.0),
            ] {
                if !token.contains("NaN") {
                    compare(&token);
                }
            }
        }

        #[test]
        fn any_bytes_are_read_as_by_the_careful_way(token in "[-+0-9.eE/nai]{1,12}") {
            compare(&token);
            let line = format!("{token} 1 2 3\n");
            if let Some(value) = Plain::new(line.as_bytes()).integer() {
                let line = format!("{token} 1 2 3");
                prop_assert_eq!(Tokens::new(line.as_bytes()).integer(), Ok(value as i64));
            }
            if let Some(value) = Plain::new(line.as_bytes()).integer_before_slash() {
                let line = format!("{token} 1 2 3");
                prop_assert_eq!(Tokens::new(line.as_bytes()).integer_until(b'/'), Ok(value as i64));
            }
        }
    }
}
