//! The xfm command line: build, info, verify, extract, diff, fly.
