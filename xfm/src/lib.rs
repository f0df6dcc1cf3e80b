//! The `xfm` command line as a library: one module per command, and what they share.

pub mod distance;
