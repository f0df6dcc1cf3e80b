//! Meshes and cameras that several tests draw.
#![allow(dead_code, missing_docs)]

use glam::Vec3;
use vk_render::{Camera, Context, ContextOptions, MeshBuffers, MeshUpdate, Vertex};

/// A context with validation. Without a driver this fails and says how to get one: a machine that cannot draw has not
/// passed the tests.
pub fn context() -> Context {
    let mut options = ContextOptions::default();
    options.validation = true;
    Context::new(&options).unwrap_or_else(|error| panic!("{error}"))
}

pub fn assert_valid(context: &Context) {
    let messages = context.validation_messages();
    assert!(messages.is_empty(), "{} messages, first: {}", messages.len(), messages[0]);
}

/// A ball of radius 1 with `detail` rings; its level grows from the bottom (0) to the top (8).
pub fn ball(detail: u32) -> (Vec<Vertex>, Vec<[u32; 3]>) {
    let around = 2 * detail;
    let mut vertices = Vec::new();
    for j in 0..=detail {
        for i in 0..around {
            let (u, v) = (i as f32 / around as f32, j as f32 / detail as f32);
            let (u, v) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
            let place = Vec3::new(u.sin() * v.sin(), -v.cos(), u.cos() * v.sin());
            vertices.push(Vertex::new(place, place, (8 * j / detail) as u8));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..detail {
        for i in 0..around {
            let (a, b) = (j * around + i, j * around + (i + 1) % around);
            triangles.push([a, b, b + around]);
            triangles.push([a, b + around, a + around]);
        }
    }
    (vertices, triangles)
}

/// Everything at once.
pub fn whole<'a>(vertices: &'a [Vertex], triangles: &'a [[u32; 3]]) -> MeshUpdate<'a> {
    MeshUpdate { vertices, triangles, ..MeshUpdate::default() }
}

pub fn mesh_of(context: &Context, vertices: &[Vertex], triangles: &[[u32; 3]]) -> MeshBuffers {
    let mut mesh = MeshBuffers::new(context).expect("an empty mesh");
    mesh.update(&whole(vertices, triangles)).expect("the first update");
    mesh
}

/// A colour for every vertex of a mesh that `ball` made: green below, blue above.
pub fn colours(vertices: &[Vertex]) -> Vec<[u8; 4]> {
    let of = |v: &Vertex| if v.position[1] < 0.0 { [40, 200, 60, 255] } else { [50, 60, 220, 255] };
    vertices.iter().map(of).collect()
}

/// As `mesh_of`, with colours.
pub fn coloured_mesh_of(
    context: &Context,
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
) -> MeshBuffers {
    let mut mesh = MeshBuffers::new(context).expect("an empty mesh");
    let colours = colours(vertices);
    mesh.update(&MeshUpdate { colours: &colours, ..whole(vertices, triangles) }).expect("colours");
    mesh
}

/// Looks at the origin along −z from 3 units away.
pub fn camera(width: u32, height: u32) -> Camera {
    let aspect = width as f32 / height as f32;
    Camera::perspective(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.8, aspect, 0.01)
}

/// A fixed sequence of numbers that look like chance.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn below(&mut self, end: u32) -> u32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(end)) as u32
    }
}
