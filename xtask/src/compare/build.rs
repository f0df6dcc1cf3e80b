//! One mesh: who builds a hierarchy of it how, how large it is, and how good a level of it.

use std::fs;
use std::iter;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use super::contender::{self, Contender, Kind};
use super::contest::Input;
use super::distances;
use super::runs::{self, Attempt, Runs, median, spread};
use super::tools::Tools;
use crate::{Error, process};

/// Runs the reference and each contender in turn and returns the results, a row for each; of ours with the level that
/// has this share of the triangles.
///
/// # Errors
/// When a program cannot be started or waited for. One that fails is a row that says why.
pub fn run(
    input: &Input,
    contenders: &[Contender],
    ratio: f64,
    repeat: u32,
) -> Result<Value, Error> {
    let reference = contender::reference();
    let attempt = &mut |contender: &Contender| attempt(input, contender);
    let (alone, beside) = runs::in_turn(&reference, contenders, repeat, attempt)?;
    let outcomes = iter::once((&reference, alone)).chain(contenders.iter().zip(beside));
    let rows = runs::rows(outcomes, |contender, runs| row(input, contender, runs, ratio))?;
    Ok(json!({
        "file": input.file.file_name().map(|name| name.to_string_lossy()),
        "input_triangles": input.triangles,
        "ratio": ratio,
        "rows": rows,
    }))
}

fn output(input: &Input, contender: &Contender) -> PathBuf {
    let extension = match contender.kind {
        Kind::Tools(tools) => Tools::extension(tools),
        _ => "xfm",
    };
    input.output(contender, "built", extension)
}

fn attempt(input: &Input, contender: &Contender) -> Result<Attempt, Error> {
    let output = output(input, contender);
    match &contender.kind {
        Kind::Ours(arguments) => {
            let mut command = Command::new(&input.xfm);
            command.arg("build").arg(&input.file).arg(&output).arg("--json").args(arguments);
            input.ours(&contender.name, &mut command)
        }
        Kind::Tools(tools) => tools.run(&input.file, &output, 0),
        Kind::Peer(peer) => Ok(Err(format!("{peer} builds no hierarchies"))),
    }
}

fn row(input: &Input, contender: &Contender, runs: &Runs, ratio: f64) -> Result<Value, Error> {
    let file = output(input, contender);
    let size = fs::metadata(&file).map_err(Error::file(&file))?.len();
    let (seconds, triangles) = (median(&runs.seconds), input.triangles as f64);
    let level = match contender.kind {
        Kind::Ours(_) => level(input, &file, ratio)
            .unwrap_or_else(|error| json!({ "failure": error.to_string() })),
        _ => Value::Null,
    };
    Ok(json!({
        "name": contender.name,
        "seconds": seconds,
        "runs": runs.seconds,
        "seconds_per_triangle": seconds / triangles,
        "xfm_factor": spread(&runs.factors),
        "peak_rss": runs.peak_rss,
        "peak_anon": runs.report["peak_anon"],
        "file_bytes": size,
        "bytes_per_triangle": size as f64 / triangles,
        "level": level,
        "report": runs.report,
    }))
}

/// How far a level of detail is from the mesh.
fn level(input: &Input, file: &Path, ratio: f64) -> Result<Value, Error> {
    let mesh = file.with_extension("ply");
    let faces = (ratio * input.triangles as f64).round() as u64;
    let mut command = Command::new(&input.xfm);
    command.arg("extract").arg(file).arg(&mesh).args(["--faces", &faces.to_string()]);
    process::read(&mut command)?;
    distances(&input.xfm, &input.file, &mesh)
}
