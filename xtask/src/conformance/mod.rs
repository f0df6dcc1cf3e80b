//! The command `conformance`: every public claim, judged by trimesh.
//!
//! This side makes the inputs, runs `xfm` on them and writes down what was run and what came out, as a plan
//! in JSON. The judge in `tests/conformance` reads the plan and the files with NumPy, SciPy and trimesh
//! alone, and so shares no code with what it judges.

mod cases;
mod drive;

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::setup::{self, Python};
use crate::{Error, process};

/// Arguments of `conformance`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  cargo xtask conformance --full")]
pub struct Arguments {
    /// Larger meshes too, and those in ../shared/data where that folder exists.
    #[arg(long)]
    full: bool,
}

/// How much is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Generated meshes of some ten thousand triangles and small broken ones.
    Short,
    /// Larger ones too, and scans from the data folder.
    Full,
}

/// Builds `xfm` and judges it.
///
/// # Errors
/// [`Error::Claims`] when a claim fails; others when something cannot be run at all.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    let python = setup::python()?;
    process::run(process::cargo().args(["build", "--release", "--package", "xfm"]))?;
    let scope = if arguments.full { Scope::Full } else { Scope::Short };
    judge(&scope, "release", &python)
}

/// Judges the `xfm` that was built with a profile (`debug` or `release`, as its folder is called).
///
/// Leaves `results.json` and `report.html` in `target/conformance` and prints a table.
///
/// # Errors
/// [`Error::Claims`] when a claim fails; others when something cannot be run at all.
pub fn judge(scope: &Scope, profile: &str, python: &Python) -> Result<(), Error> {
    let folder = process::target().join("conformance");
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(Error::file(&folder))?;
    }
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let judge = process::root().join("tests/conformance/judge.py");
    let driver = drive::Driver::new(process::built(profile, "xfm"), python, judge.clone());
    let mut plan = Vec::new();
    for case in cases::all(*scope, &folder)? {
        plan.push(driver.run(&case)?);
    }
    let plan_file = folder.join("plan.json");
    write_json(&plan_file, &json!({ "cases": plan }))?;
    let mut command = python.command();
    command.arg(&judge).arg("judge").arg(&plan_file).arg(&folder);
    eprintln!("$ {}", process::display(&command));
    let ended =
        command.status().map_err(|source| Error::Start { program: "python".into(), source })?;
    let results_file = folder.join("results.json");
    let text = fs::read_to_string(&results_file).map_err(Error::file(&results_file))?;
    let results = process::parse_json("results.json", &text)?;
    eprintln!("conformance: see {}", folder.join("report.html").display());
    let count = |key| results.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
    let (passed, failed) = (count("passed"), count("failed"));
    if failed > 0 {
        return Err(Error::Claims { what: "claims", failed, total: passed + failed });
    }
    if !ended.success() || passed == 0 {
        return Err(Error::Failed {
            command: process::display(&command),
            status: ended.to_string(),
        });
    }
    Ok(())
}

fn write_json(path: &Path, value: &Value) -> Result<(), Error> {
    fs::write(path, format!("{value:#}\n")).map_err(Error::file(path))
}
