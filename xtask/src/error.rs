//! What can go wrong in a command.

use std::io;
use std::path::{Path, PathBuf};

/// The failure of one `cargo xtask` command.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be read or written.
    #[error("{path}: {source}", path = path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Triangles could not be handed on.
    #[error("writing triangles: {0}")]
    Write(#[from] io::Error),
    /// The generator was asked for something that it cannot make.
    #[error("{0}")]
    Unsupported(String),
    /// A program could not be started.
    #[error("{program}: {source}; is it installed and on the PATH?")]
    Start {
        /// The program's name.
        program: String,
        /// Why.
        source: io::Error,
    },
    /// A program ended with an error.
    #[error("`{command}` failed ({status})")]
    Failed {
        /// The whole command line.
        command: String,
        /// Its exit status, in words.
        status: String,
    },
    /// Something the commands need is missing and could not be installed.
    #[error("{what} is missing and could not be installed ({why}); run: {remedy}")]
    Missing {
        /// What is missing.
        what: String,
        /// Why it could not be installed.
        why: String,
        /// The command that installs it.
        remedy: String,
    },
    /// A program's report does not have the form that was agreed on.
    #[error("{what}: {why}")]
    Report {
        /// The program or file that reported.
        what: String,
        /// What is wrong with it.
        why: String,
    },
    /// Some steps or claims failed; each has been reported already.
    #[error("{failed} of {total} {what} failed")]
    Claims {
        /// What was counted.
        what: &'static str,
        /// How many failed.
        failed: usize,
        /// How many there were.
        total: usize,
    },
}

impl Error {
    /// Wraps an input or output error together with the file it happened on.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::File { path, source }
    }
}
