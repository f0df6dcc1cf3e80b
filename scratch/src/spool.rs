//! A row of records: appended to, then taken away from either end.

use std::marker::PhantomData;

use bytemuck::{Pod, Zeroable};

use crate::places::{Entry, Places};
use crate::store::{Buffer, FilePlace, Place};
use crate::{Error, Store};

/// Bytes that the system is asked to read ahead.
const AHEAD_BYTES: usize = 4 << 20;

/// Records of one kind, in the chunks of a [`Store`]; always of the same one.
///
/// Dropping a spool that is not empty loses the room that its chunks take in the store.
///
/// # Complexity
/// Memory: one chunk for the last records, and 1 KiB for every 64 chunks before.
#[derive(Debug)]
pub struct Spool<T> {
    /// The chunks that are full or were saved.
    chunks: Places,
    tail: Option<Buffer>,
    tail_len: usize,
    /// Records of a full chunk.
    capacity: usize,
    /// Chunks that the system is asked to read ahead.
    ahead: usize,
    /// Whether it was asked for those at the end that is taken from.
    asked: bool,
    len: u64,
    records: PhantomData<T>,
}

/// Some records that follow each other, taken from a spool.
#[derive(Debug)]
pub struct Piece<T> {
    buffer: Option<Buffer>,
    len: usize,
    records: PhantomData<T>,
}

impl<T> Default for Piece<T> {
    fn default() -> Self {
        Self { buffer: None, len: 0, records: PhantomData }
    }
}

impl<T: Pod> Piece<T> {
    /// The records, in the order in which they were appended.
    #[inline]
    pub fn items(&self) -> &[T] {
        match &self.buffer {
            Some(buffer) => bytemuck::cast_slice(&buffer[..self.len * Spool::<T>::WORDS]),
            None => &[],
        }
    }

    /// Gives the memory back to the store.
    pub fn clear(&mut self, store: &mut Store) {
        self.len = 0;
        if let Some(buffer) = self.buffer.take() {
            store.give_back(buffer);
        }
    }
}

/// A chunk of a spool in a kept file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SavedChunk {
    /// Which chunk of the file.
    pub number: u32,
    /// Records in it.
    pub records: u32,
    /// Its checksum, with what lies beyond the records.
    pub crc: u32,
}

/// All that is needed to find the records of a spool in a kept file again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SavedSpool {
    /// Its chunks, in order.
    pub chunks: Vec<SavedChunk>,
}

impl<T: Pod> Spool<T> {
    /// 32-bit words of a record.
    const WORDS: usize = {
        assert!(size_of::<T>() > 0 && size_of::<T>().is_multiple_of(4) && align_of::<T>() <= 4);
        size_of::<T>() / 4
    };

    /// An empty spool in this store.
    ///
    /// # Panics
    /// When a chunk of the store does not hold one record.
    pub fn new(store: &Store) -> Self {
        let capacity = store.chunk_bytes() / size_of::<T>();
        assert!(capacity > 0, "a chunk of {} bytes holds no record", store.chunk_bytes());
        Self {
            chunks: Places::default(),
            tail: None,
            tail_len: 0,
            capacity,
            ahead: (AHEAD_BYTES / store.chunk_bytes()).max(1),
            asked: false,
            len: 0,
            records: PhantomData,
        }
    }

    /// Number of records.
    #[inline]
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there is none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Appends a record.
    ///
    /// # Errors
    /// When the scratch file cannot be made or written.
    #[inline]
    pub fn push(&mut self, store: &mut Store, record: &T) -> Result<(), Error> {
        if self.tail_len == self.capacity || self.tail.is_none() {
            self.make_room(store)?;
        }
        if let Some(tail) = &mut self.tail {
            let at = self.tail_len * Self::WORDS;
            let words = bytemuck::cast_slice(std::slice::from_ref(record));
            tail[at..at + Self::WORDS].copy_from_slice(words);
            self.tail_len += 1;
            self.len += 1;
        }
        Ok(())
    }

    #[cold]
    fn make_room(&mut self, store: &mut Store) -> Result<(), Error> {
        let mut memory = None;
        if let Some(full) = self.tail.take() {
            let (place, left) = store.put(full)?;
            self.chunks.push_back(Entry { place, records: self.tail_len as u32 });
            memory = left;
        }
        self.tail_len = 0;
        self.tail = Some(memory.unwrap_or_else(|| store.buffer()));
        Ok(())
    }

    /// Takes the last records away, into `piece` instead of what was there. `false` means that there are none.
    ///
    /// # Errors
    /// When the scratch file cannot be read.
    pub fn take_last(&mut self, store: &mut Store, piece: &mut Piece<T>) -> Result<bool, Error> {
        piece.clear(store);
        if let Some(tail) = self.tail.take() {
            self.hand_over(tail, self.tail_len, piece);
            self.tail_len = 0;
            return Ok(true);
        }
        let Some(entry) = self.chunks.pop_back() else { return Ok(false) };
        let len = self.chunks.len();
        self.ask(store, |ahead| len.checked_sub(ahead));
        self.take(store, entry, piece)?;
        Ok(true)
    }

    /// Takes the first records away, into `piece` instead of what was there. `false` means that there are none.
    ///
    /// # Errors
    /// When the scratch file cannot be read.
    pub fn take_first(&mut self, store: &mut Store, piece: &mut Piece<T>) -> Result<bool, Error> {
        piece.clear(store);
        if let Some(entry) = self.chunks.pop_front() {
            self.ask(store, |ahead| Some(ahead - 1));
            self.take(store, entry, piece)?;
            return Ok(true);
        }
        let Some(tail) = self.tail.take() else { return Ok(false) };
        self.hand_over(tail, self.tail_len, piece);
        self.tail_len = 0;
        Ok(true)
    }

    /// Reads the records that [`take_last`](Self::take_last) would take after `nth` times, into `piece` instead of what was
    /// there, and leaves them where they are. `false` means that there are none.
    ///
    /// # Errors
    /// When the scratch file cannot be read.
    pub fn read_last(
        &self,
        store: &mut Store,
        nth: usize,
        piece: &mut Piece<T>,
    ) -> Result<bool, Error> {
        piece.clear(store);
        let mut nth = nth;
        if let Some(tail) = &self.tail {
            if nth == 0 {
                let mut buffer = store.buffer();
                buffer.copy_from_slice(tail);
                (piece.buffer, piece.len) = (Some(buffer), self.tail_len);
                return Ok(true);
            }
            nth -= 1;
        }
        let index = self.chunks.len().checked_sub(nth + 1);
        let Some((index, entry)) = index.and_then(|at| Some((at, self.chunks.get(at)?))) else {
            return Ok(false);
        };
        if let Some(ahead) = index.checked_sub(self.ahead).and_then(|at| self.chunks.get(at)) {
            store.will_take(ahead.place);
        }
        (piece.buffer, piece.len) = (Some(store.read(entry.place)?), entry.records as usize);
        Ok(true)
    }

    /// Has the system read ahead: all of the first ones once, then one more for each that is taken. `nth` is the place of the
    /// chunk that will be taken then, 1 for the next one.
    fn ask(&mut self, store: &Store, nth: impl Fn(usize) -> Option<usize>) {
        let first = if self.asked { self.ahead } else { 1 };
        self.asked = true;
        for entry in (first..=self.ahead).filter_map(|ahead| self.chunks.get(nth(ahead)?)) {
            store.will_take(entry.place);
        }
    }

    fn take(&mut self, store: &mut Store, entry: Entry, piece: &mut Piece<T>) -> Result<(), Error> {
        let buffer = store.take(entry.place)?;
        self.hand_over(buffer, entry.records as usize, piece);
        Ok(())
    }

    fn hand_over(&mut self, buffer: Buffer, len: usize, piece: &mut Piece<T>) {
        piece.buffer = Some(buffer);
        piece.len = len;
        self.len -= len as u64;
    }

    /// Writes to the kept file of the store what is not there yet, and says where all of it is. More may be appended after;
    /// what was saved stays as it is.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// When the store is not a kept one.
    pub fn save(&mut self, store: &mut Store) -> Result<SavedSpool, Error> {
        if let Some(tail) = self.tail.take() {
            let place = store.write(&tail)?;
            let records = self.tail_len as u32;
            self.chunks.push_back(Entry { place: Place::File(place), records });
            self.tail_len = 0;
            store.give_back(tail);
        }
        let saved = |entry: Entry| match entry.place {
            Place::File(FilePlace { number, crc }) => {
                SavedChunk { number, records: entry.records, crc }
            }
            Place::Memory(_) => panic!("a spool is saved whose store is not kept"),
        };
        Ok(SavedSpool { chunks: self.chunks.iter().map(saved).collect() })
    }

    /// The spool that was saved, in the kept store that it was saved to.
    ///
    /// # Errors
    /// When no such spool can have been in the store.
    pub fn restore(store: &Store, saved: &SavedSpool) -> Result<Self, Error> {
        let mut spool = Self::new(store);
        for chunk in &saved.chunks {
            if chunk.number >= store.num_file_chunks() || chunk.records as usize > spool.capacity {
                return Err(store.inconsistent());
            }
            let place = FilePlace { number: chunk.number, crc: chunk.crc };
            spool.chunks.push_back(Entry { place: Place::File(place), records: chunk.records });
            spool.len += u64::from(chunk.records);
        }
        Ok(spool)
    }

    /// Reads all that is in the file once, and makes sure that it is what was saved.
    ///
    /// # Errors
    /// When it is not, or cannot be read.
    pub fn check(&mut self, store: &mut Store) -> Result<(), Error> {
        for entry in self.chunks.iter().filter(|entry| matches!(entry.place, Place::File(_))) {
            let buffer = store.take(entry.place)?;
            store.give_back(buffer);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use std::collections::VecDeque;

    use super::*;
    use crate::{Scratch, StoreOptions};

    fn store(folder: &std::path::Path, memory_bytes: u64) -> Store {
        Store::new(&Scratch::new(folder), &StoreOptions { chunk_bytes: 64, memory_bytes })
    }

    #[derive(Clone, Debug)]
    enum Step {
        Push(u8),
        First,
        Last,
        Read(usize),
    }

    fn steps() -> impl Strategy<Value = Vec<(usize, Step)>> {
        let step = prop_oneof![
            4 => (0..60u8).prop_map(Step::Push),
            1 => Just(Step::First),
            1 => Just(Step::Last),
            1 => (0..4usize).prop_map(Step::Read),
        ];
        prop::collection::vec((0..3usize, step), 0..60)
    }

    proptest! {
        #[test]
        fn spools_behave_like_queues_whatever_fits_into_memory(
            steps in steps(),
            memory in prop_oneof![Just(0u64), Just(128), Just(1000), Just(1 << 20)],
        ) {
            let folder = tempfile::tempdir().unwrap();
            let mut store = store(folder.path(), memory);
            let mut spools = [(); 3].map(|()| Spool::<[u32; 3]>::new(&store));
            let mut naive = [(); 3].map(|()| VecDeque::new());
            let mut piece = Piece::default();
            let mut count = 0;
            for (which, step) in steps {
                let (spool, naive) = (&mut spools[which], &mut naive[which]);
                match step {
                    Step::Push(times) => for _ in 0..times {
                        let record = [count, which as u32, 7 * count];
                        count += 1;
                        spool.push(&mut store, &record).unwrap();
                        naive.push_back(record);
                    },
                    Step::First => {
                        let some = spool.take_first(&mut store, &mut piece).unwrap();
                        prop_assert_eq!(some, !naive.is_empty());
                        for &record in piece.items() {
                            prop_assert_eq!(Some(record), naive.pop_front());
                        }
                    }
                    Step::Read(nth) => {
                        // What comes before it from the end, then it.
                        let mut end = naive.len();
                        for nth in 0..=nth {
                            let some = spool.read_last(&mut store, nth, &mut piece).unwrap();
                            prop_assert_eq!(some, end > 0);
                            let begin = end - piece.items().len();
                            prop_assert!(naive.range(begin..end).eq(piece.items()));
                            end = begin;
                        }
                    }
                    Step::Last => {
                        let some = spool.take_last(&mut store, &mut piece).unwrap();
                        prop_assert_eq!(some, !naive.is_empty());
                        for &record in piece.items().iter().rev() {
                            prop_assert_eq!(Some(record), naive.pop_back());
                        }
                    }
                }
                prop_assert_eq!(spool.len(), naive.len() as u64);
                prop_assert_eq!(spool.is_empty(), naive.is_empty());
            }
            for (spool, naive) in spools.iter_mut().zip(&mut naive) {
                while spool.take_first(&mut store, &mut piece).unwrap() {
                    prop_assert!(!piece.items().is_empty());
                    for &record in piece.items() {
                        prop_assert_eq!(Some(record), naive.pop_front());
                    }
                }
                prop_assert!(naive.is_empty());
            }
        }
    }

    #[test]
    fn what_is_taken_makes_room_for_what_comes() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = store(folder.path(), 0);
        let (mut log, mut other) = (Spool::<u32>::new(&store), Spool::<u32>::new(&store));
        for i in 0..1600 {
            log.push(&mut store, &i).unwrap();
        }
        let peak = store.peak_file_bytes();
        assert_eq!(peak, 99 * 64);
        let mut piece = Piece::default();
        while log.take_last(&mut store, &mut piece).unwrap() {
            for i in piece.items() {
                other.push(&mut store, i).unwrap();
            }
        }
        assert_eq!(store.peak_file_bytes(), peak);
        assert_eq!(other.len(), 1600);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_fits_into_memory_makes_no_file() {
        let mut store = store("/no/such/folder".as_ref(), 1 << 20);
        let mut spool = Spool::<u32>::new(&store);
        (0..100).for_each(|i| spool.push(&mut store, &i).unwrap());
        let mut store = Store::new(
            &Scratch::new("/no/such/folder"),
            &StoreOptions { chunk_bytes: 64, memory_bytes: 64 },
        );
        let mut spool = Spool::<u32>::new(&store);
        let error = (0..100).find_map(|i| spool.push(&mut store, &i).err()).unwrap();
        assert!(error.to_string().contains("/no/such/folder"), "{error}");
    }

    #[test]
    fn a_saved_spool_is_found_again_as_it_was_then() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let mut store = Store::new_kept(&scratch, "log", 64).unwrap();
        let mut spool = Spool::<u32>::new(&store);
        (0..40).for_each(|i| spool.push(&mut store, &i).unwrap());
        let saved = spool.save(&mut store).unwrap();
        let chunks = store.num_file_chunks();
        (40..100).for_each(|i| spool.push(&mut store, &i).unwrap());
        store.sync().unwrap();
        let whole = spool.save(&mut store).unwrap();
        let mut piece = Piece::default();
        assert!(spool.take_last(&mut store, &mut piece).unwrap());
        assert_eq!(piece.items(), (88..100).collect::<Vec<u32>>());
        assert_eq!(whole.chunks.iter().map(|chunk| chunk.records).sum::<u32>(), 100);
        drop((spool, store));

        let read = |saved: &SavedSpool, chunks| -> Result<Vec<u32>, Error> {
            let mut store = Store::open_kept(&scratch, "log", 64, chunks)?;
            let mut spool = Spool::<u32>::restore(&store, saved)?;
            spool.check(&mut store)?;
            let (mut piece, mut all) = (Piece::default(), Vec::new());
            while spool.take_last(&mut store, &mut piece)? {
                all.extend(piece.items().iter().rev());
            }
            Ok(all)
        };
        assert_eq!(read(&saved, chunks).unwrap(), (0..40).rev().collect::<Vec<u32>>());
        let bad = |change: fn(&mut SavedChunk)| {
            let mut saved = saved.clone();
            change(&mut saved.chunks[1]);
            read(&saved, chunks).unwrap_err().to_string()
        };
        assert!(bad(|chunk| chunk.crc ^= 1).contains("begin again"));
        assert!(bad(|chunk| chunk.number = 3).contains("begin again"));
        assert!(bad(|chunk| chunk.records = 17).contains("begin again"));

        let path = folder.path().join("log");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[70] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        assert!(read(&saved, chunks).unwrap_err().to_string().contains("begin again"));
    }
}
