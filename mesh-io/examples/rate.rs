//! How fast files are read: `cargo run --release --example rate -- FILE...`
//!
//! Opens each file ten times as a stream, reads it to the end in batches, and prints the best time.

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use mesh_io::open_source;

/// Triangles per call, about what a decimator asks for.
const BATCH: usize = 1 << 14;

fn main() -> Result<(), Box<dyn Error>> {
    for argument in std::env::args().skip(1) {
        let path = Path::new(&argument);
        let megabytes = std::fs::metadata(path)?.len() as f64 / 1e6;
        let (mut open, mut whole, mut triangles) = (Duration::MAX, Duration::MAX, 0);
        for _ in 0..10 {
            let start = Instant::now();
            let mut source = open_source(path)?;
            open = open.min(start.elapsed());
            let mut batch = Vec::new();
            triangles = 0;
            loop {
                batch.clear();
                match source.read(&mut batch, BATCH)? {
                    0 => break,
                    count => triangles += count,
                }
            }
            whole = whole.min(start.elapsed());
        }
        let seconds = whole.as_secs_f64();
        println!(
            "{argument}: {triangles} triangles in {seconds:.4} s, {:.4} s of it to open; {:.0} MB/s, {:.1} M/s",
            open.as_secs_f64(),
            megabytes / seconds,
            triangles as f64 / 1e6 / seconds,
        );
    }
    Ok(())
}
