//! Never more memory is taken than was allowed.
#![allow(unsafe_code, reason = "an allocator that counts")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{Sequence, coloured, independent_sets, link, plain, recycled, sweep, torus};
use xfm_build::{Error, LinkOptions, NumberOptions};

/// Counts what is allocated now and at most.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller keeps the same promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the same promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The most that is allocated while something is done, beyond what was before; and what came of it.
fn peak_of<T>(before: usize, act: impl FnOnce() -> T) -> (usize, T) {
    PEAK.store(NOW.load(Ordering::Relaxed), Ordering::Relaxed);
    let result = act();
    (PEAK.load(Ordering::Relaxed).saturating_sub(before), result)
}

/// Builds with the least memory and with more, and looks at what is taken.
fn check(sequence: &Sequence) {
    let folder = tempfile::tempdir().unwrap();
    let mut continues = |_| ControlFlow::Continue(());
    for more in [0, 300 << 10, 3 << 20, 100 << 20] {
        let mut options = LinkOptions::new(sequence.names);
        options.write.page_nodes = Some(64);
        options.colours = !sequence.colours.is_empty();
        options.memory_bytes = options.least_memory_bytes() + more;
        let before = NOW.load(Ordering::Relaxed);
        let first = link(sequence, folder.path(), &options);
        if let Err(Error::Memory { needed, allowed }) = first {
            // Only where the coarsest mesh is not small.
            assert!(needed > allowed && sequence.coarse.faces.len() > 1000);
            options.memory_bytes = needed;
        }
        drop(first);
        let (peak, linked) = peak_of(before, || link(sequence, folder.path(), &options).unwrap());
        assert!(peak as u64 <= options.memory_bytes, "{peak} of {}", options.memory_bytes);
        let mut number = NumberOptions::default();
        number.memory_bytes = linked.least_memory_bytes() + more;
        let (peak, numbered) = peak_of(before, || linked.number(&number, &mut continues).unwrap());
        assert!(peak as u64 <= number.memory_bytes, "{peak} of {}", number.memory_bytes);
        let path = folder.path().join("a.xfm");
        let (peak, _) = peak_of(before, || numbered.write(&path, &mut continues).unwrap());
        assert!(peak as u64 <= number.memory_bytes, "{peak} of {}", number.memory_bytes);
    }
}

/// In one test, for another beside it would be counted too.
#[test]
fn what_is_allocated_is_never_more_than_what_is_allowed() {
    // Few names and many collapses.
    let shape = torus(250, 250);
    let few_names = recycled(&plain(&shape, &sweep(&shape, 2000, 3, 1)), 1);
    check(&few_names);
    check(&coloured(few_names));
    // As many names as there can be.
    let shape = torus(100, 100);
    check(&plain(&shape, &independent_sets(&shape, 100)));
    // A coarsest mesh that is not small.
    let shape = torus(200, 200);
    let large = plain(&shape, &independent_sets(&shape, 60_000));
    check(&large);
    check(&coloured(large));
}
