//! Runs a target: changes cases, keeps what is new, stops at what is wrong.

use std::any::Any;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::coverage::Coverage;
use crate::memory;
use crate::random::Random;
use crate::target::Target;

/// A case that takes longer hangs. Cases take milliseconds; this allows for a machine that is busy with other things.
pub const TIME_LIMIT: Duration = Duration::from_secs(60);

/// The exit code of a process in which a case hung.
pub const HUNG: i32 = 99;

/// How long to go on.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Cases at most.
    pub cases: u64,
    /// Time at most.
    pub time: Duration,
    /// Seed of all changes.
    pub seed: u64,
}

/// How a run went.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Cases run.
    pub cases: u64,
    /// Cases that reached something new, and those to begin with.
    pub corpus: usize,
    /// Edges of the control flow that were taken; 0 where they are not counted.
    pub edges: usize,
    /// The most memory that a case took, beyond the fixed part, in bytes per byte of the case.
    pub memory_per_byte: f64,
    /// The most memory that a case took, in bytes.
    pub memory: usize,
    /// What went wrong, if something did.
    pub failure: Option<Failure>,
}

/// A case that does what it must not.
#[derive(Clone, Debug)]
pub struct Failure {
    /// What it does.
    pub what: String,
    /// The case, made smaller.
    pub case: Vec<u8>,
}

/// Runs one case; what it does wrong is the error. Returns the memory it took.
///
/// # Errors
/// A panic, or too much memory.
pub fn run_case(target: &Target, case: &[u8]) -> Result<usize, String> {
    let (outcome, taken) =
        memory::measure(|| catch_unwind(AssertUnwindSafe(|| (target.run)(case))));
    outcome.map_err(|payload| format!("panic: {}", panic_message(&*payload)))?;
    let most = target.memory.of(case.len());
    if taken > most {
        return Err(format!("memory: {taken} bytes for {} of file, at most {most}", case.len()));
    }
    Ok(taken)
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default()
}

/// Begins with the target's files and those in `folder`; writes there what is new, and before each case what it is, so that
/// one that ends the process is known.
///
/// # Errors
/// The operating system's, where the folder cannot be written.
pub fn fuzz(target: &Target, effort: &Effort, folder: &Path) -> io::Result<Summary> {
    fs::create_dir_all(folder)?;
    let current = Current::new(folder)?;
    let mut corpus = (target.seeds)();
    corpus.extend(saved_cases(folder)?.into_iter().map(|(_, case)| case));
    let mut random = Random::new(effort.seed);
    let mut coverage = Coverage::default();
    let mut summary =
        Summary { cases: 0, corpus: 0, edges: 0, memory_per_byte: 0.0, memory: 0, failure: None };
    let start = Instant::now();
    let seeds = corpus.len() as u64;
    while summary.cases < effort.cases.max(seeds) && start.elapsed() < effort.time {
        let is_seed = summary.cases < seeds;
        let mut case = match corpus.get(summary.cases as usize).filter(|_| is_seed) {
            Some(seed) => seed.clone(),
            // Half of the time what is new.
            None if random.one_in(2) => {
                corpus[corpus.len() - 1 - newest(&mut random, corpus.len())].clone()
            }
            None => random.pick(&corpus).clone(),
        };
        if !is_seed {
            let other = corpus[random.below(corpus.len())].clone();
            (target.mutate)(&mut random, &mut case, &other);
        }
        summary.cases += 1;
        current.write(&case)?;
        Coverage::reset();
        let outcome = run_case(target, &case);
        current.done();
        let new = coverage.take();
        match outcome {
            Ok(taken) => {
                let more = taken.saturating_sub(target.memory.fixed) as f64;
                let per_byte = more / case.len().max(1) as f64;
                summary.memory_per_byte = summary.memory_per_byte.max(per_byte);
                summary.memory = summary.memory.max(taken);
            }
            Err(what) => {
                let case = smaller(target, case, &what, &current)?;
                summary.failure = Some(Failure { what, case });
                break;
            }
        }
        if new && !is_seed {
            fs::write(folder.join(format!("{:016x}", name(&case))), &case)?;
            corpus.push(case);
        }
    }
    current.done();
    summary.corpus = corpus.len();
    summary.edges = coverage.edges();
    Ok(summary)
}

/// How far from the end, nearer ones more often.
fn newest(random: &mut Random, length: usize) -> usize {
    let within = 1 + random.below(length);
    random.below(within)
}

/// A name for a case (FNV-1a).
pub fn name(case: &[u8]) -> u64 {
    case.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// The files of a folder by name, in the order of the names; none where there is no folder.
///
/// # Errors
/// The operating system's.
pub fn saved_cases(folder: &Path) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_file() && entry.file_name() != CURRENT {
            paths.push(entry.path());
        }
    }
    paths.sort();
    paths.into_iter().map(|path| fs::read(&path).map(|case| (path, case))).collect()
}

/// Leaves out as much as can be while the case still fails in the same way.
fn smaller(
    target: &Target,
    mut case: Vec<u8>,
    what: &str,
    current: &Current,
) -> io::Result<Vec<u8>> {
    // Numbers in messages may change with the size.
    let kind = |what: &str| what.chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
    let wanted = kind(what);
    let start = Instant::now();
    let mut piece = case.len().next_power_of_two() / 2;
    while piece > 0 && start.elapsed() < TIME_LIMIT {
        let mut at = 0;
        while at < case.len() && start.elapsed() < TIME_LIMIT {
            let mut shorter = case.clone();
            shorter.drain(at..(at + piece).min(case.len()));
            current.write(&shorter)?;
            match run_case(target, &shorter) {
                Err(what) if kind(&what) == wanted => case = shorter,
                _ => at += piece,
            }
        }
        piece /= 2;
    }
    Ok(case)
}

/// The name of the file that holds the case being run.
pub const CURRENT: &str = "current";

/// Milliseconds since the process began when the case began; 0 where none runs.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// The case that is being run, in a file; a thread watches its time.
struct Current {
    file: File,
    epoch: Instant,
}

impl Current {
    fn new(folder: &Path) -> io::Result<Self> {
        let file = File::create(folder.join(CURRENT))?;
        let epoch = Instant::now();
        thread::spawn(move || {
            loop {
                thread::sleep(Duration::from_millis(200));
                let begun = BEGUN.load(Ordering::Relaxed);
                let now = epoch.elapsed().as_millis() as u64;
                if begun > 0 && now.saturating_sub(begun) > TIME_LIMIT.as_millis() as u64 {
                    eprintln!("a case takes longer than {} s", TIME_LIMIT.as_secs());
                    std::process::exit(HUNG);
                }
            }
        });
        Ok(Self { file, epoch })
    }

    fn write(&self, case: &[u8]) -> io::Result<()> {
        self.file.set_len(case.len() as u64)?;
        self.file.write_all_at(case, 0)?;
        BEGUN.store(self.epoch.elapsed().as_millis() as u64 + 1, Ordering::Relaxed);
        Ok(())
    }

    fn done(&self) {
        BEGUN.store(0, Ordering::Relaxed);
    }
}
