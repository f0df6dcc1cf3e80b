//! The `xfm` command line as a library: one module per command in [`commands`], and what they share.
//!
//! The binary is nothing but [`run`]. The one part with a use of its own is [`distance`], the two-sided distance between
//! surfaces that `xfm diff` reports:
//!
//! ```
//! use glam::DVec3;
//! use xfm::distance::{DistanceOptions, Surface, measure};
//!
//! let corners = |z| vec![DVec3::new(0.0, 0.0, z), DVec3::new(1.0, 0.0, z), DVec3::new(0.0, 1.0, z)];
//! let low = Surface::new(corners(0.0), vec![[0, 1, 2]])?;
//! let high = Surface::new(corners(2.0), vec![[0, 1, 2]])?;
//! let options = DistanceOptions { samples: 100, ..DistanceOptions::default() };
//! let report = measure(&low, &high, &options)?;
//! assert!((report.a_to_b.max - 2.0).abs() < 1e-12);
//! # Ok::<(), xfm::distance::DistanceError>(())
//! ```

pub mod commands;
pub mod distance;
pub mod full;
pub mod interrupt;
pub mod level;
pub mod mapped;
pub mod memory;
pub mod mesh_file;
pub mod mesh_stream;
pub mod pipe;
pub mod progress;
pub mod repaired;
pub mod report;
pub mod same_colours;
pub mod same_soup;
pub mod same_surface;
pub mod spread;
pub mod text;
pub mod threads;
pub mod values;
pub mod writable;
pub mod xfm_file;

mod cli;
mod error;

pub use cli::run;
pub use error::{Error, one_line};
