//! Results as text.

use serde_json::Value;

const CONTEST: [&str; 13] = [
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

const STREAMS: [&str; 8] =
    ["torus of", "read", "written", "s", "M/s", "of first", "peak MB", "gen CPU s"];

/// Below a contest's table.
const CONTEST_LEGEND: &str = "\
    M/s     millions of input triangles per second: xfm from file to file, peers the call alone, in core\n\
    xfm ×   how much faster xfm is, by its default, than this: median over runs side by side\n\
    MB      resident at most, and how much of it came with the call\n\
    → ←     distance from the input to the result and back, in % of the diagonal of the input's box\n";

/// Below the streams' table.
const STREAMS_LEGEND: &str = "\
    M/s     millions of triangles per second through the pipe, the generator on the same machine\n";

/// The table of one mesh and ratio.
pub fn contest(contest: &Value) -> String {
    let mut lines = vec![CONTEST.map(str::to_owned).to_vec()];
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
                fixed(number(row, "/xfm_factor"), 2),
                fixed(scaled(row, "/peak_rss", 1e-6), 0),
                fixed(peak.zip(before).map(|(peak, before)| (peak - before) * 1e-6), 0),
            ]);
            for what in ["mean", "rms", "max"] {
                for side in ["a_to_b", "b_to_a"] {
                    let path = format!("/distances/{side}/{what}_percent");
                    cells.push(fixed(number(row, &path), 4));
                }
            }
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
    head + &aligned(&lines) + CONTEST_LEGEND
}

/// The table of the streams.
pub fn streams(streams: &[Value]) -> String {
    let first = streams.iter().find_map(|row| number(row, "/rate"));
    let mut lines = vec![STREAMS.map(str::to_owned).to_vec()];
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
    aligned(&lines) + STREAMS_LEGEND
}

fn rows<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value, path: &str) -> Option<f64> {
    value.pointer(path).and_then(Value::as_f64)
}

fn scaled(value: &Value, path: &str, factor: f64) -> Option<f64> {
    number(value, path).map(|number| number * factor)
}

fn text(value: &Value, path: &str) -> String {
    value.pointer(path).and_then(Value::as_str).unwrap_or_default().to_owned()
}

/// A number that may not be there.
fn fixed(number: Option<f64>, digits: usize) -> String {
    number.map_or_else(|| "–".to_owned(), |number| format!("{number:.digits$}"))
}

/// A count with its digits in groups of three.
fn whole(value: &Value, path: &str) -> String {
    let Some(count) = value.pointer(path).and_then(Value::as_u64) else { return "–".to_owned() };
    let digits = count.to_string();
    let mut grouped = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place) % 3 == 0 {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// The first column to the left, the others to the right; a line of two cells is no part of the columns.
fn aligned(lines: &[Vec<String>]) -> String {
    let num_columns = lines.first().map_or(0, Vec::len);
    let width = |column: usize| {
        let whole_lines = lines.iter().filter(|line| column == 0 || line.len() == num_columns);
        whole_lines.map(|line| line[column].chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..num_columns).map(width).collect();
    lines
        .iter()
        .map(|line| {
            let mut text = format!("{:<width$}", line[0], width = widths[0]);
            for (cell, width) in line[1..].iter().zip(&widths[1..]) {
                let width = if line.len() == num_columns { *width } else { 0 };
                text += &format!("  {cell:>width$}");
            }
            text.trim_end().to_owned() + "\n"
        })
        .collect()
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
        let table = contest(&json!({
            "file": "dragon.ply", "input_triangles": 871_414, "ratio": 0.02, "target_triangles": 17_428,
            "rows": [
                row("xfm", Value::Null, Value::Null),
                row("peer", json!(1.5), json!(30_000_000)),
                { "name": "another", "failure": "No module named 'another', and nothing shorter" },
            ],
        }));
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines[0], "dragon.ply: 871,414 triangles to 2.00 % (17,428)");
        let words = |line: usize| lines[line].split_whitespace().collect::<Vec<_>>();
        let figures = ["0.0100", "0.0200", "0.0200", "0.0400", "9.5000", "9.5000"];
        assert_eq!(words(2)[..7], ["xfm", "17,428", "0.500", "1.74", "–", "80", "–"]);
        assert_eq!(words(3)[..7], ["peer", "17,428", "0.500", "1.74", "1.50", "80", "50"]);
        assert_eq!(words(2)[7..], figures);
        assert_eq!(lines[4], "another  n/a: No module named 'another', and nothing shorter");
        let ends = [1, 2, 3].map(|line| lines[line].chars().count());
        assert_eq!(ends, [ends[0]; 3], "columns are aligned, whatever a failure says");
    }

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

    #[test]
    fn counts_are_grouped_and_what_is_missing_is_a_dash() {
        let counts = [(0, "0"), (999, "999"), (1_000, "1,000"), (1_234_567, "1,234,567")];
        for (count, text) in counts {
            assert_eq!(whole(&json!({ "count": count }), "/count"), text);
        }
        assert_eq!(whole(&Value::Null, "/count"), "–");
        assert_eq!(fixed(None, 2), "–");
    }
}
