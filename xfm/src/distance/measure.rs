//! The measurement itself: every point of one surface against the tree of the other.

use rayon::prelude::*;

use super::frame::Frame;
use super::sample::Sampler;
use super::surface::{DistanceError, Side, Surface};
use super::tree::Tree;

/// Points that one task works through in order. Part of the result's definition only through the order of summation,
/// therefore fixed and independent of the number of threads.
const BATCH: usize = 2048;

/// How finely to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DistanceOptions {
    /// Samples drawn on each surface, at least 1; default 500,000, with which mean and RMS of a scan are stable to about
    /// three digits from one seed to another. Vertices come on top, for the maximum only.
    pub samples: usize,
    /// Which samples are drawn; default 0.
    pub seed: u64,
}

impl Default for DistanceOptions {
    fn default() -> Self {
        Self { samples: 500_000, seed: 0 }
    }
}

/// Distances from the points of one surface to the other surface.
///
/// # Units
///
/// Model units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneSided {
    /// The largest distance over samples and vertices.
    pub max: f64,
    /// The mean distance over the surface.
    pub mean: f64,
    /// The root of the mean squared distance over the surface.
    pub rms: f64,
}

/// The distances between two surfaces; the module's documentation defines them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistanceReport {
    /// The diagonal of the bounding box of `A`, in model units: what percentages refer to.
    pub diagonal: f64,
    /// From points of `A` to surface `B`.
    pub a_to_b: OneSided,
    /// From points of `B` to surface `A`.
    pub b_to_a: OneSided,
}

/// Is told how the work goes on, and may end it.
pub trait Observer: Sync {
    /// `points` more of the total have been measured. Called from any thread.
    fn advance(&self, points: u64);

    /// Called once before the first point, with the number of points to come.
    fn begin(&self, total_points: u64);

    /// Whether to give up; asked often, from any thread.
    fn is_cancelled(&self) -> bool;
}

/// Lets the work run to its end in silence.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoObserver;

impl Observer for NoObserver {
    fn advance(&self, _points: u64) {}

    fn begin(&self, _total_points: u64) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Measures the distances between two surfaces in both directions.
///
/// Runs on the current rayon pool; the result is the same for any number of threads.
///
/// # Complexity
///
/// O(n log n) in the triangles for two search trees (about 80 bytes per triangle), then about a microsecond per sample
/// and vertex where the surfaces are close.
///
/// # Errors
///
/// [`DistanceError::NoArea`] if a surface consists of degenerate triangles only.
pub fn measure(
    a: &Surface,
    b: &Surface,
    options: &DistanceOptions,
) -> Result<DistanceReport, DistanceError> {
    measure_observed(a, b, options, &NoObserver)
}

/// [`measure`], with reports of progress and the possibility to cancel.
///
/// # Errors
///
/// As [`measure`], and [`DistanceError::Cancelled`] if the observer said so.
pub fn measure_observed(
    a: &Surface,
    b: &Surface,
    options: &DistanceOptions,
    observer: &impl Observer,
) -> Result<DistanceReport, DistanceError> {
    let frame = Frame::around(a, b);
    let (tree_a, tree_b) = rayon::join(|| Tree::new(a, &frame), || Tree::new(b, &frame));
    let samples = options.samples.max(1);
    let sampler = |tree, side| {
        Sampler::new(tree, samples, options.seed)
            .ok_or(DistanceError::NoArea { side, triangles: tree.triangles.len() })
    };
    let (sampler_a, sampler_b) = (sampler(&tree_a, Side::A)?, sampler(&tree_b, Side::B)?);
    let num_points = 2 * samples + tree_a.positions.len() + tree_b.positions.len();
    observer.begin(num_points as u64);
    let one_sided = |tree: &Tree, sampler: &Sampler<'_>, target: &Tree| -> Option<OneSided> {
        let vertices = over_batches(tree.positions.len(), target, observer, |range, visit| {
            tree.positions[range].iter().for_each(|&position| visit(position));
        })?;
        let sampled = over_batches(samples, target, observer, |range, visit| {
            sampler.draw(range, visit);
        })?;
        Some(OneSided {
            max: frame.length_outside(vertices.max_squared.max(sampled.max_squared).sqrt()),
            mean: frame.length_outside(sampled.sum / samples as f64),
            rms: frame.length_outside((sampled.sum_squared / samples as f64).sqrt()),
        })
    };
    let a_to_b = one_sided(&tree_a, &sampler_a, &tree_b).ok_or(DistanceError::Cancelled)?;
    let b_to_a = one_sided(&tree_b, &sampler_b, &tree_a).ok_or(DistanceError::Cancelled)?;
    Ok(DistanceReport { diagonal: a.diagonal(), a_to_b, b_to_a })
}

/// Sums over distances, in the frame.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    sum: f64,
    sum_squared: f64,
    max_squared: f64,
}

/// Measures points in batches on all threads and adds the batches up in order; `None` when cancelled.
///
/// `points` hands the points of a range, in order, to its second argument.
fn over_batches(
    num_points: usize,
    target: &Tree,
    observer: &impl Observer,
    points: impl Fn(std::ops::Range<usize>, &mut dyn FnMut(glam::DVec3)) + Sync,
) -> Option<Sums> {
    let batches: Vec<Sums> = (0..num_points.div_ceil(BATCH))
        .into_par_iter()
        .map(|batch| {
            if observer.is_cancelled() {
                return None;
            }
            let range = batch * BATCH..((batch + 1) * BATCH).min(num_points);
            let length = range.len() as u64;
            let mut sums = Sums::default();
            let mut hint = 0;
            points(range, &mut |point| {
                let nearest = target.nearest(point, hint);
                hint = nearest.triangle;
                sums.sum += nearest.distance_squared.sqrt();
                sums.sum_squared += nearest.distance_squared;
                sums.max_squared = sums.max_squared.max(nearest.distance_squared);
            });
            observer.advance(length);
            Some(sums)
        })
        .collect::<Option<_>>()?;
    Some(batches.iter().fold(Sums::default(), |total, batch| Sums {
        sum: total.sum + batch.sum,
        sum_squared: total.sum_squared + batch.sum_squared,
        max_squared: total.max_squared.max(batch.max_squared),
    }))
}
