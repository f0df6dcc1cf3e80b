//! Values on the command line: sizes, points, image sizes, positive numbers, formats.

use std::time::Duration;

use glam::DVec3;
use mesh_io::Format;
use xfm_format::PositionError;

/// Reads a size in bytes: `1GiB`, `512MiB`, `64M`, `1.5G`, `4096`.
///
/// `K`, `M`, `G`, `T`, alone or with `iB`, are powers of 1024; `KB`, `MB`, `GB`, `TB` are powers of 1000. Letter case does not
/// matter.
///
/// # Errors
///
/// What is wrong with the text, and an example of what would be right.
pub fn size(text: &str) -> Result<u64, String> {
    const EXAMPLE: &str = "a size looks like 1GiB, 512MiB or 64M";
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let (number, unit) = (digits.trim(), &text[digits.len()..]);
    let unit: f64 = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1024.0 * 1024.0,
        "g" | "gib" => 1024.0 * 1024.0 * 1024.0,
        "t" | "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(format!("`{unit}` is not a unit; {EXAMPLE}")),
    };
    if !number.chars().all(|c| c.is_ascii_digit() || c == '.') {
        return Err(EXAMPLE.to_owned());
    }
    let number: f64 = number.parse().map_err(|_| EXAMPLE.to_owned())?;
    let bytes = (number * unit).round();
    // The largest double below 2⁶⁴.
    if bytes >= 18_446_744_073_709_551_615.0 {
        return Err(format!("too large; {EXAMPLE}"));
    }
    if bytes < 1.0 {
        return Err(format!("must be at least one byte; {EXAMPLE}"));
    }
    Ok(bytes as u64)
}

/// Reads an error allowed for positions: a share of the diagonal, or a distance in model units followed by `u`.
///
/// # Errors
///
/// What is wrong with the text, and an example of what would be right.
pub fn position_error(text: &str) -> Result<PositionError, String> {
    const EXAMPLE: &str =
        "an error is a share of the diagonal like 1e-4, or a distance in model units like 0.05u";
    let (number, of): (&str, fn(f64) -> PositionError) = match text.strip_suffix('u') {
        Some(number) => (number, PositionError::Units),
        None => (text, PositionError::OfDiagonal),
    };
    match number.parse() {
        Ok(number) if number > 0.0 && number < 1e29 => Ok(of(number)),
        _ => Err(EXAMPLE.to_owned()),
    }
}

/// Reads a time in seconds.
///
/// # Errors
///
/// What is wrong with the text, and an example of what would be right.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| "a time is a number of seconds, like 600 or 0.5".to_owned())
}

/// Reads a point, `X,Y,Z`.
///
/// # Errors
///
/// What is wrong with the text, and an example of what would be right.
pub fn point(text: &str) -> Result<DVec3, String> {
    const EXAMPLE: &str = "a point is three numbers, like 0,-1.5,2";
    let coordinates: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| EXAMPLE.to_owned()))
        .collect::<Result<_, _>>()?;
    let coordinates: [f64; 3] = coordinates.try_into().map_err(|_| EXAMPLE.to_owned())?;
    let point = DVec3::from_array(coordinates);
    if point.is_finite() { Ok(point) } else { Err(EXAMPLE.to_owned()) }
}

/// Reads an image size, `WxH`, in pixels.
///
/// # Errors
///
/// What is wrong with the text, and an example of what would be right.
pub fn image_size(text: &str) -> Result<[u32; 2], String> {
    const EXAMPLE: &str = "an image size is width x height in pixels, like 1280x720";
    const LARGEST: u32 = 1 << 16;
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(|| EXAMPLE.to_owned())?;
    let side = |text: &str| -> Result<u32, String> {
        let side: u32 = text.trim().parse().map_err(|_| EXAMPLE.to_owned())?;
        if (1..=LARGEST).contains(&side) {
            Ok(side)
        } else {
            Err(format!("each side must be from 1 to {LARGEST}; {EXAMPLE}"))
        }
    };
    Ok([side(width)?, side(height)?])
}

/// Reads a finite number above zero.
///
/// # Errors
///
/// That it is not one.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("must be a number above zero".to_owned()),
    }
}

/// Reads how much something counts: a number from zero to a million.
///
/// # Errors
///
/// That it is not one.
pub fn weight(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(value) if (0.0..=1e6).contains(&value) => Ok(value),
        _ => Err("must be a number from 0 to 1,000,000".to_owned()),
    }
}

/// Reads a finite number, zero or above.
///
/// # Errors
///
/// That it is not one.
pub fn distance(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("must be a distance in model units, zero or above".to_owned()),
    }
}

/// Reads a share, above 0 and up to 1.
///
/// # Errors
///
/// That it is not one.
pub fn share(text: &str) -> Result<f64, String> {
    match positive(text) {
        Ok(share) if share <= 1.0 => Ok(share),
        _ => Err("must be a share above 0 and up to 1, like 0.02".to_owned()),
    }
}

/// Reads how many triangles a buffer holds.
///
/// # Errors
///
/// That it is too small or not a number.
pub fn buffer(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(count) if (64..=1 << 30).contains(&count) => Ok(count),
        _ => Err("must be a number of triangles, 64 or more".to_owned()),
    }
}

/// Reads an angle of view in degrees, above 0 and below 180.
///
/// # Errors
///
/// That it is not one.
pub fn field_of_view(text: &str) -> Result<f64, String> {
    match positive(text) {
        Ok(degrees) if degrees < 180.0 => Ok(degrees),
        _ => Err("must be an angle in degrees above 0 and below 180".to_owned()),
    }
}

/// Reads the short name of a mesh format.
///
/// # Errors
///
/// The names there are.
pub fn format(text: &str) -> Result<Format, String> {
    Format::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = Format::ALL.iter().map(|format| format.name()).collect();
        format!("must be one of {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_come_with_and_without_units() {
        let cases = [
            ("4096", 4096),
            ("1B", 1),
            ("64M", 64 << 20),
            ("512MiB", 512 << 20),
            ("1GiB", 1 << 30),
            ("1.5 gib", 3 << 29),
            ("2t", 2 << 40),
            ("10kb", 10_000),
            ("3GB", 3_000_000_000),
        ];
        for (text, bytes) in cases {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in
            ["", "M", "1X", "-1", "1e9", "inf", "nan", "1..2", "0", "0.1B", "16777216T", "1 2"]
        {
            assert!(size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn points_have_three_finite_coordinates() {
        assert_eq!(point("0,-1.5,2e3"), Ok(DVec3::new(0.0, -1.5, 2000.0)));
        assert_eq!(point(" 1, 2 ,3 "), Ok(DVec3::new(1.0, 2.0, 3.0)));
        for text in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,", "nan,0,0", "inf,0,0"] {
            assert!(point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn image_sizes_have_two_sides() {
        assert_eq!(image_size("1280x720"), Ok([1280, 720]));
        assert_eq!(image_size("8X9"), Ok([8, 9]));
        for text in ["", "1280", "0x5", "5x0", "5x", "-5x5", "70000x5", "1x2x3"] {
            assert!(image_size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn positive_numbers_are_above_zero() {
        assert_eq!(positive("0.5"), Ok(0.5));
        for text in ["0", "-1", "nan", "inf", "x", ""] {
            assert!(positive(text).is_err(), "{text}");
        }
        assert_eq!(field_of_view("60"), Ok(60.0));
        for text in ["0", "180", "-3", "x"] {
            assert!(field_of_view(text).is_err(), "{text}");
        }
        assert_eq!(seconds("0.5"), Ok(Duration::from_millis(500)));
        for text in ["-1", "nan", "inf", "x", ""] {
            assert!(seconds(text).is_err(), "{text}");
        }
        assert_eq!((distance("0"), distance("1e-3")), (Ok(0.0), Ok(0.001)));
        for text in ["-1", "nan", "inf", "x", ""] {
            assert!(distance(text).is_err(), "{text}");
        }
    }

    #[test]
    fn shares_and_buffers_keep_to_their_ranges() {
        assert_eq!((share("1"), share("0.02")), (Ok(1.0), Ok(0.02)));
        for text in ["0", "1.01", "-0.5", "2%", "nan"] {
            assert!(share(text).is_err(), "{text}");
        }
        assert_eq!((buffer("64"), buffer("400000")), (Ok(64), Ok(400_000)));
        for text in ["63", "-1", "1e6", "99999999999999999999", ""] {
            assert!(buffer(text).is_err(), "{text}");
        }
    }

    #[test]
    fn formats_go_by_their_short_names() {
        assert_eq!(format("PLY"), Ok(Format::PlyBinaryLittle));
        assert!(format("step").is_err_and(|message| message.contains("obj")));
    }
}
