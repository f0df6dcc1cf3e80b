//! The active mesh: connectivity of the triangles of a front, laid out so that a renderer can take it as it is.
//!
//! Every split node has a *slot* `s`: one vertex and a pair of faces. Vertex `B + s` and faces `F + 2s`, `F + 2s + 1`
//! belong to it, `B` and `F` being the numbers of vertices and faces of the coarsest mesh. A face that is not there
//! has the corners `[0, 0, 0]` and so draws nothing.

use glam::Vec3;
use halfedge::{FaceId, HalfEdgeId, HalfEdgeMesh};

use crate::front::changes::DirtySet;
use crate::{BaseMesh, OctNormal, SlotId};

/// A vertex as a renderer wants it.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FrontVertex {
    /// Position.
    pub position: Vec3,
    /// Normal.
    pub normal: OctNormal,
    /// Depth of its node in the forest, from 1; 0 for a vertex of the coarsest mesh.
    pub level: u32,
}

const _: () = assert!(size_of::<FrontVertex>() == 20);

/// Why a vertex split cannot be done on the mesh as it is: what the node says of its neighbours does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Misfit;

#[derive(Clone, Debug)]
pub(crate) struct ActiveMesh {
    num_base_vertices: u32,
    num_base_faces: u32,
    pub(crate) vertices: Vec<FrontVertex>,
    pub(crate) triangles: Vec<[u32; 3]>,
    reverse: Vec<Option<HalfEdgeId>>,
    /// Per vertex a half-edge that leaves it.
    out: Vec<Option<HalfEdgeId>>,
    num_faces: usize,
    pub(crate) dirty_vertices: DirtySet,
    pub(crate) dirty_faces: DirtySet,
    /// Half-edges to be turned by the operation at hand.
    fan: Vec<HalfEdgeId>,
}

impl ActiveMesh {
    pub(crate) fn new(base: &BaseMesh, connectivity: &HalfEdgeMesh) -> Self {
        let vertices: Vec<_> = base
            .vertices
            .iter()
            .map(|v| FrontVertex { position: v.position, normal: v.normal, level: 0 })
            .collect();
        let reverse = (0..3 * base.faces.len())
            .map(|h| connectivity.reverse(HalfEdgeId::from_index(h)))
            .collect();
        let mut out = vec![None; vertices.len()];
        for (h, &v) in base.faces.as_flattened().iter().enumerate() {
            out[v as usize] = Some(HalfEdgeId::from_index(h));
        }
        let mut mesh = Self {
            num_base_vertices: vertices.len() as u32,
            num_base_faces: base.faces.len() as u32,
            num_faces: base.faces.len(),
            vertices,
            triangles: base.faces.clone(),
            reverse,
            out,
            dirty_vertices: DirtySet::default(),
            dirty_faces: DirtySet::default(),
            fan: Vec::new(),
        };
        (0..mesh.num_base_vertices).for_each(|v| mesh.dirty_vertices.insert(v));
        (0..mesh.num_base_faces).for_each(|f| mesh.dirty_faces.insert(f));
        mesh
    }

    pub(crate) fn num_faces(&self) -> usize {
        self.num_faces
    }

    #[inline]
    pub(crate) fn vertex_of(&self, slot: SlotId) -> u32 {
        self.num_base_vertices + slot.get()
    }

    pub(crate) fn vertex(&self, slot: SlotId) -> FrontVertex {
        self.vertices[self.vertex_of(slot) as usize]
    }

    pub(crate) fn set_vertex(&mut self, slot: SlotId, vertex: FrontVertex) {
        let v = self.vertex_of(slot);
        self.vertices[v as usize] = vertex;
        self.dirty_vertices.insert(v);
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.vertices.capacity() * size_of::<FrontVertex>()
            + self.triangles.capacity() * size_of::<[u32; 3]>()
            + (self.reverse.capacity() + self.out.capacity()) * size_of::<Option<HalfEdgeId>>()
            + self.fan.capacity() * size_of::<HalfEdgeId>()
            + self.dirty_vertices.memory_bytes()
            + self.dirty_faces.memory_bytes()
    }

    /// Half-edge `k` (0 to 5) of a slot: `h, a, b` of the first face, `h', d, e` of the second.
    #[inline]
    pub(crate) fn half_edge_of(&self, slot: SlotId, k: u32) -> HalfEdgeId {
        HalfEdgeId::new(3 * self.num_base_faces + 6 * slot.get() + k)
    }

    /// The slot whose face a half-edge belongs to, and which of its six it is; `None` for one of the coarsest mesh.
    #[inline]
    pub(crate) fn slot_of_half_edge(&self, h: HalfEdgeId) -> Option<(SlotId, u32)> {
        let h = h.get().checked_sub(3 * self.num_base_faces)?;
        Some((SlotId::new(h / 6), h % 6))
    }

    /// A half-edge that leaves a vertex; `None` if no face has it.
    #[inline]
    pub(crate) fn out(&self, v: u32) -> Option<HalfEdgeId> {
        self.out[v as usize]
    }

    #[inline]
    pub(crate) fn reverse(&self, h: HalfEdgeId) -> Option<HalfEdgeId> {
        self.reverse[h.index()]
    }

    #[inline]
    pub(crate) fn start(&self, h: HalfEdgeId) -> u32 {
        self.triangles.as_flattened()[h.index()]
    }

    #[inline]
    pub(crate) fn end(&self, h: HalfEdgeId) -> u32 {
        self.start(h.next())
    }

    #[inline]
    fn set_start(&mut self, h: HalfEdgeId, v: u32) {
        self.triangles.as_flattened_mut()[h.index()] = v;
        self.dirty_faces.insert(h.face().get());
    }

    fn link(&mut self, a: Option<HalfEdgeId>, b: Option<HalfEdgeId>) {
        if let Some(a) = a {
            self.reverse[a.index()] = b;
        }
        if let Some(b) = b {
            self.reverse[b.index()] = a;
        }
    }

    /// Gathers the half-edges out of the vertex that `x` leaves, from `x` round to the face of `y`, or to the boundary
    /// where `y` is `None`.
    fn gather_fan(&mut self, x: Option<HalfEdgeId>, y: Option<HalfEdgeId>) -> Result<(), Misfit> {
        self.fan.clear();
        let Some(x) = x else {
            return if y.is_none() { Ok(()) } else { Err(Misfit) };
        };
        let mut g = x;
        loop {
            self.fan.push(g);
            if Some(g.prev()) == y {
                return Ok(());
            }
            match self.reverse(g.prev()) {
                Some(turned) if turned != x => g = turned,
                // Round the whole vertex without meeting y.
                Some(_) => return Err(Misfit),
                None => return if y.is_none() { Ok(()) } else { Err(Misfit) },
            }
        }
    }

    /// Makes the half-edges gathered leave `v`.
    fn turn_fan(&mut self, v: u32) {
        let fan = std::mem::take(&mut self.fan);
        for &g in &fan {
            self.set_start(g, v);
        }
        self.fan = fan;
    }

    /// Brings back a vertex next to `u`, and its faces at the outer half-edges `w, x, y, z`, all present. Changes nothing
    /// when they do not fit.
    ///
    /// Whatever the half-edges are, a manifold stays one.
    pub(crate) fn split(
        &mut self,
        slot: SlotId,
        u: u32,
        adjacent: [Option<HalfEdgeId>; 4],
        vertex: FrontVertex,
    ) -> Result<(), Misfit> {
        let [w, x, y, z] = adjacent;
        let p = w.map(|w| self.start(w)).or_else(|| x.map(|x| self.end(x))).ok_or(Misfit)?;
        let joined = |a: Option<HalfEdgeId>, b: Option<HalfEdgeId>| {
            a.is_none_or(|a| self.reverse(a) == b) && b.is_none_or(|b| self.reverse(b) == a)
        };
        let around = w.is_none_or(|w| self.end(w) == u) && x.is_none_or(|x| self.start(x) == u);
        if !joined(w, x) || !joined(y, z) || !around {
            return Err(Misfit);
        }
        if let Some(y) = y {
            // An inner vertex comes back: it needs a face beyond b and one beyond d, around the same vertex.
            if x.is_none() || self.end(y) != u || self.start(y) == p {
                return Err(Misfit);
            }
        } else if z.is_some() {
            return Err(Misfit);
        }
        self.gather_fan(x, y)?;

        let v = self.vertex_of(slot);
        self.grow(slot);
        self.vertices[v as usize] = vertex;
        self.dirty_vertices.insert(v);
        self.turn_fan(v);
        let [h, a, b, h1, d, e] = [0, 1, 2, 3, 4, 5].map(|k| self.half_edge_of(slot, k));
        for (g, start) in [(h, v), (a, u), (b, p)] {
            self.set_start(g, start);
        }
        self.link(Some(a), w);
        self.link(Some(b), x);
        self.num_faces += 1;
        if let Some(y) = y {
            let q = self.start(y);
            for (g, start) in [(h1, u), (d, v), (e, q)] {
                self.set_start(g, start);
            }
            self.link(Some(h), Some(h1));
            self.link(Some(d), Some(y));
            self.link(Some(e), z);
            self.num_faces += 1;
        } else {
            self.reverse[h.index()] = None;
        }
        self.out[v as usize] = Some(h);
        self.out[u as usize] = Some(a);
        Ok(())
    }

    fn grow(&mut self, slot: SlotId) {
        let v = self.vertex_of(slot) as usize;
        if self.vertices.len() <= v {
            self.vertices.resize(v + 1, FrontVertex::default());
            self.out.resize(v + 1, None);
            let faces = self.half_edge_of(slot, 5).face().index() + 1;
            self.triangles.resize(faces, [0; 3]);
            self.reverse.resize(3 * faces, None);
        }
    }

    /// The vertex that the vertex of a slot came out of, and would go back into.
    #[inline]
    pub(crate) fn kept(&self, slot: SlotId) -> u32 {
        self.start(self.half_edge_of(slot, 1))
    }

    /// Removes the vertex and faces of a slot whose outer half-edges are `w, x, y, z`, those that were there at the split.
    /// Returns the vertex that stays.
    pub(crate) fn collapse(
        &mut self,
        slot: SlotId,
        adjacent: [Option<HalfEdgeId>; 4],
    ) -> Result<u32, Misfit> {
        let [w, x, y, z] = adjacent;
        self.gather_fan(x, y)?;
        let u = self.kept(slot);
        self.turn_fan(u);
        self.link(w, x);
        self.link(y, z);
        self.num_faces -= if y.is_some() { 2 } else { 1 };
        // What led out of the neighbours through the faces that go.
        let [v, p, q] = [0, 2, 5].map(|k| self.start(self.half_edge_of(slot, k)));
        self.out[u as usize] = x.or_else(|| w.map(|w| w.next()));
        self.out[v as usize] = None;
        let led_through = |mesh: &Self, r: u32| {
            let out = mesh.out[r as usize];
            out.and_then(|h| mesh.slot_of_half_edge(h)).is_some_and(|(s, _)| s == slot)
        };
        if led_through(self, p) {
            self.out[p as usize] = w.or_else(|| x.map(|x| x.next()));
        }
        if y.is_some() && led_through(self, q) {
            self.out[q as usize] = y;
        }
        for k in 0..6 {
            let h = self.half_edge_of(slot, k);
            self.set_start(h, 0);
            self.reverse[h.index()] = None;
        }
        Ok(u)
    }

    /// Vertices that faces name, less edges, plus faces.
    ///
    /// # Complexity
    /// Linear in the number of faces.
    pub(crate) fn euler(&self) -> i64 {
        let present = |&h: &usize| self.has_face(HalfEdgeId::from_index(h).face());
        let mut vertices: i64 = 0;
        let mut half_edges: i64 = 0;
        let mut boundary: i64 = 0;
        for h in (0..self.reverse.len()).filter(present).map(HalfEdgeId::from_index) {
            half_edges += 1;
            boundary += i64::from(self.reverse(h).is_none());
            vertices += i64::from(self.out(self.start(h)) == Some(h));
        }
        vertices - (half_edges + boundary) / 2 + half_edges / 3
    }

    /// Whether a face is there.
    #[inline]
    pub(crate) fn has_face(&self, f: FaceId) -> bool {
        self.triangles[f.index()] != [0; 3]
    }

    /// Calls `visit` with every neighbour of the vertex that `h` leaves.
    pub(crate) fn for_each_neighbour(&self, h: HalfEdgeId, mut visit: impl FnMut(u32)) {
        let mut g = h;
        loop {
            visit(self.end(g));
            match self.reverse(g.prev()) {
                Some(turned) if turned == h => return,
                Some(turned) => g = turned,
                None => {
                    visit(self.start(g.prev()));
                    break;
                }
            }
        }
        // The boundary was met: the other way round, too.
        let mut g = h;
        while let Some(r) = self.reverse(g) {
            g = r.next();
            visit(self.end(g));
        }
    }
}
