//! What can go wrong.

use std::path::PathBuf;

/// Why a pager could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read.
    #[error(transparent)]
    Format(#[from] xfm_format::Error),
    /// The hard quota does not hold what must always be resident.
    #[error("{}: needs {minimum} bytes of memory at least, the hard quota is {hard_quota_bytes}; raise it", file.display())]
    QuotaTooSmall {
        /// The file.
        file: PathBuf,
        /// Least hard quota that this file can be opened with.
        minimum: usize,
        /// The quota given.
        hard_quota_bytes: usize,
    },
    /// The coarsest mesh in the file is not a manifold.
    #[error("{}: the coarsest mesh is damaged: {source}", file.display())]
    BaseMesh {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: halfedge::BuildError,
    },
}

/// A page that cannot be read: its detail is not shown.
#[derive(Debug)]
#[non_exhaustive]
pub struct Problem {
    /// Number of the page.
    pub page: usize,
    /// Why.
    pub error: xfm_format::Error,
}
