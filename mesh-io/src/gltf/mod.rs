//! glTF 2.0, as JSON and in its binary container.

mod accessor;
mod buffers;
mod read;
mod write;

pub(crate) use read::read_mesh;
pub(crate) use write::{Container, GltfSink, write_mesh};

use crate::{Error, Place};

const EXPORT_AGAIN: &str = "export the scene again";

fn malformed(name: &str, problem: String, remedy: &'static str) -> Error {
    Error::Malformed { name: name.to_owned(), place: Place::File, problem, remedy }
}
