//! Chunks of memory that go to one file when there are too many.

use crate::{Error, Scratch, ScratchFile};

/// How much a [`Store`] holds in memory.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StoreOptions {
    /// Size of a chunk in bytes: what is written and read at once. Rounded to a multiple of 4; at least 64. Default
    /// 256 KiB.
    pub chunk_bytes: usize,
    /// Bytes of full chunks that stay in memory. Besides these, every spool that is not empty takes one chunk, every
    /// [`crate::Piece`] another, and the store itself up to two. Default 32 MiB.
    pub memory_bytes: u64,
}

impl Default for StoreOptions {
    fn default() -> Self {
        Self { chunk_bytes: 256 << 10, memory_bytes: 32 << 20 }
    }
}

/// Chunks whose memory is not given back to the system even if there should be none.
const MIN_SPARE: usize = 2;

/// Chunks in memory as long as they fit, and in one scratch file beyond. The file is made when the first chunk has to go
/// there; where chunks are taken out of it others take their place, so that it is never longer than what was in it at once.
#[derive(Debug)]
pub struct Store {
    scratch: Scratch,
    chunk_words: usize,
    max_held: u64,
    /// Full chunks in memory, by number; the numbers of those that are gone are used again.
    held: Vec<Buffer>,
    free_held: Vec<u32>,
    /// Memory for chunks that is not in use.
    spare: Vec<Buffer>,
    file: Option<ScratchFile<u32>>,
    /// Whether the file has a name and outlives the store; then nothing in it is overwritten, and all of it is checked.
    kept: bool,
    /// Places in the file that hold nothing any more.
    free: Vec<u32>,
    num_places: u32,
}

/// A chunk's memory. Four bytes are the strictest alignment of what can be in it.
pub(crate) type Buffer = Vec<u32>;

/// Where a full chunk is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// In memory, under this number.
    Memory(u32),
    /// In the file.
    File(FilePlace),
}

/// Which chunk of the file, and its checksum where the file is kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilePlace {
    pub number: u32,
    pub crc: u32,
}

impl Store {
    /// A store with its file in this folder.
    pub fn new(scratch: &Scratch, options: &StoreOptions) -> Self {
        let chunk_words = (options.chunk_bytes / 4).max(16);
        Self {
            scratch: scratch.clone(),
            chunk_words,
            max_held: options.memory_bytes / (4 * chunk_words as u64),
            held: Vec::new(),
            free_held: Vec::new(),
            spare: Vec::new(),
            file: None,
            kept: false,
            free: Vec::new(),
            num_places: 0,
        }
    }

    /// A store all of whose chunks go to a new file of this name, which stays after it; see [`crate::Spool::save`].
    ///
    /// # Errors
    /// As [`Scratch::new_kept_file`].
    pub fn new_kept(scratch: &Scratch, name: &str, chunk_bytes: usize) -> Result<Self, Error> {
        let mut store = Self::new(scratch, &StoreOptions { chunk_bytes, memory_bytes: 0 });
        store.file = Some(scratch.new_kept_file(name)?);
        store.kept = true;
        Ok(store)
    }

    /// The store that an earlier run has left under this name, with chunks of the same size, of which it had so many; what was
    /// written after these is cut off.
    ///
    /// # Errors
    /// As [`Scratch::kept_file`], and when there are fewer.
    pub fn open_kept(
        scratch: &Scratch,
        name: &str,
        chunk_bytes: usize,
        num_chunks: u32,
    ) -> Result<Self, Error> {
        let mut store = Self::new(scratch, &StoreOptions { chunk_bytes, memory_bytes: 0 });
        let mut file = scratch.kept_file::<u32>(name)?;
        file.truncate(u64::from(num_chunks) * store.chunk_words as u64)
            .map_err(|_| store.inconsistent())?;
        store.file = Some(file);
        store.kept = true;
        store.num_places = num_chunks;
        Ok(store)
    }

    /// Size of a chunk in bytes.
    pub fn chunk_bytes(&self) -> usize {
        4 * self.chunk_words
    }

    /// Chunks that the file has had at most.
    pub fn num_file_chunks(&self) -> u32 {
        self.num_places
    }

    /// Length that the file has had at most, in bytes.
    pub fn peak_file_bytes(&self) -> u64 {
        u64::from(self.num_places) * self.chunk_bytes() as u64
    }

    /// Bytes of full chunks that are in memory now.
    pub fn held_bytes(&self) -> u64 {
        self.num_held() * self.chunk_bytes() as u64
    }

    /// Waits until all that was written is on the disk.
    ///
    /// # Errors
    /// When the system could not write it.
    pub fn sync(&self) -> Result<(), Error> {
        self.file.as_ref().map_or(Ok(()), ScratchFile::sync)
    }

    /// Number of full chunks in memory.
    fn num_held(&self) -> u64 {
        (self.held.len() - self.free_held.len()) as u64
    }

    /// From now on so many bytes of full chunks may be in memory. Those that are stay.
    pub fn set_memory_bytes(&mut self, memory_bytes: u64) {
        self.max_held = if self.kept { 0 } else { memory_bytes / self.chunk_bytes() as u64 };
    }

    /// Memory for one more chunk.
    pub(crate) fn buffer(&mut self) -> Buffer {
        self.spare.pop().unwrap_or_else(|| vec![0; self.chunk_words])
    }

    /// Takes memory back.
    pub(crate) fn give_back(&mut self, buffer: Buffer) {
        let spare = self.spare.len();
        if spare < MIN_SPARE || self.num_held() + (spare as u64) < self.max_held {
            self.spare.push(buffer);
        }
    }

    /// Puts a full chunk away. Its memory is either kept or may be used again.
    pub(crate) fn put(&mut self, buffer: Buffer) -> Result<(Place, Option<Buffer>), Error> {
        if self.num_held() < self.max_held && self.held.len() < u32::MAX as usize {
            let number = match self.free_held.pop() {
                Some(number) => {
                    self.held[number as usize] = buffer;
                    number
                }
                None => {
                    self.held.push(buffer);
                    self.held.len() as u32 - 1
                }
            };
            let spare = self.spare.len();
            if spare > MIN_SPARE && self.num_held() + spare as u64 > self.max_held {
                drop(self.spare.pop());
            }
            return Ok((Place::Memory(number), None));
        }
        let place = self.write(&buffer)?;
        Ok((Place::File(place), Some(buffer)))
    }

    /// Writes a chunk to the file.
    pub(crate) fn write(&mut self, buffer: &[u32]) -> Result<FilePlace, Error> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(self.scratch.file()?),
        };
        let number = match self.free.pop() {
            Some(number) => number,
            None => {
                let number = self.num_places;
                let full = || std::io::Error::other("more chunks than have numbers");
                self.num_places =
                    number.checked_add(1).ok_or_else(|| self.scratch.failed(full()))?;
                number
            }
        };
        file.write(u64::from(number) * self.chunk_words as u64, buffer)?;
        let crc = if self.kept { crc32fast::hash(bytemuck::cast_slice(buffer)) } else { 0 };
        Ok(FilePlace { number, crc })
    }

    /// Takes a chunk out again.
    pub(crate) fn take(&mut self, place: Place) -> Result<Buffer, Error> {
        match place {
            Place::Memory(number) => {
                self.free_held.push(number);
                Ok(std::mem::take(&mut self.held[number as usize]))
            }
            Place::File(FilePlace { number, crc }) => {
                let mut buffer = self.buffer();
                let first = u64::from(number) * self.chunk_words as u64;
                let Some(file) = &mut self.file else {
                    return Err(self.scratch.failed(std::io::Error::other("there is none")));
                };
                file.read(first, &mut buffer)?;
                if !self.kept {
                    self.free.push(number);
                } else if crc32fast::hash(bytemuck::cast_slice(&buffer)) != crc {
                    return Err(self.inconsistent());
                }
                Ok(buffer)
            }
        }
    }

    /// Reads a chunk, and leaves it where it is.
    pub(crate) fn read(&mut self, place: Place) -> Result<Buffer, Error> {
        let mut buffer = self.buffer();
        match place {
            Place::Memory(number) => buffer.copy_from_slice(&self.held[number as usize]),
            Place::File(FilePlace { number, crc }) => {
                let first = u64::from(number) * self.chunk_words as u64;
                let Some(file) = &mut self.file else {
                    return Err(self.scratch.failed(std::io::Error::other("there is none")));
                };
                file.read(first, &mut buffer)?;
                if self.kept && crc32fast::hash(bytemuck::cast_slice(&buffer)) != crc {
                    return Err(self.inconsistent());
                }
            }
        }
        Ok(buffer)
    }

    /// That a kept file does not hold what was saved.
    pub(crate) fn inconsistent(&self) -> Error {
        let damaged = "what an earlier run wrote is not there any more; begin again";
        self.scratch.failed(std::io::Error::new(std::io::ErrorKind::InvalidData, damaged))
    }

    /// Tells the system that a chunk will be taken soon.
    pub(crate) fn will_take(&self, place: Place) {
        if let (Place::File(place), Some(file)) = (place, &self.file) {
            file.will_read(u64::from(place.number) * self.chunk_words as u64, self.chunk_words);
        }
    }
}
