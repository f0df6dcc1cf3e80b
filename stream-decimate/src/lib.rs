//! Decimation of triangle streams of any length in a fixed buffer.
