//! The command `fuzz`: looks for files that do harm.

use std::path::PathBuf;
use std::process::Command;

use crate::{Error, process};

/// What to fuzz, and for how long.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Every target for ten minutes
    cargo xtask fuzz --seconds 600

  One target with other changes than last time
    cargo xtask fuzz obj --seed 7

  A case that was found, with a backtrace
    cargo xtask fuzz obj --case target/fuzz/cases/obj-0123456789abcdef")]
pub struct Arguments {
    /// Targets; all, if none is named
    targets: Vec<String>,
    /// Seconds for each
    #[arg(long, default_value = "60")]
    seconds: u32,
    /// Seed of the changes
    #[arg(long, default_value = "0")]
    seed: u64,
    /// Run this case alone
    #[arg(long)]
    case: Option<PathBuf>,
}

/// The targets by name, in the order in which they are run.
pub const TARGETS: [&str; 9] =
    ["xfm", "stl", "ply", "obj", "gltf", "packed", "decimate", "collapse", "build"];

/// LLVM's SanitizerCoverage pass, as a stable compiler takes it.
const COUNT_EDGES: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=3 \
                           -Cllvm-args=-sanitizer-coverage-inline-8bit-counters";

/// Builds the targets with counters and runs them; cases that reach something new stay under `target/fuzz`, and the next run
/// begins with them.
///
/// # Errors
/// The number of targets that found something.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    let folder = process::target().join("fuzz");
    let host = host()?;
    let mut build = process::cargo();
    // With a target named, the flags are not for build scripts, which have nobody to count for.
    build.args(["build", "--package", "fuzz", "--bin", "fuzz", "--target", &host]);
    build.arg("--target-dir").arg(&folder).env("RUSTFLAGS", COUNT_EDGES);
    process::run(&mut build)?;
    let program = folder.join(&host).join("debug/fuzz");
    if let Some(case) = &arguments.case {
        let [target] = &arguments.targets[..] else {
            return Err(Error::Report {
                what: case.display().to_string(),
                why: "say which target it is for, and only that".into(),
            });
        };
        let mut command = Command::new(program);
        command.arg(target).arg("--case").arg(case).env("RUST_BACKTRACE", "1");
        return process::run(command.arg("--corpus").arg(&folder));
    }
    let targets: Vec<&str> = match &arguments.targets[..] {
        [] => TARGETS.to_vec(),
        some => some.iter().map(String::as_str).collect(),
    };
    let effort = [format!("--seconds={}", arguments.seconds), format!("--seed={}", arguments.seed)];
    run_each(&program, &targets, &effort, &folder.join("cases"))
}

/// A short run of every target without counters, the same every time.
///
/// # Errors
/// The number of targets that found something.
pub fn smoke() -> Result<(), Error> {
    let program = process::built("debug", "fuzz");
    let folder = process::target().join("fuzz/smoke");
    if folder.exists() {
        // Not to begin with what another run left.
        std::fs::remove_dir_all(&folder).map_err(|source| Error::Report {
            what: folder.display().to_string(),
            why: source.to_string(),
        })?;
    }
    let effort = ["--seconds=2.5".to_owned(), "--cases=3000".to_owned()];
    run_each(&program, &TARGETS, &effort, &folder)
}

fn run_each(
    program: &std::path::Path,
    targets: &[&str],
    effort: &[String],
    cases: &std::path::Path,
) -> Result<(), Error> {
    let mut failed = 0;
    for target in targets {
        let corpus = cases.join(target);
        let mut command = Command::new(program);
        command.arg(target).args(effort).arg("--corpus").arg(&corpus);
        if let Err(error) = process::run(&mut command) {
            failed += 1;
            eprintln!("error: {error}");
            eprintln!("the last case is {}", corpus.join("current").display());
        }
    }
    match failed {
        0 => Ok(()),
        failed => Err(Error::Claims { what: "fuzz targets", failed, total: targets.len() }),
    }
}

/// The triple of this machine.
fn host() -> Result<String, Error> {
    let version = process::read(Command::new("rustc").arg("-vV"))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| Error::Report {
        what: "rustc -vV".into(),
        why: "it does not say which host it is for".into(),
    })
}
