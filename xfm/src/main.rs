//! The `xfm` binary.

fn main() {}
