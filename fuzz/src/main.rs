//! Runs fuzz targets; `cargo xtask fuzz` builds it with counters and calls it.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use fuzz::engine::{Effort, fuzz, name};
use fuzz::memory::Counting;
use fuzz::targets;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs one fuzz target in this process.
#[derive(Debug, Parser)]
struct Arguments {
    /// The target
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(targets::ALL.map(|target| target.name)))]
    target: String,
    /// Seconds to go on for
    #[arg(long, default_value = "60")]
    seconds: f64,
    /// Cases to run at most
    #[arg(long, default_value_t = u64::MAX)]
    cases: u64,
    /// Seed of the changes
    #[arg(long, default_value = "0")]
    seed: u64,
    /// Folder for cases that reach something new, and for the one being run
    #[arg(long)]
    corpus: PathBuf,
    /// Let panics say where they are
    #[arg(long)]
    loud: bool,
    /// Run this case alone
    #[arg(long, conflicts_with_all = ["seconds", "cases", "seed"])]
    case: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> std::io::Result<ExitCode> {
    let Some(target) = targets::ALL.iter().find(|target| target.name == arguments.target) else {
        return Ok(ExitCode::FAILURE);
    };
    if let Some(path) = &arguments.case {
        (target.run)(&std::fs::read(path)?);
        return Ok(ExitCode::SUCCESS);
    }
    if !arguments.loud {
        std::panic::set_hook(Box::new(|_| ()));
    }
    let start = Instant::now();
    let effort = Effort {
        cases: arguments.cases,
        time: Duration::try_from_secs_f64(arguments.seconds).unwrap_or(Duration::MAX),
        seed: arguments.seed,
    };
    let summary = fuzz(target, &effort, &arguments.corpus)?;
    println!(
        "{:<9} {:>8} cases in {:>6.1} s, {:>5} kept, {:>6} edges, at most {:.1} MiB, {:.0} times the file and {:.0} MiB",
        target.name,
        summary.cases,
        start.elapsed().as_secs_f64(),
        summary.corpus,
        summary.edges,
        summary.memory as f64 / f64::from(1 << 20),
        summary.memory_per_byte,
        target.memory.fixed as f64 / f64::from(1 << 20),
    );
    let Some(failure) = summary.failure else { return Ok(ExitCode::SUCCESS) };
    let path =
        arguments.corpus.with_file_name(format!("{}-{:016x}", target.name, name(&failure.case)));
    std::fs::write(&path, &failure.case)?;
    eprintln!(
        "error: {}: {}; the case is {}",
        target.name,
        failure.what.replace('\n', " "),
        path.display()
    );
    Ok(ExitCode::FAILURE)
}
