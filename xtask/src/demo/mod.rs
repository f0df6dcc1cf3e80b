//! The command `demo`: the main job from end to end, with a picture and a table.
//!
//! The picture is laid out as the first paper's Figure 10, the table as its Table 3 (DeCoro and Pajarola,
//! *XFastMesh: Fast View-dependent Meshing from External Memory*, 2002, section 5).

pub mod frames;
mod sheet;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use serde_json::Value;

use crate::generate::{self, Generator, Options, Shape};
use crate::{Error, process, setup};

/// Frames of the rendered camera path.
const VIEW_FRAMES: usize = 40;
/// Frames of the path that is flown without rendering.
const FLY_FRAMES: usize = 300;
/// Triangles that the tolerance is adjusted to while flying.
const FLY_BUDGET: usize = 100_000;
/// Size of a rendered frame.
const SIZE: &str = "960x720";

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  cargo xtask demo statue.ply")]
pub struct Arguments {
    /// The model; without it a scan-like one of a million triangles is generated.
    file: Option<PathBuf>,
    /// Tolerance of the rendered frames, in pixels.
    #[arg(long, default_value_t = 1.0)]
    pixels: f64,
}

/// Builds the model's `.xfm`, checks it, flies around it, and leaves `sheet.png` and `table.txt` in
/// `target/demo`.
///
/// # Errors
/// When a program fails or its report lacks what the picture or the table needs.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    setup::rendering()?;
    let mut build = process::cargo();
    build.args(["build", "--release", "--package", "xfm", "--package", "vk-render", "--bins"]);
    process::run(&mut build)?;
    let start = Instant::now();
    let folder = process::target().join("demo");
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let input = match &arguments.file {
        Some(file) => file.clone(),
        None => generated(&folder)?,
    };
    let name = input.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let model = folder.join(&name).with_extension("xfm");
    let xfm = || Command::new(process::built("release", "xfm"));

    let built = report("xfm build", xfm().arg("build").arg(&input).arg(&model).arg("--json"))?;
    let verified = report("xfm verify", xfm().arg("verify").arg(&model).arg("--json"))?;
    if verified.get("ok").and_then(Value::as_bool) != Some(true) {
        return Err(Error::Report { what: "xfm verify".into(), why: verified.to_string() });
    }
    let mut fly = xfm();
    fly.arg("fly").arg(&model).args(["--path", "orbit", "--json"]);
    fly.args(["--frames", &FLY_FRAMES.to_string(), "--budget", &FLY_BUDGET.to_string()]);
    let flown = report("xfm fly", &mut fly)?;
    let flight = folder.join("fly.json");
    fs::write(&flight, format!("{flown:#}\n")).map_err(Error::file(&flight))?;

    let pictures = folder.join("frames");
    if pictures.exists() {
        // Frames of an earlier, longer path would remain.
        fs::remove_dir_all(&pictures).map_err(Error::file(&pictures))?;
    }
    fs::create_dir_all(&pictures).map_err(Error::file(&pictures))?;
    let mut view = Command::new(process::built("release", "xfm-view"));
    view.arg(&model).arg("--offscreen").arg(&pictures).args(["--path", "orbit", "--outside"]);
    view.args(["--frames", &VIEW_FRAMES.to_string(), "--size", SIZE]);
    view.args(["--pixels", &arguments.pixels.to_string()]).stdout(std::io::stderr());
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // Drivers complain without one, though nothing of it is needed offscreen.
        view.env("XDG_RUNTIME_DIR", &pictures);
    }
    process::run(&mut view)?;
    let frames = frames::read(&pictures)?;

    let picture = folder.join("sheet.png");
    sheet::compose(&pictures, &frames, arguments.pixels, &picture)?;
    let faces = built.get("input_triangles").and_then(Value::as_u64).unwrap_or(0);
    let text = table::write(&name, faces, &frames, &built, &flown);
    let table = folder.join("table.txt");
    fs::write(&table, &text).map_err(Error::file(&table))?;
    println!("{text}");
    println!("picture  {}", picture.display());
    println!("table    {}", table.display());
    println!("took     {:.1} s after compilation", start.elapsed().as_secs_f64());
    Ok(())
}

fn generated(folder: &Path) -> Result<PathBuf, Error> {
    let input = folder.join("scan.ply");
    let start = Instant::now();
    let count =
        generate::write_file(&Generator::new(&Options::new(Shape::Scan, 1_000_000))?, &input)?;
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("generated {} with {count} triangles in {seconds:.2} s", input.display());
    Ok(input)
}

fn report(what: &str, command: &mut Command) -> Result<Value, Error> {
    process::parse_json(what, &process::read(command)?)
}
