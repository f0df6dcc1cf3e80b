//! The command `compare`: our decimation and our hierarchies beside their peers, decimation as a stream of any length, and the
//! papers' own numbers beside ours.
//!
//! Everything is measured in one run on one machine. Our times are of the whole process, from the file to the
//! file, as are those of peers that are programs; those of packages are of the call that decimates, in core. Each run of
//! another contender comes right after one of `xfm` as it is by default, and factors are medians and quartiles over these
//! pairs: a machine that is slower for a while is so for both.

mod build;
mod contender;
mod contest;
mod papers;
mod runs;
mod stream;
mod table;
mod tools;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::generate::{self, Generator, Options, Shape};
use crate::{Error, bench, process, setup};
use contest::{Contest, Input};
use papers::Papers;
use stream::Stream;

/// Triangles of the scan that is generated where no file is given.
const GENERATED: u64 = 1_000_000;
/// Share of the triangles to keep where none is given.
const RATIO: f64 = 0.02;

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    cargo xtask compare                      # everything, on a generated scan\n  \
    cargo xtask compare dragon.ply --part decimate --ratio 0.02 --ratio 0.5\n  \
    cargo xtask compare dragon.ply --part build\n  \
    cargo xtask compare --part papers --largest 60000000\n  \
    cargo xtask compare dragon.ply --only meshoptimizer --repeat 15\n  \
    cargo xtask compare --stream 8000000 --stream 372000000\n  \
    cargo xtask compare --stream 50000000 --holes 0.1\n\
    The tables and the same as JSON are in target/compare.")]
pub struct Arguments {
    /// The mesh; without it a scan-like one of a million triangles is generated.
    file: Option<PathBuf>,
    /// What to compare; may be given several times [default: all of it].
    #[arg(long = "part", value_name = "PART")]
    parts: Vec<Part>,
    /// Share of the triangles to keep; may be given several times. The first is that of the level measured of hierarchies.
    #[arg(long = "ratio", value_name = "P", default_values_t = [RATIO], value_parser = parse_share)]
    ratios: Vec<f64>,
    /// Runs of each contender.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Only the contenders whose name contains this; may be given several times.
    #[arg(long, value_name = "WORD")]
    only: Vec<String>,
    /// Pipe a generated torus of so many triangles through `xfm decimate`; may be given several times.
    /// Without a file or part, that is all that is done.
    #[arg(long = "stream", value_name = "TRIANGLES")]
    streams: Vec<u64>,
    /// Share of the generated torus's edges that lie on the boundary of small holes.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    holes: f64,
    /// The papers' models up to so many triangles.
    #[arg(long, value_name = "TRIANGLES", default_value_t = 10_000_000)]
    largest: u64,
    /// Folder where the papers' models may lie (bunny.ply, horse.ply, dragon.ply, happy.ply, …); scans stand in for those
    /// that do not [default: ../shared/data].
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Where to write the results as JSON [default: results.json in target/compare].
    #[arg(long, value_name = "OUT")]
    json: Option<PathBuf>,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Decimation: rate, memory, distances.
    Decimate,
    /// Hierarchies: time, memory, size, a level's distances.
    Build,
    /// The papers' tables and Figure 4.
    Papers,
}

fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err("a number between 0 and 1 is needed".into()),
    }
}

/// Tables as they come, and the same as JSON.
#[derive(Debug)]
struct Report {
    text: String,
    results: Value,
}

impl Report {
    fn new() -> Self {
        let results = bench::circumstances();
        let line = |key: &str| match &results[key] {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let text = format!("{}, {} cores, {}\n", line("processor"), line("cores"), line("date"));
        Self { text, results }
    }

    fn table(&mut self, table: &str) {
        println!("{table}");
        self.text += &format!("\n{table}");
    }

    fn add(&mut self, key: &str, value: Value) {
        self.results[key] = value;
    }
}

/// Builds `xfm`, installs the peers, lets everyone work, and prints tables.
///
/// # Errors
/// When the input cannot be prepared. A contender that fails is a row that says why.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    process::run(process::cargo().args(["build", "--release", "--package", "xfm"]))?;
    let xfm = process::built("release", "xfm");
    let folder = process::target().join("compare");
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let folder = absolute(&folder)?;
    let parts = match &arguments.parts[..] {
        [] if arguments.file.is_none() && !arguments.streams.is_empty() => &[][..],
        [] => &[Part::Decimate, Part::Build, Part::Papers],
        parts => parts,
    };
    let mut report = Report::new();
    if parts.iter().any(|&part| part != Part::Papers) {
        let input = prepare(arguments, xfm.clone(), &folder)?;
        if parts.contains(&Part::Decimate) {
            let contenders = contender::decimating(input.triangles, &arguments.only);
            let mut contests = Vec::new();
            for &ratio in &arguments.ratios {
                let contest = Contest::new(&input, ratio, arguments.repeat).run(&contenders)?;
                report.table(&table::decimation(&contest));
                contests.push(contest);
            }
            report.add("contests", contests.into());
        }
        if parts.contains(&Part::Build) {
            let contenders = contender::building(&arguments.only);
            let ratio = arguments.ratios.first().copied().unwrap_or(RATIO);
            let built = build::run(&input, &contenders, ratio, arguments.repeat)?;
            report.table(&table::building(&built));
            report.add("builds", built);
        }
    }
    if !arguments.streams.is_empty() {
        let mut streams = Vec::new();
        for &triangles in &arguments.streams {
            streams.push(stream::run(&xfm, Stream::torus(triangles, arguments.holes), &folder)?);
        }
        report.table(&table::streams(&streams));
        report.add("streams", streams.into());
    }
    if parts.contains(&Part::Papers) {
        let data = arguments.data.clone().unwrap_or_else(process::data);
        let papers = Papers { xfm, data, folder: folder.clone(), largest: arguments.largest };
        let (tables, results) = papers.run()?;
        tables.iter().for_each(|table| report.table(table));
        report.add("papers", results);
    }
    let tables = folder.join("report.txt");
    fs::write(&tables, &report.text).map_err(Error::file(&tables))?;
    let file = arguments.json.clone().unwrap_or_else(|| folder.join("results.json"));
    fs::write(&file, format!("{:#}\n", report.results)).map_err(Error::file(&file))?;
    println!("tables   {}\nresults  {}", tables.display(), file.display());
    Ok(())
}

/// The mesh, given or generated, and its arrays for the peers.
fn prepare(arguments: &Arguments, xfm: PathBuf, folder: &Path) -> Result<Input, Error> {
    let python = setup::peers()?;
    let file = match &arguments.file {
        Some(file) => file.clone(),
        None => generated(folder)?,
    };
    fs::metadata(&file).map_err(Error::file(&file))?;
    let scripts = process::root().join("tests/compare");
    let mut prepare = python.command();
    prepare.arg(scripts.join("prepare.py")).arg(absolute(&file)?).arg(folder);
    let counts = process::parse_json("prepare.py", &process::read(&mut prepare)?)?;
    let triangles = counts["triangles"].as_u64().unwrap_or(0);
    Ok(Input { file, folder: folder.to_owned(), triangles, xfm, python })
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
