//! Reading glTF: every mesh of the default scene, where its nodes put it.

use std::io::Read;
use std::path::Path;

use glam::{DMat4, Mat4, Vec3};
use gltf::mesh::Mode;
use gltf::{Document, Mesh, Node, Primitive};

use super::buffers::{Buffers, split};
use super::{EXPORT_AGAIN, accessor, malformed};
use crate::codec::input::Input;
use crate::codec::quote::{printable, quote};
use crate::mesh::WHITE;
use crate::{Error, IndexedMesh, Place};

/// Required extensions that say nothing about where triangles are, or that we know.
const HARMLESS: [&str; 7] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_mesh_quantization",
    "EXT_texture_",
    "MSFT_texture_",
];

/// Bytes of a mesh that are believed of each byte of file. Nodes may show the same mesh as often as they like, and meshes the
/// same data; a small file could fill any memory.
const MAX_EXPANSION: u64 = 1024;
/// Bytes of a vertex, and of a triangle.
const ITEM_BYTES: u64 = 12;

/// The whole scene as one mesh; other files are looked for in `folder`.
pub(crate) fn read_mesh<R: Read>(
    mut input: Input<R>,
    folder: Option<&Path>,
) -> Result<IndexedMesh, Error> {
    let file = input.read_to_end()?;
    let name = input.name();
    if file.is_empty() {
        return Err(input.empty());
    }
    let (json, bin) = split(&file, name)?;
    let document = parse(json, name)?;
    let mut scene = SceneReader {
        buffers: Buffers::new(name, folder, bin, file.len() as u64),
        mesh: IndexedMesh::default(),
        seen: vec![false; document.nodes().len()],
    };
    scene.read(&document)?;
    Ok(scene.mesh)
}

fn parse(json: &[u8], name: &str) -> Result<Document, Error> {
    let mut root: gltf::json::Root =
        gltf::json::deserialize::from_slice(json).map_err(|error| {
            if error.is_eof() {
                Error::Truncated {
                    name: name.to_owned(),
                    place: Place::Line(error.line() as u64),
                    missing: "the JSON is complete".to_owned(),
                }
            } else {
                Error::Malformed {
                    name: name.to_owned(),
                    place: Place::Line(error.line() as u64),
                    problem: printable(&format!("not the JSON of a glTF: {error}")),
                    remedy: EXPORT_AGAIN,
                }
            }
        })?;
    root.extensions_required
        .retain(|extension| !HARMLESS.iter().any(|harmless| extension.starts_with(harmless)));
    if let Some(extension) = root.extensions_required.first() {
        return Err(malformed(
            name,
            format!(
                "it needs the extension {}, which is not known here",
                quote(extension.as_bytes())
            ),
            "export the scene without it (without compression)",
        ));
    }
    // The validation below takes this for granted.
    for (at, mesh) in root.meshes.iter().enumerate() {
        for source in mesh.primitives.iter().flat_map(|primitive| primitive.attributes.values()) {
            if source.value() >= root.accessors.len() {
                let problem =
                    format!("mesh {at} names accessor {}, which is not there", source.value());
                return Err(malformed(name, problem, EXPORT_AGAIN));
            }
        }
    }
    // Bounds are asked for by the format but not needed by us, and often left out.
    for accessor in &mut root.accessors {
        accessor.min.get_or_insert_with(|| vec![0.0f32; 3].into());
        accessor.max.get_or_insert_with(|| vec![0.0f32; 3].into());
    }
    Document::from_json(root).map_err(|error| {
        let problem = match error {
            gltf::Error::Validation(faults) => match faults.first() {
                Some((path, fault)) => format!("{path}: {fault}"),
                None => "invalid".to_owned(),
            },
            error => error.to_string(),
        };
        malformed(name, printable(&problem), EXPORT_AGAIN)
    })
}

struct SceneReader<'a> {
    buffers: Buffers<'a>,
    mesh: IndexedMesh,
    /// Nodes visited: a tree has each one once.
    seen: Vec<bool>,
}

impl SceneReader<'_> {
    fn read(&mut self, document: &Document) -> Result<(), Error> {
        let mut open: Vec<(Node<'_>, DMat4)> = match document.default_scene() {
            Some(scene) => scene.nodes().map(|node| (node, DMat4::IDENTITY)).collect(),
            None => {
                let mut is_child = vec![false; document.nodes().len()];
                for child in document.nodes().flat_map(|node| node.children()) {
                    if let Some(mark) = is_child.get_mut(child.index()) {
                        *mark = true;
                    }
                }
                let is_root = |node: &Node<'_>| is_child.get(node.index()) == Some(&false);
                document.nodes().filter(is_root).map(|node| (node, DMat4::IDENTITY)).collect()
            }
        };
        if document.nodes().len() == 0 {
            for mesh in document.meshes() {
                self.add_mesh(&mesh, DMat4::IDENTITY)?;
            }
        }
        open.reverse();
        while let Some((node, parent)) = open.pop() {
            match self.seen.get_mut(node.index()) {
                Some(seen) if !*seen => *seen = true,
                _ => {
                    let problem = format!("node {} has two parents or is its own", node.index());
                    return Err(malformed(self.buffers.name(), problem, EXPORT_AGAIN));
                }
            }
            let own = Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
            let transform = parent * own;
            if let Some(mesh) = node.mesh() {
                self.add_mesh(&mesh, transform)?;
            }
            let first = open.len();
            open.extend(node.children().map(|child| (child, transform)));
            open[first..].reverse();
        }
        Ok(())
    }

    fn add_mesh(&mut self, mesh: &Mesh<'_>, transform: DMat4) -> Result<(), Error> {
        // Primitives often share one list of positions: it is taken over once.
        let mut taken: Vec<([Option<usize>; 2], u32, u32)> = Vec::new();
        for primitive in mesh.primitives() {
            let mode = primitive.mode();
            if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                continue;
            }
            let Some(source) = primitive.get(&gltf::Semantic::Positions) else { continue };
            let colours = primitive.get(&gltf::Semantic::Colors(0));
            let key = [Some(source.index()), colours.as_ref().map(|colours| colours.index())];
            let known = taken.iter().find(|&&(other, ..)| other == key);
            let (base, count) = match known {
                Some(&(_, base, count)) => (base, count),
                None => {
                    let (base, count) = self.add_positions(&source, transform)?;
                    self.add_colours(colours.as_ref(), count)?;
                    taken.push((key, base, count));
                    (base, count)
                }
            };
            self.add_triangles(&primitive, mesh.index(), [base, count], transform)?;
        }
        Ok(())
    }

    /// That there may be so many vertices or triangles more.
    fn check_size(&self, more: usize) -> Result<(), Error> {
        let items = (self.mesh.positions.len() + self.mesh.triangles.len()) as u64;
        let bytes = items.saturating_add(more as u64).saturating_mul(ITEM_BYTES);
        if bytes > self.buffers.num_bytes().saturating_mul(MAX_EXPANSION) {
            let problem = format!(
                "its nodes show the same data so often that it becomes more than {MAX_EXPANSION} times as large as the file"
            );
            let remedy = "export parts of the scene, or each mesh once";
            return Err(malformed(self.buffers.name(), problem, remedy));
        }
        Ok(())
    }

    fn add_positions(
        &mut self,
        source: &gltf::Accessor<'_>,
        transform: DMat4,
    ) -> Result<(u32, u32), Error> {
        self.check_size(source.count())?;
        let positions = accessor::positions(&mut self.buffers, source)?;
        let base = self.mesh.positions.len();
        let (Ok(first), Ok(count), true) = (
            u32::try_from(base),
            u32::try_from(positions.len()),
            base.saturating_add(positions.len()) <= u32::MAX as usize,
        ) else {
            return Err(Error::TooLarge {
                name: self.buffers.name().to_owned(),
                what: "vertices",
                limit: u64::from(u32::MAX),
            });
        };
        if transform == DMat4::IDENTITY {
            self.mesh.positions.extend(positions);
        } else {
            let place = |p: Vec3| transform.transform_point3(p.as_dvec3()).as_vec3();
            self.mesh.positions.extend(positions.into_iter().map(place));
        }
        Ok((first, count))
    }

    /// The colours of the positions that came last, `count` of them.
    fn add_colours(
        &mut self,
        source: Option<&gltf::Accessor<'_>>,
        count: u32,
    ) -> Result<(), Error> {
        let IndexedMesh { positions, colours: all, .. } = &mut self.mesh;
        let Some(source) = source else {
            if !all.is_empty() {
                all.resize(positions.len(), WHITE);
            }
            return Ok(());
        };
        let colours = accessor::colours(&mut self.buffers, source)?;
        if colours.len() != count as usize {
            let problem = format!(
                "accessor {} has {} colours, which are not as many as there are positions",
                source.index(),
                colours.len()
            );
            return Err(malformed(self.buffers.name(), problem, EXPORT_AGAIN));
        }
        all.resize(positions.len() - colours.len(), WHITE);
        all.extend(colours);
        Ok(())
    }

    fn add_triangles(
        &mut self,
        primitive: &Primitive<'_>,
        mesh: usize,
        [base, count]: [u32; 2],
        transform: DMat4,
    ) -> Result<(), Error> {
        let corners = match primitive.indices() {
            Some(source) => accessor::indices(&mut self.buffers, &source)?,
            None => (0..count).collect(),
        };
        self.check_size(match primitive.mode() {
            Mode::TriangleStrip | Mode::TriangleFan => corners.len(),
            _ => corners.len() / 3,
        })?;
        if let Some(&index) = corners.iter().find(|&&index| index >= count) {
            return Err(Error::IndexOutOfRange {
                name: format!(
                    "{}, mesh {mesh}, primitive {}",
                    self.buffers.name(),
                    primitive.index()
                ),
                place: Place::File,
                index: i64::from(index),
                num_vertices: u64::from(count),
            });
        }
        // A transform that mirrors turns the winding round (glTF 2.0, section 3.7.4).
        let mirrored = transform.determinant() < 0.0;
        let mut push = |triangle: [u32; 3]| {
            let [a, b, c] = triangle.map(|corner| base + corner);
            self.mesh.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] });
        };
        let distinct = |&[a, b, c]: &[u32; 3]| a != b && b != c && a != c;
        match primitive.mode() {
            Mode::TriangleStrip => corners
                .windows(3)
                .enumerate()
                .map(|(at, w)| if at % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
                // Triangles that repeat a corner only stitch the strip.
                .filter(distinct)
                .for_each(push),
            Mode::TriangleFan => {
                if let [first, rest @ ..] = corners.as_slice() {
                    rest.windows(2).for_each(|edge| push([*first, edge[0], edge[1]]));
                }
            }
            _ => {
                let (triangles, rest) = corners.as_chunks::<3>();
                if !rest.is_empty() {
                    let problem = format!(
                        "mesh {mesh}, primitive {} has {} corners, not a multiple of three",
                        primitive.index(),
                        corners.len()
                    );
                    return Err(malformed(self.buffers.name(), problem, EXPORT_AGAIN));
                }
                triangles.iter().for_each(|&triangle| push(triangle));
            }
        }
        Ok(())
    }
}
