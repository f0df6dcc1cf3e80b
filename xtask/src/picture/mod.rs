//! Pictures of three bytes per pixel, read from and written to PNG.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

use font8x8::UnicodeFonts;

use crate::Error;

/// A picture in RGB.
#[derive(Debug, Clone)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Image {
    /// A picture of one colour.
    pub fn new(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// Reads a PNG; transparency is dropped.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let broken = |why: String| Error::Report { what: path.display().to_string(), why };
        let file = File::open(path).map_err(Error::file(path))?;
        let mut decoder = png::Decoder::new(BufReader::new(file));
        decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
        let mut reader = decoder.read_info().map_err(|e| broken(e.to_string()))?;
        let size = reader.output_buffer_size();
        let mut bytes = vec![0; size.ok_or_else(|| broken("too large a picture".into()))?];
        let info = reader.next_frame(&mut bytes).map_err(|e| broken(e.to_string()))?;
        bytes.truncate(info.buffer_size());
        let samples = info.color_type.samples();
        let pixels = bytes.chunks_exact(samples).map(|pixel| match *pixel {
            [r, g, b, ..] => [r, g, b],
            [grey, ..] => [grey; 3],
            [] => [0; 3],
        });
        let (width, height) = (info.width as usize, info.height as usize);
        Ok(Self { width, height, pixels: pixels.collect() })
    }

    /// Writes a PNG.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let broken = |e: png::EncodingError| Error::Report {
            what: path.display().to_string(),
            why: e.to_string(),
        };
        let file = File::create(path).map_err(Error::file(path))?;
        let (width, height) = (self.width as u32, self.height as u32);
        let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().map_err(broken)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(broken)?;
        writer.finish().map_err(broken)
    }

    /// The picture at another size, each pixel the mean of those it covers.
    pub fn resized(&self, width: usize, height: usize) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let columns = covered(x, width, self.width);
                let rows = covered(y, height, self.height);
                let (mut sum, mut count) = ([0_u32; 3], 0);
                for row in rows {
                    for pixel in &self.pixels[row * self.width..][columns.clone()] {
                        for (total, &part) in sum.iter_mut().zip(pixel) {
                            *total += u32::from(part);
                        }
                        count += 1;
                    }
                }
                pixels.push(sum.map(|total| (total / count.max(1)) as u8));
            }
        }
        Self { width, height, pixels }
    }

    /// Copies a picture into this one; what reaches beyond is cut off.
    pub fn paste(&mut self, other: &Self, left: usize, top: usize) {
        let width = other.width.min(self.width.saturating_sub(left));
        for y in 0..other.height.min(self.height.saturating_sub(top)) {
            let row = &other.pixels[y * other.width..][..width];
            self.pixels[(top + y) * self.width + left..][..width].copy_from_slice(row);
        }
    }

    /// Writes a line of text, its letters `scale` times their size of 8 by 8 pixels.
    pub fn caption(&mut self, text: &str, left: usize, top: usize, scale: usize) {
        for (place, letter) in text.chars().enumerate() {
            for (row, bits) in glyph(letter).into_iter().enumerate() {
                for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                    let x = left + (place * 8 + column) * scale;
                    let dot = Self::new(scale, scale, [30; 3]);
                    self.paste(&dot, x, top + row * scale);
                }
            }
        }
    }
}

/// The rows of a letter from top to bottom, the left column in bit 0; empty for one that the font lacks.
fn glyph(letter: char) -> [u8; 8] {
    let basic = font8x8::BASIC_FONTS.get(letter);
    basic.or_else(|| font8x8::GREEK_FONTS.get(letter)).unwrap_or_default()
}

/// The pixels of an old row of `old` that a pixel of a new row of `new` covers: at least one.
fn covered(place: usize, new: usize, old: usize) -> std::ops::Range<usize> {
    let start = (place * old / new).min(old.saturating_sub(1));
    start..((place + 1) * old / new).max(start + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_averages_and_pasting_cuts_off() {
        let mut image = Image::new(4, 2, [0; 3]);
        image.paste(&Image::new(9, 9, [200; 3]), 2, 0);
        assert_eq!(image.resized(2, 1).pixels, [[0; 3], [200; 3]]);
        assert_eq!(image.resized(1, 1).pixels, [[100; 3]]);
        assert_eq!(image.resized(8, 1).pixels[3..5], [[0; 3], [200; 3]]);
    }

    #[test]
    fn a_picture_survives_its_file() -> Result<(), Error> {
        let mut image = Image::new(40, 12, [255; 3]);
        image.caption("X 1.5", 2, 2, 1);
        let path = std::env::temp_dir().join(format!("xtask-image-{}.png", std::process::id()));
        image.write(&path)?;
        let read = Image::read(&path);
        std::fs::remove_file(&path).map_err(Error::file(&path))?;
        assert_eq!(read?.pixels, image.pixels);
        Ok(())
    }
}
