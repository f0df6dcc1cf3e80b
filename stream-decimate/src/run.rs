//! From a source to a sink, with parsing, decimation and writing on threads of their own.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use mesh_io::{Colour, Frame, Triangle, TriangleSink, TriangleSource};
use scratch::Scratch;

use crate::decimator::{StreamDecimator, WhenCrowded};
use crate::finality::{self, Direct, Feed, Finality};
use crate::presort::{self, Open};
use crate::{DecimateOptions, DecimateReport, Error, Observer, Progress};

/// Triangles that go from thread to thread at a time.
pub(crate) const BATCH: usize = 1 << 12;
/// Batches under way at most, in either direction.
const UNDER_WAY: usize = 3;
/// How often the observer is told.
const INTERVAL: Duration = Duration::from_millis(50);

/// Decimates a stream in one pass.
///
/// The source is read on one thread and the sink written on another while this one decimates, with `options.threads`
/// threads. The sink is not [finished](TriangleSink::finish).
///
/// Where a boundary may be a true one or one whose neighbours have not come yet, and the buffer is crowded with such,
/// those that have waited longest are taken for true ones ("sealed").
///
/// # Errors
/// Options out of range, those of source and sink, [`Error::Unsorted`], [`Error::UnknownLength`], and
/// [`Error::Interrupted`] if the observer says so.
pub fn decimate(
    source: &mut (dyn TriangleSource + Send),
    sink: &mut (dyn TriangleSink + Send),
    options: &DecimateOptions,
    observer: &mut Observer<'_>,
) -> Result<DecimateReport, Error> {
    let expected = source.triangle_count();
    let hint = source.triangle_hint();
    let mut decimator = StreamDecimator::new(options, expected)?;
    decimator.expect(hint);
    run(&mut Direct::new(source), sink, &mut decimator, observer)
}

/// Decimates a file, which may be read more than once.
///
/// The first pass is that of [`decimate`]. If the buffer gets crowded with boundaries whose neighbours have not come, the
/// file is read again: if it numbers its vertices, once to learn where each of them is used for the last time; and if
/// that does not help, it is sorted along its longest axis, in scratch files in the folder `scratch`. What was written by
/// then is dropped with its sink, and a new one is made.
///
/// # Errors
/// As [`decimate`], and [`Error::Scratch`].
pub fn decimate_file(
    open: &mut Open<'_>,
    create: &mut dyn FnMut(Frame) -> Result<Box<dyn TriangleSink + Send>, mesh_io::Error>,
    options: &DecimateOptions,
    scratch: &Path,
    observer: &mut Observer<'_>,
) -> Result<DecimateReport, Error> {
    options.check()?;
    let mut source = open()?;
    let mut length = source.triangle_count();
    if length.is_none() && needs_length(options) {
        length = Some(count_triangles(&mut *source, observer)?);
        source = open()?;
    }
    let frame = source.frame();
    let numbered = source.has_vertex_numbers();
    let hint = source.triangle_hint();
    let mut attempt =
        |feed: &mut dyn Feed, answer, length: Option<u64>, observer: &mut Observer<'_>| {
            let mut sink = create(frame)?;
            let mut decimator = StreamDecimator::new(options, length)?.when_crowded(answer);
            decimator.expect(length.or(hint));
            let report = run(feed, &mut *sink, &mut decimator, observer)?;
            sink.finish()?;
            Ok(report)
        };
    let crowded =
        |result: &Result<DecimateReport, Error>| matches!(result, Err(Error::Unsorted { .. }));

    let direct = attempt(&mut Direct::new(&mut *source), WhenCrowded::Fail, length, observer);
    if !crowded(&direct) {
        return direct;
    }
    drop(source);
    let folder = Scratch::new(scratch);
    if numbered {
        let mut counted = finality::count(open()?, &folder, observer)?;
        let length = Some(counted.triangle_count());
        let report = attempt(&mut counted, WhenCrowded::Fail, length, observer);
        if !crowded(&report) {
            return report.map(|report| DecimateReport { counted: true, ..report });
        }
    }
    let mut sorted = presort::presort(open, &folder, presort::DEFAULT_BYTES, observer)?;
    let length = Some(sorted.triangle_count());
    let report = attempt(&mut sorted, WhenCrowded::Seal, length, observer)?;
    Ok(DecimateReport { sorted: true, ..report })
}

/// Whether the target means something else for each length of the stream, and cannot wait for its end.
fn needs_length(options: &DecimateOptions) -> bool {
    StreamDecimator::new(options, None).is_err()
}

fn count_triangles(
    source: &mut (dyn TriangleSource + Send),
    observer: &mut Observer<'_>,
) -> Result<u64, Error> {
    let mut batch = Vec::with_capacity(BATCH);
    let mut progress = crate::Progress {
        stage: crate::Stage::Counting,
        expected: source.triangle_hint(),
        ..Default::default()
    };
    loop {
        batch.clear();
        let read = source.read(&mut batch, BATCH)?;
        progress.read += read as u64;
        if read == 0 {
            return Ok(progress.read);
        }
        if observer(&progress) == ControlFlow::Break(()) {
            return Err(Error::Interrupted);
        }
    }
}

/// Triangles on their way from the reading thread.
#[derive(Debug, Default)]
struct Batch {
    triangles: Vec<Triangle>,
    colours: Vec<[Colour; 3]>,
    known: Known,
}

/// Triangles that have arrived.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrived<'a> {
    pub(crate) triangles: &'a [Triangle],
    /// Of their corners; none where these have none.
    pub(crate) colours: &'a [[Colour; 3]],
    pub(crate) finality: Finality<'a>,
}

/// [`Finality`], to be sent.
#[derive(Debug, Default)]
pub(crate) enum Known {
    #[default]
    Nothing,
    Corners(Vec<u8>),
    Below {
        axis: usize,
        coordinate: f32,
    },
}

impl Known {
    pub(crate) fn new(finality: Finality<'_>) -> Self {
        match finality {
            Finality::Unknown => Self::Nothing,
            Finality::Corners(tags) => Self::Corners(tags.to_vec()),
            Finality::Below { axis, coordinate } => Self::Below { axis, coordinate },
        }
    }

    pub(crate) fn finality(&self) -> Finality<'_> {
        match self {
            Self::Nothing => Finality::Unknown,
            Self::Corners(tags) => Finality::Corners(tags),
            &Self::Below { axis, coordinate } => Finality::Below { axis, coordinate },
        }
    }
}

/// Runs the three threads.
fn run(
    feed: &mut dyn Feed,
    sink: &mut (dyn TriangleSink + Send),
    decimator: &mut StreamDecimator,
    observer: &mut Observer<'_>,
) -> Result<DecimateReport, Error> {
    thread::scope(|scope| {
        let (to_decimate, batches) = sync_channel(UNDER_WAY);
        let (give_back, used) = sync_channel(UNDER_WAY + 2);
        let reader = scope.spawn(move || read(feed, &to_decimate, &used));
        let (to_write, written) = sync_channel::<Vec<Triangle>>(UNDER_WAY);
        let writer = scope.spawn(move || written.iter().try_for_each(|batch| sink.write(&batch)));
        let outcome = decimate_batches(&batches, &give_back, to_write, decimator, observer);
        // Whichever thread still waits for this one learns that nothing more will come.
        drop((batches, give_back));
        let read = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        // What went wrong first is the reason of what went wrong after it.
        written?;
        match (outcome, read) {
            (Err(error), _) => Err(error),
            (Ok(_), Err(error)) => Err(error),
            (Ok(report), Ok(())) => Ok(report),
        }
    })
}

/// Reads batches until the end, or until nobody wants them any more.
fn read(
    feed: &mut dyn Feed,
    to_decimate: &SyncSender<Batch>,
    used: &Receiver<Vec<Triangle>>,
) -> Result<(), Error> {
    loop {
        let mut triangles = used.try_recv().unwrap_or_default();
        triangles.clear();
        if feed.read(&mut triangles, BATCH)? == 0 {
            return Ok(());
        }
        let known = Known::new(feed.finality());
        let colours = feed.colours().to_vec();
        if to_decimate.send(Batch { triangles, colours, known }).is_err() {
            return Ok(());
        }
    }
}

/// Reads on a thread of its own, and gives each batch to `take`, which returns how far it is; now and then without one.
pub(crate) fn with_reader<E: From<Error>>(
    feed: &mut dyn Feed,
    observer: &mut Observer<'_>,
    mut take: impl FnMut(Option<Arrived<'_>>, &mut Observer<'_>) -> Result<Progress, E>,
) -> Result<(), E> {
    thread::scope(|scope| {
        let (to_take, batches) = sync_channel(UNDER_WAY);
        let (give_back, used) = sync_channel(UNDER_WAY + 2);
        let reader = scope.spawn(move || read(feed, &to_take, &used));
        let mut told = Instant::now();
        let taken = loop {
            let batch: Option<Batch> = match batches.recv_timeout(INTERVAL) {
                Ok(batch) => Some(batch),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break Ok(()),
            };
            let arrived = batch.as_ref().map(|batch| Arrived {
                triangles: &batch.triangles,
                colours: &batch.colours,
                finality: batch.known.finality(),
            });
            let progress = match take(arrived, observer) {
                Ok(progress) => progress,
                Err(error) => break Err(error),
            };
            if let Some(batch) = batch {
                // If there are enough empty ones already, this one is dropped.
                give_back.try_send(batch.triangles).ok();
            }
            if told.elapsed() >= INTERVAL {
                told = Instant::now();
                if observer(&progress) == ControlFlow::Break(()) {
                    break Err(Error::Interrupted.into());
                }
            }
        };
        drop((batches, give_back));
        let read = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        taken?;
        Ok(read?)
    })
}

/// A sink that hands its triangles to the writing thread.
struct Handover(SyncSender<Vec<Triangle>>);

impl TriangleSink for Handover {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), mesh_io::Error> {
        // If the writing thread is gone, its error is what counts.
        match self.0.send(triangles.to_vec()) {
            Ok(()) | Err(_) => Ok(()),
        }
    }

    fn finish(self: Box<Self>) -> Result<(), mesh_io::Error> {
        Ok(())
    }
}

fn decimate_batches(
    batches: &Receiver<Batch>,
    give_back: &SyncSender<Vec<Triangle>>,
    to_write: SyncSender<Vec<Triangle>>,
    decimator: &mut StreamDecimator,
    observer: &mut Observer<'_>,
) -> Result<DecimateReport, Error> {
    let mut sink = Handover(to_write);
    let mut told = Instant::now();
    loop {
        let batch = match batches.recv_timeout(INTERVAL) {
            Ok(batch) => Some(batch),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if let Some(Batch { triangles, known, .. }) = batch {
            decimator.push_with(&triangles, known.finality(), &mut sink)?;
            // If there are enough empty ones already, this one is dropped.
            match give_back.try_send(triangles) {
                Ok(()) | Err(_) => {}
            }
        }
        if told.elapsed() >= INTERVAL {
            told = Instant::now();
            if observer(&decimator.progress()) == ControlFlow::Break(()) {
                return Err(Error::Interrupted);
            }
        }
    }
    if observer(&decimator.progress()) == ControlFlow::Break(()) {
        return Err(Error::Interrupted);
    }
    decimator.finish_with(&mut sink)
}
