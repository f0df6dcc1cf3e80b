//! Names of vertices and triangles, by which collapses are told: they stay what they are while a vertex or triangle is in the
//! buffer, wherever it is moved there, and are used again after that.

use glam::Vec3;

/// Who a vertex is, where collapses are recorded.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Identity {
    pub(crate) name: u32,
    /// One more than the rank of the collapse that touched it last.
    pub(crate) touched: u32,
    /// The sum of the normals of the triangles it came with.
    pub(crate) normal: Vec3,
    /// The sum of the unit normals of all vertices that it has taken and of its own; zero while triangles may still come.
    pub(crate) mean: Vec3,
}

/// The names that are not in use.
#[derive(Debug, Default)]
pub(crate) struct Names {
    pub(crate) vertices: Free,
    pub(crate) faces: Free,
}

impl Names {
    pub(crate) fn take_vertex(&mut self) -> u32 {
        self.vertices.take()
    }

    pub(crate) fn give_back_vertex(&mut self, name: u32) {
        self.vertices.names.push(name);
    }

    pub(crate) fn take_face(&mut self) -> u32 {
        self.faces.take()
    }

    pub(crate) fn give_back_face(&mut self, name: u32) {
        self.faces.names.push(name);
    }
}

/// Those of one kind.
#[derive(Debug, Default)]
pub(crate) struct Free {
    pub(crate) names: Vec<u32>,
    /// How many have ever been in use.
    pub(crate) used: u32,
}

impl Free {
    fn take(&mut self) -> u32 {
        self.names.pop().unwrap_or_else(|| {
            self.used += 1;
            self.used - 1
        })
    }
}

/// The share of a triangle in the normal of its first corner, weighted such that normals are exact on spheres.
///
/// # Sources
/// Max, *Weights for Computing Vertex Normals from Facet Normals*, 1999.
pub(crate) fn normal_at([p, q, r]: [Vec3; 3], cross: Vec3) -> Vec3 {
    let weight = (q - p).length_squared() * (r - p).length_squared();
    if weight > 0.0 && weight.is_finite() { cross / weight } else { Vec3::ZERO }
}
