//! Writing glTF: one node, one mesh, one buffer.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::malformed;
use crate::codec::output::{BoxedOutput, Pen};
use crate::codec::weld::Welder;
use crate::{Error, Frame, IndexedMesh, Triangle, TriangleSink};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const TRIANGLES: u32 = 4;

/// Bytes of a position and of a triangle's indices alike; a multiple of three, so that base64 needs no padding, and of
/// four, so that everything in the buffer is aligned.
const ITEM_BYTES: usize = 12;

const DATA_URI: &str = "data:application/octet-stream;base64,";

/// What the JSON lies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Container {
    /// A `.gltf` with its buffer inside, in base64.
    Json,
    /// A `.glb`.
    Binary,
}

/// The whole mesh. A mesh without triangles becomes a file without a scene, since the format
/// has no empty lists.
pub(crate) fn write_mesh<W: Write>(
    pen: &mut Pen<W>,
    mesh: &IndexedMesh,
    container: Container,
) -> Result<(), Error> {
    let bytes = (mesh.positions.len() as u64 + mesh.triangles.len() as u64) * ITEM_BYTES as u64;
    let bytes = if mesh.triangles.is_empty() { 0 } else { bytes };
    let json = describe(mesh, bytes, container, pen.name())?.to_string();
    match container {
        Container::Json => {
            // The data goes between the address's prefix and whatever follows it.
            let cut = json.find(DATA_URI).map_or(json.len(), |at| at + DATA_URI.len());
            let (before, after) = json.split_at(cut);
            pen.bytes(before.as_bytes())?;
            if bytes > 0 {
                put_buffer(pen, mesh, |out, item| {
                    let mut text = [0; ITEM_BYTES / 3 * 4];
                    // The sizes are constants that match.
                    let length = STANDARD.encode_slice(item, &mut text).unwrap_or(0);
                    out.extend_from_slice(&text[..length]);
                })?;
            }
            pen.bytes(after.as_bytes())?;
        }
        Container::Binary => {
            let padding = json.len().wrapping_neg() % 4;
            let json_bytes = (json.len() + padding) as u64;
            let bin_chunk = if bytes > 0 { 8 + bytes } else { 0 };
            let total =
                u32::try_from(12 + 8 + json_bytes + bin_chunk).map_err(|_| Error::TooLarge {
                    name: pen.name().to_owned(),
                    what: "bytes in a .glb",
                    limit: u64::from(u32::MAX),
                })?;
            // Both parts are smaller than the total, which fits.
            let (json_bytes, bytes) = (json_bytes as u32, bytes as u32);
            pen.put(|out| {
                out.extend_from_slice(b"glTF");
                out.extend_from_slice(&2u32.to_le_bytes());
                out.extend_from_slice(&total.to_le_bytes());
                out.extend_from_slice(&json_bytes.to_le_bytes());
                out.extend_from_slice(b"JSON");
                out.extend_from_slice(json.as_bytes());
                out.extend_from_slice(&b"   "[..padding]);
                if bytes > 0 {
                    out.extend_from_slice(&bytes.to_le_bytes());
                    out.extend_from_slice(b"BIN\0");
                }
                Ok(())
            })?;
            if bytes > 0 {
                put_buffer(pen, mesh, |out, item| out.extend_from_slice(item))?;
            }
        }
    }
    pen.flush()
}

/// Positions, then indices, item by item.
fn put_buffer<W: Write>(
    pen: &mut Pen<W>,
    mesh: &IndexedMesh,
    put: impl Fn(&mut Vec<u8>, &[u8; ITEM_BYTES]),
) -> Result<(), Error> {
    let positions = mesh.positions.iter().map(|p| p.to_array().map(f32::to_le_bytes));
    let triangles = mesh.triangles.iter().map(|t| t.map(u32::to_le_bytes));
    for words in positions.chain(triangles) {
        let mut item = [0; ITEM_BYTES];
        item.copy_from_slice(words.as_flattened());
        pen.put(|out| {
            put(out, &item);
            Ok(())
        })?;
    }
    Ok(())
}

fn describe(
    mesh: &IndexedMesh,
    bytes: u64,
    container: Container,
    name: &str,
) -> Result<Value, Error> {
    if let Some(vertex) = mesh.positions.iter().position(|position| !position.is_finite()) {
        return Err(malformed(
            name,
            format!("vertex {vertex} is not finite, which glTF cannot hold"),
            "remove it, or write PLY",
        ));
    }
    let asset = json!({ "version": "2.0", "generator": "mesh-io" });
    let (Some((low, high)), true) = (mesh.bounds(), bytes > 0) else {
        return Ok(json!({ "asset": asset }));
    };
    let split = (mesh.positions.len() * ITEM_BYTES) as u64;
    let buffer = match container {
        Container::Json => json!({ "byteLength": bytes, "uri": DATA_URI }),
        Container::Binary => json!({ "byteLength": bytes }),
    };
    Ok(json!({
        "asset": asset,
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{
            "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "mode": TRIANGLES }]
        }],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": FLOAT,
                "count": mesh.positions.len(),
                "type": "VEC3",
                "min": low.to_array(),
                "max": high.to_array()
            },
            {
                "bufferView": 1,
                "componentType": UNSIGNED_INT,
                "count": 3 * mesh.triangles.len(),
                "type": "SCALAR"
            }
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": split, "target": ARRAY_BUFFER },
            {
                "buffer": 0,
                "byteOffset": split,
                "byteLength": bytes - split,
                "target": ELEMENT_ARRAY_BUFFER
            }
        ],
        "buffers": [buffer]
    }))
}

/// Gathers a stream of triangles, welded, and writes it at the end.
pub(crate) struct GltfSink<'a> {
    pen: Pen<BoxedOutput<'a>>,
    frame: Frame,
    mesh: IndexedMesh,
    welder: Welder,
    container: Container,
}

impl<'a> GltfSink<'a> {
    pub(crate) fn new(
        output: BoxedOutput<'a>,
        name: &str,
        frame: Frame,
        container: Container,
    ) -> Self {
        Self {
            pen: Pen::new(output, name),
            frame,
            mesh: IndexedMesh::default(),
            welder: Welder::exact(),
            container,
        }
    }
}

impl TriangleSink for GltfSink<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
        for triangle in triangles {
            let mut face = [0; 3];
            for (index, &position) in face.iter_mut().zip(triangle) {
                let Some((vertex, new)) = self.welder.weld(position) else {
                    return Err(Error::TooLarge {
                        name: self.pen.name().to_owned(),
                        what: "vertices",
                        limit: self.welder.num_vertices(),
                    });
                };
                if new {
                    self.mesh.positions.push(self.frame.to_single(position));
                }
                *index = vertex;
            }
            self.mesh.triangles.push(face);
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), Error> {
        write_mesh(&mut self.pen, &self.mesh, self.container)?;
        self.pen.commit()
    }
}
