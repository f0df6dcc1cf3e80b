//! Scratch files: few and large, and without a name, so that nothing remains of them however a run ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use bytemuck::Pod;

use crate::Error;

/// A folder for scratch files.
#[derive(Debug, Clone)]
pub struct Scratch {
    folder: PathBuf,
}

impl Scratch {
    /// Scratch files in this folder, which has to be there.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A new file, which goes when it is dropped or the process ends.
    ///
    /// # Errors
    /// When the folder is not there or must not be written to.
    pub fn file<T: Pod>(&self) -> Result<ScratchFile<T>, Error> {
        self.wrap(tempfile::tempfile_in(&self.folder))
    }

    /// A new file with a name, which stays until it is removed, so that a later run can go on with it.
    ///
    /// As long as it is open, no other run can open it.
    ///
    /// # Errors
    /// As [`file`](Self::file), and when there is a file of this name.
    pub fn new_kept_file<T: Pod>(&self, name: &str) -> Result<ScratchFile<T>, Error> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true);
        self.wrap(options.open(self.folder.join(name)).and_then(|file| alone(file, name)))
    }

    /// The file with a name that an earlier run left. As long as it is open, no other run can open it.
    ///
    /// # Errors
    /// When it is not there, must not be read, or is open in another run.
    pub fn kept_file<T: Pod>(&self, name: &str) -> Result<ScratchFile<T>, Error> {
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        self.wrap(options.open(self.folder.join(name)).and_then(|file| alone(file, name)))
    }

    /// Removes the file of this name, if there is one.
    ///
    /// # Errors
    /// When it cannot be removed.
    pub fn remove(&self, name: &str) -> Result<(), Error> {
        match std::fs::remove_file(self.folder.join(name)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(self.failed(error)),
            _ => Ok(()),
        }
    }

    fn wrap<T>(&self, file: io::Result<File>) -> Result<ScratchFile<T>, Error> {
        let file = file.map_err(|error| self.failed(error))?;
        Ok(ScratchFile { file, cursor: 0, scratch: self.clone(), items: PhantomData })
    }

    /// Makes sure, as far as the system tells, that this many bytes are free.
    ///
    /// # Errors
    /// When they are not.
    pub fn require(&self, bytes: u64) -> Result<(), Error> {
        match self.free_bytes() {
            Some(free) if free < bytes => {
                let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
                let problem = format!("{} MiB needed, {} MiB free", mebibytes(bytes), free >> 20);
                Err(self.failed(io::Error::new(io::ErrorKind::StorageFull, problem)))
            }
            _ => Ok(()),
        }
    }

    /// Bytes that may still be written there; `None` where the system does not tell.
    pub fn free_bytes(&self) -> Option<u64> {
        free_bytes(&self.folder)
    }

    /// An error about this folder.
    pub fn failed(&self, source: io::Error) -> Error {
        Error { folder: self.folder.clone(), source }
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

/// Locks a file, as far as the system knows locks; they go with the process, however it ends.
fn alone(file: File, name: &str) -> io::Result<File> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(io::Error::other(format!("{name} is in use by another run")))
        }
        _ => Ok(file),
    }
}

/// A hint: where it is refused nothing is lost but time.
#[cfg(target_os = "linux")]
fn advise(file: &File, start: u64, bytes: u64) {
    let advice = rustix::fs::Advice::WillNeed;
    rustix::fs::fadvise(file, start, std::num::NonZeroU64::new(bytes), advice).ok();
}

#[cfg(not(target_os = "linux"))]
fn advise(_file: &File, _start: u64, _bytes: u64) {}

/// A file of items of one kind, by number.
#[derive(Debug)]
pub struct ScratchFile<T> {
    file: File,
    /// Where the file's own cursor is, in bytes.
    cursor: u64,
    scratch: Scratch,
    items: PhantomData<T>,
}

impl<T: Pod> ScratchFile<T> {
    /// Writes items from number `first` on.
    ///
    /// # Errors
    /// When the system refuses, nearly always because the disk is full.
    pub fn write(&mut self, first: u64, items: &[T]) -> Result<(), Error> {
        self.at(first, size_of_val(items), |file| file.write_all(bytemuck::cast_slice(items)))
    }

    /// Reads items from number `first` on, which have to be there.
    ///
    /// # Errors
    /// When the system refuses or the file ends before.
    pub fn read(&mut self, first: u64, items: &mut [T]) -> Result<(), Error> {
        let bytes = size_of_val(items);
        self.at(first, bytes, |file| file.read_exact(bytemuck::cast_slice_mut(items)))
    }

    /// Tells the system, where it listens, that these items will be read soon.
    pub fn will_read(&self, first: u64, count: usize) {
        let size = size_of::<T>() as u64;
        advise(&self.file, first * size, count as u64 * size);
    }

    /// Waits until all that was written is on the disk.
    ///
    /// # Errors
    /// When the system could not write it.
    pub fn sync(&self) -> Result<(), Error> {
        self.file.sync_data().map_err(|error| self.scratch.failed(error))
    }

    /// Cuts the file off after so many items, which have to be there.
    ///
    /// # Errors
    /// When there are fewer, or the system refuses.
    pub fn truncate(&mut self, items: u64) -> Result<(), Error> {
        let bytes = items.saturating_mul(size_of::<T>() as u64);
        let cut = self.file.metadata().and_then(|there| match there.len() < bytes {
            true => Err(io::ErrorKind::UnexpectedEof.into()),
            false => self.file.set_len(bytes),
        });
        cut.map_err(|error| self.scratch.failed(error))
    }

    /// The folder it is in.
    pub fn scratch(&self) -> &Scratch {
        &self.scratch
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
        file.will_read(0, 5);
        file.read(0, &mut back).unwrap();
        assert_eq!(back.map(|item| item[0]), [0, 1, 2, 0, 4]);
        file.read(3, &mut back[..2]).unwrap();
        assert_eq!(back[1], [4; 3]);
        assert!(file.read(4, &mut back[..2]).is_err(), "beyond the end");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "it has no name");
    }

    #[test]
    fn a_kept_file_is_found_again_and_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        assert!(scratch.kept_file::<u32>("a.log").is_err());
        let mut file = scratch.new_kept_file::<u32>("a.log").unwrap();
        file.write(0, &[7, 8]).unwrap();
        file.sync().unwrap();
        let message = scratch.kept_file::<u32>("a.log").unwrap_err().to_string();
        assert!(message.contains("in use"), "{message}");
        drop(file);
        let message = scratch.new_kept_file::<u32>("a.log").unwrap_err().to_string();
        assert!(message.contains("exists"), "{message}");
        let mut back = [0; 2];
        let mut file = scratch.kept_file("a.log").unwrap();
        file.read(0, &mut back).unwrap();
        assert_eq!(back, [7, 8]);
        assert!(file.truncate(3).is_err(), "there are two");
        file.truncate(1).unwrap();
        assert!(file.read(0, &mut back).is_err());
    }

    #[test]
    fn errors_name_the_folder() {
        let scratch = Scratch::new("/no/such/folder");
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
