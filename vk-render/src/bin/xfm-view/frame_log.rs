//! What every frame showed and took, for programs.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use crate::camera::path;
use crate::error::Error;
use crate::model::Numbers;
use crate::state::{FrameTime, State};

/// One frame, by the names that `frames.json`, `frames.csv` and `--log` share. Times in seconds, sizes in bytes.
pub(crate) fn entry(
    frame: u64,
    numbers: &Numbers,
    time: &FrameTime,
    uploaded_bytes: u64,
    state: &State,
) -> Map<String, Value> {
    let value = json!({
        "frame": frame,
        "view": path::view_text(&state.camera()),
        "triangles_shown": numbers.triangles_shown,
        "updates": numbers.updates,
        "tests": numbers.tests,
        "waiting": numbers.waiting,
        "queue": numbers.queue,
        "pixels": numbers.tolerance_px,
        "blocks_loaded": numbers.blocks_loaded,
        "resident_blocks": numbers.resident_blocks,
        "resident_bytes": numbers.resident_bytes,
        "hard_quota": numbers.hard_quota,
        "hits": numbers.hits,
        "misses": numbers.misses,
        "uploaded_bytes": uploaded_bytes,
        "update_s": numbers.update_time.as_secs_f64(),
        "test_s": numbers.test_time.as_secs_f64(),
        "handover_s": numbers.handover_time.as_secs_f64(),
        "load_s": numbers.load_time.as_secs_f64(),
        "upload_s": time.upload.as_secs_f64(),
        "render_s": time.whole.saturating_sub(time.update + time.upload).as_secs_f64(),
        "frame_s": time.whole.as_secs_f64(),
    });
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// All frames as a table: the names, then a line each.
pub(crate) fn csv(frames: &[Map<String, Value>]) -> String {
    let Some(first) = frames.first() else { return String::new() };
    // Which frame it is comes first.
    let mut names: Vec<&str> = first.keys().map(String::as_str).collect();
    names.sort_by_key(|&name| name != "frame");
    let mut text = names.join(",") + "\n";
    for frame in frames {
        let values: Vec<String> = names
            .iter()
            .map(|&name| match frame.get(name).unwrap_or(&Value::Null) {
                Value::Null => String::new(),
                Value::String(text) => format!("\"{}\"", text.replace('"', "\"\"")),
                other => other.to_string(),
            })
            .collect();
        text += &(values.join(",") + "\n");
    }
    text
}

/// A file that grows by a line of JSON per frame.
pub(crate) struct FrameLog {
    file: PathBuf,
    out: BufWriter<File>,
}

impl FrameLog {
    pub(crate) fn create(file: &Path) -> Result<Self, Error> {
        let out = BufWriter::new(File::create(file).map_err(Error::file(file))?);
        Ok(Self { file: file.to_owned(), out })
    }

    /// Writes a line, at once.
    pub(crate) fn write(&mut self, value: &Value) -> Result<(), Error> {
        let written = writeln!(self.out, "{value}").and_then(|()| self.out.flush());
        written.map_err(Error::file(&self.file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_names_and_quotes_text() {
        let mut frame = Map::new();
        frame.insert("a".into(), json!(1));
        frame.insert("frame".into(), json!(7));
        frame.insert("b".into(), json!("x, y"));
        frame.insert("c".into(), Value::Null);
        assert_eq!(csv(&[frame]), "frame,a,b,c\n7,1,\"x, y\",\n");
        assert_eq!(csv(&[]), "");
    }
}
