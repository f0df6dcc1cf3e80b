//! Scratch files: few and large, and without a name, so that nothing remains of them however a run ends.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use bytemuck::Pod;

use crate::Error;

/// A folder for scratch files.
#[derive(Debug, Clone)]
pub(crate) struct Scratch {
    folder: PathBuf,
}

impl Scratch {
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// A new file, which goes when it is dropped or the process ends.
    pub(crate) fn file<T: Pod>(&self) -> Result<ScratchFile<T>, Error> {
        let file = tempfile::tempfile_in(&self.folder).map_err(|error| self.failed(error))?;
        Ok(ScratchFile { file, cursor: 0, scratch: self.clone(), items: PhantomData })
    }

    /// Makes sure, as far as the system tells, that this many bytes are free.
    pub(crate) fn require(&self, bytes: u64) -> Result<(), Error> {
        match free_bytes(&self.folder) {
            Some(free) if free < bytes => {
                let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
                let problem = format!("{} MiB needed, {} MiB free", mebibytes(bytes), free >> 20);
                Err(self.failed(io::Error::new(io::ErrorKind::StorageFull, problem)))
            }
            _ => Ok(()),
        }
    }

    fn failed(&self, source: io::Error) -> Error {
        Error::Scratch { folder: self.folder.display().to_string(), source }
    }
}

/// What an ordinary user may still write there; `None` where the system does not tell.
#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let there = rustix::fs::statvfs(folder).ok()?;
    there.f_bavail.checked_mul(there.f_frsize)
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

/// A file of items of one kind, by number.
#[derive(Debug)]
pub(crate) struct ScratchFile<T> {
    file: File,
    /// Where the file's own cursor is, in bytes.
    cursor: u64,
    scratch: Scratch,
    items: PhantomData<T>,
}

impl<T: Pod> ScratchFile<T> {
    /// Writes items from number `first` on.
    pub(crate) fn write(&mut self, first: u64, items: &[T]) -> Result<(), Error> {
        self.at(first, size_of_val(items), |file| file.write_all(bytemuck::cast_slice(items)))
    }

    /// Reads items from number `first` on, which have to be there.
    pub(crate) fn read(&mut self, first: u64, items: &mut [T]) -> Result<(), Error> {
        let bytes = size_of_val(items);
        self.at(first, bytes, |file| file.read_exact(bytemuck::cast_slice_mut(items)))
    }

    /// Does something to the file that moves the cursor by so many bytes from item `first`.
    fn at(
        &mut self,
        first: u64,
        bytes: usize,
        act: impl FnOnce(&mut File) -> io::Result<()>,
    ) -> Result<(), Error> {
        let start = first * size_of::<T>() as u64;
        let moved = match self.cursor == start {
            true => Ok(start),
            false => self.file.seek(SeekFrom::Start(start)),
        };
        // Wherever it is after an error.
        self.cursor = u64::MAX;
        moved.and_then(|_| act(&mut self.file)).map_err(|error| self.scratch.failed(error))?;
        self.cursor = start + bytes as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_found_again_and_no_file_remains() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = Scratch::new(folder.path()).file::<[u32; 3]>().unwrap();
        file.write(0, &[[0; 3]; 4]).unwrap();
        file.write(1, &[[1; 3], [2; 3]]).unwrap();
        file.write(4, &[[4; 3]]).unwrap();
        let mut back = [[9; 3]; 5];
        file.read(0, &mut back).unwrap();
        assert_eq!(back.map(|item| item[0]), [0, 1, 2, 0, 4]);
        file.read(3, &mut back[..2]).unwrap();
        assert_eq!(back[1], [4; 3]);
        assert!(file.read(4, &mut back[..2]).is_err(), "beyond the end");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "it has no name");
    }

    #[test]
    fn errors_name_the_folder() {
        let scratch = Scratch::new("/no/such/folder".as_ref());
        let message = scratch.file::<u8>().unwrap_err().to_string();
        assert!(message.starts_with("scratch file in /no/such/folder: "), "{message}");
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        scratch.require(1).unwrap();
        if cfg!(unix) {
            let message = scratch.require(u64::MAX / 2).unwrap_err().to_string();
            assert!(message.contains("MiB needed, "), "{message}");
        }
    }
}
