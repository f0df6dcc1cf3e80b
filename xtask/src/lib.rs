//! The project's own commands, called as `cargo xtask COMMAND`.
//!
//! [`generate`] makes deterministic test meshes of any size in constant memory; the other modules
//! are one command each.
//!
//! ```
//! use xtask::generate::{Generator, Options, Shape};
//!
//! let mut options = Options::new(Shape::Torus, 1_000);
//! options.seed = 7;
//! let generator = Generator::new(&options)?;
//! let mut count = 0;
//! generator.triangles(&mut |chunk| {
//!     count += chunk.len() as u64;
//!     Ok(())
//! })?;
//! assert_eq!(count, generator.num_triangles());
//! # Ok::<(), xtask::Error>(())
//! ```

pub mod bench;
pub mod chart;
pub mod command_line;
pub mod compare;
pub mod conformance;
pub mod demo;
mod error;
pub mod fuzz;
// `gen` is a keyword of the 2024 edition, so the module has the verb's whole name.
#[path = "gen/mod.rs"]
pub mod generate;
pub mod load;
mod picture;
pub mod process;
pub mod setup;
pub mod test;

pub use error::Error;
