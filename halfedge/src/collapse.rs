//! The half-edge collapse: check it, apply it, take it back.
//!
//! With `h: v→u` in the face `(h, a, b)` and its reverse `h': u→v` in `(h', d, e)`, the collapse removes the vertex `v`
//! and both faces; the outer neighbours `w = rev(a)`, `x = rev(b)`, `y = rev(d)`, `z = rev(e)` become each other's
//! reverse, `w↔x` and `y↔z`, and every half-edge that left `v` leaves `u` instead
//! (DeCoro and Pajarola, *XFastMesh*, 2002, Figure 2).

use crate::{HalfEdgeId, HalfEdgeMesh, VertexId};

/// A collapse that was checked against a mesh, and all that is needed to take it back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collapse {
    /// The half-edge `h: v→u` that is collapsed.
    pub half_edge: HalfEdgeId,
    /// Its reverse `h'`; `None` along a boundary.
    pub reverse: Option<HalfEdgeId>,
    /// The vertex `v`, which goes.
    pub removed: VertexId,
    /// The vertex `u`, which stays where it is.
    pub kept: VertexId,
    /// The outer half-edges `w, x, y, z`; `None` on a boundary.
    pub adjacent: [Option<HalfEdgeId>; 4],
    /// The third corners: `p` of the face of `h`, `q` of the face of `h'`.
    opposite: [Option<VertexId>; 2],
    /// `outgoing` of `v`, `u`, `p` and `q` as it was before.
    outgoing_before: [Option<HalfEdgeId>; 4],
}

/// Why a half-edge must not be collapsed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CollapseRejected {
    /// The half-edge belongs to a face that was removed.
    #[error("half-edge {0} belongs to a removed face")]
    Removed(HalfEdgeId),
    /// A boundary vertex may only move along its boundary.
    #[error("vertex {0} would leave the boundary")]
    LeavesBoundary(VertexId),
    /// The vertex would be left without a face.
    #[error("vertex {0} would be left without a face")]
    LastFace(VertexId),
    /// Both ends share a neighbour other than the edge's own third corners: the surface would be pinched.
    #[error("both ends are neighbours of vertex {0}: the link condition does not hold")]
    LinkCondition(VertexId),
    /// The edge belongs to a tetrahedron, which would become flat.
    #[error("vertex {0} closes a tetrahedron")]
    Tetrahedron(VertexId),
}

impl HalfEdgeMesh {
    /// Checks whether the start vertex of `h` can be merged into its end without changing the topology.
    ///
    /// # Complexity
    /// Time proportional to the product of both valences for common valences, no allocation.
    ///
    /// # Errors
    /// The first reason against it; see [`CollapseRejected`].
    ///
    /// # Sources
    /// Dey, Edelsbrunner, Guha and Nekhayev, *Topology preserving edge contraction*, 1999 (link condition).
    pub fn check_collapse(&self, h: HalfEdgeId) -> Result<Collapse, CollapseRejected> {
        let removed = self.start[h.index()].ok_or(CollapseRejected::Removed(h))?;
        let kept = self.end(h);
        let reverse = self.reverse(h);
        if reverse.is_some() && self.is_boundary_vertex(removed) {
            return Err(CollapseRejected::LeavesBoundary(removed));
        }
        let (a, b) = (h.next(), h.prev());
        let p = self.start(b);
        let [w, x] = [self.reverse(a), self.reverse(b)];
        if w.is_none() && x.is_none() {
            return Err(CollapseRejected::LastFace(p));
        }
        let mut q = None;
        let mut yz = [None; 2];
        if let Some(h1) = reverse {
            let corner = self.start(h1.prev());
            yz = [self.reverse(h1.next()), self.reverse(h1.prev())];
            if yz == [None; 2] {
                return Err(CollapseRejected::LastFace(corner));
            }
            q = Some(corner);
        }
        self.check_link(removed, kept, p, q)?;
        let before = |v: VertexId| self.outgoing[v.index()];
        Ok(Collapse {
            half_edge: h,
            reverse,
            removed,
            kept,
            adjacent: [w, x, yz[0], yz[1]],
            opposite: [Some(p), q],
            outgoing_before: [before(removed), before(kept), before(p), q.and_then(before)],
        })
    }

    fn check_link(
        &self,
        removed: VertexId,
        kept: VertexId,
        p: VertexId,
        q: Option<VertexId>,
    ) -> Result<(), CollapseRejected> {
        // The neighbours of the end that is kept, on the stack unless it is a hub.
        const ON_STACK: usize = 24;
        let mut stack = [kept; ON_STACK];
        let mut len = 0;
        let mut hub = Vec::new();
        for r in self.one_ring(kept) {
            if len < ON_STACK {
                stack[len] = r;
            } else {
                hub.push(r);
            }
            len += 1;
        }
        hub.sort_unstable();
        let near = &stack[..len.min(ON_STACK)];
        let mut ring_is_pq = true;
        for r in self.one_ring(removed) {
            if r == p || Some(r) == q || r == kept {
                continue;
            }
            ring_is_pq = false;
            if near.contains(&r) || hub.binary_search(&r).is_ok() {
                return Err(CollapseRejected::LinkCondition(r));
            }
        }
        // Around an interior vertex of valence three whose neighbours are p, q and u, the only closed case left is the
        // tetrahedron: there p and q are neighbours across the face opposite v.
        if ring_is_pq
            && let Some(q) = q
            && p != q
            && self.valence(removed) == 3
            && self.valence(kept) == 3
            && !self.is_boundary_vertex(kept)
        {
            return Err(CollapseRejected::Tetrahedron(removed));
        }
        if Some(p) == q {
            return Err(CollapseRejected::LastFace(p));
        }
        Ok(())
    }

    /// Applies a collapse that [`Self::check_collapse`] gave for the mesh as it is now.
    ///
    /// # Complexity
    /// Time linear in the valence of the removed vertex.
    ///
    /// # Panics
    /// May panic, or leave a mesh that is not valid, when the mesh was changed since the check.
    pub fn apply(&mut self, c: &Collapse) {
        let [w, x, y, z] = c.adjacent;
        let h = c.half_edge;
        // Turn the fan of v, from the face beyond b round to the face beyond d.
        let mut fan = x;
        while let Some(g) = fan {
            self.start[g.index()] = Some(c.kept);
            fan = if Some(g.prev()) == y { None } else { self.reverse(g.prev()) };
        }
        self.link(w, x);
        self.link(y, z);
        for g in h.face().half_edges() {
            self.start[g.index()] = None;
        }
        self.num_faces -= 1;
        let mut gone = [Some(h.next()), None];
        if let Some(h1) = c.reverse {
            for g in h1.face().half_edges() {
                self.start[g.index()] = None;
            }
            self.num_faces -= 1;
            gone[1] = Some(h1);
        }
        self.num_vertices -= 1;

        self.outgoing[c.removed.index()] = None;
        if gone.contains(&self.outgoing[c.kept.index()]) {
            self.outgoing[c.kept.index()] = x;
        }
        let [p, q] = c.opposite;
        if let Some(p) = p
            && self.outgoing[p.index()] == Some(h.prev())
        {
            self.outgoing[p.index()] = w;
        }
        if let (Some(q), Some(h1)) = (q, c.reverse)
            && self.outgoing[q.index()] == Some(h1.prev())
        {
            self.outgoing[q.index()] = y;
        }
    }

    /// Takes back a collapse: the exact inverse of [`Self::apply`], for the mesh as it was right after it.
    ///
    /// # Complexity
    /// Time linear in the valence of the vertex that comes back.
    ///
    /// # Panics
    /// May panic, or leave a mesh that is not valid, when later collapses were not taken back before.
    pub fn undo(&mut self, c: &Collapse) {
        let [w, x, y, z] = c.adjacent;
        let (h, a, b) = (c.half_edge, c.half_edge.next(), c.half_edge.prev());
        let [p, q] = c.opposite;
        self.start[h.index()] = Some(c.removed);
        self.start[a.index()] = Some(c.kept);
        self.start[b.index()] = p;
        self.restore(a, w);
        self.restore(b, x);
        self.num_faces += 1;
        if let Some(h1) = c.reverse {
            self.start[h1.index()] = Some(c.kept);
            self.start[h1.next().index()] = Some(c.removed);
            self.start[h1.prev().index()] = q;
            self.restore(h1.next(), y);
            self.restore(h1.prev(), z);
            self.num_faces += 1;
        }
        self.num_vertices += 1;
        let mut fan = x;
        while let Some(g) = fan {
            self.start[g.index()] = Some(c.removed);
            fan = if Some(g.prev()) == y { None } else { self.reverse(g.prev()) };
        }
        let [of_v, of_u, of_p, of_q] = c.outgoing_before;
        self.outgoing[c.removed.index()] = of_v;
        self.outgoing[c.kept.index()] = of_u;
        if let Some(p) = p {
            self.outgoing[p.index()] = of_p;
        }
        if let Some(q) = q {
            self.outgoing[q.index()] = of_q;
        }
    }

    fn link(&mut self, a: Option<HalfEdgeId>, b: Option<HalfEdgeId>) {
        if let Some(a) = a {
            self.reverse[a.index()] = b;
        }
        if let Some(b) = b {
            self.reverse[b.index()] = a;
        }
    }

    fn restore(&mut self, inner: HalfEdgeId, outer: Option<HalfEdgeId>) {
        self.reverse[inner.index()] = outer;
        if let Some(outer) = outer {
            self.reverse[outer.index()] = Some(inner);
        }
    }
}
