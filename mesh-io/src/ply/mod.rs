//! PLY as text and in both byte orders.

mod ascii;
mod header;
mod positions;
mod read;
mod rows;
mod write;

pub(crate) use read::{Origin, PlyReader, read_mesh};
pub(crate) use write::{Encoding, PlySink, Rows, write_mesh};
