//! From the number of a block to its place in memory, in constant time.

/// Blocks that share a chunk.
const CHUNK: usize = 64;

#[derive(Debug, Default)]
struct Chunk {
    /// Empty while no block of the chunk is in memory.
    places: Box<[u32]>,
    num_used: u8,
}

/// Per block one more than its place, or 0; in chunks that are there only while they hold something, so that a file
/// takes memory for what is resident, not for what it has.
#[derive(Debug)]
pub(crate) struct Directory {
    chunks: Vec<Chunk>,
    num_chunks_used: usize,
}

impl Directory {
    pub fn new(num_blocks: usize) -> Self {
        let mut chunks = Vec::new();
        chunks.resize_with(num_blocks.div_ceil(CHUNK), Chunk::default);
        Self { chunks, num_chunks_used: 0 }
    }

    const fn chunk_bytes() -> usize {
        CHUNK * size_of::<u32>() + 16
    }

    /// Memory taken.
    pub fn bytes(&self) -> usize {
        self.chunks.capacity() * size_of::<Chunk>() + self.num_chunks_used * Self::chunk_bytes()
    }

    /// Memory that another block takes at most.
    pub const fn cost() -> usize {
        Self::chunk_bytes()
    }

    #[inline]
    pub fn get(&self, block: usize) -> Option<u32> {
        let place = *self.chunks.get(block / CHUNK)?.places.get(block % CHUNK)?;
        place.checked_sub(1)
    }

    /// Notes a block that is not there.
    pub fn insert(&mut self, block: usize, place: u32) {
        let chunk = &mut self.chunks[block / CHUNK];
        if chunk.places.is_empty() {
            chunk.places = vec![0; CHUNK].into_boxed_slice();
            self.num_chunks_used += 1;
        }
        chunk.num_used += 1;
        chunk.places[block % CHUNK] = place + 1;
    }

    /// Notes that a block that is there is in another place.
    pub fn replace(&mut self, block: usize, place: u32) {
        self.chunks[block / CHUNK].places[block % CHUNK] = place + 1;
    }

    /// Forgets a block that is there.
    pub fn remove(&mut self, block: usize) {
        let chunk = &mut self.chunks[block / CHUNK];
        chunk.places[block % CHUNK] = 0;
        chunk.num_used -= 1;
        if chunk.num_used == 0 {
            chunk.places = Box::default();
            self.num_chunks_used -= 1;
        }
    }

    /// Number of blocks noted, counted anew.
    ///
    /// # Errors
    /// When it is not what the chunks say, or their memory not what [`bytes`](Self::bytes) says.
    pub fn count(&self) -> Result<usize, String> {
        let mut count = 0;
        let mut bytes = self.chunks.capacity() * size_of::<Chunk>();
        for chunk in &self.chunks {
            let used = chunk.places.iter().filter(|&&place| place != 0).count();
            if used != usize::from(chunk.num_used) || chunk.places.is_empty() != (used == 0) {
                return Err("a chunk of the directory counts its blocks wrongly".into());
            }
            count += used;
            bytes += if used > 0 { size_of_val(&*chunk.places) + 16 } else { 0 };
        }
        if bytes != self.bytes() {
            return Err(format!("the directory takes {bytes} bytes and says {}", self.bytes()));
        }
        Ok(count)
    }
}
