//! `xfm verify`: whether a `.xfm` file is what it should be.

mod against;

use std::fmt;
use std::path::PathBuf;

use mesh_io::Format;
use serde::Serialize;
use xfm_format::{Numbering, Place, Problem, XfmFile};

use crate::progress::{Progress, Unit};
use crate::report::ReportTo;
use crate::{Error, interrupt, text, values, xfm_file};

/// Check a .xfm file: checksums, links, bounds, counts; and with --against that it holds a mesh whole
///
/// With --against the file is refined fully, and its triangles must be those of the input, every coordinate the same to the
/// last bit, or rounded as a compact file says. Where all of it fits --memory, the input is welded and repaired as `xfm build` does before. Where it does not,
/// triangles are compared as they are. Those without a surface (two corners at one place, a coordinate that is no number) are
/// left out and counted, and so are repetitions at one place. Exit code 1 if anything is wrong.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Did the copy arrive whole?
    xfm verify scan.xfm

  Is every triangle of the input in it?
    xfm verify dragon.xfm --against dragon.ply

  Which pages are damaged?
    xfm verify scan.xfm --json | jq '[.errors[].page]'")]
pub struct VerifyArgs {
    /// The .xfm file
    #[arg(value_name = "FILE.xfm")]
    file: PathBuf,
    /// The mesh it was built from; - is standard input
    #[arg(long, value_name = "IN")]
    against: Option<PathBuf>,
    /// Format of that mesh where its name does not tell: stl, ply, obj, gltf, glb
    #[arg(long, value_name = "FMT", value_parser = values::format, requires = "against")]
    from: Option<Format>,
    /// Anonymous memory that --against may use at most, like 512MiB or 4G; what does not fit goes through scratch files
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = values::size)]
    memory: u64,
    /// Folder for scratch files [default: that of the .xfm file]
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What `xfm verify` reports.
#[derive(Debug, Clone, Default, Serialize)]
struct VerifyReport {
    ok: bool,
    errors: Vec<Finding>,
    /// Errors beyond those listed.
    more_errors: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<against::Comparison>,
}

/// One thing that is wrong, and where: exactly one of the first three is there.
#[derive(Debug, Clone, Default, Serialize)]
struct Finding {
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    block: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    field: Option<String>,
    message: String,
}

impl Finding {
    fn new(place: Place, message: String, numbering: Option<Numbering>) -> Self {
        let block_of = |node: u64| {
            let node = mergetree::NodeId::new(u32::try_from(node).ok()?);
            Some(u64::from(numbering?.block(node).get()))
        };
        match place {
            Place::Page(page) => Self { page: Some(page), message, ..Self::default() },
            Place::Block(block) => Self { block: Some(block), message, ..Self::default() },
            Place::Node(node) => match block_of(node) {
                Some(block) => {
                    let message = format!("node {node}: {message}");
                    Self { block: Some(block), message, ..Self::default() }
                }
                None => Self { field: Some(place.to_string()), message, ..Self::default() },
            },
            _ => Self { field: Some(place.to_string()), message, ..Self::default() },
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.page, self.block, &self.field) {
            (Some(page), ..) => write!(f, "page {page}: {}", self.message),
            (_, Some(block), _) => write!(f, "block {block}: {}", self.message),
            (_, _, Some(field)) => write!(f, "{field}: {}", self.message),
            _ => f.write_str(&self.message),
        }
    }
}

impl fmt::Display for VerifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for error in &self.errors {
            writeln!(f, "{error}")?;
        }
        if self.more_errors > 0 {
            writeln!(f, "and {} more", text::count(self.more_errors))?;
        }
        if let Some(against) = &self.against {
            writeln!(f, "{against}")?;
        }
        f.write_str(if self.ok { "ok" } else { "not ok" })
    }
}

/// Runs the command.
///
/// # Errors
///
/// A file that cannot be read, or in which anything is wrong.
pub fn run(args: &VerifyArgs) -> Result<(), Error> {
    let report = verify(args)?;
    if report.ok {
        return ReportTo::new(args.json).deliver(&report);
    }
    let failed = Error::VerifyFailed {
        file: args.file.clone(),
        errors: report.errors.len() as u64 + report.more_errors,
        first: report.errors.first().map(ToString::to_string).unwrap_or_default(),
    };
    // People who get a single error have read it all in the error line.
    if args.json || report.errors.len() > 1 {
        ReportTo::new(args.json).deliver(&report)?;
    }
    Err(failed)
}

fn verify(args: &VerifyArgs) -> Result<VerifyReport, Error> {
    let file = match interrupt::freely(|| xfm_file::open(&args.file)) {
        Ok(file) => file,
        Err(Error::Format(error)) => match place_of(&error) {
            // A file that is there and damaged is a finding, not a failure to look.
            Some(place) => {
                let errors = vec![Finding::new(place, defect(&error), None)];
                return Ok(VerifyReport { errors, ..VerifyReport::default() });
            }
            None => return Err(error.into()),
        },
        Err(error) => return Err(error),
    };
    let mut report = interrupt::freely(|| check(&file));
    if report.errors.is_empty()
        && let Some(input) = &args.against
    {
        let (comparison, wrong) = against::compare(&file, input, args)?;
        report.errors.extend(wrong.map(|message| {
            let field = Some("triangles".to_owned());
            Finding { field, message, ..Finding::default() }
        }));
        report.against = Some(comparison);
    }
    report.ok = report.errors.is_empty();
    Ok(report)
}

/// Where a file is damaged that cannot even be opened; `None` if it is not damage that keeps it from being opened.
fn place_of(error: &xfm_format::Error) -> Option<Place> {
    match *error {
        xfm_format::Error::Truncated { place, .. }
        | xfm_format::Error::Checksum { place, .. }
        | xfm_format::Error::Invalid { place, .. } => Some(place),
        xfm_format::Error::TrailingBytes { .. } => Some(Place::File),
        _ => None,
    }
}

/// The defect alone: file and place stand beside it.
fn defect(error: &xfm_format::Error) -> String {
    match error {
        xfm_format::Error::Truncated { needed, found, .. } => {
            format!("needs {needed} bytes, the file ends after {found}")
        }
        xfm_format::Error::Checksum { expected, found, .. } => {
            format!("is damaged (checksum {found:08x}, should be {expected:08x})")
        }
        xfm_format::Error::Invalid { message, .. } => message.clone(),
        xfm_format::Error::TrailingBytes { expected, found, .. } => {
            format!("is {found} bytes long, should be {expected}")
        }
        other => other.to_string(),
    }
}

fn check(file: &XfmFile) -> VerifyReport {
    let progress = Progress::new("verifying", None, Unit::Items);
    let found = xfm_format::verify(file, |pages| {
        progress.set_total(pages.total as u64);
        progress.set(pages.done as u64);
    });
    let finding =
        |problem: Problem| Finding::new(problem.place, problem.message, Some(file.numbering()));
    VerifyReport {
        more_errors: found.more as u64,
        errors: found.errors.into_iter().map(finding).collect(),
        ..VerifyReport::default()
    }
}
