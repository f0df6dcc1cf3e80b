//! Deterministic test meshes of any size, streamed in constant memory.
//!
//! Every shape is emitted in layers along its longest axis (y, for the torus x), so the output is
//! approximately sorted; [`Options::shuffle`] permutes the blocks it is generated in instead. Right-handed
//! coordinates in millimetres; faces are counter-clockwise seen from outside; each shape is closed
//! unless [`Options::holes`] asks otherwise.

mod command;
mod figure;
mod isosurface;
mod marching;
mod noise;
mod output;
mod rings;
mod scan;
mod torus;

pub use command::{Arguments, run, write_file};

use std::io;

use crate::Error;
use rings::RingSurface;

/// Three corners, counter-clockwise seen from outside.
pub type Triangle = [[f32; 3]; 3];

/// What takes the triangles, some thousands at a time.
pub type Emit<'a> = dyn FnMut(&[Triangle]) -> io::Result<()> + 'a;

/// The largest share of boundary edges that [`Options::holes`] can ask for.
pub const MAX_HOLES: f64 = 0.15;

/// The largest number of triangles that can be asked for.
pub const MAX_TRIANGLES: u64 = 400_000_000;

/// The least number of triangles that can be asked for.
pub const MIN_TRIANGLES: u64 = 200;

/// The meshes there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Shape {
    /// A statue-like scan: lobes, folds, a flat face, detail at many scales, scanner noise; genus 0.
    Scan,
    /// A bumpy torus; genus 1.
    Torus,
    /// Marching tetrahedra over an analytic function, block by block.
    Isosurface,
}

/// What to generate.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Options {
    /// The shape.
    pub shape: Shape,
    /// Triangles asked for (before holes), [`MIN_TRIANGLES`] to [`MAX_TRIANGLES`]. `Scan` makes
    /// exactly that many if even, `Torus` the nearest product, `Isosurface` comes near.
    pub triangles: u64,
    /// Share of all edges that shall lie on a boundary, 0 (closed, the default) to [`MAX_HOLES`].
    pub holes: f64,
    /// Emit small blocks in a random order instead of layer by layer; default false.
    pub shuffle: bool,
    /// Added to each position before it is rounded to f32; default the origin.
    pub origin: [f64; 3],
    /// Chooses noise, holes and order; default 0.
    pub seed: u64,
}

impl Options {
    /// A closed, sorted mesh about the origin.
    pub fn new(shape: Shape, triangles: u64) -> Self {
        Self { shape, triangles, holes: 0.0, shuffle: false, origin: [0.0; 3], seed: 0 }
    }
}

/// A mesh ready to be streamed, as often as one likes: each time the same triangles.
#[derive(Debug)]
pub struct Generator {
    options: Options,
    surface: Surface,
}

#[derive(Debug)]
enum Surface {
    Scan(scan::Scan),
    Torus(torus::Torus),
    Isosurface(Box<isosurface::Isosurface>),
}

impl Generator {
    /// Plans the mesh.
    ///
    /// # Errors
    /// [`Error::Unsupported`] when a value is out of range.
    pub fn new(options: &Options) -> Result<Self, Error> {
        if !(MIN_TRIANGLES..=MAX_TRIANGLES).contains(&options.triangles) {
            return Err(Error::Unsupported(format!(
                "{} triangles asked for; choose {MIN_TRIANGLES} to {MAX_TRIANGLES}",
                options.triangles
            )));
        }
        if !(0.0..=MAX_HOLES).contains(&options.holes) {
            return Err(Error::Unsupported(format!(
                "a share of holes of {} asked for; choose 0 to {MAX_HOLES}",
                options.holes
            )));
        }
        let surface = match options.shape {
            Shape::Scan => Surface::Scan(scan::Scan::new(options)),
            Shape::Torus => Surface::Torus(torus::Torus::new(options)),
            Shape::Isosurface => {
                Surface::Isosurface(Box::new(isosurface::Isosurface::new(options)))
            }
        };
        Ok(Self { options: options.clone(), surface })
    }

    /// The number of triangles that [`triangles`](Self::triangles) emits.
    ///
    /// # Complexity
    /// Time goes with the rings and holes of a scan or torus; an isosurface is walked without its
    /// positions.
    pub fn num_triangles(&self) -> u64 {
        match &self.surface {
            Surface::Scan(scan) => rings::num_triangles(scan, &self.options),
            Surface::Torus(torus) => rings::num_triangles(torus, &self.options),
            Surface::Isosurface(isosurface) => isosurface.num_triangles(&self.options),
        }
    }

    /// Streams the triangles.
    ///
    /// # Errors
    /// The first error of `emit`.
    pub fn triangles(&self, emit: &mut Emit<'_>) -> io::Result<()> {
        match &self.surface {
            Surface::Scan(scan) => rings::triangles(scan, &self.options, emit),
            Surface::Torus(torus) => rings::triangles(torus, &self.options, emit),
            Surface::Isosurface(isosurface) => isosurface.triangles(&self.options, emit),
        }
    }

    /// The surface as rings of numbered vertices, where it is one.
    fn rings(&self) -> Option<&dyn RingSurface> {
        match &self.surface {
            Surface::Scan(scan) => Some(scan),
            Surface::Torus(torus) => Some(torus),
            Surface::Isosurface(_) => None,
        }
    }
}
