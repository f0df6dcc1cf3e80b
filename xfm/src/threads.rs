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

/// Has all work in the process that asks for no number of threads of its own done by so many, or one for each core.
///
/// # Errors
///
/// [`Error::Threads`] if the system does not give that many, or the threads are there already.
pub fn limit_threads(threads: Option<NonZeroUsize>) -> Result<(), Error> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .map_err(|source| Error::Threads { source })
}
