//! Cost per triangle and memory as a model grows: decimate, build and fly a generated torus of every size.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::results;
use crate::chart::{self, Chart, Curve, Over};
use crate::{Error, process};

/// Sizes there are between one and ten times a size.
const PER_DECADE: f64 = 2.0;
/// Triangles of the smallest model.
const LEAST: u64 = 1_000_000;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  cargo xtask bench scale
  cargo xtask bench scale --most 372000000 --memory 1GiB")]
pub struct Arguments {
    /// Triangles of the largest model; the smallest has a million.
    #[arg(long, value_name = "N", default_value_t = 100_000_000)]
    most: u64,
    /// What `xfm build` may take.
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    memory: String,
    /// Folder for the models [default: target/bench].
    #[arg(long, value_name = "DIR")]
    folder: Option<std::path::PathBuf>,
}

/// Runs all sizes; leaves `scale.json` and `scale.svg` in `target/bench`.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    process::run(process::cargo().args(["build", "--release", "--package", "xfm"]))?;
    let results_folder = process::target().join("bench");
    let folder = arguments.folder.clone().unwrap_or_else(|| results_folder.clone());
    for folder in [&folder, &results_folder] {
        fs::create_dir_all(folder).map_err(Error::file(folder))?;
    }
    let xfm = process::built("release", "xfm");
    let mut rows = Vec::new();
    println!(
        "{:>12} {:>16} {:>16} {:>16}",
        "triangles", "decimate µs/MiB", "build µs/MiB", "frame ms/MiB"
    );
    for triangles in sizes(arguments.most) {
        let row = row(&xfm, triangles, &arguments.memory, &folder)?;
        let cell = |what: &str, scale: f64| {
            let (cost, memory) = (number(&row, what, "cost"), number(&row, what, "memory"));
            format!("{:.2} / {:.0}", cost * scale, memory / f64::from(1 << 20))
        };
        println!(
            "{triangles:>12} {:>16} {:>16} {:>16}",
            cell("decimate", 1e6),
            cell("build", 1e6),
            cell("fly", 1e3)
        );
        rows.push(row);
    }
    let chart = |title: &str, key: &str, unit: f64, whats: &[&str]| -> Chart {
        let points = |what: &str| {
            let point = |row: &Value| {
                (row["triangles"].as_f64().unwrap_or(0.0), number(row, what, key) * unit)
            };
            rows.iter().map(point).collect()
        };
        let curve = |what: &&str| Curve { name: (*what).into(), points: points(what) };
        let curves = whats.iter().map(curve).collect();
        Chart { title: title.into(), over: Over::Triangles, curves }
    };
    let picture = results_folder.join("scale.svg");
    chart::write(
        &picture,
        &[
            chart("time per triangle, µs", "cost", 1e6, &["decimate", "build"]),
            chart("time per frame, ms (median)", "cost", 1e3, &["fly"]),
            chart("memory, MiB", "memory", 1.0 / f64::from(1 << 20), &["decimate", "build", "fly"]),
        ],
    )?;
    let mut all = results::circumstances();
    all["memory"] = arguments.memory.clone().into();
    all["rows"] = rows.into();
    let file = results_folder.join("scale.json");
    fs::write(&file, format!("{all:#}\n")).map_err(Error::file(&file))?;
    println!("results  {}\npicture  {}", file.display(), picture.display());
    Ok(())
}

/// From the least to the most, evenly on a logarithmic scale.
fn sizes(most: u64) -> Vec<u64> {
    let steps = (most as f64 / LEAST as f64).log10() * PER_DECADE;
    let step = |i: u32| LEAST as f64 * 10f64.powf(f64::from(i) / PER_DECADE);
    let mut sizes: Vec<u64> = (0..steps.max(0.0).ceil() as u32)
        .map(|i| (step(i) / 1e5).round() as u64 * 100_000)
        .collect();
    sizes.push(most.max(LEAST));
    sizes
}

fn number(row: &Value, what: &str, key: &str) -> f64 {
    row[what][key].as_f64().unwrap_or(f64::NAN)
}

fn row(xfm: &Path, triangles: u64, memory: &str, folder: &Path) -> Result<Value, Error> {
    let mesh = folder.join("scale.ply");
    let model = folder.join("scale.xfm");
    let mut decimate = Command::new(xfm);
    decimate.args(["decimate", "-"]).arg(&mesh);
    decimate.args(["--from", "stl", "--ratio", "0.005", "--json"]);
    let decimated = piped(triangles, &mut decimate)?;
    let mut build = Command::new(xfm);
    build.args(["build", "-"]).arg(&model).args(["--from", "stl", "--json"]);
    build.args(["--memory", memory, "--scratch"]).arg(folder);
    let built = piped(triangles, &mut build)?;
    let mut fly = Command::new(xfm);
    fly.arg("fly").arg(&model).args(["--budget", "100000", "--json"]);
    let flown = process::parse_json("xfm fly", &process::read(&mut fly)?)?;
    for file in [&mesh, &model] {
        fs::remove_file(file).map_err(Error::file(file))?;
    }
    let cost = |report: &Value, memory: &str| {
        let seconds = report["seconds"].as_f64().unwrap_or(f64::NAN);
        json!({ "cost": seconds / triangles as f64, "memory": report[memory], "report": report })
    };
    let resident = flown["resident_bytes"].as_f64().unwrap_or(f64::NAN);
    let front = flown["front_bytes"].as_f64().unwrap_or(f64::NAN);
    Ok(json!({
        "triangles": triangles,
        "decimate": cost(&decimated, "peak_rss"),
        "build": cost(&built, "peak_anon"),
        "fly": { "cost": flown["frame_s"]["median"], "memory": resident + front, "report": flown },
    }))
}

/// Pipes a generated torus into a command and returns what that reports.
fn piped(triangles: u64, command: &mut Command) -> Result<Value, Error> {
    let mut generate = Command::new(env::current_exe().map_err(Error::Write)?);
    generate.args(["gen", "torus", "--output", "-", "--triangles", &triangles.to_string()]);
    generate.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    eprintln!("$ {} | {}", process::display(&generate), process::display(command));
    let mut generator = generate.spawn().map_err(process::start_error(&generate))?;
    if let Some(pipe) = generator.stdout.take() {
        command.stdin(pipe);
    }
    let done = command.stderr(Stdio::inherit()).output().map_err(process::start_error(command))?;
    // The reader's end of the pipe is closed, else the generator might wait for ever.
    command.stdin(Stdio::null());
    let generated = generator.wait().map_err(Error::Write)?;
    for (status, command) in [(done.status, &*command), (generated, &generate)] {
        if !status.success() {
            return Err(Error::Failed {
                command: process::display(command),
                status: status.to_string(),
            });
        }
    }
    process::parse_json("xfm", &String::from_utf8_lossy(&done.stdout))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_even_on_a_logarithmic_scale_and_end_where_asked() {
        assert_eq!(sizes(100_000_000), [1_000_000, 3_200_000, 10_000_000, 31_600_000, 100_000_000]);
        assert_eq!(sizes(2_000_000), [1_000_000, 2_000_000]);
        assert_eq!(sizes(5), [1_000_000]);
    }
}
