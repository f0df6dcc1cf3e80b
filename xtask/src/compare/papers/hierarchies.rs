//! The first paper's Tables 1 to 3: sizes of files, times of building, times of frames.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::super::table::{aligned, fixed, grouped, number, rows, text};
use super::figures::{MODELS, Model};
use super::{Papers, report};
use crate::demo::frames;
use crate::{Error, process};

/// Pictures whose drawing is timed for Table 3.
const PICTURES: usize = 20;
/// Share of a model's nodes that may stay in memory without need: the paper's soft quota.
const SOFT_QUOTA: f64 = 0.1;
/// What a node takes in memory, roughly, in bytes; and the least quota, so that the smallest model's front has room.
const NODE_BYTES: f64 = 80.0;
const LEAST_QUOTA: f64 = 4e6;

/// Builds every model and flies around it.
pub fn measure(papers: &Papers) -> Result<Value, Error> {
    let models = MODELS.iter().filter(|model| model.faces <= papers.largest);
    models.map(|model| measure_one(papers, model)).collect::<Result<Vec<_>, _>>().map(Value::from)
}

fn measure_one(papers: &Papers, model: &Model) -> Result<Value, Error> {
    let mesh = papers.mesh(model.name, model.file, model.faces)?;
    let file = papers.folder.join("paper.xfm");
    let compact = papers.folder.join("paper-compact.xfm");
    let built = report("xfm build", papers.xfm("build").arg(&mesh.file).arg(&file))?;
    let mut command = papers.xfm("build");
    command.arg(&mesh.file).arg(&compact).args(["--encoding", "compact"]);
    let built_compact = report("xfm build", &mut command)?;
    let flown = match model.frame {
        Some(frame) => {
            let nodes = number(&built, "/nodes").unwrap_or(0.0);
            let quota = (SOFT_QUOTA * nodes * NODE_BYTES).max(LEAST_QUOTA);
            fly(papers, &file, frame.shown, quota)?
        }
        None => Value::Null,
    };
    for file in [&file, &compact] {
        fs::remove_file(file).map_err(Error::file(file))?;
    }
    Ok(json!({
        "name": mesh.name,
        "paper": {
            "name": model.name,
            "faces": model.faces,
            "file_mb": model.file_mb,
            "seconds": model.seconds,
            "frame": model.frame.map(|frame| json!({
                "shown": frame.shown, "updates": frame.updates, "ms": frame.ms,
            })),
        },
        "build": built,
        "compact": built_compact,
        "frame": flown,
    }))
}

/// Means per frame of an orbit at so many triangles, the first frame left out: without a renderer as the pager works for
/// one, then the time to draw as many.
fn fly(papers: &Papers, file: &Path, triangles: f64, quota: f64) -> Result<Value, Error> {
    let [triangles, quota] = [triangles, quota].map(|number| format!("{number:.0}"));
    let mut command = papers.xfm("fly");
    command.arg(file).args(["--budget", &triangles, "--soft-quota", &quota]);
    let flown = report("xfm fly", &mut command)?;
    let pictures = papers.folder.join("frames");
    let empty = || match fs::remove_dir_all(&pictures) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::file(&pictures)(error))
        }
        _ => Ok(()),
    };
    empty()?;
    fs::create_dir_all(&pictures).map_err(Error::file(&pictures))?;
    let mut view = papers.view(file, &pictures);
    view.args(["--path", "orbit", "--size", "640x480", "--frames", &PICTURES.to_string()]);
    view.args(["--budget", &triangles]);
    process::run(&mut view)?;
    let frames = frames::read(&pictures)?;
    empty()?;
    let moving = if frames.len() > 1 { &frames[1..] } else { &frames[..] };
    let render_s = moving.iter().map(|frame| frame.render_s).sum::<f64>() / moving.len() as f64;
    let ms = |path: &str| number(&flown, path).map(|seconds| 1e3 * seconds);
    Ok(json!({
        "shown": flown["triangles_shown"],
        "updates": flown["updates"],
        "ms": [ms("/update_s/mean"), ms("/test_s/mean"), ms("/load_s/mean"), 1e3 * render_s],
    }))
}

/// The three tables.
pub fn tables(models: &Value) -> Vec<String> {
    let models = rows(models, "");
    vec![sizes(models), times(models), frames_table(models)]
}

fn name_and_faces(row: &Value) -> [String; 2] {
    let faces = row["build"]["input_triangles"].as_u64().unwrap_or(0);
    [text(row, "/name"), grouped(faces)]
}

fn faces(row: &Value) -> f64 {
    number(row, "/build/input_triangles").unwrap_or(f64::NAN)
}

fn sizes(models: &[Value]) -> String {
    let columns =
        ["", "faces", "paper MB", "B/Δ", "exact MB", "B/Δ", "compact MB", "B/Δ", "paper / exact"];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in models {
        let paper = number(row, "/paper/file_mb").map(|mb| 1e6 * mb);
        let paper_faces = number(row, "/paper/faces").unwrap_or(f64::NAN);
        let [exact, compact] =
            ["/build/file_bytes", "/compact/file_bytes"].map(|path| number(row, path));
        let mut cells = name_and_faces(row).to_vec();
        for (bytes, faces) in [(paper, paper_faces), (exact, faces(row)), (compact, faces(row))] {
            cells.push(fixed(bytes.map(|bytes| 1e-6 * bytes), 2));
            cells.push(fixed(bytes.map(|bytes| bytes / faces), 2));
        }
        let per = paper.zip(exact).map(|(p, e)| (p / paper_faces) / (e / faces(row)));
        cells.push(fixed(per, 2));
        lines.push(cells);
    }
    format!("XFastMesh, Table 1: size of the file\n{}", aligned(&lines))
}

fn times(models: &[Value]) -> String {
    let columns = ["", "faces", "paper s", "µs/Δ", "xfm s", "µs/Δ", "paper / xfm", "peak MB"];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in models {
        let paper = number(row, "/paper/seconds");
        let paper_faces = number(row, "/paper/faces").unwrap_or(f64::NAN);
        let ours = number(row, "/build/seconds");
        let [theirs_each, ours_each] =
            [(paper, paper_faces), (ours, faces(row))].map(|(s, n)| s.map(|s| 1e6 * s / n));
        let mut cells = name_and_faces(row).to_vec();
        cells.extend([
            fixed(paper, 1),
            fixed(theirs_each, 0),
            fixed(ours, 2),
            fixed(ours_each, 2),
            fixed(theirs_each.zip(ours_each).map(|(theirs, ours)| theirs / ours), 0),
            fixed(number(row, "/build/peak_rss").map(|bytes| 1e-6 * bytes), 0),
        ]);
        lines.push(cells);
    }
    format!("XFastMesh, Table 2: building the file (exact)\n{}", aligned(&lines))
}

fn frames_table(models: &[Value]) -> String {
    let columns = ["", "faces", "", "#Shown", "#U", "U ms", "VT ms", "BL ms", "R ms"];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in models {
        for (who, path, digits) in [("paper", "/paper/frame", 1), ("xfm", "/frame", 2)] {
            let mut cells = match who {
                "paper" => name_and_faces(row).to_vec(),
                _ => vec![String::new(); 2],
            };
            cells.push(who.to_owned());
            cells.push(fixed(number(row, &format!("{path}/shown")), 0));
            cells.push(fixed(number(row, &format!("{path}/updates")), 0));
            cells.extend(
                (0..4).map(|place| fixed(number(row, &format!("{path}/ms/{place}")), digits)),
            );
            lines.push(cells);
        }
    }
    format!(
        "XFastMesh, Table 3: means per frame at as many triangles; soft quota a tenth of the nodes\n{}\
         U updates, VT view tests; BL block loading, ours on threads beside the frames; R rendering by the Vulkan driver there is\n",
        aligned(&lines)
    )
}
