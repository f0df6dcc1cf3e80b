//! Checkpoints: the state of a long run, as arrays with names in one file.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | the magic number |
//! | 4 | a number that tells the byte order: everything is in the machine's own |
//! | 48 | of each section: its name, padded with zeros (24); bytes per item (8); items (8); a zero (4); a checksum (4) |
//! | … | its items |
//! | 4 | a checksum |
//!
//! Each checksum (CRC-32) is of everything before it, so that parts of different checkpoints do not pass for one. The last
//! section is `end`, and empty. A file that is being written has another name, and takes its own when it is on the disk: a
//! crash at any moment leaves the checkpoint before.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use crate::{Error, Scratch};

const MAGIC: [u8; 8] = *b"XFMSTAT2";
const BYTE_ORDER: u32 = 0x0102_0304;
const END: &str = "end";
/// What is added to the name of a file that is being written.
const UNFINISHED: &str = ".new";
/// Bytes that are written or read at once: they are still in the cache for their checksum.
const PIECE: usize = 256 << 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
struct Head {
    name: [u8; 24],
    item_bytes: u64,
    items: u64,
}

impl Head {
    fn new<T>(name: &str, items: u64) -> Self {
        let mut padded = [0; 24];
        for (to, from) in padded.iter_mut().zip(name.bytes()) {
            *to = from;
        }
        Self { name: padded, item_bytes: size_of::<T>() as u64, items }
    }
}

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It is not such a file, or a damaged one, or from another version of the program.
    #[error("{0} cannot be right")]
    Damaged(&'static str),
    /// It is about another input or other options.
    #[error("it belongs to another input or to other options")]
    Other,
}

/// Writes a checkpoint. Dropped before it is finished, it leaves what was there before.
#[derive(Debug)]
pub struct CheckpointWriter {
    file: BufWriter<File>,
    crc: crc32fast::Hasher,
    bytes: u64,
    scratch: Scratch,
    path: PathBuf,
    is_finished: bool,
}

fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(UNFINISHED);
    name.into()
}

impl CheckpointWriter {
    /// Begins a checkpoint of this name.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub fn create(scratch: &Scratch, name: &str) -> Result<Self, Error> {
        let path = scratch.folder().join(name);
        let file = File::create(unfinished(&path)).map_err(|error| scratch.failed(error))?;
        let mut writer = Self {
            file: BufWriter::new(file),
            crc: crc32fast::Hasher::new(),
            bytes: 0,
            scratch: scratch.clone(),
            path,
            is_finished: false,
        };
        writer.write(&MAGIC)?;
        writer.write(&BYTE_ORDER.to_ne_bytes())?;
        Ok(writer)
    }

    /// Removes a checkpoint, and what may be there of one that was not finished.
    ///
    /// # Errors
    /// When one is there and cannot be removed.
    pub fn remove(scratch: &Scratch, name: &str) -> Result<(), Error> {
        scratch.remove(&format!("{name}{UNFINISHED}"))?;
        scratch.remove(name)
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Adds a section of these items.
    ///
    /// # Errors
    /// When the system refuses, nearly always because the disk is full.
    pub fn put<T: Pod>(&mut self, name: &'static str, items: &[T]) -> Result<(), Error> {
        self.put_all(name, items.len() as u64, std::iter::once(items))
    }

    /// Adds a section of the items in all of these slices, `count` in all.
    ///
    /// # Errors
    /// As [`put`](Self::put).
    ///
    /// # Panics
    /// When there are more or fewer of them.
    pub fn put_all<'a, T: Pod>(
        &mut self,
        name: &'static str,
        count: u64,
        slices: impl IntoIterator<Item = &'a [T]>,
    ) -> Result<(), Error> {
        assert!(name.len() <= 24, "names have up to 24 bytes");
        self.write(bytemuck::bytes_of(&Head::new::<T>(name, count)))?;
        self.write(&[0; 4])?;
        self.write_crc()?;
        let mut left = count;
        for items in slices {
            left = left.checked_sub(items.len() as u64).expect("as many items as were told");
            for piece in bytemuck::cast_slice::<T, u8>(items).chunks(PIECE) {
                self.write(piece)?;
            }
        }
        assert!(left == 0, "as many items as were told");
        self.write_crc()
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.crc.update(bytes);
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes).map_err(|error| self.scratch.failed(error))
    }

    fn write_crc(&mut self) -> Result<(), Error> {
        let crc = self.crc.clone().finalize();
        self.write(&crc.to_ne_bytes())
    }

    /// Completes the checkpoint, which replaces the one before once all of it is on the disk.
    ///
    /// # Errors
    /// As [`put`](Self::put).
    pub fn finish(mut self) -> Result<(), Error> {
        self.put::<u8>(END, &[])?;
        let done = self
            .file
            .flush()
            .and_then(|()| self.file.get_ref().sync_all())
            .and_then(|()| fs::rename(unfinished(&self.path), &self.path));
        done.map_err(|error| self.scratch.failed(error))?;
        self.is_finished = true;
        sync_folder(self.scratch.folder());
        Ok(())
    }
}

/// So that the new name is on the disk too. Where that cannot be had, a crash of the whole system may bring the old one back.
fn sync_folder(folder: &Path) {
    if cfg!(unix) {
        File::open(folder).and_then(|folder| folder.sync_all()).ok();
    }
}

impl Drop for CheckpointWriter {
    fn drop(&mut self) {
        if !self.is_finished {
            // There is nobody to tell, and what failed before is told already.
            fs::remove_file(unfinished(&self.path)).ok();
        }
    }
}

/// Reads a checkpoint section by section, in the order in which they were written.
///
/// What it gives is what was written, or it says that it is not; but whoever wrote it may have been wrong, or wicked.
#[derive(Debug)]
pub struct CheckpointReader {
    file: BufReader<File>,
    crc: crc32fast::Hasher,
    /// Bytes up to the end of the file.
    left: u64,
    /// The section that is being read, and the bytes of it that are still to come.
    section: (&'static str, u64),
}

impl CheckpointReader {
    /// Opens the checkpoint of this name; `None` where there is none.
    ///
    /// # Errors
    /// When it cannot be read or is none.
    pub fn open(scratch: &Scratch, name: &str) -> Result<Option<Self>, CheckpointError> {
        let file = match File::open(scratch.folder().join(name)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            file => file?,
        };
        let left = file.metadata()?.len();
        let mut reader = Self {
            file: BufReader::new(file),
            crc: crc32fast::Hasher::new(),
            left,
            section: ("the beginning", 0),
        };
        let (mut magic, mut byte_order) = ([0; 8], [0; 4]);
        reader.read(&mut magic)?;
        reader.read(&mut byte_order)?;
        if magic != MAGIC || byte_order != BYTE_ORDER.to_ne_bytes() {
            return Err(reader.damaged());
        }
        Ok(Some(reader))
    }

    fn damaged(&self) -> CheckpointError {
        CheckpointError::Damaged(self.section.0)
    }

    /// Reads bytes that are covered by a later checksum.
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), CheckpointError> {
        self.left = self.left.checked_sub(bytes.len() as u64).ok_or_else(|| self.damaged())?;
        for piece in bytes.chunks_mut(PIECE) {
            self.file.read_exact(piece)?;
            self.crc.update(piece);
        }
        Ok(())
    }

    fn check_crc(&mut self) -> Result<(), CheckpointError> {
        let expected = self.crc.clone().finalize().to_ne_bytes();
        let mut found = [0; 4];
        self.read(&mut found)?;
        if found == expected { Ok(()) } else { Err(self.damaged()) }
    }

    /// Begins the next section, which has to be this one with no more than `most` items. Returns how many there are; no more
    /// than the file is long.
    ///
    /// # Errors
    /// When it is another one, or damaged.
    pub fn begin<T: Pod>(&mut self, name: &'static str, most: u64) -> Result<u64, CheckpointError> {
        if self.section.1 != 0 {
            return Err(self.damaged());
        }
        self.section = (name, 0);
        let (mut head, mut zero) = (Head::zeroed(), [0; 4]);
        self.read(bytemuck::bytes_of_mut(&mut head))?;
        self.read(&mut zero)?;
        self.check_crc()?;
        let bytes = head.items.checked_mul(head.item_bytes).filter(|&bytes| bytes <= self.left);
        let (Some(bytes), true) = (bytes, head == Head::new::<T>(name, head.items)) else {
            return Err(self.damaged());
        };
        if head.items > most {
            return Err(self.damaged());
        }
        self.section.1 = bytes;
        Ok(head.items)
    }

    /// The next items of the section that was begun.
    ///
    /// # Errors
    /// When there are fewer, or the file cannot be read.
    pub fn read_items<T: Pod>(&mut self, items: &mut [T]) -> Result<(), CheckpointError> {
        let bytes = bytemuck::cast_slice_mut::<T, u8>(items);
        let left = self.section.1.checked_sub(bytes.len() as u64);
        self.section.1 = left.ok_or_else(|| self.damaged())?;
        self.read(bytes)
    }

    /// Ends the section that was begun, all items of which have been read.
    ///
    /// # Errors
    /// When it is damaged, or there are more.
    pub fn end(&mut self) -> Result<(), CheckpointError> {
        if self.section.1 != 0 {
            return Err(self.damaged());
        }
        self.check_crc()
    }

    /// Reads the next section, which has to be this one with no more than `most` items, into `items` instead of what was
    /// there.
    ///
    /// # Errors
    /// When it is another one, or damaged.
    pub fn take<T: Pod>(
        &mut self,
        name: &'static str,
        most: u64,
        items: &mut Vec<T>,
    ) -> Result<(), CheckpointError> {
        let count = self.begin::<T>(name, most)?;
        let count = usize::try_from(count).map_err(|_| self.damaged())?;
        items.clear();
        items.reserve_exact(count);
        items.resize(count, T::zeroed());
        self.read_items(items)?;
        self.end()
    }

    /// Reads a section of one item.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn take_one<T: Pod>(&mut self, name: &'static str) -> Result<T, CheckpointError> {
        let mut item = T::zeroed();
        self.begin::<T>(name, 1)?;
        self.read_items(std::slice::from_mut(&mut item))?;
        self.end()?;
        Ok(item)
    }

    /// Makes sure that this is the end.
    ///
    /// # Errors
    /// When there is more, or it is damaged.
    pub fn finish(mut self) -> Result<(), CheckpointError> {
        self.begin::<u8>(END, 0)?;
        self.end()?;
        if self.left == 0 { Ok(()) } else { Err(self.damaged()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(scratch: &Scratch, items: &[[u32; 3]]) {
        let mut writer = CheckpointWriter::create(scratch, "state").unwrap();
        writer.put("one", &[7u64]).unwrap();
        writer.put("triples", items).unwrap();
        let halves = items.split_at(items.len() / 2);
        writer.put_all("again", items.len() as u64, [halves.0, halves.1]).unwrap();
        let bytes = writer.bytes();
        writer.finish().unwrap();
        let length = fs::metadata(scratch.folder().join("state")).unwrap().len();
        assert!(bytes < length && length < bytes + 100);
    }

    fn read(scratch: &Scratch) -> Result<Vec<[u32; 3]>, CheckpointError> {
        let mut reader = CheckpointReader::open(scratch, "state")?.expect("it is there");
        assert_eq!(reader.take_one::<u64>("one")?, 7);
        let (mut items, mut again) = (Vec::new(), Vec::new());
        reader.take("triples", 1000, &mut items)?;
        let count = reader.begin::<[u32; 3]>("again", 1000)?;
        for _ in 0..count {
            let mut item = [[0; 3]];
            reader.read_items(&mut item)?;
            again.extend(item);
        }
        reader.end()?;
        reader.finish()?;
        assert_eq!(items, again);
        Ok(items)
    }

    #[test]
    fn what_was_written_comes_back_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        assert!(CheckpointReader::open(&scratch, "state").unwrap().is_none());
        let items: Vec<[u32; 3]> = (0..20).map(|i| [i, i * i, 7 * i]).collect();
        write(&scratch, &items);
        assert_eq!(read(&scratch).unwrap(), items);
        let path = folder.path().join("state");
        let bytes = fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            fs::write(&path, &bytes[..at]).unwrap();
            assert!(read(&scratch).is_err(), "{at} of {} bytes", bytes.len());
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (at % 8);
            fs::write(&path, changed).unwrap();
            assert!(read(&scratch).is_err(), "byte {at}");
        }
        fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
        assert!(read(&scratch).is_err(), "one byte more");
        // Sections of another checkpoint.
        write(&scratch, &items[1..]);
        let other = fs::read(&path).unwrap();
        let mixed = [&bytes[..bytes.len() - 60], &other[other.len() - 60..]].concat();
        fs::write(&path, mixed).unwrap();
        assert!(read(&scratch).is_err());
    }

    #[test]
    fn sections_are_what_was_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        write(&scratch, &[[1; 3]; 5]);
        let open = || CheckpointReader::open(&scratch, "state").unwrap().unwrap();
        assert!(open().begin::<u64>("other", 9).is_err());
        assert!(open().begin::<[u32; 3]>("one", 9).is_err());
        let mut items = Vec::<[u32; 3]>::new();
        let mut reader = open();
        reader.take_one::<u64>("one").unwrap();
        let error = reader.take("triples", 4, &mut items).unwrap_err();
        assert_eq!(error.to_string(), "triples cannot be right");
        let mut reader = open();
        reader.begin::<u64>("one", 1).unwrap();
        assert!(reader.end().is_err(), "there is an item to read");
        assert!(open().begin::<u64>("one", 1).is_ok_and(|items| items == 1));
        assert!(open().finish().is_err());
    }

    #[test]
    fn the_one_before_stays_until_the_new_one_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        write(&scratch, &[[1; 3]]);
        let mut writer = CheckpointWriter::create(&scratch, "state").unwrap();
        writer.put("one", &[8u64]).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        drop(writer);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(read(&scratch).unwrap(), [[1; 3]]);
        CheckpointWriter::remove(&scratch, "state").unwrap();
        CheckpointWriter::remove(&scratch, "state").unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
