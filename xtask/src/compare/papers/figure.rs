//! The second paper's Figure 4: one model by stream decimation, in core and by clusters of vertices.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::super::distances;
use super::super::table::{aligned, fixed, grouped, number, rows, text, whole};
use super::figures::{FIGURE, FIGURE_INPUT};
use super::{Papers, report};
use crate::picture::Image;
use crate::{Error, process};

/// The models that it may be of, the paper's own first.
const CHOICES: [(&str, &str); 2] = [("buddha", "happy.ply"), ("dragon", "dragon.ply")];
/// Size of each picture.
const SIZE: [usize; 2] = [480, 480];
/// Room for the captions.
const CAPTION: usize = 40;

/// Decimates a model by each method to the share that the paper left, measures and draws the results.
pub fn measure(papers: &Papers) -> Result<Value, Error> {
    let at_hand = CHOICES.iter().find(|(_, file)| papers.data.join(file).is_file());
    let (name, file) = *at_hand.unwrap_or(&CHOICES[0]);
    let mesh = papers.mesh(name, file, FIGURE_INPUT / 2 * 2)?;
    let (mut measured, mut drawn) = (Vec::new(), Vec::new());
    for paper in FIGURE {
        let mut row = json!({
            "paper": {
                "name": paper.name, "triangles": paper.triangles, "max_percent": paper.max_percent,
            },
        });
        if let Some(method) = paper.method {
            let output = papers.folder.join(format!("figure-{method}.ply"));
            let ratio = paper.triangles as f64 / FIGURE_INPUT as f64;
            let mut command = papers.xfm("decimate");
            command.arg(&mesh.file).arg(&output).args(["--method", method]);
            command.args(["--ratio", &ratio.to_string()]);
            row["xfm"] = report("xfm decimate", &mut command)?;
            row["distances"] = distances(&papers.xfm, &mesh.file, &output)?;
            let picture = papers.folder.join(format!("figure-{method}.png"));
            let mut view = papers.view(&output, &picture);
            view.args(["--shading", "flat", "--pixels", "0.1", "--cache", "temporary"]);
            view.args(["--size", &format!("{}x{}", SIZE[0], SIZE[1])]);
            process::run(&mut view)?;
            drawn.push((picture, paper.name, row["xfm"]["output_triangles"].as_u64()));
        }
        measured.push(row);
    }
    let picture = papers.folder.join("figure4.png");
    compose(&drawn)?.write(&picture)?;
    Ok(json!({ "model": mesh.name, "picture": picture, "rows": measured }))
}

/// The pictures beside each other, each with its method and triangles below.
fn compose(drawn: &[(PathBuf, &str, Option<u64>)]) -> Result<Image, Error> {
    let [width, height] = SIZE;
    let mut sheet = Image::new(width * drawn.len(), height + CAPTION, [255; 3]);
    for (place, (picture, name, triangles)) in drawn.iter().enumerate() {
        sheet.paste(&Image::read(picture)?, place * width, 0);
        let text = format!("{name}: {} triangles", grouped(triangles.unwrap_or(0)));
        sheet.caption(&text, place * width + 12, height + 12, 2);
    }
    Ok(sheet)
}

/// The table.
pub fn table(figure: &Value) -> String {
    let columns =
        ["", "paper Δ", "max %", "xfm Δ", "max → %", "max ← %", "rms → %", "rms ← %", "s"];
    let mut lines = vec![columns.map(str::to_owned).to_vec()];
    for row in rows(figure, "rows") {
        let mut cells = vec![
            text(row, "/paper/name"),
            whole(row, "/paper/triangles"),
            fixed(number(row, "/paper/max_percent"), 2),
            whole(row, "/xfm/output_triangles"),
        ];
        for what in ["max", "rms"] {
            for side in ["a_to_b", "b_to_a"] {
                cells.push(fixed(number(row, &format!("/distances/{side}/{what}_percent")), 3));
            }
        }
        cells.push(fixed(number(row, "/xfm/seconds"), 2));
        lines.push(cells);
    }
    format!(
        "Stream decimation, Figure 4: {} here, the Buddha there; errors in % of the diagonal\n{}\
         QEM is `--method greedy`, OOCS `--method cluster`; OEMM is another program\n\
         picture  {}\n",
        text(figure, "/model"),
        aligned(&lines),
        text(figure, "/picture"),
    )
}
