//! What `xfm-view` says about the frames that it rendered.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{Error, process};

/// One rendered frame; times in seconds.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Triangles shown.
    pub triangles_shown: f64,
    /// Splits and collapses done.
    pub updates: f64,
    /// Time for these.
    pub update_s: f64,
    /// Time for view tests.
    pub test_s: f64,
    /// Time for block loading.
    pub load_s: f64,
    /// Time for rendering.
    pub render_s: f64,
    /// The tolerance, in pixels, if it was told.
    pub pixels: Option<f64>,
}

/// Reads `frames.json` of a folder of frames.
///
/// # Errors
/// [`Error::Report`] when there are no frames or one lacks a number.
pub fn read(folder: &Path) -> Result<Vec<Frame>, Error> {
    let path = folder.join("frames.json");
    let what = path.display().to_string();
    let text = fs::read_to_string(&path).map_err(Error::file(&path))?;
    let json = process::parse_json(&what, &text)?;
    // An array, or an object that has it under "frames".
    let list = json.get("frames").unwrap_or(&json).as_array().filter(|list| !list.is_empty());
    let list = list.ok_or_else(|| Error::Report { what: what.clone(), why: "no frames".into() })?;
    let number = |frame: &Value, index: usize, key: &str| {
        frame.get(key).and_then(Value::as_f64).ok_or_else(|| Error::Report {
            what: what.clone(),
            why: format!("frame {index} has no number `{key}`"),
        })
    };
    list.iter()
        .enumerate()
        .map(|(index, frame)| {
            Ok(Frame {
                triangles_shown: number(frame, index, "triangles_shown")?,
                updates: number(frame, index, "updates")?,
                update_s: number(frame, index, "update_s")?,
                test_s: number(frame, index, "test_s")?,
                load_s: number(frame, index, "load_s")?,
                render_s: number(frame, index, "render_s")?,
                pixels: frame.get("pixels").and_then(Value::as_f64),
            })
        })
        .collect()
}
