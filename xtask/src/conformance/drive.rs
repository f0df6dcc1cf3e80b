//! Runs `xfm` on a case and writes down what it was asked and what came of it.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use super::cases::{Case, Nature};
use crate::setup::Python;
use crate::{Error, process};

/// The longest part of a program's messages that goes into the plan.
const MAX_MESSAGE: usize = 2_000;

/// Runs `xfm`, and the judge where files of its making are wanted.
#[derive(Debug)]
pub struct Driver<'a> {
    xfm: PathBuf,
    python: &'a Python,
    judge: PathBuf,
}

impl<'a> Driver<'a> {
    /// A driver of this `xfm`.
    pub fn new(xfm: PathBuf, python: &'a Python, judge: PathBuf) -> Self {
        Self { xfm, python, judge }
    }

    /// Does all that a case asks for; a command that fails is a finding for the judge, not an error.
    pub fn run(&self, case: &Case) -> Result<Value, Error> {
        eprintln!("conformance: {}", case.name);
        let at = |name: &str| case.folder.join(name);
        let model = at("exact.xfm");
        let mut steps = vec![
            self.build(&case.input, &model, &["--encoding", "exact"])?,
            self.step("verify", None, &["verify", &text(&model), "--json"])?,
            self.step(
                "against",
                None,
                &["verify", &text(&model), "--against", &text(&case.input), "--json"],
            )?,
            self.extract("full", &model, &at("full.ply"), &["--full"])?,
        ];
        for faces in &case.fronts {
            let front = at(&format!("front-{faces}.ply"));
            let mut step =
                self.extract("front", &model, &front, &["--faces", &faces.to_string()])?;
            step["asked"] = json!(faces);
            steps.push(step);
        }
        for (number, eye) in case.eyes.iter().enumerate() {
            let eye = eye.map(|c| c.to_string()).join(",");
            let camera = ["--eye", &eye, "--at", "0,0,0", "--size", "960x720", "--pixels", "2"];
            steps.push(self.extract(
                "view",
                &model,
                &at(&format!("view-{number}.ply")),
                &camera,
            )?);
        }
        if case.nature != Nature::Dirty {
            let compact = at("compact.xfm");
            steps.push(self.build(&case.input, &compact, &["--encoding", "compact"])?);
            steps.push(self.extract("compact", &compact, &at("compact.ply"), &["--full"])?);
        }
        if let Some(memory) = case.memory {
            let streamed = at("streamed.xfm");
            steps.push(self.build(
                &case.input,
                &streamed,
                &["--encoding", "exact", "--memory", memory],
            )?);
            steps.push(self.extract("full", &streamed, &at("streamed.ply"), &["--full"])?);
        }
        if let Some(faces) = case.decimate {
            steps.extend(self.decimate(case, faces)?);
        }
        if case.formats {
            steps.extend(self.formats(case, &model)?);
            steps.extend(self.colours(case)?);
        }
        let euler = match case.nature {
            Nature::Closed(euler) => json!(euler),
            _ => Value::Null,
        };
        Ok(json!({
            "name": case.name,
            "input": case.input,
            "nature": case.nature.word(),
            "euler": euler,
            "steps": steps,
        }))
    }

    fn build(&self, input: &Path, model: &Path, options: &[&str]) -> Result<Value, Error> {
        let (input, output) = (text(input), text(model));
        let mut arguments = vec!["build", &input, &output, "--json"];
        arguments.extend(options);
        self.step("build", None, &arguments)
    }

    fn extract(&self, kind: &str, model: &Path, to: &Path, what: &[&str]) -> Result<Value, Error> {
        let (model, output) = (text(model), text(to));
        let mut arguments = vec!["extract", &model, &output, "--json"];
        arguments.extend(what);
        self.step(kind, Some(to), &arguments)
    }

    /// Decimates, and measures the distance between both meshes.
    fn decimate(&self, case: &Case, faces: u64) -> Result<[Value; 2], Error> {
        let output = case.folder.join("decimated.ply");
        let (input, decimated, count) = (text(&case.input), text(&output), faces.to_string());
        let arguments = ["decimate", &input, &decimated, "--faces", &count, "--json"];
        let mut step = self.step("decimate", Some(&output), &arguments)?;
        step["asked"] = json!(faces);
        let difference =
            self.step("diff", Some(&output), &["diff", &input, &decimated, "--json"])?;
        Ok([step, difference])
    }

    /// Each format in, as trimesh writes it, and out, as trimesh reads it.
    fn formats(&self, case: &Case, model: &Path) -> Result<Vec<Value>, Error> {
        let mut write = self.python.command();
        write.arg(&self.judge).arg("write").arg(&case.input).arg(&case.folder);
        let files = process::read(&mut write)?;
        let mut steps = Vec::new();
        for file in files.lines() {
            let (input, built) = (Path::new(file), format!("{file}.xfm"));
            steps.push(self.build(input, Path::new(&built), &["--encoding", "exact"])?);
            let to = PathBuf::from(format!("{file}.ply"));
            steps.push(self.extract("read", Path::new(&built), &to, &["--full"])?);
        }
        for extension in ["stl", "ply", "obj", "glb"] {
            let to = case.folder.join(format!("written.{extension}"));
            steps.push(self.extract("write", model, &to, &["--full"])?);
        }
        Ok(steps)
    }

    /// Colours of vertices, as trimesh writes them and reads them again: those of the whole mesh and those of a front.
    fn colours(&self, case: &Case) -> Result<Vec<Value>, Error> {
        let mut paint = self.python.command();
        paint.arg(&self.judge).arg("paint").arg(&case.input).arg(&case.folder);
        let painted = process::read(&mut paint)?;
        let input = Path::new(painted.trim());
        let model = case.folder.join("painted.xfm");
        let mut steps = vec![self.build(input, &model, &["--encoding", "exact"])?];
        let front = ["--faces", "1000"];
        for (name, what) in [
            ("ply", &["--full"][..]),
            ("obj", &["--full"]),
            ("glb", &["--full"]),
            ("front.ply", &front),
        ] {
            let to = case.folder.join(format!("painted-out.{name}"));
            let mut step = self.extract("colours", &model, &to, what)?;
            step["painted"] = json!(input);
            step["everywhere"] = json!(what == ["--full"]);
            steps.push(step);
        }
        Ok(steps)
    }

    fn step(&self, kind: &str, output: Option<&Path>, arguments: &[&str]) -> Result<Value, Error> {
        let mut command = Command::new(&self.xfm);
        command.args(arguments);
        let done = process::capture(&mut command)?;
        let message = String::from_utf8_lossy(&done.stderr);
        let report: Value = serde_json::from_slice(&done.stdout).unwrap_or(Value::Null);
        Ok(json!({
            "kind": kind,
            "arguments": arguments,
            "command": format!("xfm {}", arguments.join(" ")),
            "exit": done.status.code(),
            "message": message.chars().take(MAX_MESSAGE).collect::<String>(),
            "report": report,
            "output": output,
        }))
    }
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
