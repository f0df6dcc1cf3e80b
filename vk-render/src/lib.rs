//! Draws a mesh that changes a little every frame, through Vulkan.
//!
//! A [`MeshBuffers`] is the device's copy of a mesh; [`MeshBuffers::update`] sends it what has changed and nothing else.
//! A [`Scene`] is that mesh, a [`Camera`] and a [`Shading`], with lines, text and a user interface's panels ([`Ui`]) if wanted; an [`Offscreen`] target turns
//! it into an [`Image`], a [`WindowTarget`] shows it. The same code draws on a graphics card and on a software driver.
//!
//! ```
//! use glam::Vec3;
//! use vk_render::{Camera, Context, ContextOptions, MeshBuffers, MeshUpdate, Offscreen, Scene, Vertex};
//!
//! # fn main() -> vk_render::Result<()> {
//! let context = Context::new(&ContextOptions::default())?;
//! let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
//! let vertices = corners.map(|corner| Vertex::new(corner, Vec3::Z, 0));
//!
//! let mut mesh = MeshBuffers::new(&context)?;
//! mesh.update(&MeshUpdate { vertices: &vertices, triangles: &[[0, 1, 2]], ..Default::default() })?;
//!
//! let camera = Camera::perspective(Vec3::Z * 2.0, Vec3::ZERO, Vec3::Y, 1.0, 4.0 / 3.0, 0.01);
//! let image = Offscreen::new(&context, 64, 48)?.draw(&Scene::new(&mesh, camera))?;
//! assert_ne!(image.pixel(36, 18), image.pixel(10, 18), "the triangle and what is beside it");
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//! Right-handed coordinates; triangles counter-clockwise seen from outside; the inside is drawn too, in red. Depth is
//! reversed (see [`Camera`]). Colours that callers give are sRGB. Matrices and positions are single precision: give
//! positions relative to an origin near the model.
//!
//! # Waiting
//! Nothing waits for the device but what must: [`Offscreen::draw`] for its picture, a target for the picture before
//! the last one, an update for room when more than 8 MiB are on their way, a resize of a window, and drops.
//!
//! # What is required
//! Vulkan 1.1 and nothing beyond its core; multisampling, 32-bit indices, swapchains and the validation layer are
//! used where they are found.

mod camera;
mod context;
mod error;
mod gpu;
mod mesh;
mod offscreen;
mod overlay;
mod painter;
mod ranges;
mod scene;
mod texture;
mod ui;
mod upload;
mod vertex;
mod window;

pub use camera::Camera;
pub use context::{Context, ContextOptions, DeviceChoice};
pub use error::{Error, Result};
pub use mesh::{MeshBuffers, MeshUpdate, Uploaded};
pub use offscreen::Offscreen;
pub use scene::{Background, Image, Line, Scene, Section, Shading, Text};
pub use texture::Texture;
pub use ui::{Ui, UiPiece, UiVertex};
pub use vertex::Vertex;
pub use window::{Pacing, Presented, WindowTarget};
