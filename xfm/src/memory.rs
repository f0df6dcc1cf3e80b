//! How much memory the process has used at most.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often anonymous memory is looked at; a peak shorter than this may be missed.
const PERIOD: Duration = Duration::from_millis(5);

/// Blocks from here on go back to the system as soon as they are free.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BYTES: libc::c_int = 1 << 20;

/// Has the allocator give large blocks back to the system when they are free, where it would not by itself.
///
/// The one of glibc takes every large block that is freed as a sign to keep blocks of that size, up to 32 MiB, and in an arena
/// for each thread. What a process is said to be allowed then holds for what it uses, but not for what it has: a tenth to a
/// sixth more was measured. A fixed size ends that; no difference in speed was found.
pub fn give_back_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    #[allow(unsafe_code, reason = "there is no other way to tell the allocator")]
    {
        // SAFETY: the function takes two numbers and may be called at any time from any thread (mallopt(3)). Where it
        // refuses, all stays as it was, so that what it returns does not matter.
        unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BYTES) };
    }
}

/// The most physical memory the process has had so far, mapped files included; `None` where the system does not tell.
///
/// # Units
///
/// Bytes.
pub fn peak_rss() -> Option<u64> {
    #[cfg(target_os = "linux")]
    return status_field("VmHWM:");
    #[cfg(all(unix, not(target_os = "linux")))]
    {
        use nix::sys::resource::{UsageWho, getrusage};
        let peak = u64::try_from(getrusage(UsageWho::RUSAGE_SELF).ok()?.max_rss()).ok()?;
        // Kibibytes everywhere but on Apple's systems, where it is bytes.
        return Some(if cfg!(target_vendor = "apple") { peak } else { peak * 1024 });
    }
    #[cfg(not(unix))]
    None
}

/// The physical memory the process has as of now, mapped files included; `None` where the system does not tell.
///
/// # Units
///
/// Bytes.
pub fn resident() -> Option<u64> {
    if cfg!(target_os = "linux") { status_field("VmRSS:") } else { None }
}

/// The physical memory that no file backs, as of now: what a memory limit is about. `None` where the system does not tell.
///
/// # Units
///
/// Bytes.
pub fn anonymous() -> Option<u64> {
    if cfg!(target_os = "linux") { status_field("RssAnon:") } else { None }
}

/// A field of `/proc/self/status`, which gives sizes in kibibytes.
#[cfg(any(target_os = "linux", test))]
fn status_field(name: &str) -> Option<u64> {
    parse_status_field(&std::fs::read_to_string("/proc/self/status").ok()?, name)
}

#[cfg(not(any(target_os = "linux", test)))]
fn status_field(_name: &str) -> Option<u64> {
    None
}

#[cfg(any(target_os = "linux", test))]
fn parse_status_field(status: &str, name: &str) -> Option<u64> {
    let value = status.lines().find_map(|line| line.strip_prefix(name))?;
    value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Watches anonymous memory from a thread of its own until asked for the peak.
#[derive(Debug)]
pub struct AnonymousPeak {
    peak: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    watcher: Option<JoinHandle<()>>,
}

impl AnonymousPeak {
    /// Starts to watch; where the system does not tell, or has no thread left, nothing is watched.
    pub fn watch() -> Self {
        let (peak, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let watcher = anonymous().and_then(|now| {
            peak.store(now, Ordering::Relaxed);
            let (peak, stop) = (Arc::clone(&peak), Arc::clone(&stop));
            let watch = move || {
                while !stop.load(Ordering::Relaxed) {
                    peak.fetch_max(anonymous().unwrap_or(0), Ordering::Relaxed);
                    std::thread::park_timeout(PERIOD);
                }
            };
            std::thread::Builder::new().name("memory".to_owned()).spawn(watch).ok()
        });
        Self { peak, stop, watcher }
    }

    /// The most seen so far, in bytes; `None` where nothing is watched.
    pub fn so_far(&self) -> Option<u64> {
        self.watcher.as_ref()?;
        let now = anonymous().unwrap_or(0);
        Some(self.peak.fetch_max(now, Ordering::Relaxed).max(now))
    }
}

impl Drop for AnonymousPeak {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            // The watcher has nothing to return and cannot panic.
            drop(watcher.join());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_fields_are_kibibytes() {
        let status = "Name:\txfm\nVmHWM:\t   12 kB\nRssAnon:\t    3 kB\nOdd:\t 5\n";
        assert_eq!(parse_status_field(status, "VmHWM:"), Some(12 * 1024));
        assert_eq!(parse_status_field(status, "RssAnon:"), Some(3 * 1024));
        assert_eq!(parse_status_field(status, "Odd:"), None);
        assert_eq!(parse_status_field(status, "RssFile:"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_large_allocation_shows_in_the_peak() {
        const SIZE: usize = 64 << 20;
        let watch = AnonymousPeak::watch();
        let before = watch.so_far().expect("Linux tells");
        let block = vec![1_u8; SIZE];
        std::thread::sleep(20 * PERIOD);
        assert!(block.iter().step_by(4096).all(|&byte| byte == 1));
        drop(block);
        let peak = watch.so_far().expect("Linux tells");
        assert!(peak >= before.max(SIZE as u64), "{peak} after {before}");
        assert!(peak_rss().expect("Linux tells") >= SIZE as u64);
    }
}
