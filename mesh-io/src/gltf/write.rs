//! Writing glTF: one node, one mesh, one buffer.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use serde_json::{Value, json};

use super::malformed;
use crate::codec::output::{BoxedOutput, Pen};
use crate::codec::weld::Welder;
use crate::{Error, Frame, IndexedMesh, IndexedSource, Triangle, TriangleSink};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const TRIANGLES: u32 = 4;

/// Bytes of a position, of a triangle's indices and of three colours alike; a multiple of three, so that base64 needs no padding, and of
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
    mesh: &mut dyn IndexedSource,
    container: Container,
    frame: Frame,
) -> Result<(), Error> {
    let colours = if mesh.has_colours() { mesh.num_vertices().div_ceil(3) } else { 0 };
    let items = mesh.num_vertices().saturating_add(mesh.num_triangles()).saturating_add(colours);
    let bytes = items * ITEM_BYTES as u64;
    let bytes = if mesh.num_triangles() == 0 { 0 } else { bytes };
    let bounds = bounds(mesh, frame, pen.name())?;
    let json = describe(mesh, bytes, bounds, container).to_string();
    match container {
        Container::Json => {
            // The data goes between the address's prefix and whatever follows it.
            let cut = json.find(DATA_URI).map_or(json.len(), |at| at + DATA_URI.len());
            let (before, after) = json.split_at(cut);
            pen.bytes(before.as_bytes())?;
            if bytes > 0 {
                put_buffer(pen, mesh, frame, |out, item| {
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
                put_buffer(pen, mesh, frame, |out, item| out.extend_from_slice(item))?;
            }
        }
    }
    pen.flush()
}

/// Positions, then indices, then colours if there are any, item by item.
fn put_buffer<W: Write>(
    pen: &mut Pen<W>,
    mesh: &mut dyn IndexedSource,
    frame: Frame,
    put: impl Fn(&mut Vec<u8>, &[u8; ITEM_BYTES]),
) -> Result<(), Error> {
    let mut put = |words: [[u8; 4]; 3]| {
        let mut item = [0; ITEM_BYTES];
        item.copy_from_slice(words.as_flattened());
        pen.put(|out| {
            put(out, &item);
            Ok(())
        })
    };
    mesh.each_position(&mut |positions| {
        let mut words =
            positions.iter().map(|&p| frame.to_single(p).to_array().map(f32::to_le_bytes));
        words.try_for_each(&mut put)
    })?;
    mesh.each_triangle(&mut |triangles| {
        triangles.iter().map(|t| t.map(u32::to_le_bytes)).try_for_each(&mut put)
    })?;
    // Three make an item; the last one may lack some.
    let (mut item, mut held) = ([[0; 4]; 3], 0);
    mesh.each_vertex(&mut |_, colours| {
        for &colour in colours {
            item[held] = colour;
            held += 1;
            if held == 3 {
                put(std::mem::take(&mut item))?;
                held = 0;
            }
        }
        Ok(())
    })?;
    if held > 0 { put(item) } else { Ok(()) }
}

/// Least and largest coordinates as they are written; without vertices not a range.
fn bounds(mesh: &mut dyn IndexedSource, frame: Frame, name: &str) -> Result<[Vec3; 2], Error> {
    let mut vertex = 0_u64;
    let [mut low, mut high] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    mesh.each_position(&mut |positions| {
        for position in positions.iter().map(|&position| frame.to_single(position)) {
            if !position.is_finite() {
                return Err(malformed(
                    name,
                    format!("vertex {vertex} is not finite, which glTF cannot hold"),
                    "remove it, or write PLY",
                ));
            }
            (low, high) = (low.min(position), high.max(position));
            vertex += 1;
        }
        Ok(())
    })?;
    Ok([low, high])
}

fn describe(
    mesh: &dyn IndexedSource,
    bytes: u64,
    [low, high]: [Vec3; 2],
    container: Container,
) -> Value {
    let asset = json!({ "version": "2.0", "generator": "mesh-io" });
    if bytes == 0 {
        return json!({ "asset": asset });
    }
    let split = mesh.num_vertices() * ITEM_BYTES as u64;
    let indices = mesh.num_triangles() * ITEM_BYTES as u64;
    let buffer = match container {
        Container::Json => json!({ "byteLength": bytes, "uri": DATA_URI }),
        Container::Binary => json!({ "byteLength": bytes }),
    };
    let mut attributes = json!({ "POSITION": 0 });
    let mut accessors = vec![
        json!({
            "bufferView": 0,
            "componentType": FLOAT,
            "count": mesh.num_vertices(),
            "type": "VEC3",
            "min": low.to_array(),
            "max": high.to_array()
        }),
        json!({
            "bufferView": 1,
            "componentType": UNSIGNED_INT,
            "count": 3 * mesh.num_triangles(),
            "type": "SCALAR"
        }),
    ];
    let mut views = vec![
        json!({ "buffer": 0, "byteOffset": 0, "byteLength": split, "target": ARRAY_BUFFER }),
        json!({
            "buffer": 0,
            "byteOffset": split,
            "byteLength": indices,
            "target": ELEMENT_ARRAY_BUFFER
        }),
    ];
    if mesh.has_colours() {
        attributes["COLOR_0"] = json!(2);
        accessors.push(json!({
            "bufferView": 2,
            "componentType": UNSIGNED_BYTE,
            "normalized": true,
            "count": mesh.num_vertices(),
            "type": "VEC4"
        }));
        views.push(json!({
            "buffer": 0,
            "byteOffset": split + indices,
            "byteLength": 4 * mesh.num_vertices(),
            "target": ARRAY_BUFFER
        }));
    }
    json!({
        "asset": asset,
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{
            "primitives": [{ "attributes": attributes, "indices": 1, "mode": TRIANGLES }]
        }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [buffer]
    })
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
        // What was gathered is in the frame of the file already.
        write_mesh(&mut self.pen, &mut &self.mesh, self.container, Frame::default())?;
        self.pen.commit()
    }
}
