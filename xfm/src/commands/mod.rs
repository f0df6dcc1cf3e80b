//! The commands, one module each: its arguments, its report, and its `run`.

pub mod diff;
