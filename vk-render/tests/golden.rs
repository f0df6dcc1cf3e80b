//! Pictures as they were when somebody last looked at them.
//!
//! Drivers round differently, so pictures are compared as an eye does from a step back: in blocks of 4 x 4 pixels. What has
//! changed on purpose is looked at and written anew by `XFM_BLESS=1 cargo test -p vk-render --test golden`.
#![cfg(target_os = "linux")]

mod display;

use display::viewer::{coloured_torus, command, torus};
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

const BLOCK: usize = 4;
/// Of 255, in the mean over all blocks, and in the worst of a thousand.
const MEAN: f64 = 1.5;
const WORST: f64 = 24.0;

struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

fn read(file: &Path) -> Picture {
    let open = File::open(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut reader = png::Decoder::new(BufReader::new(open)).read_info().expect("PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("pixels");
    let channels = info.color_type.samples();
    let rgb = bytes.chunks(channels).flat_map(|pixel| &pixel[..3]).copied().collect();
    Picture { width: info.width as usize, height: info.height as usize, rgb }
}

fn write(file: &Path, picture: &Picture) {
    let out = BufWriter::new(File::create(file).expect("a file"));
    let (width, height) = (picture.width as u32, picture.height as u32);
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&picture.rgb).expect("pixels");
    writer.finish().expect("a picture");
}

impl Picture {
    /// The mean colours of all blocks, row by row.
    fn blocks(&self) -> Vec<[f64; 3]> {
        let mut blocks = Vec::new();
        for top in (0..self.height).step_by(BLOCK) {
            for left in (0..self.width).step_by(BLOCK) {
                let (mut sum, mut pixels) = ([0.0; 3], 0.0);
                for y in top..(top + BLOCK).min(self.height) {
                    for x in left..(left + BLOCK).min(self.width) {
                        let at = 3 * (y * self.width + x);
                        (0..3).for_each(|k| sum[k] += f64::from(self.rgb[at + k]));
                        pixels += 1.0;
                    }
                }
                blocks.push(sum.map(|c| c / pixels));
            }
        }
        blocks
    }

    /// A part of it, from its upper left corner.
    fn part(&self, left: usize, top: usize, width: usize, height: usize) -> Self {
        let rows = (top..top + height).flat_map(|y| {
            let at = 3 * (y * self.width + left);
            &self.rgb[at..at + 3 * width]
        });
        Self { width, height, rgb: rows.copied().collect() }
    }
}

fn compare(name: &str, seen: &Picture) {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.png"));
    if std::env::var_os("XFM_BLESS").is_some() {
        write(&file, seen);
        return;
    }
    let known = read(&file);
    assert_eq!((seen.width, seen.height), (known.width, known.height), "{name}");
    let mut apart: Vec<f64> = seen
        .blocks()
        .iter()
        .zip(known.blocks())
        .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max))
        .collect();
    let mean = apart.iter().sum::<f64>() / apart.len() as f64;
    apart.sort_by(f64::total_cmp);
    let worst = apart[apart.len() - 1 - apart.len() / 1000];
    let kept = std::env::temp_dir().join(format!("xfm-golden-{name}.png"));
    if mean > MEAN || worst > WORST {
        write(&kept, seen);
    }
    assert!(
        mean <= MEAN && worst <= WORST,
        "{name} looks different: by {mean:.2} in the mean, {worst:.1} in places; it is now {}",
        kept.display()
    );
}

/// Runs the viewer offscreen, under the validation layer, and reads the picture.
fn picture(folder: &Path, size: &str, args: &[&str]) -> Picture {
    let out = folder.join("out.png");
    let output = command(folder)
        .args(["torus.xfm", "--offscreen", "out.png", "--validation", "--size", size])
        .args(args)
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    read(&out)
}

/// A folder with a hierarchy in it: of so few triangles that all which are seen can be shown, so that pictures do not depend on
/// which are chosen.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    torus(&folder.path().join("torus.ply"), 54, 36);
    let args = ["torus.ply", "--cache", "beside", "--offscreen", "first.png", "--size", "16x16"];
    let built = command(folder.path()).args(args).output().expect("it runs");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let names = ["torus.ply.xfm", "torus.xfm"].map(|name| folder.path().join(name));
    std::fs::rename(&names[0], &names[1]).expect("another name");
    folder
}

#[test]
fn every_shading_looks_as_it_did() {
    let folder = folder();
    for shading in ["smooth", "flat", "wireframe", "lod", "residency", "normals"] {
        let view = ["--view", "1.5,1.6,2.4 0,-0.1,0", "--pixels", "0.01", "--shading", shading];
        compare(shading, &picture(folder.path(), "240x160", &view));
    }
}

/// Which block has which colour is the file's affair; that there are many is not.
#[test]
fn blocks_have_many_colours_and_clay_has_one() {
    let folder = folder();
    let hues = |shading: &str| {
        let view = ["--view", "1.5,1.6,2.4 0,-0.1,0", "--pixels", "0.01", "--shading", shading];
        let picture = picture(folder.path(), "240x160", &view);
        let mut seen: Vec<[u8; 3]> = Vec::new();
        for pixel in picture.rgb.chunks(3) {
            // By the order of the channels and how far apart they are, whatever the light.
            let most = f32::from(*pixel.iter().max().expect("three").max(&1));
            let share = [0, 1, 2].map(|k| (6.0 * f32::from(pixel[k]) / most) as u8);
            if !seen.contains(&share) {
                seen.push(share);
            }
        }
        seen.len()
    };
    let (blocks, clay) = (hues("blocks"), hues("smooth"));
    assert!(blocks > 2 * clay && blocks > 30, "{blocks} and {clay}");
}

#[test]
fn sections_and_frozen_detail_look_as_they_did() {
    let folder = folder();
    let section = ["--view", "1.5,1.6,2.4 0,-0.1,0", "--pixels", "0.01", "--section", "0.45"];
    compare("section", &picture(folder.path(), "240x160", &section));
    let outside = ["--view", "1.6,0.5,0.9 1,0,0", "--outside", "--pixels", "0.5"];
    picture(folder.path(), "240x160", &outside);
    compare("outside", &read(&folder.path().join("out.outside.png")));
}

#[test]
fn a_model_with_colours_shows_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let properties = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let stripes = |u: f32, _: f32| {
        if ((6.0 * u) as u32).is_multiple_of(2) { [230, 60, 40] } else { [40, 90, 220] }
    };
    let file = folder.path().join("torus.ply");
    coloured_torus(&file, 54, 36, properties, |u, v| stripes(u, v).to_vec());
    let seen = |name: &str, more: &[&str]| {
        let args = ["torus.ply", "--offscreen", name, "--validation", "--size", "240x160"];
        let view = ["--view", "1.5,1.6,2.4 0,-0.1,0", "--pixels", "0.01"];
        let output = command(folder.path()).args(args).args(view).args(more).output();
        let output = output.expect("it runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        read(&folder.path().join(name))
    };
    let own = seen("own.png", &[]);
    let told = seen("told.png", &["--shading", "colours"]);
    assert_eq!(own.rgb, told.rgb, "they are what is shown unless told otherwise");
    compare("colours", &own);
    let clay = seen("clay.png", &["--shading", "smooth"]);
    let blue = |p: &Picture| {
        p.rgb.chunks(3).filter(|p| p[2] > 80 && p[2].saturating_sub(p[0]) > 60).count()
    };
    assert!(blue(&own) > 2000 && blue(&clay) == 0, "{} and {}", blue(&own), blue(&clay));
}

/// Only what shows no times: the bar, and the controls on the left.
#[test]
fn panels_look_as_they_did() {
    let folder = folder();
    let view = ["--view", "1.5,1.6,2.4 0,-0.1,0", "--pixels", "0.2"];
    let args = ["--overlay", "--section", "0.4", view[0], view[1], view[2], view[3]];
    for (size, name) in [("1280x720", "panels-720"), ("1920x1080", "panels-1080")] {
        let seen = picture(folder.path(), size, &args);
        compare(name, &seen.part(0, 0, 640, 460));
    }
}

#[test]
fn a_flight_is_written_frame_by_frame() {
    let folder = folder();
    let output = command(folder.path())
        .args(["torus.xfm", "--offscreen", "frames", "--frames", "3", "--size", "64x48"])
        .args(["--validation", "--log", "log.jsonl"])
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a file");
    let frames: serde_json::Value =
        serde_json::from_str(&text("frames/frames.json")).expect("JSON");
    let frames = frames.as_array().expect("a list");
    let csv = text("frames/frames.csv");
    assert_eq!((frames.len(), csv.lines().count(), text("log.jsonl").lines().count()), (3, 4, 3));
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!(frame["frame"], i);
        assert!(frame["triangles_shown"].as_u64() > Some(100));
        let picture = read(&folder.path().join(format!("frames/frame_{i:04}.png")));
        assert_eq!((picture.width, picture.height), (64, 48));
    }
    assert!(csv.starts_with("frame,"), "{csv}");
}
