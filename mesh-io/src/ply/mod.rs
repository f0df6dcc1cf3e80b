//! PLY as text and in both byte orders.

mod header;
mod positions;
mod read;
mod rows;
mod write;

pub(crate) use read::{Origin, PlyReader, read_mesh};
pub(crate) use write::{Encoding, PlySink, write_mesh};
