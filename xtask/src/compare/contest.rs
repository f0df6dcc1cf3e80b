//! One mesh and one ratio: who decimates it how, and what came of it.

use std::iter;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::contender::{self, Contender, Kind};
use super::runs::{self, Attempt, Run, Runs, median, spread};
use super::tools::{self, Tools};
use super::{distances, reason};
use crate::setup::Python;
use crate::{Error, process};

/// What is decimated or built, and by which programs.
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

impl Input {
    /// Where a contender's result goes.
    pub fn output(&self, contender: &Contender, what: &str, extension: &str) -> PathBuf {
        let name: String =
            contender.name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        self.folder.join(Path::new(&format!("{name}-{what}.{extension}")))
    }

    /// What one of our runs took and reported.
    pub fn ours(&self, name: &str, command: &mut Command) -> Result<Attempt, Error> {
        let done = process::measure(command.stdin(Stdio::null()))?;
        if !done.status.success() {
            return Ok(Err(reason(&done.stderr)));
        }
        Ok(process::parse_json(name, &done.stdout)
            .map(|report| Run { seconds: done.seconds, peak_rss: done.peak_rss, report })
            .map_err(|error| error.to_string()))
    }
}

/// A contest on one mesh at one ratio.
#[derive(Debug)]
pub struct Contest<'a> {
    input: &'a Input,
    ratio: f64,
    target: u64,
    repeat: u32,
    /// What OpenMesh shall leave to come to the target; found when it is first run.
    vertices: Option<u64>,
}

impl<'a> Contest<'a> {
    /// A contest that has not begun.
    pub fn new(input: &'a Input, ratio: f64, repeat: u32) -> Self {
        let target = (ratio * input.triangles as f64).round() as u64;
        Self { input, ratio, target, repeat, vertices: None }
    }

    /// Runs the reference and each contender in turn and returns the results, a row for each.
    ///
    /// # Errors
    /// When a program cannot be started or waited for. One that fails is a row that says why.
    pub fn run(mut self, contenders: &[Contender]) -> Result<Value, Error> {
        let (reference, repeat) = (contender::reference(), self.repeat);
        let attempt = &mut |contender: &Contender| self.attempt(contender);
        let (alone, beside) = runs::in_turn(&reference, contenders, repeat, attempt)?;
        let outcomes = iter::once((&reference, alone)).chain(contenders.iter().zip(beside));
        let rows = runs::rows(outcomes, |contender, runs| Ok(self.row(contender, runs)))?;
        Ok(json!({
            "file": self.input.file.file_name().map(|name| name.to_string_lossy()),
            "input_triangles": self.input.triangles,
            "ratio": self.ratio,
            "target_triangles": self.target,
            "rows": rows,
        }))
    }

    /// Runs a contender once; a failure of its own is what it gave as its reason.
    fn attempt(&mut self, contender: &Contender) -> Result<Attempt, Error> {
        let output = self.output(contender);
        let Input { file, xfm, .. } = self.input;
        match &contender.kind {
            Kind::Ours(arguments) => {
                let mut command = Command::new(xfm);
                command.arg("decimate").arg(file).arg(&output).arg("--json");
                command.arg("--ratio").arg(self.ratio.to_string()).args(arguments);
                self.input.ours(&contender.name, &mut command)
            }
            Kind::Peer(peer) => self.call(peer, &output),
            Kind::Tools(tools) => {
                let vertices = match self.vertices {
                    Some(vertices) => vertices,
                    None => tools::vertices_for(xfm, file, &output, self.target)?,
                };
                self.vertices = Some(vertices);
                tools.run(file, &output, vertices)
            }
        }
    }

    /// Lets a peer decimate; its time and memory are those of its own clock: without start, input and output.
    fn call(&self, peer: &str, output: &Path) -> Result<Attempt, Error> {
        let mut command = self.input.python.command();
        command.arg(process::root().join("tests/compare/peer.py")).arg(peer);
        command.arg(&self.input.folder).arg(self.target.to_string()).arg(output);
        let done = process::measure(command.stdin(Stdio::null()))?;
        if !done.status.success() {
            return Ok(Err(reason(&done.stderr)));
        }
        // A peer may chat before its report.
        let from = done.stdout.find('{').unwrap_or(0);
        Ok(process::parse_json(peer, &done.stdout[from..])
            .map(|report| Run {
                seconds: report["seconds"].as_f64().unwrap_or(f64::NAN),
                peak_rss: report["peak_rss"].as_u64().unwrap_or(0),
                report,
            })
            .map_err(|error| error.to_string()))
    }

    fn row(&self, contender: &Contender, runs: &Runs) -> Value {
        let seconds = median(&runs.seconds);
        let output = self.output(contender);
        let distances = match distances(&self.input.xfm, &self.input.file, &output) {
            Ok(distances) => distances,
            Err(error) => json!({ "failure": error.to_string() }),
        };
        let counted = &runs.report["output_triangles"];
        let triangles = if counted.is_null() { &distances["b_triangles"] } else { counted };
        json!({
            "name": contender.name,
            "kind": match contender.kind {
                Kind::Ours(_) => "ours",
                Kind::Peer(_) => "peer",
                Kind::Tools(_) => "tools",
            },
            "output_triangles": triangles,
            "seconds": seconds,
            "runs": runs.seconds,
            "rate": self.input.triangles as f64 / seconds,
            "xfm_factor": spread(&runs.factors),
            "peak_rss": runs.peak_rss,
            "rss_before": runs.report["rss_before"],
            "distances": distances,
            "report": runs.report,
        })
    }

    fn output(&self, contender: &Contender) -> PathBuf {
        let extension = match contender.kind {
            Kind::Tools(tools) => Tools::extension(tools),
            _ => "ply",
        };
        let ratio = self.ratio.to_string().replace('.', "_");
        self.input.output(contender, &ratio, extension)
    }
}
