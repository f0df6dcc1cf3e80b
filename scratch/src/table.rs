//! A table of items by number, of which so much is in memory as may be; the rest is in a scratch file.

use bytemuck::Pod;

use crate::{Error, Scratch, ScratchFile};

/// How much of a [`Table`] is in memory.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TableOptions {
    /// What is read and written at once, in bytes. Default 64 KiB.
    pub chunk_bytes: usize,
    /// Bytes of items that are in memory at most; two chunks always are. Default 32 MiB.
    pub memory_bytes: u64,
}

impl Default for TableOptions {
    fn default() -> Self {
        Self { chunk_bytes: 64 << 10, memory_bytes: 32 << 20 }
    }
}

/// Least chunks in memory.
const MIN_CHUNKS: usize = 2;
/// A chunk that is not in memory.
const AWAY: u32 = u32::MAX;

/// Items of one kind by number, all bits zero in the beginning. Where they are asked for near each other, few have to be
/// read from the file; it is made when the first chunk has to make room.
///
/// # Complexity
/// Memory: that of the [options](TableOptions), and 5 bytes for each chunk of the whole.
#[derive(Debug)]
pub struct Table<T> {
    scratch: Scratch,
    file: Option<ScratchFile<T>>,
    len: u64,
    /// Items of a chunk.
    chunk: usize,
    /// Chunks that may be in memory.
    max_slots: usize,
    /// For each chunk where in memory it is.
    slot_of: Vec<u32>,
    /// For each chunk whether the file has it.
    in_file: Vec<bool>,
    slots: Vec<Slot<T>>,
    /// Where the search for a chunk that makes room goes on.
    hand: usize,
    peak_file_bytes: u64,
}

/// A chunk in memory.
#[derive(Debug)]
struct Slot<T> {
    items: Vec<T>,
    chunk: usize,
    /// Whether the file has something else.
    is_dirty: bool,
    /// Whether it was asked for since the hand came by.
    is_used: bool,
}

impl<T: Pod> Table<T> {
    /// So many items, all zero.
    pub fn new(scratch: &Scratch, len: u64, options: &TableOptions) -> Self {
        let chunk = (options.chunk_bytes / size_of::<T>().max(1)).max(1);
        let chunks = usize::try_from(len.div_ceil(chunk as u64)).unwrap_or(usize::MAX);
        let mut table = Self {
            scratch: scratch.clone(),
            file: None,
            len,
            chunk,
            max_slots: 0,
            slot_of: vec![AWAY; chunks],
            in_file: vec![false; chunks],
            slots: Vec::new(),
            hand: 0,
            peak_file_bytes: 0,
        };
        table.max_slots = table.slots_in(options.memory_bytes);
        table
    }

    fn slots_in(&self, memory_bytes: u64) -> usize {
        let slots = memory_bytes / (self.chunk * size_of::<T>()) as u64;
        usize::try_from(slots).unwrap_or(usize::MAX).clamp(MIN_CHUNKS, AWAY as usize - 1)
    }

    /// Number of items.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Length that the file has had at most, in bytes.
    pub fn peak_file_bytes(&self) -> u64 {
        self.peak_file_bytes
    }

    /// From now on so much may be in memory.
    ///
    /// # Errors
    /// When what has to make room cannot be written.
    pub fn set_memory_bytes(&mut self, bytes: u64) -> Result<(), Error> {
        self.max_slots = self.slots_in(bytes);
        while self.slots.len() > self.max_slots {
            let last = self.slots.len() - 1;
            self.put_away(last)?;
            self.slots.pop();
        }
        self.slots.shrink_to_fit();
        self.hand = 0;
        Ok(())
    }

    /// An item.
    ///
    /// # Errors
    /// When the scratch file cannot be written or read.
    ///
    /// # Panics
    /// When there is no item of this number.
    #[inline]
    pub fn get(&mut self, number: u64) -> Result<T, Error> {
        let (slot, at) = self.find(number)?;
        Ok(self.slots[slot].items[at])
    }

    /// An item, to be changed.
    ///
    /// # Errors
    /// When the scratch file cannot be written or read.
    ///
    /// # Panics
    /// When there is no item of this number.
    #[inline]
    pub fn get_mut(&mut self, number: u64) -> Result<&mut T, Error> {
        let (slot, at) = self.find(number)?;
        let slot = &mut self.slots[slot];
        slot.is_dirty = true;
        Ok(&mut slot.items[at])
    }

    /// Where in memory an item is, after it has been brought there.
    #[inline]
    fn find(&mut self, number: u64) -> Result<(usize, usize), Error> {
        assert!(number < self.len, "item {number} of {}", self.len);
        let chunk = (number / self.chunk as u64) as usize;
        let at = (number % self.chunk as u64) as usize;
        let slot = match self.slot_of[chunk] {
            AWAY => self.bring(chunk)?,
            slot => slot as usize,
        };
        self.slots[slot].is_used = true;
        Ok((slot, at))
    }

    #[cold]
    fn bring(&mut self, chunk: usize) -> Result<usize, Error> {
        let slot = if self.slots.len() < self.max_slots {
            let items = vec![T::zeroed(); self.chunk];
            self.slots.push(Slot { items, chunk, is_dirty: false, is_used: true });
            self.slots.len() - 1
        } else {
            let slot = self.least_used();
            self.put_away(slot)?;
            slot
        };
        let first = chunk as u64 * self.chunk as u64;
        let memory = &mut self.slots[slot];
        (memory.chunk, memory.is_dirty) = (chunk, false);
        match &mut self.file {
            Some(file) if self.in_file[chunk] => file.read(first, &mut memory.items)?,
            _ => memory.items.fill(T::zeroed()),
        }
        self.slot_of[chunk] = slot as u32;
        Ok(slot)
    }

    /// The first one from the hand on that was not asked for since it last came by.
    fn least_used(&mut self) -> usize {
        loop {
            let slot = self.hand;
            self.hand = (self.hand + 1) % self.slots.len();
            if !std::mem::replace(&mut self.slots[slot].is_used, false) {
                return slot;
            }
        }
    }

    /// Makes a slot free, whose chunk goes to the file if that has something else.
    fn put_away(&mut self, slot: usize) -> Result<(), Error> {
        let Slot { items, chunk, is_dirty, .. } = &mut self.slots[slot];
        if self.slot_of.get(*chunk) == Some(&(slot as u32)) {
            if *is_dirty {
                let file = match &mut self.file {
                    Some(file) => file,
                    none => none.insert(self.scratch.file()?),
                };
                let first = *chunk as u64 * self.chunk as u64;
                file.write(first, items)?;
                *is_dirty = false;
                self.in_file[*chunk] = true;
                let end = (first + self.chunk as u64) * size_of::<T>() as u64;
                self.peak_file_bytes = self.peak_file_bytes.max(end);
            }
            self.slot_of[*chunk] = AWAY;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn table(folder: &std::path::Path, len: u64, memory_bytes: u64) -> Table<[u32; 2]> {
        Table::new(&Scratch::new(folder), len, &TableOptions { chunk_bytes: 32, memory_bytes })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

        #[test]
        fn items_stay_whatever_fits_into_memory(
            steps in prop::collection::vec((0u64..50, any::<bool>(), 1u32..9), 0..300),
            memory in prop_oneof![Just(0u64), Just(100), Just(1 << 20)],
            resize in (0usize..300, 0u64..400),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let mut table = table(folder.path(), 50, memory);
            let mut naive = vec![[0; 2]; 50];
            for (step, (number, write, value)) in steps.into_iter().enumerate() {
                if step == resize.0 {
                    table.set_memory_bytes(resize.1).unwrap();
                }
                if write {
                    *table.get_mut(number).unwrap() = [value; 2];
                    naive[number as usize] = [value; 2];
                }
                prop_assert_eq!(table.get(number).unwrap(), naive[number as usize]);
            }
            for number in 0..50 {
                prop_assert_eq!(table.get(number).unwrap(), naive[number as usize]);
            }
            prop_assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }

    #[test]
    fn there_is_a_file_only_where_memory_does_not_do() {
        // Where no file can be made.
        let mut whole = table("/no/such/folder".as_ref(), 1000, 1 << 20);
        for number in 0..1000 {
            whole.get_mut(number).unwrap()[0] = number as u32;
        }
        assert!((0..1000).all(|number| whole.get(number).unwrap()[0] == number as u32));
        assert_eq!(whole.peak_file_bytes(), 0);
        let mut part = table("/no/such/folder".as_ref(), 1000, 64);
        part.get(999).unwrap();
        assert!((0..1000).all(|number| part.get(number).is_ok()), "nothing to be written yet");
        assert!((0..1000).any(|number| part.get_mut(number).is_err()));
    }
}
