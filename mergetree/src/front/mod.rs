//! The active front: which nodes are split, and the mesh that follows from it.

mod changes;
mod frontier;
mod held;
mod mesh;
mod morph;
mod refine;
mod scan;
mod update;
mod validate;

use std::ops::Range;

use glam::Vec3;
use halfedge::{BuildError, HalfEdgeMesh};

pub use mesh::FrontVertex;
pub use refine::{CollapseBlocked, SplitBlocked};
pub use update::{UpdateLimits, UpdateStats};
pub use validate::FrontInvalid;

use crate::front::frontier::Frontier;
use crate::front::held::Held;
use crate::front::morph::Morphs;
use crate::front::refine::Pending;
use crate::front::scan::Scan;
use crate::measure::BoundsTable;
use crate::{Colour, HalfEdgeNames, NodeId, NodeStore, SlotId};
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

/// What the front remembers of a split node.
#[derive(Clone, Copy, Debug)]
struct Slot {
    node: Option<NodeId>,
    /// Where its parent is; `None` for a root.
    parent: Option<SlotId>,
    level: u32,
    num_split_children: u8,
}

impl Slot {
    const FREE: Self = Self { node: None, parent: None, level: 0, num_split_children: 0 };
}

/// The active front over a forest, with its mesh.
///
/// The mesh is a function of the set of split nodes alone, whatever order they were split in. After every operation it
/// is a manifold with the topology of the input.
///
/// A frame tests two things per vertex: whether the split it came out of is still worth it, and whether its next one is.
/// The bounds that this takes are copied side by side, so that a test touches no node (`scan.rs`).
#[derive(Clone, Debug)]
pub struct Front {
    names: HalfEdgeNames,
    dependencies: Dependencies,
    mesh: ActiveMesh,
    /// Colours per vertex; empty where the store has none.
    colours: Vec<Colour>,
    /// Per vertex its next split.
    frontier: Frontier,
    slots: Vec<Slot>,
    /// Bounds of the node in each slot.
    bounds: BoundsTable,
    /// A bit per slot: whether it has a node without split child.
    leaves: Vec<u8>,
    held: Held,
    free: Vec<SlotId>,
    num_split: usize,
    /// Euler number of the coarsest mesh, and so of every other.
    euler: i64,
    /// Roots with their vertices, in order of their ids.
    roots: Vec<(NodeId, u32)>,
    /// Nodes that wait to be split, deepest dependency last; kept for its memory.
    pending: Vec<Pending>,
    /// Slots split by the operation at hand, forced ones included.
    just_split: Vec<SlotId>,
    scans: [Scan; 2],
    morphs: Morphs,
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
        let mut roots: Vec<_> =
            (0..).zip(&base.vertices).filter_map(|(v, vertex)| Some((vertex.root?, v))).collect();
        roots.sort_unstable();
        let mesh = ActiveMesh::new(base, &connectivity);
        Ok(Self {
            names: base.names(),
            dependencies,
            euler: mesh.euler(),
            mesh,
            colours: base.colours.clone(),
            frontier: Frontier::new(store),
            slots: Vec::new(),
            bounds: BoundsTable::default(),
            leaves: Vec::new(),
            held: Held::default(),
            free: Vec::new(),
            num_split: 0,
            roots,
            pending: Vec::new(),
            just_split: Vec::new(),
            scans: Default::default(),
            morphs: Morphs::default(),
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

    /// Bytes that the front takes in memory.
    pub fn memory_bytes(&self) -> usize {
        self.mesh.memory_bytes()
            + self.frontier.memory_bytes()
            + self.bounds.memory_bytes()
            + self.slots.capacity() * size_of::<Slot>()
            + self.leaves.capacity()
            + self.held.memory_bytes()
            + (self.free.capacity() + self.just_split.capacity()) * size_of::<SlotId>()
            + self.colours.capacity() * size_of::<Colour>()
            + self.roots.capacity() * size_of::<(NodeId, u32)>()
            + self.pending.capacity() * size_of::<Pending>()
            + self.scans.iter().map(Scan::memory_bytes).sum::<usize>()
            + self.morphs.memory_bytes()
    }

    fn set_leaf(&mut self, slot: SlotId, is_leaf: bool) {
        set_bit(&mut self.leaves, slot.index(), is_leaf);
    }
}

/// Sets or clears a bit of a table that grows as needed.
#[inline]
fn set_bit(bytes: &mut Vec<u8>, index: usize, value: bool) {
    if index / 8 >= bytes.len() {
        bytes.resize(index / 8 + 1, 0);
    }
    let bit = 1 << (index % 8);
    if value {
        bytes[index / 8] |= bit;
    } else {
        bytes[index / 8] &= !bit;
    }
}

/// Whether a bit is set.
#[inline]
fn has_bit(bytes: &[u8], index: usize) -> bool {
    bytes.get(index / 8).is_some_and(|byte| byte >> (index % 8) & 1 == 1)
}

/// Where a node is split, if it is.
fn slot_of(store: &impl NodeStore, id: NodeId) -> Option<SlotId> {
    store.node(id)?.slot
}
