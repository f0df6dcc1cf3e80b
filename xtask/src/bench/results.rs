//! What criterion measured, gathered into one file with machine and date.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::{Error, process};

/// The machine and the time of a measurement.
pub fn circumstances() -> Value {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    json!({
        "date": jiff::Timestamp::now().to_string(),
        "processor": processor(),
        "cores": cores,
        "os": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
    })
}

fn processor() -> Option<String> {
    let info = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Gathers all results that are there into `target/bench/results.json`.
pub fn write() -> Result<(), Error> {
    let mut found = Vec::new();
    gather(&process::target().join("criterion"), &mut found)?;
    found.sort_by(|a, b| a["name"].as_str().cmp(&b["name"].as_str()));
    let mut results = circumstances();
    results["benchmarks"] = found.into();
    let folder = process::target().join("bench");
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    let file = folder.join("results.json");
    fs::write(&file, format!("{results:#}\n")).map_err(Error::file(&file))?;
    println!("results  {}", file.display());
    Ok(())
}

/// Goes through criterion's folders: a benchmark has its last run in one called `new`.
fn gather(folder: &Path, found: &mut Vec<Value>) -> Result<(), Error> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    let folders = entries.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    for folder in folders.filter(|path| path.is_dir()) {
        if folder.ends_with("new") {
            let read = |name: &str| -> Result<Value, Error> {
                let file: PathBuf = folder.join(name);
                let text = fs::read_to_string(&file).map_err(Error::file(&file))?;
                process::parse_json(name, &text)
            };
            let (benchmark, estimates) = (read("benchmark.json")?, read("estimates.json")?);
            let seconds = estimates["median"]["point_estimate"].as_f64().unwrap_or(0.0) * 1e-9;
            let elements = benchmark["throughput"]["Elements"].as_f64();
            found.push(json!({
                "name": benchmark["full_id"],
                "median_s": seconds,
                "elements": elements,
                "elements_per_s": elements.map(|count| count / seconds),
            }));
        } else {
            gather(&folder, found)?;
        }
    }
    Ok(())
}
