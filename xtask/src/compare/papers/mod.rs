//! The papers' tables and a figure, with our numbers beside theirs.
//!
//! DeCoro and Pajarola, *XFastMesh: Fast View-dependent Meshing from External Memory*, 2002, Tables 1 to 3; Wu and
//! Kobbelt, *A Stream Algorithm for the Decimation of Massive Meshes*, 2003, Table 1 and Figure 4. Their machines were of
//! their day (450 and 866 MHz). A model of theirs that is not at hand is replaced by a generated scan of as many triangles.

mod figure;
mod figures;
mod hierarchies;
mod streams;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use crate::generate::{self, Generator, Options, Shape};
use crate::{Error, process, setup};

/// Where things are, and up to what size models are tried.
#[derive(Debug)]
pub struct Papers {
    /// Our program.
    pub xfm: PathBuf,
    /// Where models may lie.
    pub data: PathBuf,
    /// Where results go.
    pub folder: PathBuf,
    /// Models with more triangles are left out.
    pub largest: u64,
}

/// A mesh to be measured, and what it is called.
#[derive(Debug)]
struct Mesh {
    /// The paper's name of it, or that of its replacement.
    name: String,
    file: PathBuf,
}

impl Papers {
    /// Measures everything; returns the tables and the same as JSON.
    ///
    /// # Errors
    /// When a program of ours fails.
    pub fn run(&self) -> Result<(Vec<String>, Value), Error> {
        setup::rendering()?;
        process::run(process::cargo().args([
            "build",
            "--release",
            "--package",
            "vk-render",
            "--bins",
        ]))?;
        let hierarchies = hierarchies::measure(self)?;
        let streams = streams::measure(self)?;
        let figure = figure::measure(self)?;
        let mut tables = hierarchies::tables(&hierarchies);
        tables.extend([streams::table(&streams), figure::table(&figure)]);
        Ok((tables, json!({ "hierarchies": hierarchies, "streams": streams, "figure": figure })))
    }

    /// The model of this file's name, or a scan of as many triangles.
    fn mesh(&self, name: &str, file: &str, triangles: u64) -> Result<Mesh, Error> {
        let model = self.data.join(file);
        if model.is_file() {
            return Ok(Mesh { name: name.to_owned(), file: model });
        }
        let file = self.folder.join(format!("scan-{triangles}.ply"));
        if !file.is_file() {
            let options = Options::new(Shape::Scan, triangles);
            generate::write_file(&Generator::new(&options)?, &file)?;
        }
        Ok(Mesh { name: format!("{name}: scan"), file })
    }

    fn xfm(&self, command: &str) -> Command {
        let mut xfm = Command::new(&self.xfm);
        xfm.arg(command);
        xfm
    }

    /// `xfm-view` that draws into a file or folder.
    fn view(&self, model: &Path, output: &Path) -> Command {
        let mut view = Command::new(process::built("release", "xfm-view"));
        view.arg(model).arg("--offscreen").arg(output).stdout(std::io::stderr());
        if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
            // Drivers complain without one, though nothing of it is needed offscreen.
            view.env("XDG_RUNTIME_DIR", &self.folder);
        }
        view
    }
}

fn report(what: &str, command: &mut Command) -> Result<Value, Error> {
    process::parse_json(what, &process::read(command.arg("--json"))?)
}
