//! The second paper's Table 1: decimation of a stream.

use serde_json::{Value, json};

use super::super::stream::{self, Stream};
use super::super::table::{aligned, fixed, grouped, number, rows, text, whole};
use super::Papers;
use super::figures::STREAMS;
use crate::Error;

/// Pipes a generated scan of as many triangles through, to as many.
pub fn measure(papers: &Papers) -> Result<Value, Error> {
    let mut measured = Vec::new();
    for paper in STREAMS.iter().filter(|row| row.input <= papers.largest) {
        let ratio = paper.output as f64 / paper.input as f64;
        let scan = Stream { shape: "scan", triangles: paper.input, holes: 0.0, ratio };
        let row = stream::run(&papers.xfm, scan, &papers.folder)?;
        measured.push(json!({
            "paper": {
                "name": paper.name,
                "input": paper.input,
                "output": paper.output,
                "seconds": paper.seconds,
                "rate": paper.input as f64 / paper.seconds,
                "memory_mb": paper.memory_mb,
            },
            "xfm": row,
        }));
    }
    Ok(measured.into())
}

/// The table.
pub fn table(measured: &Value) -> String {
    let columns = [
        "scan for",
        "input",
        "output",
        "paper s",
        "K/s",
        "MB",
        "xfm s",
        "K/s",
        "peak MB",
        "xfm / paper",
    ];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in rows(measured, "") {
        let mut cells = vec![text(row, "/paper/name")];
        if let Some(why) = row["xfm"]["failure"].as_str() {
            cells.push(format!("n/a: {why}"));
            lines.push(cells);
            continue;
        }
        let input = row["paper"]["input"].as_u64().unwrap_or(0);
        let [theirs, ours] = ["/paper/rate", "/xfm/rate"].map(|path| number(row, path));
        cells.extend([
            grouped(input),
            whole(row, "/xfm/output_triangles"),
            fixed(number(row, "/paper/seconds"), 0),
            fixed(theirs.map(|rate| 1e-3 * rate), 1),
            fixed(number(row, "/paper/memory_mb"), 0),
            fixed(number(row, "/xfm/seconds"), 2),
            fixed(ours.map(|rate| 1e-3 * rate), 0),
            fixed(number(row, "/xfm/peak_rss").map(|bytes| 1e-6 * bytes), 1),
            fixed(ours.zip(theirs).map(|(ours, theirs)| ours / theirs), 1),
        ]);
        lines.push(cells);
    }
    format!(
        "Stream decimation, Table 1: rate and memory, through a pipe from the generator\n{}{}",
        aligned(&lines),
        if lines.len() < STREAMS.len() + 1 { "larger ones by --largest\n" } else { "" }
    )
}
