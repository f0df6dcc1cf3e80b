//! Runs the binary on small meshes in a directory of its own.
#![allow(dead_code, reason = "every test file uses some of these")]

pub mod mesh;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// What a finished run left behind.
pub struct Ran {
    /// The exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Ran {
    fn new(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("the streams carry UTF-8");
        Self {
            code: output.status.code().expect("the process was not killed"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// What a child leaves behind once it has ended.
    pub fn of(child: Child) -> Self {
        Self::new(child.wait_with_output().expect("the binary ends"))
    }

    /// The JSON report on standard output of a run that succeeded.
    pub fn json(&self) -> serde_json::Value {
        assert_eq!(self.code, 0, "{}", self.stderr);
        serde_json::from_str(&self.stdout).expect("standard output is one JSON value")
    }

    /// The one line that a failed run says.
    pub fn error_line(&self) -> &str {
        assert_eq!(self.code, 1, "{}", self.stderr);
        assert_eq!(self.stdout, "", "a failure writes nothing to standard output");
        let line = self.stderr.strip_suffix('\n').expect("a whole line");
        assert!(!line.contains('\n'), "one line only: {line}");
        line.strip_prefix("error: ").expect("an error line")
    }
}

/// Runs `xfm` with these arguments and nothing on standard input.
pub fn xfm(args: &[&str]) -> Ran {
    Ran::new(command(args).stdin(Stdio::null()).output().expect("the binary runs"))
}

/// Runs `xfm` with these arguments and `input` on standard input.
pub fn xfm_with_input(args: &[&str], input: &[u8]) -> Ran {
    let mut child = command(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    let mut stdin = child.stdin.take().expect("standard input is a pipe");
    let input = input.to_vec();
    let writer = std::thread::spawn(move || stdin.write_all(&input));
    let output = child.wait_with_output().expect("the binary ends");
    // The command may well stop reading early.
    drop(writer.join().expect("the writer does not panic"));
    Ran::new(output)
}

/// The binary with these arguments, not yet started.
pub fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xfm"));
    command.args(args);
    command
}

/// A directory of its own for one test, removed at its end.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// The path of a file in it, whether it is there or not.
    pub fn file(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("a UTF-8 path").to_owned()
    }

    /// Writes a file and returns its path.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.file(name);
        std::fs::write(&path, content).expect("the file can be written");
        path
    }

    /// The names of all files in it, sorted.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.path()).expect("the directory is there");
        let mut names: Vec<String> = entries
            .map(|entry| PathBuf::from(entry.expect("an entry").file_name()))
            .map(|name| name.to_str().expect("a UTF-8 name").to_owned())
            .collect();
        names.sort();
        names
    }
}

/// A bumpy height field over the unit square as OBJ text, `2 · n²` triangles, raised by `z`.
pub fn bumpy_square(n: u32, z: f64) -> String {
    let mut obj = String::new();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            obj += &format!("v {x} {y} {}\n", z + 0.1 * (5.0 * x).sin() * (4.0 * y).cos());
        }
    }
    for j in 0..n {
        for i in 0..n {
            let at = j * (n + 1) + i + 1;
            obj += &format!("f {} {} {}\n", at, at + 1, at + n + 2);
            obj += &format!("f {} {} {}\n", at, at + n + 2, at + n + 1);
        }
    }
    obj
}

/// A flat unit square at height `z` as OBJ text, two triangles.
pub fn flat_square(z: f64) -> String {
    format!("v 0 0 {z}\nv 1 0 {z}\nv 1 1 {z}\nv 0 1 {z}\nf 1 2 3\nf 1 3 4\n")
}

/// A closed torus as OBJ text, `2 · n · m` triangles.
pub fn torus(n: u32, m: u32) -> String {
    use std::f64::consts::TAU;
    let mut obj = String::new();
    for j in 0..m {
        for i in 0..n {
            let (u, v) = (TAU * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(m));
            let radius = 1.0 + (0.35 + 0.03 * (7.0 * u).sin()) * v.cos();
            obj += &format!("v {} {} {}\n", radius * u.cos(), radius * u.sin(), 0.35 * v.sin());
        }
    }
    let at = |i: u32, j: u32| (j % m) * n + i % n + 1;
    for j in 0..m {
        for i in 0..n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            obj += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    }
    obj
}

/// What `xfm decimate` reports.
pub fn decimate(input: &str, output: &str, how: &[&str]) -> serde_json::Value {
    xfm(&[&["decimate", input, output, "--json"], how].concat()).json()
}
