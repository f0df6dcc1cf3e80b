//! Arguments and their dispatch; each command lives in a file of its own.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{Error, bench, compare, conformance, demo, fuzz, generate, load, test};

/// Builds, tests, demonstrates and judges the whole project.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Generate a deterministic test mesh of any size in constant memory.
    Gen(generate::Arguments),
    /// Build a model and make pictures and a table of it, as in the first paper's Figure 10 and Table 3.
    Demo(demo::Arguments),
    /// Format, lint, test and judge everything.
    Test,
    /// What the continuous integration runs: the same as `test`.
    Ci,
    /// Judge every public claim with trimesh.
    Conformance(conformance::Arguments),
    /// Decimate beside the peers, and as a stream of any length: rate, memory and distances.
    Compare(compare::Arguments),
    /// Look for files that do harm: changed ones, for every reader of files.
    Fuzz(fuzz::Arguments),
    /// Jump about a model in almost no memory for ten minutes: does memory stay flat, and does everything hold?
    Load(load::Arguments),
    /// Measure the hot parts with criterion: rates, and how they changed since the run before.
    Bench(bench::Arguments),
}

/// Runs the command that the process was started with.
///
/// Exits with 0 when done, 1 after one `error:` line, 2 on wrong usage.
pub fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<(), Error> {
    match command {
        Command::Gen(arguments) => generate::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Test | Command::Ci => test::run(),
        Command::Conformance(arguments) => conformance::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Fuzz(arguments) => fuzz::run(&arguments),
        Command::Load(arguments) => load::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
    }
}
