//! Numbers in lines of text.

use std::io::{self, Write};

use fast_float2::FastFloat;
use glam::{DVec3, Vec3};

use crate::Frame;
use crate::codec::quote::quote;

/// What is wrong with a token; the caller knows the line.
#[derive(Debug, PartialEq)]
pub(crate) enum Fault {
    /// The line ends where a value should be.
    Missing,
    /// This is not a number.
    BadNumber(String),
}

impl Fault {
    fn bad(rest: &[u8]) -> Self {
        Self::BadNumber(quote(first_token(rest)))
    }
}

#[inline]
pub(crate) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

#[inline]
pub(crate) fn trim_start(mut rest: &[u8]) -> &[u8] {
    while let [first, tail @ ..] = rest
        && is_blank(*first)
    {
        rest = tail;
    }
    rest
}

fn first_token(rest: &[u8]) -> &[u8] {
    let stop = rest.iter().position(|&b| is_blank(b)).unwrap_or(rest.len());
    &rest[..stop]
}

/// A cursor over the blank-separated tokens of a line.
#[derive(Clone, Copy)]
pub(crate) struct Tokens<'a> {
    rest: &'a [u8],
}

impl<'a> Tokens<'a> {
    pub(crate) fn new(line: &'a [u8]) -> Self {
        Self { rest: line }
    }

    /// The next token, or `None` at the end of the line.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        self.rest = trim_start(self.rest);
        let token = first_token(self.rest);
        self.rest = &self.rest[token.len()..];
        (!token.is_empty()).then_some(token)
    }

    pub(crate) fn is_at_end(&mut self) -> bool {
        self.rest = trim_start(self.rest);
        self.rest.is_empty()
    }

    /// A decimal number, rounded to the nearest; infinities and NaN too, in the spellings of C libraries.
    #[inline]
    pub(crate) fn real<T: FastFloat + From<f32>>(&mut self) -> Result<T, Fault> {
        let rest = trim_start(self.rest);
        let digits = match rest {
            [] => return Err(Fault::Missing),
            [b'+', tail @ ..] if !matches!(tail, [b'+' | b'-', ..]) => tail,
            _ => rest,
        };
        if let Ok((value, length)) = fast_float2::parse_partial::<T, _>(digits) {
            match &digits[length..] {
                [] => {
                    self.rest = &[];
                    return Ok(value);
                }
                tail @ [next, ..] if is_blank(*next) => {
                    self.rest = tail;
                    return Ok(value);
                }
                _ => {}
            }
        }
        let token = first_token(rest);
        let value = odd_real(token).ok_or_else(|| Fault::bad(rest))?;
        self.rest = &rest[token.len()..];
        Ok(value.into())
    }

    /// Three numbers as they stand.
    pub(crate) fn exact_point(&mut self) -> Result<DVec3, Fault> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }

    /// Three numbers as a position in this frame.
    #[inline]
    pub(crate) fn point(&mut self, frame: &Frame) -> Result<Vec3, Fault> {
        if frame.double {
            self.exact_point().map(|point| frame.from_file(point))
        } else {
            Ok(Vec3::new(self.real()?, self.real()?, self.real()?))
        }
    }

    /// An integer that ends at a blank, at the end of the line, or at `stop` (which is left there).
    #[inline]
    pub(crate) fn integer_until(&mut self, stop: u8) -> Result<i64, Fault> {
        let rest = trim_start(self.rest);
        let (negative, digits) = match rest {
            [] => return Err(Fault::Missing),
            [b'-', tail @ ..] => (true, tail),
            [b'+', tail @ ..] => (false, tail),
            _ => (false, rest),
        };
        let mut value = 0i64;
        let mut length = 0;
        for &byte in digits {
            let digit = byte.wrapping_sub(b'0');
            if digit > 9 {
                if is_blank(byte) || byte == stop {
                    break;
                }
                return Err(Fault::bad(rest));
            }
            if length >= 18 {
                return Err(Fault::bad(rest));
            }
            value = value * 10 + i64::from(digit);
            length += 1;
        }
        if length == 0 {
            return Err(Fault::bad(rest));
        }
        self.rest = &digits[length..];
        Ok(if negative { -value } else { value })
    }

    /// An integer between blanks.
    #[inline]
    pub(crate) fn integer(&mut self) -> Result<i64, Fault> {
        self.integer_until(b' ')
    }

    /// Passes over what is left of the token begun.
    #[inline]
    pub(crate) fn skip_token_rest(&mut self) {
        while let [first, tail @ ..] = self.rest
            && !is_blank(*first)
        {
            self.rest = tail;
        }
    }

    /// Passes over one token.
    pub(crate) fn skip_word(&mut self) -> Result<(), Fault> {
        self.word().map(|_| ()).ok_or(Fault::Missing)
    }
}

/// The spellings of infinity and NaN that C libraries have printed over the years (`-1.#IND`, `nan(ind)`).
fn odd_real(token: &[u8]) -> Option<f32> {
    let text = std::str::from_utf8(token).ok()?.to_ascii_lowercase();
    let (sign, text) = match text.strip_prefix(['-', '+']) {
        Some(rest) => (if text.starts_with('-') { -1.0 } else { 1.0 }, rest),
        None => (1.0, text.as_str()),
    };
    if text.starts_with("1.#inf") {
        Some(f32::INFINITY * sign)
    } else if text.starts_with("1.#") || text.starts_with("nan(") {
        Some(f32::NAN)
    } else {
        None
    }
}

/// The shortest decimal that reads back to the same number.
fn write_real<T>(out: &mut Vec<u8>, value: T) -> io::Result<()>
where
    T: Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp,
{
    let size = value.into().abs();
    if size.is_nan() {
        out.write_all(b"nan")
    } else if size == 0.0 || (f64::from(1e-5f32)..1e9).contains(&size) || size.is_infinite() {
        write!(out, "{value}")
    } else {
        write!(out, "{value:e}")
    }
}

/// The direction's three numbers with blanks between them.
#[cfg(feature = "stl")]
pub(crate) fn write_direction(out: &mut Vec<u8>, direction: Vec3) -> io::Result<()> {
    write_reals(out, direction.to_array())
}

/// The numbers of a position in this frame with blanks between them.
pub(crate) fn write_point(out: &mut Vec<u8>, point: Vec3, frame: &Frame) -> io::Result<()> {
    if frame.double {
        write_reals(out, frame.to_file(point).to_array())
    } else {
        write_reals(out, point.to_array())
    }
}

fn write_reals<T>(out: &mut Vec<u8>, [x, y, z]: [T; 3]) -> io::Result<()>
where
    T: Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp,
{
    write_real(out, x)?;
    out.write_all(b" ")?;
    write_real(out, y)?;
    out.write_all(b" ")?;
    write_real(out, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_of_every_kind() {
        let mut tokens =
            Tokens::new(b"  1 -2.5\t+3e-2 .5 6. inf -INF nan -1.#IND 1.#INF -nan(ind)");
        for expected in [1.0, -2.5, 0.03, 0.5, 6.0, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(tokens.real::<f32>(), Ok(expected));
        }
        assert!(tokens.real::<f32>().unwrap().is_nan());
        assert!(tokens.real::<f32>().unwrap().is_nan());
        assert_eq!(tokens.real::<f32>(), Ok(f32::INFINITY));
        assert!(tokens.real::<f32>().unwrap().is_nan());
        assert_eq!(tokens.real::<f32>(), Err(Fault::Missing));
    }

    #[test]
    fn bad_numbers_are_named() {
        for bad in ["1.2.3", "x", "--1", "+-1", "1,5", "-", "+"] {
            let fault = Tokens::new(format!("{bad} 7").as_bytes()).real::<f32>();
            assert_eq!(fault, Err(Fault::BadNumber(bad.to_owned())));
        }
        for bad in ["1.0", "-", "99999999999999999999", "a"] {
            let fault = Tokens::new(bad.as_bytes()).integer_until(b'/');
            assert_eq!(fault, Err(Fault::BadNumber(bad.to_owned())));
        }
    }

    #[test]
    fn rounding_is_to_the_nearest_f32_not_by_way_of_f64() {
        // Just above the middle between 1 and the next f32: lost if rounded to f64 first.
        let text = "1.00000005960464477540";
        assert_eq!(Tokens::new(text.as_bytes()).real::<f32>(), Ok(1.000_000_1));
    }

    #[test]
    fn written_reals_read_back_bit_for_bit() {
        let mut bits = 1u32;
        for _ in 0..100_000 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f32::from_bits(bits);
            let mut text = Vec::new();
            write_real(&mut text, value).unwrap();
            let back = Tokens::new(&text).real::<f32>().unwrap();
            assert!(back.to_bits() == bits || (back.is_nan() && value.is_nan()), "{value:?}");
        }
        for value in [0.0f32, -0.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, 16_777_216.0] {
            let mut text = Vec::new();
            write_real(&mut text, value).unwrap();
            assert_eq!(Tokens::new(&text).real::<f32>().unwrap().to_bits(), value.to_bits());
        }
    }
}
