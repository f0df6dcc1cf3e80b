//! Where a command's report goes: for people on standard error, for scripts as JSON on standard output.

use std::fmt::Display;
use std::io::{self, Write};

use serde::Serialize;

use crate::Error;

/// Says one line on standard error. Where even that is closed, there is nobody to tell.
pub fn say(line: &str) {
    drop(writeln!(io::stderr().lock(), "{line}"));
}

/// The form of a report, and the stream for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReportTo {
    /// Text on standard error.
    People,
    /// JSON on standard output.
    Scripts,
    /// JSON on standard error, because standard output carries the mesh.
    ScriptsBesideMesh,
}

impl ReportTo {
    /// Scripts if `--json` was given, people otherwise.
    pub fn new(json: bool) -> Self {
        if json { Self::Scripts } else { Self::People }
    }

    /// Hands out a report. A reader that has gone away is no failure: it has seen what it wanted.
    ///
    /// # Errors
    ///
    /// [`Error::Report`] if the stream cannot be written.
    pub fn deliver(self, report: &(impl Serialize + Display)) -> Result<(), Error> {
        let written = match self {
            Self::People => writeln!(io::stderr().lock(), "{report}"),
            Self::Scripts => write_json(io::stdout().lock(), report),
            Self::ScriptsBesideMesh => write_json(io::stderr().lock(), report),
        };
        match written {
            Err(source) if source.kind() != io::ErrorKind::BrokenPipe => {
                Err(Error::Report { source })
            }
            _ => Ok(()),
        }
    }
}

fn write_json(mut stream: impl Write, report: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut stream, report)?;
    writeln!(stream)?;
    stream.flush()
}
