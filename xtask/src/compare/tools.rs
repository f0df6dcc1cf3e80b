//! Peers that are programs of their own. They are used where they are installed; installing them is up to the user.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::runs::{Attempt, Run};
use super::{distances, reason};
use crate::{Error, process};
use serde_json::json;

/// One or two programs that go from a mesh to a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tools {
    /// OpenMesh's greedy decimation by quadrics with half-edge collapses.
    OpenMeshDecimater,
    /// OpenMesh's view-dependent progressive mesh: a balanced progressive mesh, then its analysis.
    OpenMeshVdpm,
    /// Nexus's hierarchy of clusters.
    Nexus,
    /// The same, compressed.
    NexusCompressed,
}

/// Every name that a program goes by.
type Names = &'static [&'static str];

const DECIMATER: Names = &["OpenMesh-commandlineDecimater", "commandlineDecimater"];
const BALANCED: Names = &["OpenMesh-mkbalancedpm", "mkbalancedpm"];
const ANALYZER: Names = &["OpenMesh-Analyzer", "Analyzer", "vdpmanalyzer"];
const NEXUS_BUILD: Names = &["nxsbuild"];
const NEXUS_COMPRESS: Names = &["nxscompress"];

impl Tools {
    /// What the table calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenMeshDecimater => "OpenMesh decimater",
            Self::OpenMeshVdpm => "OpenMesh VDPM",
            Self::Nexus => "Nexus",
            Self::NexusCompressed => "Nexus compressed",
        }
    }

    fn programs(self) -> &'static [Names] {
        match self {
            Self::OpenMeshDecimater => &[DECIMATER],
            Self::OpenMeshVdpm => &[BALANCED, ANALYZER],
            Self::Nexus => &[NEXUS_BUILD],
            Self::NexusCompressed => &[NEXUS_BUILD, NEXUS_COMPRESS],
        }
    }

    /// What the result's name ends in.
    pub fn extension(self) -> &'static str {
        match self {
            Self::OpenMeshDecimater => "ply",
            Self::OpenMeshVdpm => "spm",
            Self::Nexus => "nxs",
            Self::NexusCompressed => "nxz",
        }
    }

    /// The programs' paths, or which of them is missing.
    fn find(self) -> Result<Vec<PathBuf>, String> {
        let found = |names: &Names| {
            names.iter().find_map(|name| process::find_program(name)).ok_or_else(|| {
                let package = if names[0].starts_with("OpenMesh") {
                    " (Debian: libopenmesh-apps)"
                } else {
                    ""
                };
                format!("{} is not on the PATH{package}", names[names.len() - 1])
            })
        };
        self.programs().iter().map(found).collect()
    }

    /// Runs the programs one after the other: seconds are of both, memory is of the one that takes more.
    ///
    /// `vertices` is how many a decimation shall leave.
    ///
    /// # Errors
    /// When a program cannot be started. One that is missing or fails is an attempt with a reason.
    pub fn run(self, input: &Path, output: &Path, vertices: u64) -> Result<Attempt, Error> {
        let programs = match self.find() {
            Ok(programs) => programs,
            Err(missing) => return Ok(Err(missing)),
        };
        // What is between two programs.
        let middle = output.with_extension(match self {
            Self::OpenMeshVdpm => "pm",
            _ => "nxs",
        });
        let mut run = Run { seconds: 0.0, peak_rss: 0, report: json!({}) };
        for (place, program) in programs.iter().enumerate() {
            let mut command = Command::new(program);
            let last = place + 1 == programs.len();
            let from = if place == 0 { input } else { &middle };
            let to = if last { output } else { &middle };
            match self {
                Self::OpenMeshDecimater => {
                    let count = format!("-{vertices}");
                    command.args(["-M", "Q", "-n", &count, "-i"]).arg(from).arg("-o").arg(to);
                }
                _ => {
                    command.arg(OsStr::new("-o")).arg(to).arg(from);
                }
            }
            let done = process::measure(command.stdin(Stdio::null()))?;
            if !done.status.success() {
                return Ok(Err(reason(&done.stderr)));
            }
            if !to.exists() {
                return Ok(Err(format!("{} left no result", process::display(&command))));
            }
            run.seconds += done.seconds;
            run.peak_rss = run.peak_rss.max(done.peak_rss);
        }
        Ok(Ok(run))
    }
}

/// Runs that may be spent on finding how many vertices leave a number of triangles.
const TRIES: usize = 3;

/// How many vertices OpenMesh's decimater shall leave for so many triangles, found by runs that are not counted: it knows
/// vertices only, those that no triangle uses with them, and what becomes of the boundary is not known before.
pub fn vertices_for(xfm: &Path, input: &Path, output: &Path, triangles: u64) -> Result<u64, Error> {
    let mut vertices = triangles / 2;
    for _ in 0..TRIES {
        if Tools::OpenMeshDecimater.run(input, output, vertices)?.is_err() {
            break;
        }
        let got = distances(xfm, input, output)?["b_triangles"].as_u64().unwrap_or(triangles);
        if got.abs_diff(triangles) * 200 <= triangles {
            break;
        }
        vertices = (vertices + triangles / 2).saturating_sub(got / 2);
    }
    Ok(vertices)
}
