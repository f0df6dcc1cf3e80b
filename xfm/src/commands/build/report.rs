//! What `xfm build` reports.

use std::fmt;
use std::time::Duration;

use serde::Serialize;
use xfm_format::WriteReport;

use super::plan::{Mode, Plan};
use crate::memory::{AnonymousPeak, peak_rss};
use crate::repaired::{self, Repaired};
use crate::text;

/// What came of a build, in either mode.
#[derive(Debug, Clone)]
pub struct Built {
    /// How it was built.
    pub mode: Mode,
    /// Triangles of the input.
    pub input_triangles: u64,
    /// Number of nodes.
    pub nodes: u64,
    /// Triangles of the coarsest mesh.
    pub base_triangles: u64,
    /// What was wrong with the input.
    pub repaired: Repaired,
    /// What was written.
    pub written: WriteReport,
    /// Scratch space at most, in bytes.
    pub scratch_bytes: u64,
    /// Time for each stage.
    pub stages: Stages,
    /// Whether an earlier run was gone on with.
    pub resumed: bool,
}

/// Time for each stage of a build; those that a mode does not have take none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stages {
    /// Reading where that is done beforehand.
    pub read: Duration,
    /// Collapsing, and with it linking.
    pub collapse: Duration,
    /// Numbering.
    pub number: Duration,
    /// Writing.
    pub write: Duration,
}

/// The same in seconds, for scripts.
#[derive(Debug, Clone, Copy, Serialize)]
struct StageSeconds {
    read: f64,
    collapse: f64,
    number: f64,
    write: f64,
}

/// What `xfm build` reports; sizes in bytes, times in seconds.
#[derive(Debug, Clone, Serialize)]
pub struct BuildReport {
    input_triangles: u64,
    mode: Mode,
    resumed: bool,
    seconds: f64,
    stages: StageSeconds,
    peak_rss: Option<u64>,
    peak_anon: Option<u64>,
    memory: u64,
    file_bytes: u64,
    bytes_per_triangle: f64,
    nodes: u64,
    base_triangles: u64,
    tree_depth: u64,
    blocks: u64,
    pages: u64,
    fill: f64,
    scratch_bytes: u64,
    repaired: Repaired,
}

impl BuildReport {
    /// Of a build that took so long.
    pub fn new(built: Built, plan: &Plan, taken: Duration, peak: &AnonymousPeak) -> Self {
        let Stages { read, collapse, number, write } = built.stages;
        Self {
            input_triangles: built.input_triangles,
            mode: built.mode,
            resumed: built.resumed,
            seconds: taken.as_secs_f64(),
            stages: StageSeconds {
                read: read.as_secs_f64(),
                collapse: collapse.as_secs_f64(),
                number: number.as_secs_f64(),
                write: write.as_secs_f64(),
            },
            peak_rss: peak_rss(),
            peak_anon: peak.so_far(),
            memory: plan.memory,
            file_bytes: built.written.file_bytes,
            bytes_per_triangle: built.written.file_bytes as f64 / built.input_triangles as f64,
            nodes: built.nodes,
            base_triangles: built.base_triangles,
            tree_depth: built.written.tree_depth,
            blocks: built.written.blocks,
            pages: built.written.pages,
            fill: built.written.fill,
            scratch_bytes: built.scratch_bytes,
            repaired: built.repaired,
        }
    }
}

impl fmt::Display for StageSeconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stages = [
            ("read", self.read),
            ("collapsed", self.collapse),
            ("numbered", self.number),
            ("written", self.write),
        ];
        let mut between = "";
        for (stage, seconds) in stages.into_iter().filter(|&(_, seconds)| seconds > 0.0) {
            write!(f, "{between}{stage} in {}", text::seconds(seconds))?;
            between = ", ";
        }
        Ok(())
    }
}

impl fmt::Display for BuildReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} triangles in {} ({}{}), {} per triangle: {}",
            text::count(self.input_triangles),
            text::seconds(self.seconds),
            self.mode.name(),
            if self.resumed { ", from where an earlier run ended" } else { "" },
            text::seconds(self.seconds / self.input_triangles as f64),
            self.stages
        )?;
        if let Some(repaired) = repaired::words(&self.repaired) {
            writeln!(f, "repaired: {repaired}")?;
        }
        writeln!(
            f,
            "file {}, {:.1} bytes per triangle: {} nodes over {} triangles, {} levels deep; {} blocks, {:.0} % full, in {} pages",
            text::size(self.file_bytes),
            self.bytes_per_triangle,
            text::count(self.nodes),
            text::count(self.base_triangles),
            self.tree_depth,
            text::count(self.blocks),
            self.fill * 100.0,
            text::count(self.pages)
        )?;
        match self.peak_anon {
            Some(peak) => write!(f, "peak {} of {}", text::size(peak), text::size(self.memory))?,
            None => write!(f, "memory allowed {}", text::size(self.memory))?,
        }
        match self.scratch_bytes {
            0 => Ok(()),
            bytes => write!(f, ", {} of scratch files", text::size(bytes)),
        }
    }
}
