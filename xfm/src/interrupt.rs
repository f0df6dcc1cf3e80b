//! Ctrl-C, and requests to terminate: a flag that long loops look at.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::report::say;
use crate::{Error, one_line};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// Arranges for signals to set the flag instead of killing the process, so that scratch files are removed. A second
/// signal ends the process at once.
pub fn install() {
    INSTALLED.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(i32::from(Error::Interrupted.exit_code()));
            }
        });
        if let Err(error) = installed {
            say(&format!("warning: Ctrl-C will not clean up: {}", one_line(&error)));
        }
    });
}

/// Whether the process has been asked to end.
pub fn is_requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Ends a command that has been asked to end.
///
/// # Errors
///
/// [`Error::Interrupted`] if so.
pub fn check() -> Result<(), Error> {
    if is_requested() { Err(Error::Interrupted) } else { Ok(()) }
}
