//! One mesh and one ratio: who is run how, and what came of it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::contender::{self, Contender, Kind};
use super::runs::{self, Attempt, Run, Runs, median};
use super::{distances, reason};
use crate::setup::Python;
use crate::{Error, process};

/// What is decimated, and by which programs.
#[derive(Debug)]
pub struct Input {
    /// The mesh.
    pub file: PathBuf,
    /// Where its arrays are for the peers, and where results go.
    pub folder: PathBuf,
    /// Its number of triangles.
    pub triangles: u64,
    /// Our program.
    pub xfm: PathBuf,
    /// The peers'.
    pub python: Python,
}

/// A contest on one mesh at one ratio.
#[derive(Debug)]
pub struct Contest<'a> {
    input: &'a Input,
    ratio: f64,
    target: u64,
    repeat: u32,
}

impl<'a> Contest<'a> {
    /// A contest that has not begun.
    pub fn new(input: &'a Input, ratio: f64, repeat: u32) -> Self {
        let target = (ratio * input.triangles as f64).round() as u64;
        Self { input, ratio, target, repeat }
    }

    /// Runs the reference and each contender in turn and returns the results, a row for each.
    ///
    /// # Errors
    /// When a program cannot be started or waited for. One that fails is a row that says why.
    pub fn run(&self, contenders: &[Contender]) -> Result<Value, Error> {
        let reference = contender::reference();
        let attempt = &mut |contender: &Contender| self.attempt(contender);
        let (alone, beside) = runs::in_turn(&reference, contenders, self.repeat, attempt)?;
        let mut rows = Vec::new();
        for (contender, runs) in
            std::iter::once((&reference, alone)).chain(contenders.iter().zip(beside))
        {
            rows.push(match runs {
                Err(why) => json!({ "name": contender.name, "failure": why }),
                Ok(runs) => self.row(contender, &runs),
            });
        }
        Ok(json!({
            "file": self.input.file.file_name().map(|name| name.to_string_lossy()),
            "input_triangles": self.input.triangles,
            "ratio": self.ratio,
            "target_triangles": self.target,
            "rows": rows,
        }))
    }

    /// Runs a contender once; a failure of its own is what it gave as its reason.
    fn attempt(&self, contender: &Contender) -> Result<Attempt, Error> {
        let output = self.output(contender);
        let mut command = match &contender.kind {
            Kind::Ours(arguments) => {
                let mut command = Command::new(&self.input.xfm);
                command.arg("decimate").arg(&self.input.file).arg(&output).arg("--json");
                command.arg("--ratio").arg(self.ratio.to_string()).args(arguments);
                command
            }
            Kind::Peer(peer) => {
                let mut command = self.input.python.command();
                command.arg(process::root().join("tests/compare/peer.py")).arg(peer);
                command.arg(&self.input.folder).arg(self.target.to_string()).arg(&output);
                command
            }
        };
        let done = process::measure(command.stdin(Stdio::null()))?;
        if !done.status.success() {
            return Ok(Err(reason(&done.stderr)));
        }
        // A peer may chat before its report.
        let from = done.stdout.find('{').unwrap_or(0);
        let report = match process::parse_json(&contender.name, &done.stdout[from..]) {
            Ok(report) => report,
            Err(error) => return Ok(Err(error.to_string())),
        };
        Ok(Ok(match contender.kind {
            Kind::Ours(_) => Run { seconds: done.seconds, peak_rss: done.peak_rss, report },
            // The peer's own clock and memory: without start, input and output.
            Kind::Peer(_) => Run {
                seconds: report["seconds"].as_f64().unwrap_or(f64::NAN),
                peak_rss: report["peak_rss"].as_u64().unwrap_or(0),
                report,
            },
        }))
    }

    fn row(&self, contender: &Contender, runs: &Runs) -> Value {
        let seconds = median(&runs.seconds);
        let output = self.output(contender);
        let distances = match distances(&self.input.xfm, &self.input.file, &output) {
            Ok(distances) => distances,
            Err(error) => json!({ "failure": error.to_string() }),
        };
        json!({
            "name": contender.name,
            "kind": match contender.kind { Kind::Ours(_) => "ours", Kind::Peer(_) => "peer" },
            "output_triangles": runs.report["output_triangles"],
            "seconds": seconds,
            "runs": runs.seconds,
            "rate": self.input.triangles as f64 / seconds,
            "xfm_factor": (!runs.factors.is_empty()).then(|| median(&runs.factors)),
            "peak_rss": runs.peak_rss,
            "rss_before": runs.report["rss_before"],
            "distances": distances,
            "report": runs.report,
        })
    }

    fn output(&self, contender: &Contender) -> PathBuf {
        let name: String =
            contender.name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        let ratio = self.ratio.to_string().replace('.', "_");
        self.input.folder.join(Path::new(&format!("{name}-{ratio}.ply")))
    }
}
