//! Quadric error metrics (Garland and Heckbert, *Surface Simplification Using Quadric Error Metrics*, 1997).
//!
//! A [`Quadric`] is the weighted sum of squared distances to a set of planes, as a function of a point. Triangles give
//! their plane, weighted by their area; boundary edges give the plane through them that stands upright on their
//! triangle, so that boundaries keep their shape. Quadrics add; their minimiser is where a merged vertex belongs.
//!
//! Everything is in single precision and *relative to an origin the caller chooses*: keep a vertex's quadric about the
//! vertex itself and move it with [`Quadric::about`] before adding it to another one. Then precision does not depend on
//! where in space the model lies.
//!
//! ```
//! use glam::{Vec3, vec3};
//! use qem::{ErrorMetric, Quadric};
//!
//! // The corner of a cube: three faces meet in (1, 1, 1).
//! let mut corner = Quadric::default();
//! for [a, b] in [[Vec3::X, Vec3::Y], [Vec3::Y, Vec3::Z], [Vec3::Z, Vec3::X]] {
//!     corner.merge(&Quadric::from_triangle([Vec3::ONE, Vec3::ONE - a, Vec3::ONE - b]));
//! }
//! assert!(corner.cost(Vec3::ONE) < 1e-6);
//! let found = corner.optimum(vec3(0.9, 1.1, 1.0));
//! assert!(found.distance(Vec3::ONE) < 1e-3);
//! ```

mod batch;
mod metric;
mod quadric;

pub use batch::{Batch, LANES};
pub use metric::ErrorMetric;
pub use quadric::Quadric;
