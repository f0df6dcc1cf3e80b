//! The command line.

use std::path::PathBuf;

use clap::Parser;
use mergetree::{Camera, Dependencies, ViewTest};
use vk_render::{ContextOptions, DeviceChoice};
use xfm_pager::{PagerOptions, SessionOptions};

use crate::camera::standard::Up;
use crate::model::{Cache, Opener};
use crate::state::{By, DetailChoice, Look, State};

const EXAMPLES: &str = "\
Examples:
  xfm-view scan.xfm                                     look at a file in a window
  xfm-view scan.ply --shading wireframe                 any mesh, built first while the window shows how far it is
  xfm-view scan.xfm --view '0,0,5 0,0,0 0,1,0'          from a view that was copied with Ctrl+C
  xfm-view scan.xfm --path walk.txt                     with a recorded path to replay (Y)
  xfm-view scan.xfm --offscreen picture.png --pixels 1  one picture, no window
  xfm-view scan.xfm --offscreen frames --frames 120     a flight: frames/frame_0000.png …, frames/frames.json

In the window: drag to turn, drag with the right button to move, scroll to zoom; ? shows all keys. Files can be dropped
on it.

A path is a text file with a pose on each line, nine numbers: eye x y z, at x y z, up x y z (the last three may be left out),
relative to the file's origin; # begins a comment. The window records 30 poses a second (R); xfm fly --path reads the same.

A mesh of 64 MiB and more is built into a .xfm file beside it, which is used again; a smaller one into a temporary file.";

/// Looks at a .xfm file, or at any mesh, at the level of detail each view needs
#[derive(Debug, Parser)]
#[command(name = "xfm-view", version, after_help = EXAMPLES)]
pub(crate) struct Args {
    /// A .xfm file, or a mesh (STL, PLY, OBJ, glTF; .gz and .zst too); without one the window waits for a file to be dropped
    pub(crate) file: Option<PathBuf>,
    /// Draw without a window: into a PNG file, or frame by frame into a folder, with frames.json and frames.csv
    #[arg(long, value_name = "PNG|DIR")]
    pub(crate) offscreen: Option<PathBuf>,
    /// Camera path: `orbit`, or a file with a pose on each line, as below
    #[arg(long, default_value = "orbit", value_name = "orbit|FILE")]
    pub(crate) path: PathBuf,
    /// Look from here first: a view as the window copies it, nine numbers for eye, point looked at and up
    #[arg(long, value_name = "VIEW", allow_hyphen_values = true)]
    pub(crate) view: Option<String>,
    /// Frames of a flight
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) frames: u32,
    /// Size of the picture or window
    #[arg(long, default_value = "1280x720", value_parser = size, value_name = "WxH")]
    pub(crate) size: (u32, u32),
    /// Tolerance: error in pixels
    #[arg(long, default_value_t = 1.0, value_parser = positive, conflicts_with = "budget")]
    pub(crate) pixels: f32,
    /// Hold a number of triangles instead; the tolerance follows
    #[arg(long, value_name = "TRIANGLES")]
    pub(crate) budget: Option<usize>,
    /// Hold a time per frame instead, in milliseconds; the tolerance follows
    #[arg(long, value_name = "MS", value_parser = positive, conflicts_with_all = ["budget", "pixels"])]
    pub(crate) frame_ms: Option<f32>,
    /// How triangles are coloured; by the model's own colours where it has any, else smooth, unless told
    #[arg(long, value_enum)]
    pub(crate) shading: Option<Look>,
    /// Which axis points upwards
    #[arg(long, value_enum, default_value_t = Up::Y)]
    pub(crate) up: Up,
    /// Also draw every frame from outside, with the frustum of the camera
    #[arg(long, requires = "offscreen")]
    pub(crate) outside: bool,
    /// Draw the window's panels into the pictures: what a frame shows and took
    #[arg(long, requires = "offscreen")]
    pub(crate) overlay: bool,
    /// Keep no detail but that of the first frame, while the camera goes on
    #[arg(long, requires = "offscreen")]
    pub(crate) freeze: bool,
    /// Cut the model open: how much is cut away along the line of sight, 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub(crate) section: Option<f32>,
    /// Write a line of JSON per frame: what it showed, what it took
    #[arg(long, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
    /// Where the hierarchy of a mesh is kept
    #[arg(long, value_enum, default_value_t = Cache::Auto)]
    pub(crate) cache: Cache,
    /// Samples per pixel for smooth edges: 1, 2, 4 or 8; 4, and 1 in a window without a graphics card
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<u32>,
    /// Bytes of nodes that are kept without need, as 256MiB
    #[arg(long, value_parser = bytes, value_name = "SIZE")]
    pub(crate) soft_quota: Option<usize>,
    /// Bytes of nodes that are never exceeded, as 1GiB
    #[arg(long, value_parser = bytes, value_name = "SIZE")]
    pub(crate) hard_quota: Option<usize>,
    /// Let triangles depend on connectivity alone: fewer of them, some may fold over
    #[arg(long)]
    pub(crate) links_only: bool,
    /// Compare with a pixel how large that is which changes, as the paper does, not how far the surface moves
    #[arg(long)]
    pub(crate) radius_test: bool,
    /// Draw on the device whose name contains this; `software` for a driver without hardware
    #[arg(long, value_name = "NAME")]
    pub(crate) device: Option<String>,
    /// Run under the validation layer and fail if it has anything to say
    #[arg(long)]
    pub(crate) validation: bool,
    /// Leave after so many frames; for tests
    #[arg(long, value_name = "N", hide = true)]
    pub(crate) quit_after: Option<u64>,
    /// Act in this frame as if the device were lost; for tests
    #[arg(long, value_name = "N", hide = true)]
    pub(crate) lose_device: Option<u64>,
}

impl Args {
    /// What the viewer begins with.
    pub(crate) fn state(&self) -> State {
        let mut detail = DetailChoice { pixels: self.pixels, ..DetailChoice::default() };
        if let Some(budget) = self.budget {
            (detail.by, detail.budget) = (By::Triangles, budget);
        } else if let Some(ms) = self.frame_ms {
            (detail.by, detail.frame_ms) = (By::Time, ms);
        }
        let pager = self.pager_options();
        let quotas = [pager.soft_quota_bytes, pager.hard_quota_bytes];
        let mut state = State::new(self.lens(), detail, self.shading, quotas);
        state.navigator.set_up(self.up, &state.lens);
        if let Some(depth) = self.section {
            state.section.depth = depth;
        }
        state
    }

    pub(crate) fn opener(&self) -> Opener {
        let mut session = SessionOptions::default();
        if self.links_only {
            session.dependencies = Dependencies::Links;
        }
        if self.radius_test {
            session.test = ViewTest::Radius;
        }
        let mut pager = self.pager_options();
        if self.offscreen.is_some() {
            // Pictures are the same on every machine: a frame waits for what it needs, and does all there is to do.
            session.max_updates = usize::MAX;
            session.max_update_time = std::time::Duration::MAX;
            pager.pages_per_frame = usize::MAX;
        } else {
            pager.loaders = PagerOptions::loaders_for_this_machine();
        }
        Opener { pager, session, cache: self.cache }
    }

    fn pager_options(&self) -> PagerOptions {
        let mut options = PagerOptions::default();
        if let Some(hard) = self.hard_quota {
            options.hard_quota_bytes = hard;
            options.soft_quota_bytes = options.soft_quota_bytes.min(hard);
        }
        if let Some(soft) = self.soft_quota {
            options.soft_quota_bytes = soft.min(options.hard_quota_bytes);
        }
        options
    }

    pub(crate) fn context_options(&self) -> ContextOptions {
        let mut options = ContextOptions::default();
        options.validation = self.validation;
        options.max_samples = self.samples.unwrap_or(options.max_samples);
        options.device = match self.device.as_deref() {
            None => DeviceChoice::Fastest,
            Some("software") => DeviceChoice::Software,
            Some(name) => DeviceChoice::Name(name.to_owned()),
        };
        options
    }

    /// The camera but for where it is.
    pub(crate) fn lens(&self) -> Camera {
        Camera { width: self.size.0, height: self.size.1, ..Camera::default() }
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |side: &str| side.parse().ok().filter(|side| (1..=16384).contains(side));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| "a size is WIDTHxHEIGHT in pixels, each 1 to 16384, as 1280x720".to_owned())
}

fn positive(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|value: &f32| *value > 0.0 && value.is_finite())
        .ok_or_else(|| "a number above zero is needed".to_owned())
}

fn share(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|value: &f32| (0.0..=1.0).contains(value))
        .ok_or_else(|| "a number from 0 to 1 is needed".to_owned())
}

fn bytes(text: &str) -> Result<usize, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let shift = match unit.to_ascii_lowercase().trim_end_matches("ib").trim_end_matches('b') {
        "" => 0,
        "k" => 10,
        "m" => 20,
        "g" => 30,
        "t" => 40,
        _ => return Err("units are KiB, MiB, GiB and TiB".to_owned()),
    };
    number
        .parse::<usize>()
        .ok()
        .and_then(|n| n.checked_mul(1 << shift))
        .ok_or_else(|| "a size is a whole number with a unit, as 256MiB".to_owned())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn sizes_are_read() {
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert!(size("0x7").is_err() && size("12").is_err() && size("99999x1").is_err());
        assert_eq!(bytes("64MiB"), Ok(64 << 20));
        assert_eq!(bytes("2g"), Ok(2 << 30));
        assert_eq!(bytes("12"), Ok(12));
        assert!(bytes("x").is_err() && bytes("1PiB").is_err());
    }
}
