//! Why a command failed, and how that becomes one line.

use std::io;

use crate::distance::DistanceError;

/// Why a command failed. Each message names the file, the place in it where there is one, and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh could not be read or written.
    #[error(transparent)]
    Mesh(#[from] mesh_io::Error),
    /// Standard input has no extension that would tell the format.
    #[error("standard input: cannot tell the format; say which it is with --from")]
    NoFormat,
    /// Meshes cannot be compared.
    #[error("{name}: {source}")]
    Distance {
        /// The file, or both files.
        name: String,
        /// What is wrong with it.
        source: DistanceError,
    },
    /// The operating system did not give the threads asked for.
    #[error("cannot start the worker threads: {source}; ask for fewer with --threads")]
    Threads {
        /// What the system said.
        source: rayon::ThreadPoolBuildError,
    },
    /// The report could not be written.
    #[error("standard output: cannot write the report: {source}; check where it is redirected to")]
    Report {
        /// What the system said.
        source: io::Error,
    },
    /// The user pressed Ctrl-C, or the process was asked to terminate.
    #[error("interrupted; no output was written")]
    Interrupted,
}

impl Error {
    /// The process's exit code: 130 for an interruption (128 + the number of the signal, as shells have it), else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted => 130,
            _ => 1,
        }
    }
}

/// An error with all its sources on one line; a source that the line tells already is not told twice.
///
/// ```
/// let error = std::io::Error::other("first\nsecond");
/// assert_eq!(xfm::one_line(&error), "first second");
/// ```
pub fn one_line(error: &dyn std::error::Error) -> String {
    let flat = |message: String| message.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut line = flat(error.to_string());
    let mut next = error.source();
    while let Some(source) = next {
        let message = flat(source.to_string());
        if !line.contains(&message) {
            line = format!("{line}: {message}");
        }
        next = source.source();
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{message}")]
    struct Link {
        message: &'static str,
        source: Option<Box<Link>>,
    }

    fn link(message: &'static str, source: Option<Link>) -> Link {
        Link { message, source: source.map(Box::new) }
    }

    #[test]
    fn sources_are_joined_once_each() {
        let chain = link("a.xfm: cannot read", Some(link("page 3", Some(link("bad sum", None)))));
        assert_eq!(one_line(&chain), "a.xfm: cannot read: page 3: bad sum");
        let told = link("page 3: bad sum", Some(link("bad sum", None)));
        assert_eq!(one_line(&told), "page 3: bad sum");
    }

    #[test]
    fn an_interruption_has_its_own_exit_code() {
        assert_eq!(Error::Interrupted.exit_code(), 130);
        let report = Error::Report { source: io::Error::other("full") };
        assert_eq!(report.exit_code(), 1);
    }
}
