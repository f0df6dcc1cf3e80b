//! The command `compare`: our decimation beside its peers, and as a stream of any length.
//!
//! Everything is measured in one run on one machine. Our times are of the whole process, from the file to the
//! file; the peers' are of the call that decimates, in core. Each run of another contender comes right after one of
//! `xfm` as it is by default, and factors are medians over these pairs: a machine that is slower for a while
//! is so for both.

mod contender;
mod contest;
mod runs;
mod stream;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use crate::generate::{self, Generator, Options, Shape};
use crate::{Error, process, setup};
use contest::{Contest, Input};

/// Triangles of the scan that is generated where no file is given.
const GENERATED: u64 = 1_000_000;
/// Share of the triangles to keep where none is given.
const RATIO: f64 = 0.02;

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    cargo xtask compare dragon.ply --ratio 0.02 --ratio 0.5\n  \
    cargo xtask compare dragon.ply --only xfm --only meshoptimizer --repeat 15\n  \
    cargo xtask compare --stream 8000000 --stream 372000000\n  \
    cargo xtask compare --stream 50000000 --holes 0.1")]
pub struct Arguments {
    /// The mesh; without it a scan-like one of a million triangles is generated.
    file: Option<PathBuf>,
    /// Share of the triangles to keep; may be given several times.
    #[arg(long = "ratio", value_name = "P", default_values_t = [RATIO], value_parser = parse_share)]
    ratios: Vec<f64>,
    /// Runs of each contender.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Only the contenders whose name contains this; may be given several times.
    #[arg(long, value_name = "WORD")]
    only: Vec<String>,
    /// Pipe a generated torus of so many triangles through `xfm decimate`; may be given several times.
    /// Without a file, that is all that is done.
    #[arg(long = "stream", value_name = "TRIANGLES")]
    streams: Vec<u64>,
    /// Share of the generated torus's edges that lie on the boundary of small holes.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    holes: f64,
    /// Where to write the results as JSON [default: results.json in target/compare].
    #[arg(long, value_name = "OUT")]
    json: Option<PathBuf>,
}

fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err("a number between 0 and 1 is needed".into()),
    }
}

/// Builds `xfm`, installs the peers, lets everyone decimate, and prints tables.
///
/// # Errors
/// When the input cannot be prepared. A contender that fails is a row that says why.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    process::run(process::cargo().args(["build", "--release", "--package", "xfm"]))?;
    let xfm = process::built("release", "xfm");
    let folder = process::target().join("compare");
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let mut results = json!({ "machine": machine() });
    if arguments.file.is_some() || arguments.streams.is_empty() {
        results["contests"] = contests(arguments, xfm.clone(), &folder)?.into();
    }
    if !arguments.streams.is_empty() {
        let mut streams = Vec::new();
        for &triangles in &arguments.streams {
            streams.push(stream::run(&xfm, triangles, arguments.holes, &folder)?);
        }
        println!("{}", table::streams(&streams));
        results["streams"] = streams.into();
    }
    let file = arguments.json.clone().unwrap_or_else(|| folder.join("results.json"));
    fs::write(&file, format!("{results:#}\n")).map_err(Error::file(&file))?;
    println!("results  {}", file.display());
    Ok(())
}

fn machine() -> Value {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    json!({ "cores": cores, "os": std::env::consts::OS, "architecture": std::env::consts::ARCH })
}

fn contests(arguments: &Arguments, xfm: PathBuf, folder: &Path) -> Result<Vec<Value>, Error> {
    let python = setup::peers()?;
    let file = match &arguments.file {
        Some(file) => file.clone(),
        None => generated(folder)?,
    };
    fs::metadata(&file).map_err(Error::file(&file))?;
    let scripts = process::root().join("tests/compare");
    let mut prepare = python.command();
    prepare.arg(scripts.join("prepare.py")).arg(absolute(&file)?).arg(absolute(folder)?);
    let counts = process::parse_json("prepare.py", &process::read(&mut prepare)?)?;
    let triangles = counts["triangles"].as_u64().unwrap_or(0);
    let input = Input { file, folder: absolute(folder)?, triangles, xfm, python };
    let contenders = contender::all(triangles, &arguments.only);
    let mut results = Vec::new();
    for &ratio in &arguments.ratios {
        let contest = Contest::new(&input, ratio, arguments.repeat).run(&contenders)?;
        println!("{}", table::contest(&contest));
        results.push(contest);
    }
    Ok(results)
}

fn generated(folder: &Path) -> Result<PathBuf, Error> {
    let file = folder.join("scan.ply");
    generate::write_file(&Generator::new(&Options::new(Shape::Scan, GENERATED))?, &file)?;
    Ok(file)
}

/// Programs that run in another folder need it.
fn absolute(path: &Path) -> Result<PathBuf, Error> {
    std::path::absolute(path).map_err(Error::file(path))
}

/// The distances between two meshes, as `xfm diff` reports them.
fn distances(xfm: &Path, from: &Path, to: &Path) -> Result<Value, Error> {
    let mut command = Command::new(xfm);
    let done = process::capture(command.arg("diff").arg(from).arg(to).arg("--json"))?;
    if !done.status.success() {
        let why = reason(&String::from_utf8_lossy(&done.stderr));
        return Err(Error::Report { what: "xfm diff".into(), why });
    }
    process::parse_json("xfm diff", &String::from_utf8_lossy(&done.stdout))
}

/// Why a program failed, by what it said: its error line, or else its last one.
fn reason(stderr: &str) -> String {
    let mut lines = stderr.lines().map(str::trim).filter(|line| !line.is_empty());
    let error = lines.clone().find(|line| line.starts_with("error: "));
    error.or(lines.next_back()).unwrap_or("it did not say why").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reason_is_the_error_line_or_the_last() {
        let usage = "error: unrecognized subcommand 'x'\n\nUsage: xfm <COMMAND>\n";
        assert_eq!(reason(usage), "error: unrecognized subcommand 'x'");
        let traceback = "Traceback:\n  File\nModuleNotFoundError: No module named 'y'\n\n";
        assert_eq!(reason(traceback), "ModuleNotFoundError: No module named 'y'");
        assert_eq!(reason(""), "it did not say why");
    }

    #[test]
    fn shares_are_between_nothing_and_all() {
        assert_eq!(parse_share("0.02"), Ok(0.02));
        for text in ["0", "1", "-0.1", "NaN", "two"] {
            assert!(parse_share(text).is_err(), "{text}");
        }
    }
}
