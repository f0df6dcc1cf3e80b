//! The merge-tree forest in memory, and how collapse records become one.

use glam::{DVec3, Vec3};
use halfedge::{FaceId, HalfEdgeId, HalfEdgeMesh, VertexId};

use crate::{
    BoundCodes, CollapseRecord, Colour, HalfEdgeNames, Node, NodeId, NodeStore, OctNormal, SlotId,
};

/// A vertex of the coarsest mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseVertex {
    /// Its position.
    pub position: Vec3,
    /// Its normal.
    pub normal: OctNormal,
    /// Root of the tree of everything that was merged into it; `None` if nothing was.
    pub root: Option<NodeId>,
}

/// The coarsest mesh of a forest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BaseMesh {
    /// Its vertices.
    pub vertices: Vec<BaseVertex>,
    /// Its faces, counter-clockwise.
    pub faces: Vec<[u32; 3]>,
    /// Colours of its vertices; empty where the mesh has none.
    pub colours: Vec<Colour>,
}

impl BaseMesh {
    /// The names of half-edges in a forest with this coarsest mesh.
    pub fn names(&self) -> HalfEdgeNames {
        HalfEdgeNames::new(self.faces.len())
    }

    /// Whether the surface is inside out: as good as closed, and clockwise seen from outside.
    ///
    /// Some programs write meshes so. Nothing is turned over for it; who shows such a mesh turns the view test
    /// ([`crate::View::inside_out`]) and the lights.
    pub fn is_inside_out(&self) -> bool {
        let origin = self.vertices.first().map_or(Vec3::ZERO, |v| v.position).as_dvec3();
        let mut vector_area = DVec3::ZERO;
        let (mut area, mut volume) = (0.0, 0.0);
        for face in &self.faces {
            let [a, b, c] = face.map(|v| self.vertices[v as usize].position.as_dvec3() - origin);
            let normal = (b - a).cross(c - a);
            vector_area += normal;
            area += normal.length();
            volume += a.dot(normal);
        }
        // The areas of a closed surface add up to nothing.
        volume < 0.0 && vector_area.length() < 0.1 * area
    }

    /// The roots of the forest, in order of their vertices.
    pub fn roots(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.vertices.iter().filter_map(|v| v.root)
    }
}

/// A merge-tree forest in memory: the coarsest mesh, and one node per collapse.
///
/// A node's id is its index in [`nodes`](Self::nodes). [`from_records`](Self::from_records) gives them in order of
/// collapse; a file gives them block by block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forest {
    /// The coarsest mesh.
    pub base: BaseMesh,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// Per node the colour of the vertex that its split brings back; empty where the mesh has none.
    pub colours: Vec<Colour>,
}

/// Why records and mesh do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ForestError {
    /// There are more collapses than ids of 32 bits can name half-edges of.
    #[error("{nodes} collapses are more than 32-bit half-edge names can hold ({max})")]
    TooLarge {
        /// Number of collapses.
        nodes: usize,
        /// Largest number possible.
        max: usize,
    },
    /// A record names a half-edge whose face neither a later record nor the coarsest mesh has.
    #[error("record {order} names half-edge {half_edge}, whose face is not there any more")]
    LostHalfEdge {
        /// Index of the record.
        order: usize,
        /// The half-edge.
        half_edge: HalfEdgeId,
    },
}

impl Forest {
    /// Links records into the forest and computes the bounds of its nodes from the leaves up.
    ///
    /// `coarse` is the mesh after all collapses, in the numbering of the records; `positions` and `normals` are those
    /// of the input's vertices. The left child of a record is the last collapse into the vertex it removes, its right
    /// child the last one into the vertex it keeps.
    ///
    /// # Complexity
    /// Time and memory linear in the number of records and faces.
    ///
    /// # Errors
    /// [`ForestError`], when the records do not belong to the mesh or are too many.
    ///
    /// # Panics
    /// When a record names a vertex that has no position or normal.
    pub fn from_records(
        records: &[CollapseRecord],
        coarse: &HalfEdgeMesh,
        positions: &[Vec3],
        normals: &[OctNormal],
    ) -> Result<Self, ForestError> {
        let names = HalfEdgeNames::new(coarse.num_faces());
        let max = names.max_node().index();
        if records.len() > max {
            return Err(ForestError::TooLarge { nodes: records.len(), max });
        }
        let half_edge_name = name_half_edges(records, coarse, names);
        let mut top: Vec<Option<NodeId>> = vec![None; positions.len()];
        let mut nodes: Vec<Node> = Vec::with_capacity(records.len());
        for (order, record) in records.iter().enumerate() {
            let id = NodeId::from_index(order);
            let v = record.removed.index();
            let [left, right] = [top[v], top[record.kept.index()]];
            let mut adjacent = [None; 4];
            for (slot, outer) in adjacent.iter_mut().zip(record.adjacent) {
                if let Some(half_edge) = outer {
                    *slot = Some(
                        half_edge_name(half_edge)
                            .ok_or(ForestError::LostHalfEdge { order, half_edge })?,
                    );
                }
            }
            let mut node = Node {
                position: positions[v],
                radius: record.star.radius,
                normal: normals[v],
                cone_sine: record.star.cone_sine(),
                deviation: record.star.deviation,
                order: id.get(),
                adjacent,
                left,
                right,
                parent: None,
                slot: None,
            };
            let mut below = [None; 2];
            for (below, child) in below.iter_mut().zip([left, right]) {
                let Some(child) = child.map(|child| &mut nodes[child.index()]) else { continue };
                child.parent = Some(id);
                *below = Some(BoundCodes::of_node(child).map(|codes| codes.of(child)));
            }
            let finite = below.iter().all(|child| *child != Some(None));
            let below = below.into_iter().flatten().flatten();
            match BoundCodes::enclosing(&node, below).filter(|_| finite) {
                Some(codes) => codes.store(&mut node),
                None => (node.radius, node.cone_sine, node.deviation) = (f32::MAX, 1.0, f32::MAX),
            }
            nodes.push(node);
            top[record.kept.index()] = Some(id);
        }
        let base = base_mesh(coarse, positions, normals, &top);
        Ok(Self { base, nodes, colours: Vec::new() })
    }

    /// The same forest with the colours of the input's vertices, which are given in the numbering of the records that it was
    /// [made of](Self::from_records).
    ///
    /// # Panics
    /// When a vertex has no colour.
    pub fn with_colours(
        mut self,
        records: &[CollapseRecord],
        coarse: &HalfEdgeMesh,
        colours: &[Colour],
    ) -> Self {
        self.colours = records.iter().map(|record| colours[record.removed.index()]).collect();
        self.base.colours = coarse.vertices().map(|v| colours[v.index()]).collect();
        self
    }

    /// Number of levels of the deepest tree; zero without nodes.
    pub fn depth(&self) -> usize {
        let mut stack: Vec<(NodeId, usize)> = self.base.roots().map(|root| (root, 1)).collect();
        let mut depth = 0;
        while let Some((id, level)) = stack.pop() {
            depth = depth.max(level);
            stack.extend(self.nodes[id.index()].children().map(|child| (child, level + 1)));
        }
        depth
    }

    /// Number of faces of the input: those of the coarsest mesh and of all nodes.
    pub fn num_input_faces(&self) -> usize {
        self.base.faces.len() + self.nodes.iter().map(Node::num_faces).sum::<usize>()
    }
}

/// Gives every half-edge of a record's two faces, or of the coarsest mesh, its name in the forest.
fn name_half_edges(
    records: &[CollapseRecord],
    coarse: &HalfEdgeMesh,
    names: HalfEdgeNames,
) -> impl Fn(HalfEdgeId) -> Option<HalfEdgeId> {
    // Per face the name of its first half-edge and the corner that half-edge is.
    let mut first: Vec<Option<(HalfEdgeId, u8)>> = vec![None; coarse.face_capacity()];
    for (index, f) in coarse.faces().enumerate() {
        first[f.index()] = Some((FaceId::from_index(index).half_edge(0), 0));
    }
    for (order, record) in records.iter().enumerate() {
        let node = NodeId::from_index(order);
        for (h, k) in [(Some(record.half_edge), 0), (record.reverse, 3)] {
            if let Some(h) = h {
                first[h.face().index()] = Some((names.of_node(node, k), h.corner() as u8));
            }
        }
    }
    move |h| {
        let (name, corner) = first[h.face().index()]?;
        Some(HalfEdgeId::new(name.get() + (h.corner() + 3 - u32::from(corner)) % 3))
    }
}

fn base_mesh(
    coarse: &HalfEdgeMesh,
    positions: &[Vec3],
    normals: &[OctNormal],
    top: &[Option<NodeId>],
) -> BaseMesh {
    let mut new_id = vec![0u32; coarse.vertex_capacity()];
    let mut base = BaseMesh::default();
    for v in coarse.vertices().map(VertexId::index) {
        new_id[v] = base.vertices.len() as u32;
        base.vertices.push(BaseVertex { position: positions[v], normal: normals[v], root: top[v] });
    }
    base.faces = coarse
        .faces()
        .filter_map(|f| coarse.corners(f))
        .map(|corners| corners.map(|v| new_id[v.index()]))
        .collect();
    base
}

impl NodeStore for Forest {
    fn base(&self) -> &BaseMesh {
        &self.base
    }

    #[inline]
    fn node(&self, id: NodeId) -> Option<&Node> {
        self.nodes.get(id.index())
    }

    fn request(&mut self, id: NodeId, _urgency: f32) -> bool {
        id.index() < self.nodes.len()
    }

    #[inline]
    fn colour(&self, id: NodeId) -> Option<Colour> {
        self.colours.get(id.index()).copied()
    }

    fn set_slot(&mut self, id: NodeId, slot: Option<SlotId>) {
        self.nodes[id.index()].slot = slot;
    }
}
