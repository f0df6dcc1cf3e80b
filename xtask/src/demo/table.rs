//! The table: a row as in the first paper's Table 3, and what it took to get there.

use std::fmt::Write;

use serde_json::Value;

use super::frames::Frame;

const COLUMNS: [&str; 8] = ["Model", "Faces", "#Shown", "#U", "U", "VT", "BL", "R"];

/// The table of a model as text.
///
/// The paper's numbers are averages per frame, and so are these; the first frame, which builds the
/// front up from the coarsest mesh, is left out where there are others.
pub fn write(name: &str, faces: u64, frames: &[Frame], built: &Value, flown: &Value) -> String {
    let moving = if frames.len() > 1 { &frames[1..] } else { frames };
    let mean =
        |get: fn(&Frame) -> f64| moving.iter().map(get).sum::<f64>() / moving.len().max(1) as f64;
    let time = |get: fn(&Frame) -> f64| format!("{:.2} ms", 1e3 * mean(get));
    let cells = [
        name.to_owned(),
        thousands(faces as f64),
        thousands(mean(|f| f.triangles_shown)),
        format!("{:.0}", mean(|f| f.updates)),
        time(|f| f.update_s),
        time(|f| f.test_s),
        time(|f| f.load_s),
        time(|f| f.render_s),
    ];
    let mut text = String::new();
    for row in [COLUMNS.map(str::to_owned), cells] {
        let padded = row.iter().enumerate().map(|(column, cell)| match column {
            0 => format!("{cell:<14}"),
            _ => format!("{cell:>11}"),
        });
        text.push_str(padded.collect::<String>().trim_end());
        text.push('\n');
    }
    text.push_str(
        "\nFaces of the model; averages per frame of triangles shown, updates, and the times for\n\
         updates (U), view tests (VT), block loading (BL) and rendering (R).\n\n",
    );
    let mut line = |what: &str, value: String| {
        // Writing to a string cannot fail.
        writeln!(text, "{what:<10}{value}").unwrap_or_default();
    };
    let number = |json: &Value, path: &str| json.pointer(path).and_then(Value::as_f64);
    if let Some(seconds) = number(built, "/seconds") {
        let rate = faces as f64 / seconds.max(1e-9) / 1e6;
        let bytes = number(built, "/file_bytes").unwrap_or(0.0) / faces.max(1) as f64;
        line(
            "built",
            format!("{seconds:.2} s, {rate:.2} M triangles/s, {bytes:.1} bytes/triangle"),
        );
    }
    if let (Some(median), Some(p99)) =
        (number(flown, "/frame_s/median"), number(flown, "/frame_s/p99"))
    {
        let count = number(flown, "/frames").unwrap_or(0.0);
        let [median, p99] = [median, p99].map(|seconds| 1e3 * seconds);
        line(
            "flown",
            format!("{count:.0} frames without rendering, median {median:.2} ms, 99 % {p99:.2} ms"),
        );
    }
    text
}

/// A count as the paper writes it: `871K`.
fn thousands(count: f64) -> String {
    if count >= 10_000.0 { format!("{:.0}K", count / 1e3) } else { format!("{count:.0}") }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn rows_are_averages_without_the_first_frame() {
        let frame = |updates, update_s| Frame {
            triangles_shown: 50_000.0,
            updates,
            update_s,
            test_s: 0.001,
            load_s: 0.0,
            render_s: 0.02,
            pixels: None,
        };
        let frames = [frame(90_000.0, 1.0), frame(100.0, 0.002), frame(300.0, 0.004)];
        let text = write("dragon", 871_414, &frames, &json!({ "seconds": 2.0 }), &Value::Null);
        let row: Vec<&str> = text.lines().nth(1).unwrap_or_default().split_whitespace().collect();
        let expected = [
            "dragon", "871K", "50K", "200", "3.00", "ms", "1.00", "ms", "0.00", "ms", "20.00", "ms",
        ];
        assert_eq!(row, expected);
        assert!(text.contains("built     2.00 s, 0.44 M triangles/s"));
    }
}
