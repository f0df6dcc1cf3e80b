//! The table of the streams.

use serde_json::Value;

use super::{aligned, fixed, number, scaled, whole};

const COLUMNS: [&str; 8] =
    ["torus of", "read", "written", "s", "M/s", "of first", "peak MB", "gen CPU s"];

/// Below the table.
const LEGEND: &str = "\
    M/s     millions of triangles per second through the pipe, the generator on the same machine\n";

/// The table of the streams.
pub fn streams(streams: &[Value]) -> String {
    let first = streams.iter().find_map(|row| number(row, "/rate"));
    let mut lines = vec![COLUMNS.map(str::to_owned).to_vec()];
    for row in streams {
        let mut name = whole(row, "/triangles");
        if let Some(holes) = number(row, "/holes").filter(|&holes| holes > 0.0) {
            name += &format!(", holes {holes}");
        }
        let mut cells = vec![name];
        if let Some(why) = row["failure"].as_str() {
            cells.push(format!("n/a: {why}"));
        } else {
            let relative = number(row, "/rate").zip(first).map(|(rate, first)| rate / first);
            cells.extend([
                whole(row, "/input_triangles"),
                whole(row, "/output_triangles"),
                fixed(number(row, "/seconds"), 2),
                fixed(scaled(row, "/rate", 1e-6), 2),
                fixed(relative, 3),
                fixed(scaled(row, "/peak_rss", 1e-6), 1),
                fixed(number(row, "/generator_cpu_seconds"), 2),
            ]);
        }
        lines.push(cells);
    }
    aligned(&lines) + LEGEND
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn streams_are_compared_with_the_first_that_worked() {
        let row = |triangles: u64, rate: f64| {
            json!({
                "triangles": triangles, "holes": 0.1, "input_triangles": triangles - 1_000,
                "output_triangles": 5_000, "seconds": 2.0, "rate": rate, "peak_rss": 71_500_000,
                "generator_cpu_seconds": 0.25,
            })
        };
        let failed = json!({ "triangles": 5, "holes": 0.0, "failure": "error: too few" });
        let table = streams(&[failed, row(1_000_000, 2e6), row(372_000_000, 1.9e6)]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(
            lines[1].split_once("  ").map(|(_, rest)| rest.trim()),
            Some("n/a: error: too few")
        );
        let words: Vec<&str> = lines[3].split_whitespace().collect();
        let expected = [
            "372,000,000,",
            "holes",
            "0.1",
            "371,999,000",
            "5,000",
            "2.00",
            "1.90",
            "0.950",
            "71.5",
            "0.25",
        ];
        assert_eq!(words, expected);
    }
}
