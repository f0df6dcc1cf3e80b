//! A file on storage that takes its time.

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

use xfm_format::{Storage, XfmFile};

use crate::Error;

struct Slow {
    file: File,
    delay: Duration,
}

impl Storage for Slow {
    fn len(&self) -> io::Result<u64> {
        Storage::len(&self.file)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        std::thread::sleep(self.delay);
        Storage::read_at(&self.file, offset, buffer)
    }
}

/// Opens a `.xfm` file of which every read takes longer by `delay`.
pub fn open(path: &Path, delay: Duration) -> Result<XfmFile, Error> {
    // For its messages.
    crate::xfm_file::open(path)?;
    let file = File::open(path).map_err(|source| {
        Error::Format(xfm_format::Error::Io { file: path.to_owned(), action: "open", source })
    })?;
    XfmFile::from_storage(Box::new(Slow { file, delay }), path).map_err(Error::Format)
}
