//! The command `load`: a model is jumped about in with almost no memory, for minutes, from storage that is slow, damaged or cut
//! short under way. Memory has to stay flat, every invariant has to hold, and no frame may wait.

mod flights;
mod judge;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use crate::bench::circumstances;
use crate::chart::{self, Chart, Curve, Over};
use crate::generate::{self, Generator, Options, Shape};
use crate::{Error, process};
use flights::Flown;

/// Triangles of the torus that is generated where no file is given.
const GENERATED: u64 = 2_000_000;
/// The part of what a model needs in memory that it gets.
const PART: f64 = 0.02;
/// Memory that a node takes in a pager, with all that is there for it.
const NODE_BYTES: f64 = 96.0;
/// At least so many times what has to be resident: less would be no room to fly in.
const LEAST: f64 = 1.5;

/// Arguments of `load`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  cargo xtask load
  cargo xtask load scan.xfm --minutes 60 --quota 8MiB --seed 7
Five flights: with threads that load, from storage that takes 2 ms for each read, for as long as asked for; and for a quarter of that
each without such threads, with as many frames as there can be, over a damaged copy, and over one that is cut short under way.
Table, results.json and memory.svg are left in target/load.")]
pub struct Arguments {
    /// The model, as .xfm or as a mesh; without it a torus of two million triangles is generated.
    file: Option<PathBuf>,
    /// How long the first flight is; the others take a quarter of it each.
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = parse_minutes)]
    minutes: f64,
    /// The hard quota, like 4MiB [default: a fiftieth of what the model needs, but enough for what must be resident].
    #[arg(long, value_name = "SIZE")]
    quota: Option<String>,
    /// Which jumps.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
}

fn parse_minutes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(minutes) if minutes > 0.0 && minutes <= 1e5 => Ok(minutes),
        _ => Err("a number of minutes above 0 is needed".into()),
    }
}

/// Builds the model, flies, judges, and leaves what was found in `target/load`.
///
/// # Errors
/// When a program cannot be run, and with the number of flights in which something did not hold.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    process::run(process::cargo().args(["build", "--release", "--package", "xfm"]))?;
    let xfm = process::built("release", "xfm");
    let folder = process::target().join("load");
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let model = model(arguments, &xfm, &folder)?;
    let quota = match &arguments.quota {
        Some(quota) => quota.clone(),
        None => quota(&xfm, &model)?.to_string(),
    };
    let seconds = 60.0 * arguments.minutes;
    let mut flown = Vec::new();
    for flight in flights::all() {
        let done = flight.fly(&xfm, &model, seconds, &quota, arguments.seed)?;
        eprintln!("{}: {}", done.name, done.verdict.clone().unwrap_or_else(|| "ok".into()));
        flown.push(done);
    }
    println!("{}", judge::table(&flown));
    let picture = folder.join("memory.svg");
    let charts: Vec<Chart> =
        flown.iter().filter(|flown| flown.report.is_object()).map(memory_chart).collect();
    chart::write(&picture, &charts)?;
    let mut all = circumstances();
    all["model"] = model.display().to_string().into();
    all["hard_quota"] = quota.into();
    all["seed"] = arguments.seed.into();
    all["minutes"] = arguments.minutes.into();
    let row = |flown: &Flown| json!({ "flight": flown.name, "failed": flown.verdict, "report": flown.report });
    all["flights"] = flown.iter().map(row).collect::<Vec<Value>>().into();
    let file = folder.join("results.json");
    fs::write(&file, format!("{all:#}\n")).map_err(Error::file(&file))?;
    println!("results  {}\npicture  {}", file.display(), picture.display());
    match flown.iter().filter(|flown| flown.verdict.is_some()).count() {
        0 => Ok(()),
        failed => Err(Error::Claims { what: "flights", failed, total: flown.len() }),
    }
}

/// The model as a `.xfm` file: the one given, or built of the mesh given, or of one that is generated.
fn model(arguments: &Arguments, xfm: &Path, folder: &Path) -> Result<PathBuf, Error> {
    let mesh = match &arguments.file {
        Some(file) if file.extension().is_some_and(|extension| extension == "xfm") => {
            fs::metadata(file).map_err(Error::file(file))?;
            return Ok(file.clone());
        }
        Some(file) => file.clone(),
        None => {
            let file = folder.join("torus.ply");
            generate::write_file(&Generator::new(&Options::new(Shape::Torus, GENERATED))?, &file)?;
            file
        }
    };
    let model = folder.join(mesh.file_stem().unwrap_or_default()).with_extension("xfm");
    process::run(Command::new(xfm).arg("build").arg(&mesh).arg(&model))?;
    Ok(model)
}

/// A tiny hard quota for a model, in bytes.
fn quota(xfm: &Path, model: &Path) -> Result<u64, Error> {
    let report = |arguments: &[&str]| {
        let mut command = Command::new(xfm);
        command.arg(arguments[0]).arg(model).arg("--json").args(&arguments[1..]);
        process::parse_json(arguments[0], &process::read(&mut command)?)
    };
    let nodes = report(&["info"])?["nodes"].as_f64().unwrap_or(0.0);
    // For each of the flights that is the most.
    let loaders = flights::LOADERS.to_string();
    let opened = report(&["fly", "--frames", "1", "--loaders", &loaders])?;
    let least = opened["least_quota"].as_f64().unwrap_or(0.0);
    Ok((PART * NODE_BYTES * nodes).max(LEAST * least) as u64)
}

fn memory_chart(flown: &Flown) -> Chart {
    let samples = flown.report["memory"]["samples"].as_array();
    let curve = |name: &str, key: &str| {
        let number = |sample: &Value, key: &str| sample[key].as_f64().unwrap_or(f64::NAN);
        let point = |sample| (number(sample, "seconds"), number(sample, key) / f64::from(1 << 20));
        let points = samples.into_iter().flatten().map(point).collect();
        Curve { name: name.into(), points }
    };
    Chart {
        title: format!("{}: memory, MiB", flown.name),
        over: Over::Seconds,
        curves: vec![
            curve("process", "anonymous"),
            curve("front", "front"),
            curve("pager", "pager"),
        ],
    }
}
