//! A file that may take its time, and that knows who reads from it.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::thread::ThreadId;
use std::time::Duration;

use xfm_format::{Storage, XfmFile};

use crate::{Error, xfm_file};

struct Watched {
    file: File,
    delay: Duration,
    /// The thread whose reads are counted.
    opener: ThreadId,
    reads: Arc<AtomicU64>,
}

impl Storage for Watched {
    fn len(&self) -> io::Result<u64> {
        Storage::len(&self.file)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        if std::thread::current().id() == self.opener {
            self.reads.fetch_add(1, Relaxed);
        }
        if !self.delay.is_zero() {
            std::thread::sleep(self.delay);
        }
        Storage::read_at(&self.file, offset, buffer)
    }
}

/// How often the thread that opened a file has read from it.
pub struct OwnReads(Arc<AtomicU64>);

impl OwnReads {
    /// Takes the number, and begins at zero again.
    pub fn take(&self) -> u64 {
        self.0.swap(0, Relaxed)
    }
}

/// Opens a `.xfm` file of which every read takes longer by `delay`.
pub fn open(path: &Path, delay: Duration) -> Result<(XfmFile, OwnReads), Error> {
    let file = File::open(path).map_err(|source| {
        Error::Format(xfm_format::Error::Io { file: path.to_owned(), action: "open", source })
    })?;
    let reads = Arc::new(AtomicU64::new(0));
    let opener = std::thread::current().id();
    let watched = Watched { file, delay, opener, reads: Arc::clone(&reads) };
    Ok((xfm_file::from_storage(Box::new(watched), path)?, OwnReads(reads)))
}
