//! The table of the hierarchies of one mesh.

use serde_json::Value;

use super::{aligned, distances, fixed, rows, scaled, spread, text, whole};

/// Below the table.
const LEGEND: &str = "\
    s       from the mesh's file to the hierarchy's\n\
    xfm ×   how much faster xfm is, by its default, than this: median (quartiles) over runs side by side\n\
    MB      resident at most, mapped files with it; anonymous; the result's size (10^6 bytes)\n\
    → ←     distance from the input to that level of detail and back, in % of the diagonal of the input's box\n";

/// The table of one mesh.
pub fn building(contest: &Value) -> String {
    let level = format!("{} % Δ", fixed(scaled(contest, "/ratio", 100.0), 1));
    let columns = [
        "", "s", "µs/Δ", "xfm ×", "peak MB", "anon MB", "file MB", "B/Δ", &level, "rms →", "rms ←",
        "max →", "max ←",
    ];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in rows(contest, "rows") {
        let mut cells = vec![text(row, "/name")];
        if let Some(why) = row["failure"].as_str() {
            cells.push(format!("n/a: {why}"));
        } else {
            cells.extend([
                fixed(scaled(row, "/seconds", 1.0), 3),
                fixed(scaled(row, "/seconds_per_triangle", 1e6), 2),
                spread(row, "/xfm_factor"),
                fixed(scaled(row, "/peak_rss", 1e-6), 0),
                fixed(scaled(row, "/peak_anon", 1e-6), 0),
                fixed(scaled(row, "/file_bytes", 1e-6), 2),
                fixed(scaled(row, "/bytes_per_triangle", 1.0), 2),
                whole(row, "/level/b_triangles"),
            ]);
            cells.extend(distances(row, "/level", &["rms", "max"]));
        }
        lines.push(cells);
    }
    let head = format!(
        "{}: hierarchies of {} triangles\n",
        text(contest, "/file"),
        whole(contest, "/input_triangles")
    );
    head + &aligned(&lines) + LEGEND
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_hierarchy_that_is_not_ours_has_no_level() {
        let side = json!({ "rms_percent": 0.03, "max_percent": 0.2 });
        let table = building(&json!({
            "file": "dragon.ply", "input_triangles": 871_414, "ratio": 0.02,
            "rows": [
                {
                    "name": "xfm", "seconds": 1.5, "seconds_per_triangle": 1.72e-6, "xfm_factor": null,
                    "peak_rss": 300_000_000, "peak_anon": 250_000_000, "file_bytes": 11_940_000,
                    "bytes_per_triangle": 13.7,
                    "level": { "b_triangles": 17_428, "a_to_b": side, "b_to_a": side },
                },
                {
                    "name": "peer", "seconds": 30.0, "seconds_per_triangle": 3.44e-5,
                    "xfm_factor": { "median": 20.0, "low": 19.0, "high": 21.0 },
                    "peak_rss": 400_000_000, "peak_anon": null, "file_bytes": 35_000_000,
                    "bytes_per_triangle": 40.1, "level": null,
                },
            ],
        }));
        let words = |line: usize| {
            table.lines().nth(line).unwrap_or_default().split_whitespace().collect::<Vec<_>>()
        };
        assert_eq!(words(2)[..8], ["xfm", "1.500", "1.72", "–", "300", "250", "11.94", "13.70"]);
        assert_eq!(words(2)[8..], ["17,428", "0.0300", "0.0300", "0.2000", "0.2000"]);
        assert_eq!(words(3)[3..5], ["20.00", "(19.00–21.00)"]);
        assert_eq!(words(3)[9..], ["–"; 5]);
    }
}
