//! The way from here to the device's memory: a ring of mapped memory that copies start from.
//!
//! Bytes are written into the ring, copies out of it are recorded, and a batch of copies is submitted to the queue that
//! draws. There, barriers set the copies between the draws before and after them, so a frame in flight never sees half
//! an update and nobody waits, unless the ring is full of batches the device has not come to.

use crate::error::Result;
use crate::gpu::{Buffer, BufferCopy, CommandBuffer, Device, Keep, Memory, Serial, Work};
use ash::vk;
use std::collections::VecDeque;
use std::sync::Arc;

const RING_BYTES: u64 = 8 << 20;
/// A batch goes off when it has this many bytes, so that the device works while the rest is written.
const BATCH_BYTES: u64 = RING_BYTES / 4;
const PIECE_BYTES: u64 = RING_BYTES / 8;

pub(crate) struct Uploader {
    device: Arc<Device>,
    ring: Buffer,
    /// Bytes ever taken from the ring, and bytes ever given back; the difference is in use.
    taken: u64,
    returned: u64,
    batch: Option<Batch>,
    in_flight: VecDeque<InFlight>,
    idle: Vec<CommandBuffer>,
}

/// Copies being recorded.
struct Batch {
    commands: CommandBuffer,
    /// `taken` when it began.
    start: u64,
    keep: Vec<Keep>,
}

struct InFlight {
    commands: CommandBuffer,
    serial: Serial,
    /// `taken` when it was submitted.
    end: u64,
}

impl Uploader {
    pub(crate) fn new(device: &Arc<Device>) -> Result<Self> {
        let usage = vk::BufferUsageFlags::TRANSFER_SRC;
        Ok(Self {
            device: Arc::clone(device),
            ring: Buffer::new(device, "uploads", RING_BYTES, usage, Memory::Upload)?,
            taken: 0,
            returned: 0,
            batch: None,
            in_flight: VecDeque::new(),
            idle: Vec::new(),
        })
    }

    /// Copies the first `bytes` of one buffer to another, on the device.
    pub(crate) fn carry_over(
        &mut self,
        from: &Arc<Buffer>,
        to: &Arc<Buffer>,
        bytes: u64,
    ) -> Result<()> {
        if bytes == 0 {
            return Ok(());
        }
        let batch = self.batch()?;
        batch.commands.copy(from, to, &[BufferCopy { src_offset: 0, dst_offset: 0, size: bytes }]);
        // What is uploaded next overwrites part of it.
        batch.commands.before_mesh_writes();
        batch.keep.push(Arc::clone(from) as Keep);
        batch.keep.push(Arc::clone(to) as Keep);
        Ok(())
    }

    /// Copies pieces, each to an offset in bytes, into a buffer. They must not overlap.
    pub(crate) fn upload<'b>(
        &mut self,
        to: &Arc<Buffer>,
        pieces: impl IntoIterator<Item = (u64, &'b [u8])>,
    ) -> Result<()> {
        let mut copies = Vec::new();
        for (mut offset, bytes) in pieces {
            for piece in bytes.chunks(PIECE_BYTES as usize) {
                let size = piece.len() as u64;
                if self.batch.as_ref().is_some_and(|b| self.taken - b.start + size > BATCH_BYTES) {
                    self.record(to, &mut copies)?;
                    self.submit()?;
                }
                let at = self.take(size)?;
                self.ring.write(at, piece);
                copies.push(BufferCopy { src_offset: at, dst_offset: offset, size });
                offset += size;
            }
        }
        self.record(to, &mut copies)
    }

    /// Sends off what was recorded.
    pub(crate) fn submit(&mut self) -> Result<()> {
        let Some(mut batch) = self.batch.take() else { return Ok(()) };
        batch.commands.after_mesh_writes();
        batch.commands.end()?;
        let commands = batch.commands.raw();
        let serial =
            self.device.submit(Work { commands, keep: batch.keep, ..Default::default() })?;
        let in_flight = InFlight { commands: batch.commands, serial, end: self.taken };
        self.in_flight.push_back(in_flight);
        Ok(())
    }

    /// Forgets what was recorded and not sent, after an error.
    pub(crate) fn discard(&mut self) {
        if let Some(batch) = self.batch.take() {
            self.taken = batch.start;
            self.idle.push(batch.commands);
        }
    }

    fn record(&mut self, to: &Arc<Buffer>, copies: &mut Vec<BufferCopy>) -> Result<()> {
        if copies.is_empty() {
            return Ok(());
        }
        self.batch()?;
        if let Some(batch) = &mut self.batch {
            batch.commands.copy(&self.ring, to, copies);
            batch.keep.push(Arc::clone(to) as Keep);
        }
        copies.clear();
        Ok(())
    }

    /// The batch being recorded, begun if there is none.
    fn batch(&mut self) -> Result<&mut Batch> {
        let batch = match self.batch.take() {
            Some(batch) => batch,
            None => {
                while let Some(first) = self.in_flight.front()
                    && self.device.is_finished(first.serial)?
                {
                    self.retire_oldest()?;
                }
                let mut commands = match self.idle.pop() {
                    Some(commands) => commands,
                    None => CommandBuffer::new(&self.device)?,
                };
                commands.begin()?;
                commands.before_mesh_writes();
                Batch { commands, start: self.taken, keep: Vec::new() }
            }
        };
        Ok(self.batch.insert(batch))
    }

    /// Takes `size` contiguous bytes of the ring, at most a piece, and says where they are.
    fn take(&mut self, size: u64) -> Result<u64> {
        // A batch begins before its bytes are taken, so that they are known as its own.
        self.batch()?;
        let to_end = RING_BYTES - self.taken % RING_BYTES;
        let skip = if size > to_end { to_end } else { 0 };
        // The open batch holds at most a quarter of the ring and a skip of at most an eighth: the rest is in flight.
        while self.taken + skip + size - self.returned > RING_BYTES && !self.in_flight.is_empty() {
            self.retire_oldest()?;
        }
        self.taken += skip;
        let at = self.taken % RING_BYTES;
        self.taken += size;
        Ok(at)
    }

    fn retire_oldest(&mut self) -> Result<()> {
        if let Some(first) = self.in_flight.front() {
            self.device.wait(first.serial)?;
        }
        if let Some(first) = self.in_flight.pop_front() {
            self.returned = first.end;
            self.idle.push(first.commands);
        }
        Ok(())
    }
}

impl Drop for Uploader {
    fn drop(&mut self) {
        if let Some(last) = self.in_flight.back()
            && self.device.wait(last.serial).is_err()
        {
            // The device is lost: nothing runs on it any more, so the ring may go.
        }
    }
}
