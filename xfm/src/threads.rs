//! How many threads a command works with.

use std::num::NonZeroUsize;

use crate::Error;

/// Runs a piece of work on so many threads, or on one for each core.
///
/// # Errors
///
/// [`Error::Threads`] if the system does not give that many, and what the work returns.
pub fn with_threads<T: Send>(
    threads: Option<NonZeroUsize>,
    work: impl FnOnce() -> Result<T, Error> + Send,
) -> Result<T, Error> {
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| Error::Threads { source })?;
    pool.install(work)
}
