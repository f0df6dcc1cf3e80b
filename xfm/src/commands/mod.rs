//! The commands, one module each: its arguments, its report, and its `run`.

pub mod build;
pub mod decimate;
pub mod diff;
pub mod extract;
pub mod fly;
pub mod info;
pub mod verify;
