//! Checkpoints are written and read without a second copy of anything.
#![allow(unsafe_code, reason = "an allocator that counts")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use common::torus;
use mesh_io::{IndexedMesh, MeshSource};
use xfm_build::{Input, Keep, MeshOptions, MeshProgress, Mode, build_mesh};

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

/// The most that is allocated until there is a file or, where a number is given, that many times something has been told.
fn peak(mesh: &IndexedMesh, folder: &Path, options: &MeshOptions, mut times: usize) -> usize {
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let mut source = MeshSource::new(mesh.clone(), "mesh");
    let own = NOW.load(Ordering::Relaxed) - before;
    let mut observer = |_: MeshProgress| {
        times -= 1;
        if times == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let file = folder.join("a.xfm");
    let built = build_mesh(Input::Pipe(&mut source), &file, folder, options, &mut observer);
    assert_eq!(built.is_err(), times == 0, "{built:?}");
    PEAK.load(Ordering::Relaxed) - before - own
}

#[test]
fn checkpoints_take_next_to_no_memory() {
    let shape = torus(350, 350);
    let mesh = IndexedMesh {
        positions: shape.positions,
        triangles: shape.triangles,
        ..Default::default()
    };
    let mut options = MeshOptions::default();
    // The buffer is a few times what everything else takes.
    options.memory_bytes = 72 << 20;
    options.expected_triangles = Some(245_000);
    options.checkpoint_every = Some(Duration::ZERO);
    for mode in [Mode::Streaming, Mode::InCore] {
        options.mode = Some(mode);
        let folder = tempfile::tempdir().unwrap();
        let keep = Some(Keep { name: "a".to_owned(), identity: Vec::new() });
        // None of the log in memory either way.
        options.keep = keep.clone();
        options.checkpoint_every = Some(Duration::MAX);
        let without = peak(&mesh, folder.path(), &options, usize::MAX);
        options.checkpoint_every = Some(Duration::ZERO);
        let with = peak(&mesh, folder.path(), &options, usize::MAX);
        let broken_off = peak(&mesh, folder.path(), &options, 24);
        assert!(folder.path().join("a.state").exists());
        options.resume = true;
        let resumed = peak(&mesh, folder.path(), &options, usize::MAX);
        options.resume = false;
        println!("{mode:?}: {without} without, {with} with, {broken_off}, {resumed} resumed");
        assert!(with.max(broken_off) < without + (1 << 20), "{with} {broken_off} {without}");
        assert!(resumed < without + (2 << 20), "{resumed} {without}");
    }
}
