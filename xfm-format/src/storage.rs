//! Where the bytes of a file come from.

use std::fs::File;
use std::io;

/// Bytes that can be read at any place, by several threads at once.
///
/// [`File`] is the common one. It is read, not mapped into memory: a file that another program cuts short gives an
/// error here, where a memory map would end the process.
pub trait Storage: Send + Sync {
    /// Number of bytes.
    ///
    /// # Errors
    /// Whatever the storage says.
    fn len(&self) -> io::Result<u64>;

    /// Whether there are no bytes.
    ///
    /// # Errors
    /// Whatever the storage says.
    fn is_empty(&self) -> io::Result<bool> {
        Ok(self.len()? == 0)
    }

    /// Reads bytes from `offset` on into `buffer`, and says how many: at least one, unless `buffer` is empty or `offset`
    /// at the end. May read fewer than `buffer` holds.
    ///
    /// # Errors
    /// Whatever the storage says; [`io::ErrorKind::Interrupted`] means that it is worth trying again.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize>;
}

impl Storage for File {
    fn len(&self) -> io::Result<u64> {
        Ok(self.metadata()?.len())
    }

    #[cfg(unix)]
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        std::os::unix::fs::FileExt::read_at(self, buffer, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        std::os::windows::fs::FileExt::seek_read(self, buffer, offset)
    }
}

impl Storage for Vec<u8> {
    fn len(&self) -> io::Result<u64> {
        Ok(self.as_slice().len() as u64)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let rest = usize::try_from(offset).ok().and_then(|offset| self.get(offset..));
        let rest = rest.unwrap_or_default();
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        Ok(count)
    }
}

/// How a read of a given number of bytes ended.
pub(crate) enum ReadEnd {
    Full,
    /// The storage ended after so many bytes.
    Short(usize),
}

/// Fills the buffer, however small the pieces the storage gives.
pub(crate) fn read_full(
    storage: &dyn Storage,
    offset: u64,
    buffer: &mut [u8],
) -> io::Result<ReadEnd> {
    let mut done = 0;
    while done < buffer.len() {
        match storage.read_at(offset + done as u64, &mut buffer[done..]) {
            Ok(0) => return Ok(ReadEnd::Short(done)),
            Ok(count) if count > buffer.len() - done => {
                return Err(io::Error::other("storage read more than asked for"));
            }
            Ok(count) => done += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(ReadEnd::Full)
}
