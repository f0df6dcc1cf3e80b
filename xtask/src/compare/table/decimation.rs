//! The table of one mesh and ratio.

use serde_json::Value;

use super::{aligned, distances, fixed, number, rows, scaled, spread, text, whole};

const COLUMNS: [&str; 13] = [
    "",
    "triangles",
    "s",
    "M/s",
    "xfm ×",
    "peak MB",
    "call MB",
    "mean →",
    "mean ←",
    "rms →",
    "rms ←",
    "max →",
    "max ←",
];

/// Below the table.
const LEGEND: &str = "\
    M/s     millions of input triangles per second: xfm and OpenMesh from file to file, the others the call alone, in core\n\
    xfm ×   how much faster xfm is, by its default, than this: median (quartiles) over runs side by side\n\
    MB      resident at most, and how much of it came with the call\n\
    → ←     distance from the input to the result and back, in % of the diagonal of the input's box\n";

/// The table of one mesh and ratio.
pub fn decimation(contest: &Value) -> String {
    let mut lines = vec![COLUMNS.map(str::to_owned).to_vec()];
    for row in rows(contest, "rows") {
        let mut cells = vec![text(row, "/name")];
        if let Some(why) = row["failure"].as_str() {
            cells.push(format!("n/a: {why}"));
        } else {
            let before = row.pointer("/rss_before").and_then(Value::as_f64);
            let peak = number(row, "/peak_rss");
            cells.extend([
                whole(row, "/output_triangles"),
                fixed(number(row, "/seconds"), 3),
                fixed(scaled(row, "/rate", 1e-6), 2),
                spread(row, "/xfm_factor"),
                fixed(scaled(row, "/peak_rss", 1e-6), 0),
                fixed(peak.zip(before).map(|(peak, before)| (peak - before) * 1e-6), 0),
            ]);
            cells.extend(distances(row, "/distances", &["mean", "rms", "max"]));
        }
        lines.push(cells);
    }
    let head = format!(
        "{}: {} triangles to {} % ({})\n",
        text(contest, "/file"),
        whole(contest, "/input_triangles"),
        fixed(scaled(contest, "/ratio", 100.0), 2),
        whole(contest, "/target_triangles"),
    );
    head + &aligned(&lines) + LEGEND
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_contest_has_a_line_for_each_row_in_columns() {
        let side =
            |x: f64| json!({ "mean_percent": x, "rms_percent": 2.0 * x, "max_percent": 9.5 });
        let row = |name: &str, factor: Value, before: Value| {
            json!({
                "name": name, "output_triangles": 17_428, "seconds": 0.5, "rate": 1_742_828.0,
                "xfm_factor": factor, "peak_rss": 80_000_000_u64, "rss_before": before,
                "distances": { "a_to_b": side(0.01), "b_to_a": side(0.02) },
            })
        };
        let table = decimation(&json!({
            "file": "dragon.ply", "input_triangles": 871_414, "ratio": 0.02, "target_triangles": 17_428,
            "rows": [
                row("xfm", Value::Null, Value::Null),
                row("peer", json!({ "median": 1.5, "low": 1.4, "high": 1.75 }), json!(30_000_000)),
                { "name": "another", "failure": "No module named 'another', and nothing shorter" },
            ],
        }));
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines[0], "dragon.ply: 871,414 triangles to 2.00 % (17,428)");
        let words = |line: usize| lines[line].split_whitespace().collect::<Vec<_>>();
        let figures = ["0.0100", "0.0200", "0.0200", "0.0400", "9.5000", "9.5000"];
        assert_eq!(words(2)[..7], ["xfm", "17,428", "0.500", "1.74", "–", "80", "–"]);
        assert_eq!(
            words(3)[..8],
            ["peer", "17,428", "0.500", "1.74", "1.50", "(1.40–1.75)", "80", "50"]
        );
        assert_eq!(words(2)[7..], figures);
        assert_eq!(lines[4], "another  n/a: No module named 'another', and nothing shorter");
        let ends = [1, 2, 3].map(|line| lines[line].chars().count());
        assert_eq!(ends, [ends[0]; 3], "columns are aligned, whatever a failure says");
    }
}
