//! Wavefront OBJ: positions and faces; everything else in it is passed over.

mod read;
mod write;

pub(crate) use read::{ObjReader, read_mesh};
pub(crate) use write::{ObjSink, write_mesh};
