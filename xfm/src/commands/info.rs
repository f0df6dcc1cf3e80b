//! `xfm info`: what a `.xfm` file holds.

mod histogram;

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use xfm_format::{Attribute, AttributeType};

use self::histogram::{Histograms, bars};
use crate::report::ReportTo;
use crate::{Error, interrupt, text, xfm_file};

/// Show what a .xfm file holds: counts, tree, attributes, and where its bytes go
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  What is in the file?
    xfm info dragon.xfm

  Bytes per triangle, for a script
    xfm info dragon.xfm --json | jq '.file_bytes / .input_triangles'")]
pub struct InfoArgs {
    /// The .xfm file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What `xfm info` reports; sizes in bytes, bounds in model units.
#[derive(Debug, Clone, Serialize)]
struct InfoReport {
    version: u32,
    encoding: &'static str,
    input_triangles: u64,
    base_triangles: u64,
    base_vertices: u64,
    roots: u64,
    nodes: u64,
    blocks: u64,
    levels: u32,
    pages: u64,
    tree_depth: u64,
    fill: f64,
    histograms: Histograms,
    file_bytes: u64,
    bytes: BTreeMap<&'static str, u64>,
    attributes: Vec<AttributeReport>,
    /// In the frame of the input.
    bounds: Bounds,
    /// Where the file's own origin lies in it.
    origin: [f64; 3],
    precision: &'static str,
    /// How far vertices may have moved, in model units; 0 where they are exact.
    position_error: f64,
}

#[derive(Debug, Clone, Serialize)]
struct AttributeReport {
    name: String,
    unit: String,
    #[serde(rename = "type")]
    kind: String,
    components: u8,
    coding: &'static str,
}

#[derive(Debug, Clone, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

impl From<&Attribute> for AttributeReport {
    fn from(attribute: &Attribute) -> Self {
        let kind = match attribute.kind {
            AttributeType::F32 => "f32".to_owned(),
            AttributeType::Octahedral => "octahedral".to_owned(),
            AttributeType::F16Up => "f16-up".to_owned(),
            AttributeType::U8 => "u8".to_owned(),
            AttributeType::Other(code) => format!("type-{code}"),
            _ => "unknown".to_owned(),
        };
        Self {
            name: attribute.name.clone(),
            unit: attribute.unit.clone(),
            kind,
            components: attribute.components,
            coding: attribute.coding.name(),
        }
    }
}

impl fmt::Display for InfoReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let per_triangle = self.file_bytes as f64 / self.input_triangles.max(1) as f64;
        writeln!(f, "format     version {}, {}", self.version, self.encoding)?;
        writeln!(
            f,
            "input      {} triangles, {:.2} bytes each",
            text::count(self.input_triangles),
            per_triangle
        )?;
        writeln!(
            f,
            "coarsest   {} triangles, {} vertices, {} of them roots",
            text::count(self.base_triangles),
            text::count(self.base_vertices),
            text::count(self.roots)
        )?;
        writeln!(
            f,
            "forest     {} nodes, {} levels deep",
            text::count(self.nodes),
            self.tree_depth
        )?;
        writeln!(
            f,
            "blocks     {} of up to {} nodes, {:.1} % full, in {} pages",
            text::count(self.blocks),
            (1 << self.levels) - 1,
            self.fill * 100.0,
            text::count(self.pages)
        )?;
        let Histograms { nodes_of_blocks, depths_of_nodes } = &self.histograms;
        for (name, counts) in
            [("nodes of blocks", nodes_of_blocks), ("depths of nodes", depths_of_nodes)]
        {
            let counts = counts.get(1..).unwrap_or_default();
            writeln!(f, "           {name} 1 to {}: {}", counts.len(), bars(counts))?;
        }
        // As many digits as the input's precision needs.
        let digits = if self.origin == [0.0; 3] { 6 } else { 12 };
        let point = |point: [f64; 3]| point.map(|c| text::number(c, digits)).join(", ");
        writeln!(f, "bounds     {} to {}", point(self.bounds.min), point(self.bounds.max))?;
        if self.origin != [0.0; 3] {
            writeln!(
                f,
                "origin     {}, input in {} precision",
                point(self.origin),
                self.precision
            )?;
        }
        if self.position_error > 0.0 {
            let diagonal = std::iter::zip(self.bounds.min, self.bounds.max)
                .map(|(min, max)| (max - min) * (max - min))
                .sum::<f64>()
                .sqrt();
            writeln!(
                f,
                "positions  within {} of the input, {} of the diagonal",
                text::number(self.position_error, 4),
                text::number(self.position_error / diagonal, 4)
            )?;
        }
        for attribute in &self.attributes {
            let AttributeReport { name, unit, kind, components, .. } = attribute;
            let unit = if unit.is_empty() { "no unit" } else { unit };
            writeln!(f, "attribute  {name}: {components} x {kind}, {unit}")?;
        }
        write!(f, "file       {}", text::size(self.file_bytes))?;
        let mut by_size: Vec<_> = self.bytes.iter().collect();
        by_size.sort_by_key(|&(_, &bytes)| std::cmp::Reverse(bytes));
        for (kind, &bytes) in by_size {
            let share = bytes as f64 / self.file_bytes.max(1) as f64 * 100.0;
            write!(f, "\n           {kind:10}{:>12}{share:7.1} %", text::size(bytes))?;
        }
        Ok(())
    }
}

/// Runs the command.
///
/// # Errors
///
/// A file that cannot be read, or is damaged.
pub fn run(args: &InfoArgs) -> Result<(), Error> {
    let report = interrupt::freely(|| -> Result<InfoReport, Error> {
        let file = xfm_file::open(&args.file)?;
        let bytes: BTreeMap<_, _> = file.field_bytes()?.iter().collect();
        let header = file.header();
        let frame = xfm_file::frame(header);
        let [min, max] = header.bounds.map(|corner| frame.to_file(corner).to_array());
        Ok(InfoReport {
            version: header.version,
            encoding: header.encoding.name(),
            input_triangles: header.input_triangles,
            base_triangles: header.base_faces,
            base_vertices: header.base_vertices,
            roots: header.roots,
            nodes: header.nodes,
            blocks: header.blocks,
            levels: header.levels,
            pages: header.pages,
            tree_depth: header.tree_depth,
            fill: header.fill(),
            histograms: Histograms::of(&file)?,
            file_bytes: bytes.values().sum(),
            bytes,
            attributes: header.attributes.iter().map(AttributeReport::from).collect(),
            bounds: Bounds { min, max },
            origin: header.origin.to_array(),
            precision: header.precision.name(),
            position_error: header.rounding.error(),
        })
    })?;
    ReportTo::new(args.json).deliver(&report)
}
