//! The picture: four views, and below each the same moment from outside.

use std::path::Path;

use super::frames::Frame;
use crate::Error;
use crate::picture::Image;

const COLUMNS: usize = 4;
/// Size of one picture on the sheet, and the space between two.
const CELL: [usize; 2] = [480, 360];
const GAP: usize = 8;
/// Room for the captions.
const CAPTION: usize = 34;

/// Composes the sheet from a folder of frames and writes it.
///
/// `pixels` is the tolerance that was asked for, used where a frame does not tell its own.
pub fn compose(folder: &Path, frames: &[Frame], pixels: f64, to: &Path) -> Result<(), Error> {
    let [width, height] = CELL;
    let mut sheet =
        Image::new(COLUMNS * (width + GAP) + GAP, 2 * (height + GAP) + GAP + CAPTION, [255; 3]);
    for (column, index) in chosen(frames.len()).into_iter().enumerate() {
        let left = GAP + column * (width + GAP);
        for (row, view) in ["frame", "outside"].into_iter().enumerate() {
            let picture = Image::read(&folder.join(format!("{view}_{index:04}.png")))?;
            sheet.paste(&picture.resized(width, height), left, GAP + row * (height + GAP));
        }
        let frame = &frames[index];
        let tolerance = frame.pixels.unwrap_or(pixels);
        let text = format!("τ = {tolerance:.2} px  Δ = {:.0}", frame.triangles_shown);
        sheet.caption(&text, left + 4, 2 * (height + GAP) + GAP + 6, 2);
    }
    sheet.write(to)
}

/// Where on the path the pictures are from, as shares of it: the orbit comes close to the model a
/// quarter and three quarters of the way.
const PLACES: [f64; COLUMNS] = [0.17, 0.29, 0.67, 0.81];

/// The frames to show; fewer of a short path.
fn chosen(num_frames: usize) -> Vec<usize> {
    let mut frames: Vec<usize> = PLACES
        .iter()
        .map(|place| (place * num_frames as f64) as usize)
        .filter(|&frame| frame < num_frames)
        .collect();
    frames.dedup();
    frames
}

#[cfg(test)]
mod tests {
    use super::chosen;

    #[test]
    fn chosen_frames_exist_and_differ() {
        assert_eq!(chosen(40), [6, 11, 26, 32]);
        assert_eq!(chosen(2), [0, 1]);
        assert_eq!(chosen(1), [0]);
        assert_eq!(chosen(0), [0_usize; 0]);
    }
}
