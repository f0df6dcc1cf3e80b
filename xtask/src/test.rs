//! The command `test`: everything that must hold before a change is good.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::{Error, conformance, fuzz, process, setup};

/// A step's name, what came of it, and how long it took.
struct Outcome {
    name: &'static str,
    result: Result<(), Error>,
    time: Duration,
}

/// Sets up, formats, lints, tests, documents and judges; every step runs even where one before failed.
///
/// # Errors
/// [`Error::Claims`] with the number of failed steps.
pub fn run() -> Result<(), Error> {
    let start = Instant::now();
    let mut outcomes = Vec::new();
    let mut step = |name, work: &mut dyn FnMut() -> Result<(), Error>| {
        eprintln!("\n== {name}");
        let start = Instant::now();
        let result = work();
        if let Err(error) = &result {
            eprintln!("error: {error}");
        }
        outcomes.push(Outcome { name, result, time: start.elapsed() });
    };
    let mut python = None;
    step("set up", &mut || {
        python = Some(setup::everything()?);
        Ok(())
    });
    step("format", &mut || process::run(cargo("fmt").args(["--all", "--check"])));
    step("lint", &mut || {
        process::run(cargo("clippy").args(["--workspace", "--all-targets", "--", "-D", "warnings"]))
    });
    step("test", &mut || process::run(cargo("test").args(["--workspace", "--no-fail-fast"])));
    step("document", &mut || {
        let mut doc = cargo("doc");
        process::run(doc.args(["--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))
    });
    // With the tests, though only programs are wanted: dependencies' features then include what the
    // tests ask for, as in the step before, and nothing is built twice.
    step("build", &mut || process::run(cargo("build").args(["--workspace", "--bins", "--tests"])));
    step("fuzz", &mut fuzz::smoke);
    step("conformance", &mut || match &python {
        Some(python) => conformance::judge(&conformance::Scope::Short, "debug", python),
        None => Err(Error::Report {
            what: "conformance".into(),
            why: "there is no Python to judge with, see the set-up".into(),
        }),
    });
    summarise(&outcomes, start.elapsed())
}

/// A cargo command without colour codes where the output is no terminal: cargo's own default.
fn cargo(subcommand: &str) -> Command {
    let mut command = process::cargo();
    command.arg(subcommand);
    command
}

fn summarise(outcomes: &[Outcome], time: Duration) -> Result<(), Error> {
    println!();
    for Outcome { name, result, time } in outcomes {
        let word = if result.is_ok() { "ok" } else { "FAILED" };
        println!("{name:<12} {word:<7} {:>6.1} s", time.as_secs_f64());
    }
    println!("{:<12} {:<7} {:>6.1} s", "total", "", time.as_secs_f64());
    let failed = outcomes.iter().filter(|o| o.result.is_err()).count();
    println!("{} passed, {failed} failed", outcomes.len() - failed);
    if failed == 0 {
        Ok(())
    } else {
        Err(Error::Claims { what: "steps", failed, total: outcomes.len() })
    }
}
