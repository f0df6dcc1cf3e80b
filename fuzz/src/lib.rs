//! Fuzz targets for everything that reads files, and the engine that runs them on a stable compiler.
//!
//! A [`Target`] has valid files to begin with, a way to change them that knows their format, and a check. The engine changes,
//! runs, and keeps what reaches new code: `cargo xtask fuzz` builds it with counters on the edges of the control flow
//! ([`coverage`]); without them, as in the smoke run of `cargo xtask test`, it changes the files that it began with.
//!
//! What a case must not do: panic, take longer than [`engine::TIME_LIMIT`], or take more memory than the target states for
//! a file of its size ([`memory`]). A case that did is a file in `cases/TARGET/`, which a test runs ever after.

pub mod coverage;
pub mod engine;
pub mod memory;
pub mod mutate;
pub mod random;
pub mod target;
pub mod targets;
pub mod xfm_parts;

pub use target::Target;
