//! Ctrl-C, and requests to terminate.
//!
//! Long loops ask [`check`] now and then. Work that cannot be broken off from within, and that leaves nothing behind when the
//! process ends in the middle of it, runs [`freely`]: then the signal ends the process by itself.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use crate::report::say;
use crate::{Error, one_line};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// How many do work during which the process may end. Who ends it holds the lock, so that none of them goes on meanwhile.
static FREE: Mutex<u32> = Mutex::new(0);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// Arranges for signals to set the flag instead of killing the process, so that scratch files are removed. A second
/// signal ends the process at once.
pub fn install() {
    INSTALLED.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            let again = INTERRUPTED.swap(true, Ordering::SeqCst);
            let free = lock_free();
            if again || *free > 0 {
                leave();
            }
        });
        if let Err(error) = installed {
            say(&format!("warning: Ctrl-C will not clean up: {}", one_line(&error)));
        }
    });
}

fn lock_free() -> MutexGuard<'static, u32> {
    FREE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the process as a command broken off by Ctrl-C ends it.
fn leave() -> ! {
    if stderr().is_terminal() {
        // Below the progress bar, if there is one.
        say("");
    }
    say(&format!("error: {}", one_line(&Error::Interrupted)));
    std::process::exit(i32::from(Error::Interrupted.exit_code()))
}

/// Whether the process has been asked to end.
pub fn is_requested() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Ends a command that has been asked to end.
///
/// # Errors
///
/// [`Error::Interrupted`] if so.
pub fn check() -> Result<(), Error> {
    if is_requested() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Does work during which a signal may end the process at once: the caller vouches that there is no scratch file, and no
/// output half written, in the whole process.
pub fn freely<T>(work: impl FnOnce() -> T) -> T {
    /// Counted back even if the work panics.
    struct Free;
    impl Drop for Free {
        fn drop(&mut self) {
            *lock_free() -= 1;
        }
    }
    *lock_free() += 1;
    let _free = Free;
    // A signal may have come between the caller's last look and the line above.
    if is_requested() {
        leave();
    }
    work()
}
