//! The command `bench`: how fast the hot parts are, and how cost grows with the model.

mod results;
mod scale;

pub use results::circumstances;

use serde_json::Value;

use crate::{Error, process};

/// Seconds before and during each measurement that does not ask for more: all together should take about two
/// minutes.
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
    let benches = benches()?;
    let mut command = process::cargo();
    command.arg("bench");
    command.args(benches.iter().flat_map(|bench| ["-p", bench.krate.as_str()]));
    // By name, for the crates' own tests do not understand what is asked of a benchmark.
    command.args(benches.iter().flat_map(|bench| ["--bench", bench.name.as_str()]));
    command.args(["--", "--warm-up-time", WARM_UP, "--measurement-time", MEASUREMENT]);
    command.args(&arguments.filter);
    process::run(&mut command)?;
    results::write()
}

/// A file of benchmarks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bench {
    /// The crate it belongs to.
    pub krate: String,
    /// Its name.
    pub name: String,
    /// Whether it is run once among the tests, to see that it works.
    pub is_tested: bool,
}

/// The benchmarks of all crates of the workspace, as cargo tells them.
///
/// # Errors
/// When cargo does not.
pub fn benches() -> Result<Vec<Bench>, Error> {
    let mut metadata = process::cargo();
    metadata.args(["metadata", "--format-version", "1", "--no-deps", "--offline"]);
    let metadata = process::parse_json("cargo metadata", &process::read(&mut metadata)?)?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let mut benches = Vec::new();
    for package in list(&metadata["packages"]) {
        for target in list(&package["targets"]) {
            if list(&target["kind"]).contains(&"bench".into())
                && let (Some(krate), Some(name)) =
                    (package["name"].as_str(), target["name"].as_str())
            {
                let is_tested = target["test"] == true;
                benches.push(Bench { krate: krate.into(), name: name.into(), is_tested });
            }
        }
    }
    Ok(benches)
}
