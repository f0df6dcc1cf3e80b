//! The command line.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use mergetree::{Camera, Dependencies};
use vk_render::{ContextOptions, DeviceChoice, Shading};
use xfm_pager::{Detail, PagerOptions};

const EXAMPLES: &str = "\
Examples:
  xfm-view scan.xfm                                     look at a file in a window
  xfm-view scan.ply --shading wireframe                 any mesh, built into a temporary file first
  xfm-view scan.xfm --offscreen picture.png --pixels 1  one picture, no window
  xfm-view scan.xfm --offscreen frames --frames 120     a flight: frames/frame_0000.png …, frames/frames.json

In the window: drag to turn, drag with the right button to move, scroll to zoom; F1 shows the keys.";

/// Looks at a .xfm file, or at any mesh, at the level of detail each view needs
#[derive(Debug, Parser)]
#[command(name = "xfm-view", version, after_help = EXAMPLES)]
pub(crate) struct Args {
    /// A .xfm file, or a mesh (STL, PLY, OBJ, glTF) that is built into a temporary one
    pub(crate) file: PathBuf,
    /// Draw without a window: into a PNG file, or frame by frame into a folder
    #[arg(long, value_name = "PNG|DIR")]
    pub(crate) offscreen: Option<PathBuf>,
    /// Camera path: `orbit`, or a file with a line `eye x y z at x y z` per pose
    #[arg(long, default_value = "orbit", value_name = "orbit|FILE")]
    pub(crate) path: PathBuf,
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
    /// How triangles are coloured
    #[arg(long, value_enum, default_value_t = ShadingName::Smooth)]
    pub(crate) shading: ShadingName,
    /// Also draw every frame from outside, with the frustum of the camera
    #[arg(long, requires = "offscreen")]
    pub(crate) outside: bool,
    /// Write what a frame shows and took into its picture
    #[arg(long, requires = "offscreen")]
    pub(crate) overlay: bool,
    /// Bytes of nodes that are kept without need, as 256MiB
    #[arg(long, value_parser = bytes, value_name = "SIZE")]
    pub(crate) soft_quota: Option<usize>,
    /// Bytes of nodes that are never exceeded, as 1GiB
    #[arg(long, value_parser = bytes, value_name = "SIZE")]
    pub(crate) hard_quota: Option<usize>,
    /// Let triangles depend on connectivity alone: fewer of them, some may fold over
    #[arg(long)]
    pub(crate) links_only: bool,
    /// Draw on the device whose name contains this; `software` for a driver without hardware
    #[arg(long, value_name = "NAME")]
    pub(crate) device: Option<String>,
    /// Run under the validation layer and fail if it has anything to say
    #[arg(long)]
    pub(crate) validation: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ShadingName {
    Smooth,
    Flat,
    Wireframe,
    Lod,
    Normals,
}

impl Args {
    pub(crate) fn shading(&self) -> Shading {
        match self.shading {
            ShadingName::Smooth => Shading::Smooth,
            ShadingName::Flat => Shading::Flat,
            ShadingName::Wireframe => Shading::Wireframe,
            ShadingName::Lod => Shading::LevelOfDetail,
            ShadingName::Normals => Shading::Normals,
        }
    }

    pub(crate) fn detail(&self) -> Detail {
        self.budget.map_or(Detail::Pixels(self.pixels), Detail::Budget)
    }

    pub(crate) fn dependencies(&self) -> Dependencies {
        if self.links_only { Dependencies::Links } else { Dependencies::Order }
    }

    pub(crate) fn pager_options(&self) -> PagerOptions {
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
