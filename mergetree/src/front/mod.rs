//! The active front: which nodes are split, and the mesh that follows from it.

mod changes;
mod mesh;
mod refine;
mod update;
mod validate;

use std::ops::Range;

use glam::Vec3;
use halfedge::{BuildError, HalfEdgeId, HalfEdgeMesh};

pub use mesh::FrontVertex;
pub use refine::{CollapseBlocked, SplitBlocked};
pub use update::{UpdateLimits, UpdateStats};
pub use validate::FrontInvalid;

use crate::{Colour, HalfEdgeName, HalfEdgeNames, Node, NodeId, NodeStore, SlotId};
pub(crate) use mesh::ActiveMesh;

/// Which surroundings a split or collapse waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dependencies {
    /// Only those that connectivity needs: the faces of `w, x, y, z`. Fewest triangles; the mesh is a manifold, but
    /// triangles may fold over where neighbouring regions differ much in level.
    Links,
    /// Every neighbour must be in the state it had when the collapse was made, so that all triangles are some that the
    /// build made and checked: none is flipped.
    ///
    /// # Sources
    /// El-Sana and Varshney, *Generalized View-Dependent Simplification*, 1999 (implicit dependencies); DeCoro and
    /// Pajarola, *XFastMesh*, 2002, §3.4 item 5.
    #[default]
    Order,
}

/// What the front remembers of a vertex of the active mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cluster {
    /// The next split of this vertex; `None` if it stands for itself alone.
    top: Option<NodeId>,
    /// Order of the split that this vertex came out of last: that of the parent of `top`; `u32::MAX` if none.
    upper: u32,
}

/// What the front remembers of a split node.
#[derive(Clone, Copy, Debug)]
struct Slot {
    node: Option<NodeId>,
    level: u32,
    num_split_children: u8,
}

/// The active front over a forest, with its mesh.
///
/// The mesh is a function of the set of split nodes alone, whatever order they were split in. After every operation it
/// is a manifold with the topology of the input.
#[derive(Clone, Debug)]
pub struct Front {
    names: HalfEdgeNames,
    dependencies: Dependencies,
    mesh: ActiveMesh,
    /// Per vertex; empty where the store has none.
    colours: Vec<Colour>,
    clusters: Vec<Cluster>,
    slots: Vec<Slot>,
    free: Vec<SlotId>,
    num_split: usize,
    /// Nodes that wait to be split, deepest dependency last; kept for its memory.
    pending: Vec<(NodeId, u32)>,
    /// Nodes split by the operation at hand, forced ones included.
    just_split: Vec<NodeId>,
}

/// What changed since the changes were last taken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Ranges of [`Front::vertices`] that were written.
    pub vertices: Vec<Range<u32>>,
    /// Ranges of [`Front::triangles`] that were written.
    pub triangles: Vec<Range<u32>>,
}

impl Front {
    /// The coarsest front: nothing is split.
    ///
    /// # Errors
    /// When the coarsest mesh of the store is not a manifold.
    pub fn new(store: &impl NodeStore, dependencies: Dependencies) -> Result<Self, BuildError> {
        let base = store.base();
        let connectivity = HalfEdgeMesh::from_triangles(base.vertices.len(), &base.faces)?;
        Ok(Self {
            names: base.names(),
            dependencies,
            mesh: ActiveMesh::new(base, &connectivity),
            colours: base.colours.clone(),
            clusters: base
                .vertices
                .iter()
                .map(|v| Cluster { top: v.root, upper: u32::MAX })
                .collect(),
            slots: Vec::new(),
            free: Vec::new(),
            num_split: 0,
            pending: Vec::new(),
            just_split: Vec::new(),
        })
    }

    /// Number of triangles of the active mesh.
    pub fn num_triangles(&self) -> usize {
        self.mesh.num_faces()
    }

    /// Number of split nodes.
    pub fn num_split_nodes(&self) -> usize {
        self.num_split
    }

    /// The vertices, those of free slots included, which no triangle names.
    pub fn vertices(&self) -> &[FrontVertex] {
        &self.mesh.vertices
    }

    /// The colours of all [vertices](Self::vertices); empty where the mesh has none. What changes vertices changes them.
    pub fn colours(&self) -> &[Colour] {
        &self.colours
    }

    /// The triangles, counter-clockwise; `[0, 0, 0]` where there is none.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.mesh.triangles
    }

    /// Takes the ranges that changed since they were last taken, or since the beginning. Changes fewer than sixteen
    /// places apart come as one range.
    pub fn take_changes(&mut self) -> Changes {
        const GAP: u32 = 16;
        Changes {
            vertices: self.mesh.dirty_vertices.take_ranges(GAP),
            triangles: self.mesh.dirty_faces.take_ranges(GAP),
        }
    }

    /// The active mesh without gaps: positions and triangles.
    pub fn to_mesh(&self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let present = self.mesh.triangles.iter().filter(|&&t| t != [0; 3]);
        let mut new_id = vec![u32::MAX; self.mesh.vertices.len()];
        let used = self.used_vertices();
        for (new, &old) in used.iter().enumerate() {
            new_id[old as usize] = new as u32;
        }
        let positions = used.iter().map(|&v| self.mesh.vertices[v as usize].position).collect();
        (positions, present.map(|t| t.map(|v| new_id[v as usize])).collect())
    }

    /// The colours of the vertices of [`to_mesh`](Self::to_mesh); empty where the mesh has none.
    pub fn to_colours(&self) -> Vec<Colour> {
        if self.colours.is_empty() {
            return Vec::new();
        }
        self.used_vertices().iter().map(|&v| self.colours[v as usize]).collect()
    }

    /// The vertices that triangles name, ascending.
    fn used_vertices(&self) -> Vec<u32> {
        let present = self.mesh.triangles.iter().filter(|&&t| t != [0; 3]);
        let mut used: Vec<u32> = present.flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// The split nodes with their depth in the forest (from 1), in order of their slots.
    pub fn split_nodes(&self) -> impl Iterator<Item = (NodeId, u32)> + '_ {
        self.slots.iter().filter_map(|slot| Some((slot.node?, slot.level)))
    }

    /// Where the half-edges around a node are in the active mesh.
    ///
    /// # Errors
    /// The node whose face is missing.
    fn active_half_edges(
        &self,
        store: &impl NodeStore,
        node: &Node,
    ) -> Result<[Option<HalfEdgeId>; 4], NodeId> {
        let mut active = [None; 4];
        for (active, name) in active.iter_mut().zip(node.adjacent) {
            if let Some(name) = name {
                *active = Some(match self.names.resolve(name) {
                    HalfEdgeName::Base(h) => HalfEdgeId::new(h),
                    HalfEdgeName::Node(owner, k) => {
                        let slot = slot_of(store, owner).ok_or(owner)?;
                        self.mesh.half_edge_of(slot, k)
                    }
                });
            }
        }
        Ok(active)
    }
}

/// Where a node is split, if it is.
fn slot_of(store: &impl NodeStore, id: NodeId) -> Option<SlotId> {
    store.node(id)?.slot
}
