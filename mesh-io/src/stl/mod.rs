//! STL, binary and as text.

mod read;
mod write;

pub(crate) use read::{StlReader, read_mesh};
pub(crate) use write::{AsciiSink, BinarySink, write_mesh};

/// Bytes before the first triangle of a binary file: 80 of free text and the count.
const HEADER_BYTES: usize = 84;

/// A normal, three corners, and a word of attributes.
const RECORD_BYTES: usize = 50;
