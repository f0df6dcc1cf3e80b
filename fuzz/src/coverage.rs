//! Which parts of the program a case has been through.
//!
//! A build with LLVM's SanitizerCoverage pass (`cargo xtask fuzz` makes one; the pass needs no nightly compiler) counts how
//! often every edge of the control flow is taken. Without it there are no counters, and no case is of more interest than any
//! other.

#![allow(unsafe_code, reason = "the counters are the compiler's")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, Ordering};

/// The counters of every part of the program that has some.
static COUNTERS: Mutex<Vec<&'static [AtomicU8]>> = Mutex::new(Vec::new());

/// Called by constructors that the compiler adds, before `main`, once or several times for each part.
///
/// # Safety
/// `start` and `end` must be the ends of an array of bytes that is there as long as the program.
// SAFETY: the name is that which the pass calls, with the arguments that it passes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn __sanitizer_cov_8bit_counters_init(
    start: *const AtomicU8,
    end: *const u8,
) {
    let length = (end as usize).saturating_sub(start as usize);
    // SAFETY: the caller vouches for the array; what writes to it does so without a lock, a byte at a time, and a count
    // that is lost or doubled does no harm.
    let counters = unsafe { std::slice::from_raw_parts(start, length) };
    let mut all = COUNTERS.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    if !all.iter().any(|known| known.as_ptr() == counters.as_ptr()) {
        all.push(counters);
    }
}

/// What all cases so far have been through.
#[derive(Debug, Default)]
pub struct Coverage {
    /// Per counter which of eight classes of counts have been seen.
    seen: Vec<u8>,
    edges: usize,
}

impl Coverage {
    /// Forgets what the counters say.
    pub fn reset() {
        each(|_, counter| counter.store(0, Ordering::Relaxed));
    }

    /// Takes in what the counters say since they were [`reset`](Self::reset); says whether some of it is new.
    pub fn take(&mut self) -> bool {
        let mut new = false;
        each(|index, counter| {
            let count = counter.load(Ordering::Relaxed);
            if count == 0 {
                return;
            }
            if self.seen.len() <= index {
                self.seen.resize(index + 1, 0);
            }
            // Once, twice, three times, 4 to 7, 8 to 15, 16 to 31, 32 to 127, more.
            let class = match count {
                0..=3 => count - 1,
                4..=31 => count.ilog2() as u8 + 1,
                32..=127 => 6,
                _ => 7,
            };
            let seen = &mut self.seen[index];
            if *seen >> class & 1 == 0 {
                self.edges += usize::from(*seen == 0);
                *seen |= 1 << class;
                new = true;
            }
        });
        new
    }

    /// How many edges have been taken.
    pub fn edges(&self) -> usize {
        self.edges
    }
}

fn each(mut visit: impl FnMut(usize, &AtomicU8)) {
    let all = COUNTERS.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    all.iter().copied().flatten().enumerate().for_each(|(index, counter)| visit(index, counter));
}
