//! The coarsest mesh, checked against the collapses before it.

use std::cmp::Reverse;

use bytemuck::{Pod, Zeroable};
use halfedge::FaceId;
use mergetree::{BaseMesh, BaseVertex, NodeId, OpenPiece};
use xfm_format::Rounding;

use crate::link::Top;
use crate::log::PieceSize;
use crate::names::{CoarseMesh, NameBounds};
use crate::{CoarseProblem, Error};

/// The coarsest mesh, and the trees under its vertices.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coarse {
    /// Without roots, which have no ids yet.
    pub base: BaseMesh,
    /// Names of the faces of `base`.
    pub face_names: Vec<FaceId>,
    /// The trees, the one with the last collapse first.
    pub roots: Vec<CoarseRoot>,
}

/// A tree under a vertex of the coarsest mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct CoarseRoot {
    /// Name of the vertex.
    pub name: u32,
    /// Its place among the vertices of the coarsest mesh.
    pub vertex: u32,
    /// The size of the piece that its root is in.
    pub size: PieceSize,
}

impl Coarse {
    /// Moves the vertices to where they are written.
    pub fn round(&mut self, rounding: Rounding) -> Result<(), Error> {
        for vertex in &mut self.base.vertices {
            if vertex.position.is_finite() {
                vertex.position = rounding
                    .position(vertex.position)
                    .ok_or(Error::Coarse(CoarseProblem::TooFar))?;
            }
            vertex.normal = rounding.normal(vertex.normal);
        }
        Ok(())
    }

    /// Notes the id of the root of a tree.
    pub fn set_root(&mut self, tree: u32, id: NodeId) {
        let vertex = self.roots.get(tree as usize).map(|root| root.vertex as usize);
        if let Some(vertex) = vertex.and_then(|vertex| self.base.vertices.get_mut(vertex)) {
            vertex.root = Some(id);
        }
    }
}

/// Checks a mesh against the trees that there are.
pub(crate) fn close(
    mesh: &CoarseMesh,
    names: NameBounds,
    tops: &mut [Top],
) -> Result<Coarse, Error> {
    let fail = |problem| Err(Error::Coarse(problem));
    // Three half-edges each, and room for six more of a node.
    if mesh.faces.len() > (u32::MAX as usize - 13) / 3 || mesh.vertices.len() > MAX_VERTICES {
        return fail(CoarseProblem::TooLarge);
    }
    let mut place = vec![None; names.vertices as usize];
    let mut base = BaseMesh {
        vertices: Vec::with_capacity(mesh.vertices.len()),
        faces: Vec::with_capacity(mesh.faces.len()),
        colours: mesh.colours.clone(),
    };
    let mut trees = Vec::with_capacity(mesh.vertices.len());
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        let name = vertex.name;
        match place.get_mut(name.index()) {
            None => return fail(CoarseProblem::Name),
            Some(Some(_)) => return fail(CoarseProblem::VertexTwice(name.get())),
            Some(place) => *place = std::num::NonZeroU32::new(index as u32 + 1),
        }
        let (position, normal) = (vertex.position, vertex.normal);
        base.vertices.push(BaseVertex { position, normal, root: None });
        let top = std::mem::replace(&mut tops[name.index()], Zeroable::zeroed());
        if let Some(piece) = top.piece() {
            trees.push((top.order, piece, name.get(), index as u32));
        }
    }
    if let Some(left) = tops.iter().position(|top| top.piece().is_some()) {
        return fail(CoarseProblem::NoVertex(left as u32));
    }
    let mut seen = vec![0u64; names.faces as usize / 64 + 1];
    for face in &mesh.faces {
        let name = face.name.get();
        if name >= names.faces {
            return fail(CoarseProblem::Name);
        }
        let (word, bit) = (&mut seen[name as usize / 64], 1 << (name % 64));
        if *word & bit != 0 {
            return fail(CoarseProblem::FaceTwice(name));
        }
        *word |= bit;
        let mut corners = [0; 3];
        for (corner, v) in corners.iter_mut().zip(face.corners) {
            match place.get(v.index()).copied().flatten() {
                Some(place) => *corner = place.get() - 1,
                None => return fail(CoarseProblem::NoCorner(name)),
            }
        }
        base.faces.push(corners);
    }
    let face_names = mesh.faces.iter().map(|face| face.name).collect();
    trees.sort_unstable_by_key(|&(order, ..)| Reverse(order));
    let root = |(_, piece, name, vertex): (u32, OpenPiece, u32, u32)| CoarseRoot {
        name,
        vertex,
        size: piece.into(),
    };
    let roots = trees.into_iter().map(root).collect();
    Ok(Coarse { base, face_names, roots })
}

/// The places of vertices that have trees have to fit beside ids of nodes.
pub(crate) const MAX_VERTICES: usize = 1 << 30;
