//! A generated mesh through a pipe into `xfm decimate`: does rate or memory depend on the length?

use std::env;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::reason;
use crate::{Error, process};

/// What goes through the pipe, and how much of it is kept.
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    /// The generator's word for the shape.
    pub shape: &'static str,
    /// Triangles asked for.
    pub triangles: u64,
    /// Share of edges on the boundary of small holes.
    pub holes: f64,
    /// Share of the triangles to keep.
    pub ratio: f64,
}

impl Stream {
    /// A torus of which little is kept.
    pub fn torus(triangles: u64, holes: f64) -> Self {
        Self { shape: "torus", triangles, holes, ratio: 0.005 }
    }
}

/// Pipes a mesh through and returns the row.
///
/// # Errors
/// When a program cannot be started. One that fails is a row that says why.
pub fn run(xfm: &Path, stream: Stream, folder: &Path) -> Result<Value, Error> {
    let Stream { shape, triangles, holes, ratio } = stream;
    let mut generate = Command::new(env::current_exe().map_err(Error::Write)?);
    generate.args(["gen", shape, "--output", "-"]);
    generate.arg("--triangles").arg(triangles.to_string()).arg("--holes").arg(holes.to_string());
    let mut decimate = Command::new(xfm);
    decimate.args(["decimate", "-"]).arg(folder.join("stream.ply"));
    decimate.args(["--from", "stl", "--json", "--ratio"]).arg(ratio.to_string());
    eprintln!("$ {} | {}", process::display(&generate), process::display(&decimate));
    generate.stdin(Stdio::null()).stdout(Stdio::piped());
    let mut generator = generate.spawn().map_err(process::start_error(&generate))?;
    if let Some(pipe) = generator.stdout.take() {
        decimate.stdin(pipe);
    }
    let done = process::measure(&mut decimate)?;
    // The reader's end of the pipe is closed, else the generator might wait for ever.
    drop(decimate);
    let (status, generator_cpu, _) = process::wait(&mut generator).map_err(Error::Write)?;
    let failure = match (done.status.success(), status.success()) {
        (false, _) => Some(reason(&done.stderr)),
        (true, false) => Some(format!("the generator failed ({status})")),
        (true, true) => None,
    };
    if let Some(why) = failure {
        return Ok(json!({ "triangles": triangles, "holes": holes, "failure": why }));
    }
    let report = process::parse_json("xfm decimate", &done.stdout)?;
    let read = report["input_triangles"].as_u64().unwrap_or(triangles);
    Ok(json!({
        "shape": shape,
        "triangles": triangles,
        "holes": holes,
        "ratio": ratio,
        "input_triangles": read,
        "output_triangles": report["output_triangles"],
        "seconds": done.seconds,
        "rate": read as f64 / done.seconds,
        "peak_rss": done.peak_rss,
        "cpu_seconds": done.cpu_seconds,
        "generator_cpu_seconds": generator_cpu,
        "report": report,
    }))
}
