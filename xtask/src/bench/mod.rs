//! The command `bench`: how fast the hot parts are, and how cost grows with the model.

mod results;
mod scale;

pub use results::circumstances;

use crate::{Error, process};

/// The crates that have benchmarks.
const CRATES: [&str; 6] =
    ["qem", "halfedge", "stream-decimate", "xfm-build", "mergetree", "xfm-pager"];

/// The benchmarks; by name, for the crates' own tests do not understand what is asked of a benchmark.
const BENCHES: [&str; 6] = ["rating", "collapse", "decimate", "link", "front", "pager"];

/// Seconds before and during each measurement that does not ask for more: all together should take little more than a
/// minute.
const WARM_UP: &str = "0.3";
const MEASUREMENT: &str = "1.5";

/// What `bench` is asked for.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Examples:
  cargo xtask bench                 # all of them
  cargo xtask bench stream/whole    # those whose name contains this
  cargo xtask bench scale           # decimate, build and fly from a million to a hundred million triangles
Rates are in what each benchmark's file says, triangles mostly; changes are against the run before. The results of all, with
machine and date, are in target/bench."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Only the benchmarks whose name matches this regular expression.
    filter: Option<String>,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Decimate, build and fly models of growing size: cost per triangle and memory as curves.
    Scale(scale::Arguments),
}

/// Builds and runs the benchmarks.
///
/// # Errors
/// When they cannot be built or do not succeed.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    if let Some(Command::Scale(arguments)) = &arguments.command {
        return scale::run(arguments);
    }
    let mut command = process::cargo();
    command.arg("bench");
    command.args(CRATES.iter().flat_map(|name| ["-p", name]));
    command.args(BENCHES.iter().flat_map(|name| ["--bench", name]));
    command.args(["--", "--warm-up-time", WARM_UP, "--measurement-time", MEASUREMENT]);
    command.args(&arguments.filter);
    process::run(&mut command)?;
    results::write()
}
