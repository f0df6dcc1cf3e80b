//! Numbers as people read them.

/// A count with its thousands set apart.
///
/// ```
/// assert_eq!(xfm::text::count(871_414_u64), "871,414");
/// ```
pub fn count(number: impl Into<u64>) -> String {
    let digits = number.into().to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3 + 1);
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A size in bytes, in the binary unit that fits it.
///
/// ```
/// assert_eq!(xfm::text::size(33_831_477), "32.3 MiB");
/// ```
pub fn size(bytes: u64) -> String {
    const UNITS: [&str; 6] = ["KiB", "MiB", "GiB", "TiB", "PiB", "EiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    // 1023.95 would be written as 1024.0.
    while value >= 1023.95 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

/// A time in the unit that fits it, to three digits.
///
/// ```
/// assert_eq!(xfm::text::seconds(0.01234), "12.3 ms");
/// ```
pub fn seconds(seconds: f64) -> String {
    match seconds {
        s if s >= 3600.0 => {
            format!("{:.0} h {:02.0} min", (s / 3600.0).floor(), (s % 3600.0 / 60.0).floor())
        }
        s if s >= 60.0 => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), (s % 60.0).floor()),
        s if s >= 0.9995 => format!("{} s", number(s, 3)),
        s if s >= 0.000_999_5 => format!("{} ms", number(s * 1e3, 3)),
        s => format!("{} µs", number(s * 1e6, 3)),
    }
}

/// A number to so many significant digits, without trailing zeros, with an exponent where it is very large or small.
///
/// ```
/// use xfm::text::number;
/// assert_eq!(number(0.026_712_9, 4), "0.02671");
/// assert_eq!(number(4.0, 4), "4");
/// assert_eq!(number(1.5e-9, 4), "1.5e-9");
/// ```
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let trim = |text: &str| -> String {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text.to_owned()
        }
    };
    // Written with an exponent first: that rounding decides where the number begins.
    let scientific = format!("{:.*e}", digits.max(1) - 1, value);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if !(-5..=12).contains(&exponent) {
        return format!("{}e{exponent}", trim(mantissa));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trim(&format!("{value:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_by_thousands() {
        let cases = [(0, "0"), (999, "999"), (1000, "1,000"), (12_345_678, "12,345,678")];
        for (number, text) in cases {
            assert_eq!(count(number as u64), text);
        }
    }

    #[test]
    fn sizes_take_the_unit_that_fits() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.0 KiB"),
            ((1 << 20) - 1, "1.0 MiB"),
            (1 << 30, "1.0 GiB"),
            (u64::MAX, "16.0 EiB"),
        ];
        for (bytes, text) in cases {
            assert_eq!(size(bytes), text);
        }
    }

    #[test]
    fn times_take_the_unit_that_fits() {
        let cases = [
            (0.0, "0 µs"),
            (1.5e-6, "1.5 µs"),
            (0.9999e-3, "1 ms"),
            (0.25, "250 ms"),
            (0.9999, "1 s"),
            (59.9, "59.9 s"),
            (61.0, "1 min 01 s"),
            (7384.0, "2 h 03 min"),
        ];
        for (time, text) in cases {
            assert_eq!(seconds(time), text);
        }
    }

    #[test]
    fn numbers_keep_their_significant_digits() {
        let cases = [
            (0.0, "0"),
            (-0.25, "-0.25"),
            (99.999_99, "100"),
            (123_456.0, "123456"),
            (0.000_012_347, "0.00001235"),
            (1.0e13, "1e13"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value, 4), text);
        }
    }
}
