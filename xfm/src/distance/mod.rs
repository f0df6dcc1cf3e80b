//! The distance between two surfaces, measured from both sides.
//!
//! # Definition
//!
//! For a point `p` and a surface `S` (the union of its closed triangles) `d(p, S)` is the Euclidean distance from `p`
//! to the nearest point of `S`, found exactly, not to the nearest vertex or sample. From it, for the direction `a_to_b`:
//!
//! - `mean` is the mean of `d(p, B)` over the points `p` of surface `A`, every unit of area counting the same;
//! - `rms` is the square root of the mean of `d(p, B)²` over the same points;
//! - `max` is the largest `d(p, B)` seen, over the same points *and* every vertex of `A`.
//!
//! `b_to_a` is the same with the surfaces exchanged. The two differ: a hole in `B` is far from `A → B`'s point of view
//! and invisible from `B`'s. The larger of the two maxima is the (sampled) Hausdorff distance.
//!
//! The means are integrals over a surface, estimated by [`DistanceOptions::samples`] points spread evenly by area: the
//! surface is cut into that many pieces of equal area and one point is drawn in each. `max` is a lower bound of the
//! true maximum, which may lie inside a triangle between samples.
//!
//! The result depends on the two surfaces, the number of samples and the seed, and on nothing else: the same bits come
//! out for any number of threads.
//!
//! # Sources
//!
//! The measure is that of P. Cignoni, C. Rocchini, R. Scopigno, *Metro: measuring error on simplified surfaces* (1998),
//! §3, with stratified samples in place of its scan lines.
//!
//! # Examples
//!
//! ```
//! use glam::DVec3;
//! use xfm::distance::{DistanceOptions, Surface, measure};
//!
//! let square = |z: f64| {
//!     let corner = |x, y| DVec3::new(x, y, z);
//!     let corners = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
//!     Surface::new(corners, vec![[0, 1, 2], [0, 2, 3]])
//! };
//! let options = DistanceOptions { samples: 1000, ..DistanceOptions::default() };
//! let apart = measure(&square(0.0)?, &square(0.5)?, &options)?;
//! assert!((apart.a_to_b.rms - 0.5).abs() < 1e-12);
//! assert!((apart.a_to_b.max - 0.5).abs() < 1e-12);
//! # Ok::<(), xfm::distance::DistanceError>(())
//! ```

mod frame;
mod measure;
mod sample;
mod surface;
mod tree;
mod triangle;

#[cfg(test)]
mod tests;

pub use measure::{
    DistanceOptions, DistanceReport, NoObserver, Observer, OneSided, measure, measure_observed,
};
pub use surface::{DistanceError, Side, Surface};
