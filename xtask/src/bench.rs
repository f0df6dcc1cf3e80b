//! The command `bench`: how fast the hot parts are, and whether that has changed since the run before.

use crate::{Error, process};

/// The crates that have benchmarks.
const CRATES: [&str; 4] = ["qem", "halfedge", "stream-decimate", "xfm-build"];

/// The benchmarks; by name, for the crates' own tests do not understand what is asked of a benchmark.
const BENCHES: [&str; 4] = ["rating", "collapse", "decimate", "link"];

/// Seconds before and during each measurement that does not ask for more: all together should take little more than a
/// minute.
const WARM_UP: &str = "0.3";
const MEASUREMENT: &str = "1.5";

/// What `bench` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  cargo xtask bench                 # all of them
  cargo xtask bench stream/whole    # those whose name contains this
Rates are in what each benchmark's file says, triangles mostly; changes are against the run before.")]
pub struct Arguments {
    /// Only the benchmarks whose name matches this regular expression.
    filter: Option<String>,
}

/// Builds and runs the benchmarks.
///
/// # Errors
/// When they cannot be built or do not succeed.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    let mut command = process::cargo();
    command.arg("bench");
    command.args(CRATES.iter().flat_map(|name| ["-p", name]));
    command.args(BENCHES.iter().flat_map(|name| ["--bench", name]));
    command.args(["--", "--warm-up-time", WARM_UP, "--measurement-time", MEASUREMENT]);
    command.args(&arguments.filter);
    process::run(&mut command)
}
