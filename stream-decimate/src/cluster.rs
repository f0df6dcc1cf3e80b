//! Decimation by clustering vertices in a uniform grid (OOCS: Lindstrom, *Out-of-Core Simplification of Large Polygonal
//! Models*, 2000).
//!
//! All vertices in a cell of the grid become one, at the minimum of the quadrics of the triangles that touch the cell.
//! What the topology was, and whether anything stays a manifold, is not asked.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use mesh_io::{IndexedMesh, Triangle, TriangleSource};
use qem::{ErrorMetric, Quadric};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::presort::Open;
use crate::{
    DecimateOptions, DecimateReport, Error, MissedTarget, Observer, Progress, Stage, Target,
};

/// Triangles read at once.
const BATCH: usize = 1 << 14;
/// Bits for a cell's place along an axis.
const AXIS_BITS: u32 = 21;
/// Cells of another size are tried so often.
const MOST_TRIALS: usize = 6;
/// A number of triangles as near as this to the one asked for is near enough.
const NEAR_ENOUGH: f64 = 0.03;

/// Decimates a stream by clustering.
///
/// `open` hands out the input, several times: a first pass finds its extent and area, and then the size of the cells is
/// sought, in at most six more, that gives the number of triangles asked for. That number is met only by
/// chance; [`missed`](DecimateReport::missed) is there when it was not. With [`Target::MaxError`] cells are
/// so small that no vertex moves farther than that. Triangles that become edges or points fall away, and so thin parts
/// may. Of the options, only the target matters.
///
/// # Complexity
/// Time linear in the number of triangles, memory in the number of those that are left: about 150 bytes each.
///
/// # Errors
/// [`Error::Options`] for options out of range, [`Error::Mesh`] for an input that can't be read, [`Error::Interrupted`]
/// when the observer asks for it.
///
/// # Examples
/// ```
/// use std::ops::ControlFlow;
/// use glam::vec3;
/// use mesh_io::{IndexedMesh, MeshSource};
/// use stream_decimate::{DecimateOptions, Target, decimate_clustered};
///
/// let positions = (0..1681).map(|i| vec3((i % 41) as f32, (i / 41) as f32, 0.0)).collect();
/// let squares = (0..40).flat_map(|y| (0..40).map(move |x| 41 * y + x));
/// let triangles = squares.flat_map(|v| [[v, v + 1, v + 42], [v, v + 42, v + 41]]).collect();
/// let sheet = IndexedMesh { positions, triangles, ..Default::default() };
/// let options = DecimateOptions::new(Target::Triangles(200));
/// let mut open = || Ok(Box::new(MeshSource::new(sheet.clone(), "sheet")) as _);
/// let (mesh, report) = decimate_clustered(&mut open, &options, &mut |_| ControlFlow::Continue(()))?;
/// assert_eq!(report.output_triangles, mesh.triangles.len() as u64);
/// assert!((150..250).contains(&mesh.triangles.len()));
/// # Ok::<(), stream_decimate::Error>(())
/// ```
pub fn decimate_clustered(
    open: &mut Open<'_>,
    options: &DecimateOptions,
    observer: &mut Observer<'_>,
) -> Result<(IndexedMesh, DecimateReport), Error> {
    options.check()?;
    let mut extent = Extent::default();
    for_each_batch(&mut *open()?, Stage::Counting, observer, |batch| extent.add(batch))?;
    let target = options.target.triangles(extent.triangles);
    // How far a number of triangles is off the one asked for.
    let off = |triangles: usize| target.map_or(0, |target| target.abs_diff(triangles as u64));
    let near_enough = (NEAR_ENOUGH * target.unwrap_or(0) as f64) as u64;
    let mut size = first_size(&extent, options.target, target);
    // Sizes that gave too many triangles, and too few.
    let (mut too_small, mut too_large) = (0.0f32, f32::INFINITY);
    let mut best: Option<Clusters> = None;
    for _ in 0..MOST_TRIALS {
        let mut clusters = Clusters::new(&extent, size);
        for_each_batch(&mut *open()?, Stage::Decimating, observer, |batch| clusters.add(batch))?;
        let got = clusters.triangles.len();
        if got as u64 > target.unwrap_or(0) {
            too_small = too_small.max(clusters.size);
        } else {
            too_large = too_large.min(clusters.size);
        }
        // The number of cells goes with the area of their sides.
        let ratio = got.max(1) as f64 / target.unwrap_or(1).max(1) as f64;
        size = clusters.size * ratio.sqrt().clamp(0.25, 4.0) as f32;
        if size <= too_small || size >= too_large {
            size = too_small.sqrt() * too_large.sqrt();
        }
        if best.as_ref().is_none_or(|best| off(got) < off(best.triangles.len())) {
            best = Some(clusters);
        }
        if off(got) <= near_enough {
            break;
        }
    }
    let mesh = best.unwrap_or_default().into_mesh();
    let output = mesh.triangles.len() as u64;
    let mut report = DecimateReport {
        input_triangles: extent.triangles,
        output_triangles: output,
        target_triangles: target,
        missed: target.filter(|&target| target != output).map(|_| MissedTarget::default()),
        peak_buffer_triangles: output,
        counted: true,
        ..DecimateReport::default()
    };
    report.repaired.non_finite = extent.non_finite;
    report.repaired.degenerate = extent.degenerate;
    Ok((mesh, report))
}

/// Reads a source to its end.
fn for_each_batch(
    source: &mut dyn TriangleSource,
    stage: Stage,
    observer: &mut Observer<'_>,
    mut each: impl FnMut(&[Triangle]),
) -> Result<(), Error> {
    let mut batch = Vec::with_capacity(BATCH);
    let mut progress = Progress { stage, resolution: 1.0, ..Progress::default() };
    while source.read(&mut batch, BATCH)? > 0 {
        each(&batch);
        progress.read += batch.len() as u64;
        progress.expected = source.triangle_hint();
        if observer(&progress) == ControlFlow::Break(()) {
            return Err(Error::Interrupted);
        }
        batch.clear();
    }
    Ok(())
}

/// What the first pass finds.
#[derive(Debug)]
struct Extent {
    low: Vec3,
    high: Vec3,
    area: f64,
    triangles: u64,
    non_finite: u64,
    degenerate: u64,
}

impl Default for Extent {
    fn default() -> Self {
        let (low, high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        Self { low, high, area: 0.0, triangles: 0, non_finite: 0, degenerate: 0 }
    }
}

impl Extent {
    fn add(&mut self, batch: &[Triangle]) {
        self.triangles += batch.len() as u64;
        for &[a, b, c] in batch {
            if !(a.is_finite() && b.is_finite() && c.is_finite()) {
                self.non_finite += 1;
                continue;
            }
            if a == b || b == c || c == a {
                self.degenerate += 1;
            }
            self.low = self.low.min(a).min(b).min(c);
            self.high = self.high.max(a).max(b).max(c);
            let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
            self.area += 0.5 * (b - a).cross(c - a).length();
        }
    }

    /// The longest side of the box; 0 where there is nothing.
    fn longest(&self) -> f64 {
        (self.high.as_dvec3() - self.low.as_dvec3()).max_element().max(0.0)
    }
}

/// The size of cells to begin with.
fn first_size(extent: &Extent, wanted: Target, target: Option<u64>) -> f32 {
    match (wanted, target) {
        (Target::MaxError(distance), _) => (distance / 3.0f64.sqrt()) as f32,
        // A surface of any slope touches 3/2 cells for the area of each of their squares, and has two triangles to a cell.
        (_, Some(target)) => (3.0 * extent.area / target.max(1) as f64).sqrt() as f32,
        (_, None) => 0.0,
    }
}

/// What is gathered in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    center: Vec3,
    /// The triangles that touch it, about its center.
    quadric: Quadric,
    /// Sum of its corners of triangles, about its center, and how many they are.
    sum: Vec3,
    count: u32,
}

/// The cells that are touched, and the triangles between them.
#[derive(Debug, Default)]
struct Clusters {
    low: DVec3,
    size: f32,
    number_of: FxHashMap<u64, u32>,
    cells: Vec<Cell>,
    triangles: Vec<[u32; 3]>,
    known: FxHashSet<[u32; 3]>,
}

impl Clusters {
    /// A grid with cells of this size, or as small as they can be numbered.
    fn new(extent: &Extent, size: f32) -> Self {
        let least = (extent.longest() / f64::from((1u32 << AXIS_BITS) - 2)) as f32;
        let size = if size.is_finite() { size.max(least).max(f32::MIN_POSITIVE) } else { least };
        Self { low: extent.low.as_dvec3(), size, ..Self::default() }
    }

    fn add(&mut self, batch: &[Triangle]) {
        for triangle in batch.iter().filter(|t| t.iter().all(|p| p.is_finite())) {
            let corners = triangle.map(|p| self.cell_of(p));
            for (place, &number) in corners.iter().enumerate() {
                let cell = &mut self.cells[number as usize];
                cell.sum += triangle[place] - cell.center;
                cell.count += 1;
                // Once for each cell it touches.
                if !corners[..place].contains(&number) {
                    cell.quadric.merge(&Quadric::from_triangle(triangle.map(|p| p - cell.center)));
                }
            }
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                let first = [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or(corners);
                if self.known.insert(first) {
                    self.triangles.push(first);
                }
            }
        }
    }

    /// The number of the cell that a point is in.
    fn cell_of(&mut self, p: Vec3) -> u32 {
        let size = f64::from(self.size);
        let place = ((p.as_dvec3() - self.low) / size).floor();
        let [x, y, z] = place.to_array().map(|c| c as u64);
        let key = (x << AXIS_BITS | y) << AXIS_BITS | z;
        *self.number_of.entry(key).or_insert_with(|| {
            let center = (self.low + (place + 0.5) * size).as_vec3();
            let center = center.clamp(Vec3::splat(f32::MIN), Vec3::splat(f32::MAX));
            self.cells.push(Cell { center, ..Cell::default() });
            self.cells.len() as u32 - 1
        })
    }

    /// Places a vertex in every cell that has a triangle.
    fn into_mesh(self) -> IndexedMesh {
        const NONE: u32 = u32::MAX;
        let half = 0.5 * self.size;
        let mut number = vec![NONE; self.cells.len()];
        let mut positions = Vec::new();
        let mut triangles = self.triangles;
        for v in triangles.as_flattened_mut() {
            let number = &mut number[*v as usize];
            if *number == NONE {
                *number = positions.len() as u32;
                let cell = &self.cells[*v as usize];
                let at = cell.quadric.optimum(cell.sum / cell.count as f32);
                let at = cell.center + at.clamp(Vec3::splat(-half), Vec3::splat(half));
                // Where squares of lengths overflow there is no optimum.
                positions.push(if at.is_finite() { at } else { cell.center });
            }
            *v = *number;
        }
        IndexedMesh { positions, triangles, ..Default::default() }
    }
}
