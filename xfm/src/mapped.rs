//! A mesh that another program cuts short, or whose disk fails, while it is mapped into memory.
//!
//! Binary PLY is read where it lies ([`mesh_io::open_source`]). What is not there any more cannot be read through a map, and the
//! system says so by a signal (`SIGBUS`) that ends the process. It ends in order here: with a message, and exit code 1.

use std::path::Path;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
use std::sync::OnceLock;

/// The mesh that is being read.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
static READING: OnceLock<Vec<u8>> = OnceLock::new();

/// Notes the mesh that is being read, for the message; a command reads one of them through a map.
pub fn reading(path: &Path) {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    READING.get_or_init(|| path.display().to_string().into_bytes());
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    let _not_told = path;
}

/// Arranges for the message. Elsewhere than on Linux the process ends without one.
pub fn install() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    signal::install();
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "signals are the system's")]
mod signal {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::READING;

    static TOLD: AtomicBool = AtomicBool::new(false);

    extern "C" fn end(_signal: libc::c_int) {
        // Whatever thread comes second waits for the end.
        while TOLD.swap(true, Ordering::SeqCst) {
            std::hint::spin_loop();
        }
        let name: &[u8] = READING.get().map_or(b"the mesh", Vec::as_slice);
        let why: &[u8] = b": it was cut short, or its disk failed, while it was read; \
                           leave it alone until this has ended, and run this again\n";
        for part in [b"error: ", name, why] {
            // SAFETY: the pointer and the length are those of a slice that is there; write(2) may be called in a signal
            // handler. Where it fails, the exit code still tells.
            unsafe { libc::write(libc::STDERR_FILENO, part.as_ptr().cast(), part.len()) };
        }
        // SAFETY: _exit(2) may be called in a signal handler, and does not return.
        unsafe { libc::_exit(1) }
    }

    pub(super) fn install() {
        let handler: extern "C" fn(libc::c_int) = end;
        // SAFETY: signal(2) takes the number of a signal and a function with this signature, which does only what is allowed
        // in a signal handler. Where it is refused, the signal ends the process as before.
        unsafe { libc::signal(libc::SIGBUS, handler as libc::sighandler_t) };
    }
}
