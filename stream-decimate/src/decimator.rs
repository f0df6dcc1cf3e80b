//! The procedure as a whole (Wu and Kobbelt 2003, §4.1), as something to push triangles into.

use mesh_io::{Triangle, TriangleSink};
use rayon::ThreadPool;

use crate::finality::Finality;
use crate::insert::{Inserter, clock};
use crate::missed;
use crate::portion::{Portion, state};
use crate::rate::Rules;
use crate::reorder::reorder;
use crate::round::Decimation;
use crate::sealed::Sealed;
use crate::sweep::SWEPT;
use crate::write;
use crate::{DecimateOptions, DecimateReport, Error, Progress, Target};

/// Triangles written at a time.
const BATCH: usize = 1 << 12;

/// Late triangles beyond which a stream is out of order: so many, and more than such a share of all.
const FEW_CRACKS: u64 = 1_000;
const CRACKS_IN_ORDER: f64 = 1e-3;

/// What to do when waiting triangles crowd the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WhenCrowded {
    /// Take the boundaries that have waited longest for true ones.
    Seal,
    /// Report [`Error::Unsorted`].
    Fail,
}

/// Decimates the triangles that are pushed into it, in a buffer of fixed size.
///
/// Output goes to the sink as soon as it is final; most of it may come with [`finish`](Self::finish).
///
/// ```
/// use glam::vec3;
/// use mesh_io::{Error, Triangle, TriangleSink};
/// use stream_decimate::{DecimateOptions, StreamDecimator, Target};
///
/// struct Count(usize);
/// impl TriangleSink for Count {
///     fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
///         self.0 += triangles.len();
///         Ok(())
///     }
///     fn finish(self: Box<Self>) -> Result<(), Error> {
///         Ok(())
///     }
/// }
///
/// let mut count = Count(0);
/// let mut decimator = StreamDecimator::new(&DecimateOptions::new(Target::Ratio(0.1)), None)?;
/// let height = |x: i32, y: i32| vec3(x as f32, y as f32, (x as f32 * 0.1).sin() * (y as f32 * 0.1).cos());
/// for y in 0..100 {
///     for x in 0..100 {
///         let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| height(x + i, y + j));
///         decimator.push(&[[a, b, c], [a, c, d]], &mut count)?;
///     }
/// }
/// let report = decimator.finish(&mut count)?;
/// assert_eq!((report.input_triangles, report.output_triangles), (20_000, 2_000));
/// assert_eq!(count.0, 2_000);
/// # Ok::<(), stream_decimate::Error>(())
/// ```
#[derive(Debug)]
pub struct StreamDecimator {
    capacity: usize,
    target: Target,
    /// The share of triangles to keep, as far as it is known before the end.
    ratio: f64,
    expected: Option<u64>,
    when_crowded: WhenCrowded,
    /// The axis and the coordinate below which every vertex in the buffer has had its last triangle.
    below: Option<(usize, f32)>,
    pool: ThreadPool,
    portion: Portion,
    inserter: Inserter,
    decimation: Decimation,
    read: u64,
    /// Triangles left in the buffer when there was room again, without those that waited.
    left: usize,
    written: u64,
    peak: usize,
    sealed: u64,
    out: Vec<Triangle>,
}

impl StreamDecimator {
    /// A decimator with an empty buffer, for a stream of `expected` triangles, if that is known.
    ///
    /// # Errors
    /// Options out of range; a number of triangles asked for that is too large for a stream of unknown length.
    pub fn new(options: &DecimateOptions, expected: Option<u64>) -> Result<Self, Error> {
        options.check()?;
        let capacity = options.buffer_triangles;
        let ratio = match (options.target, expected) {
            (Target::Ratio(ratio), _) => ratio,
            (Target::Triangles(target), Some(expected)) => {
                (target as f64 / expected.max(1) as f64).min(1.0)
            }
            // Nothing may be written before the end.
            (Target::Triangles(target), None) if target <= capacity as u64 / 2 => 0.0,
            (Target::Triangles(target), None) => {
                let needed = 2 * target;
                return Err(Error::UnknownLength { target, buffer: capacity, needed });
            }
            (Target::MaxError(_), _) => 0.0,
        };
        let most_deviation = match options.target {
            Target::MaxError(most) => rounded_down(most),
            _ => f32::INFINITY,
        };
        let rules = Rules { placement: options.placement, most_deviation };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.map_or(0, |n| n.get()))
            .build()
            .map_err(Error::Threads)?;
        let mut portion = Portion::with_capacity(capacity * 9 / 16);
        portion.sealed = Sealed::remembering(capacity / 8);
        let mut inserter = Inserter::default();
        inserter.begin(&mut portion, capacity / 2);
        Ok(Self {
            capacity,
            target: options.target,
            ratio,
            expected,
            when_crowded: WhenCrowded::Seal,
            below: None,
            pool,
            portion,
            inserter,
            decimation: Decimation::new(rules, options.candidates, options.seed),
            read: 0,
            left: 0,
            written: 0,
            peak: 0,
            sealed: 0,
            out: Vec::new(),
        })
    }

    /// Another answer to a crowded buffer than to seal boundaries.
    pub(crate) fn when_crowded(mut self, answer: WhenCrowded) -> Self {
        self.when_crowded = answer;
        self
    }

    /// The number of triangles to expect, for progress alone.
    pub(crate) fn expect(&mut self, hint: Option<u64>) {
        self.expected = hint;
    }

    /// Takes triangles; as the buffer fills, decimates, and writes what is final to the sink.
    ///
    /// # Errors
    /// Those of the sink; [`Error::Unsorted`].
    pub fn push(
        &mut self,
        triangles: &[Triangle],
        sink: &mut dyn TriangleSink,
    ) -> Result<(), Error> {
        self.push_with(triangles, Finality::Unknown, sink)
    }

    /// As [`push`](Self::push), with what is known about the last triangles of vertices.
    pub(crate) fn push_with(
        &mut self,
        triangles: &[Triangle],
        finality: Finality<'_>,
        sink: &mut (impl TriangleSink + ?Sized),
    ) -> Result<(), Error> {
        let last: &[u8] = match finality {
            Finality::Corners(tags) => tags,
            _ => &[],
        };
        let mut at = 0;
        while at < triangles.len() {
            if self.is_full() {
                self.make_room(sink)?;
            }
            // So many fit, whatever they are.
            let room = (self.capacity - self.portion.num_triangles())
                .min((self.most_vertices() - self.portion.num_vertices()) / 3);
            let end = triangles.len().min(at + room);
            let last = last.get(at..end).unwrap_or_default();
            self.inserter.insert_all(&mut self.portion, &triangles[at..end], &[], last, self.read);
            self.read += (end - at) as u64;
            at = end;
        }
        // What is known of the batch is known once all of it is in the buffer.
        if let Finality::Below { axis, coordinate } = finality {
            self.below = Some((axis, coordinate));
        }
        Ok(())
    }

    /// Ends the stream: decimates what is left to the target, and writes it. Does not [`finish`](TriangleSink::finish)
    /// the sink.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn finish(mut self, sink: &mut dyn TriangleSink) -> Result<DecimateReport, Error> {
        self.finish_with(sink)
    }

    /// As [`finish`](Self::finish).
    pub(crate) fn finish_with(
        &mut self,
        sink: &mut (impl TriangleSink + ?Sized),
    ) -> Result<DecimateReport, Error> {
        self.peak = self.peak.max(self.portion.num_triangles());
        for v in 0..self.portion.num_slots() as u32 {
            if self.portion.state(v) == state::OPEN {
                self.inserter.seal(&mut self.portion, v);
            }
        }
        let target = self.target.triangles(self.read);
        let goal = target.map_or(0, |target| target.saturating_sub(self.written)) as usize;
        let share = match self.ratio > 0.0 {
            true => self.ratio,
            false => goal as f64 / self.read.max(1) as f64,
        };
        let far = (SWEPT * goal as f64) as usize;
        let sweep_goal = self.sweep_goal(goal, far, share, 0);
        self.settle_and_run(goal, 0, [sweep_goal, goal]);
        let output = self.written + self.portion.num_triangles() as u64;
        let missed = target.filter(|&target| output > target).map(|target| {
            missed::reasons(&mut self.portion, output - target, &self.decimation.rules)
        });
        write::write_all(&mut self.portion, &mut self.out);
        self.flush(sink)?;
        Ok(DecimateReport {
            input_triangles: self.read,
            output_triangles: self.written,
            target_triangles: target,
            missed,
            peak_buffer_triangles: self.peak as u64,
            repaired: self.inserter.repairs,
            sealed_vertices: self.sealed,
            ..Default::default()
        })
    }

    /// How far the run is.
    pub fn progress(&self) -> Progress {
        let represented = self.read as f64 - self.written as f64 / self.ratio.max(f64::EPSILON);
        let buffered = self.portion.num_triangles() as u64;
        Progress {
            read: self.read,
            expected: self.expected,
            written: self.written,
            buffered,
            capacity: self.capacity as u64,
            resolution: buffered as f64 / represented.max(buffered as f64).max(1.0),
            ..Default::default()
        }
    }

    /// Vertices the buffer holds at most: half as many again as a closed mesh has.
    fn most_vertices(&self) -> usize {
        self.capacity * 3 / 4
    }

    /// Whether there is no room for another triangle, whatever it is like.
    fn is_full(&self) -> bool {
        self.portion.num_triangles() >= self.capacity
            || self.portion.num_vertices() + 3 > self.most_vertices()
    }

    /// The share of the buffer that is in use.
    fn filling(&self) -> f64 {
        let triangles = self.portion.num_triangles() as f64 / self.capacity as f64;
        triangles.max((self.portion.num_vertices() + 3) as f64 / self.most_vertices() as f64)
    }

    /// DECIMATE and WRITE until the buffer is half empty (§4.1's hysteresis).
    fn make_room(&mut self, sink: &mut (impl TriangleSink + ?Sized)) -> Result<(), Error> {
        self.peak = self.peak.max(self.portion.num_triangles());
        self.inserter.seal_final(&mut self.portion, self.below);
        let cracks = self.inserter.repairs.late_cracks;
        if cracks > FEW_CRACKS && cracks as f64 > CRACKS_IN_ORDER * self.read as f64 {
            return Err(self.unsorted(self.portion.num_waiting_triangles()));
        }
        let half = self.capacity / 2;
        let slack = self.capacity / 50;
        let waiting = self.portion.num_waiting_triangles();
        if 2 * waiting > self.capacity {
            self.relieve(waiting)?;
        }
        let waiting = self.portion.num_waiting_triangles() as u64;
        // What those that wait for nothing become at the target's resolution.
        let level = self.ratio * (self.read - waiting.min(self.read)) as f64 + waiting as f64
            - self.written as f64;
        // If the rest of the output fits into the buffer, nothing need be coarser than that before the end.
        let rest = match self.expected {
            Some(expected) => self.ratio * expected as f64 - self.written as f64,
            None => 0.0,
        };
        let most = self.capacity / 8 * 5;
        let kept = if rest <= self.capacity as f64 { rest.min(most as f64) } else { 0.0 };
        let goal = half.max(level.max(kept) as usize);
        let at_level = goal as f64 <= level;
        // Sweeps are for what is far from that.
        let far = (SWEPT * (level - waiting as f64) + waiting as f64).max(kept) as usize;
        let sweep_goal = match far {
            // How much is wanted in the end is not known everywhere.
            _ if self.ratio == 0.0 => goal,
            far if far <= goal => far.max(half / 2),
            far if at_level => self.sweep_goal(goal, far, self.ratio, waiting as usize),
            far => self.sweep_goal(goal, far, goal as f64 / self.read as f64, waiting as usize),
        };
        self.settle_and_run(goal, slack, [sweep_goal, goal.min(level as usize)]);
        // What stays can still be decimated; but it takes room from what is read next.
        let settled = level - waiting as f64 > 0.375 * self.capacity as f64;
        let full_enough = if settled && kept == 0.0 { 0.5625 } else { 0.875 };
        if self.filling() > full_enough {
            let left = self.portion.num_triangles() as f64 * 0.5 / self.filling();
            write::write(&mut self.portion, left as usize, &mut self.out);
            self.flush(sink)?;
        }
        if self.filling() > 0.9375 {
            // Neither decimated nor written: it waits.
            return Err(self.unsorted(self.portion.num_waiting_triangles()));
        }
        self.left = self.portion.num_triangles().saturating_sub(waiting as usize);
        self.inserter.begin(&mut self.portion, self.capacity / 4);
        Ok(())
    }

    /// Where sweeps end on the way to a goal that is a share of what was read: not below `far`, nor where what is new since the
    /// buffer was decimated last has become some times as much as it will in the end. What is older stays for the rounds.
    fn sweep_goal(&self, goal: usize, far: usize, share: f64, waiting: usize) -> usize {
        let old = self.left + waiting;
        let fresh = self.portion.num_triangles().saturating_sub(old);
        far.min(old + (SWEPT * share * fresh as f64) as usize).max(goal)
    }

    /// Makes candidates of all vertices that have become complete, and decimates to the goal, the first part in sweeps.
    fn settle_and_run(&mut self, goal: usize, slack: usize, [sweep_goal, least]: [usize; 2]) {
        let Self { portion, decimation, pool, .. } = self;
        portion.settle();
        pool.install(|| {
            reorder(portion);
            // What a limit leaves undecided until each collapse is tried is no matter for sweeps.
            if !decimation.rules.has_limit() {
                decimation.sweep(portion, sweep_goal, least);
            }
            decimation.run(portion, goal, slack);
        });
    }

    /// Seals the boundaries that have waited longest, of a crowded buffer.
    fn relieve(&mut self, waiting: usize) -> Result<(), Error> {
        if self.when_crowded == WhenCrowded::Fail {
            return Err(self.unsorted(waiting));
        }
        let open: Vec<u32> = (0..self.portion.num_slots() as u32)
            .filter(|&v| self.portion.state(v) == state::OPEN)
            .collect();
        let mut times: Vec<u32> = open.iter().map(|&v| self.portion.waiting[v as usize]).collect();
        times.sort_unstable();
        // Three quarters of them; but never those that came with the last eighth of the buffer.
        let young = clock(self.read.saturating_sub(self.capacity as u64 / 8));
        let before = times.get(times.len() * 3 / 4).map_or(young, |&time| time.min(young));
        for v in open {
            if self.portion.waiting[v as usize] < before {
                self.portion.sealed.add(self.portion.position(v), v);
                self.inserter.seal(&mut self.portion, v);
                self.sealed += 1;
            }
        }
        Ok(())
    }

    fn unsorted(&self, waiting: usize) -> Error {
        Error::Unsorted { read: self.read, waiting: waiting as u64, buffer: self.capacity }
    }

    fn flush(&mut self, sink: &mut (impl TriangleSink + ?Sized)) -> Result<(), Error> {
        for batch in self.out.chunks(BATCH) {
            sink.write(batch)?;
        }
        self.written += self.out.len() as u64;
        self.out = Vec::new();
        Ok(())
    }
}

/// The nearest single that is not more.
fn rounded_down(most: f64) -> f32 {
    let nearest = most as f32;
    if f64::from(nearest) > most { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::messy::sheet;

    struct Nowhere;

    impl TriangleSink for Nowhere {
        fn write(&mut self, _triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
            Ok(())
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..Default::default() })]

        #[test]
        fn the_buffer_holds_a_manifold_at_any_time(
            rows in 10usize..60,
            holes in 3usize..50,
            mess in prop::collection::vec(any::<usize>(), 0..60),
            buffer in 64usize..1000,
            ratio in 0.01f64..1.0,
        ) {
            let mut options = DecimateOptions::new(Target::Ratio(ratio));
            options.buffer_triangles = buffer;
            let mut decimator = StreamDecimator::new(&options, None).unwrap();
            for batch in sheet(rows, holes, &mess).chunks(50) {
                match decimator.push(batch, &mut Nowhere) {
                    Ok(()) => {}
                    Err(Error::Unsorted { .. }) => return Ok(()),
                    Err(error) => panic!("{error}"),
                }
                prop_assert_eq!(decimator.portion.validate(), Ok(()));
                prop_assert!(decimator.portion.num_triangles() <= buffer);
            }
            decimator.finish(&mut Nowhere).unwrap();
        }
    }
}
