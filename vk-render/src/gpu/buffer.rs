//! Buffers, each with its own memory: there are few.
#![allow(unsafe_code)]

use super::device::Device;
use crate::error::{Check, Error, Result};
use ash::vk;
use std::ptr::NonNull;
use std::sync::Arc;

/// Where a buffer lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Memory {
    /// Close to the device; only the device reaches it.
    Device,
    /// Written here, read by the device.
    Upload,
    /// Written by the device, read here.
    Readback,
}

pub(crate) struct Buffer {
    pub(super) raw: vk::Buffer,
    memory: vk::DeviceMemory,
    size: u64,
    mapped: Option<NonNull<u8>>,
    device: Arc<Device>,
}

// SAFETY: the mapped memory belongs to the buffer alone; it is written through `&mut` and read through `&`.
unsafe impl Send for Buffer {}
// SAFETY: through `&` the mapped memory is only read.
unsafe impl Sync for Buffer {}

impl Buffer {
    /// A buffer of `size` bytes, its content undefined; `what` is for the error message.
    pub(crate) fn new(
        device: &Arc<Device>,
        what: &'static str,
        size: u64,
        usage: vk::BufferUsageFlags,
        kind: Memory,
    ) -> Result<Self> {
        let size = size.max(4);
        let info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive, the size is not 0.
        let raw = unsafe { device.raw.create_buffer(&info, None) }.check("vkCreateBuffer")?;
        // The drop cleans up whatever is there when a later step fails.
        let mut buffer = Self {
            raw,
            memory: vk::DeviceMemory::null(),
            size,
            mapped: None,
            device: Arc::clone(device),
        };
        // SAFETY: the buffer is the device's.
        let needs = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        buffer.memory = device.allocate(what, needs, kind)?;
        // SAFETY: the memory is new, large enough and of a type the buffer takes; nothing else is bound to it.
        unsafe { device.raw.bind_buffer_memory(raw, buffer.memory, 0) }
            .check("vkBindBufferMemory")?;
        if kind != Memory::Device {
            let flags = vk::MemoryMapFlags::empty();
            // SAFETY: the memory is host-visible and not mapped; it stays mapped until it is freed.
            let start = unsafe { device.raw.map_memory(buffer.memory, 0, vk::WHOLE_SIZE, flags) }
                .check("vkMapMemory")?;
            buffer.mapped = NonNull::new(start.cast::<u8>());
        }
        Ok(buffer)
    }

    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Writes bytes; the device must not be reading them, which the callers see to by waiting for a serial.
    ///
    /// # Panics
    /// Panics where the bytes do not fit, or the buffer is not mapped.
    pub(crate) fn write(&mut self, offset: u64, bytes: &[u8]) {
        let start = self.mapped.expect("only mapped buffers are written");
        assert!(offset <= self.size && bytes.len() as u64 <= self.size - offset, "past the buffer");
        // SAFETY: the offset is within the mapping, checked above.
        let to = unsafe { start.add(offset as usize) };
        // SAFETY: both sides are valid for that many bytes; a mapping is no Rust object, so they do not overlap.
        unsafe { to.copy_from_nonoverlapping(NonNull::from(bytes).cast::<u8>(), bytes.len()) };
    }

    /// The first `len` bytes; the device must have finished writing them.
    ///
    /// # Panics
    /// Panics where there are fewer, or the buffer is not mapped.
    pub(crate) fn read(&self, len: usize) -> &[u8] {
        let start = self.mapped.expect("only mapped buffers are read");
        assert!(len as u64 <= self.size, "past the buffer");
        // SAFETY: the mapping is that long, and bytes of any value are valid; it lives as long as `self`.
        unsafe { std::slice::from_raw_parts(start.as_ptr(), len) }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: no submission uses the buffer any more (Alive).
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        // SAFETY: the memory belonged to that buffer alone; freeing unmaps it.
        unsafe { self.device.raw.free_memory(self.memory, None) };
    }
}

impl Device {
    pub(super) fn allocate(
        &self,
        what: &'static str,
        needs: vk::MemoryRequirements,
        kind: Memory,
    ) -> Result<vk::DeviceMemory> {
        use vk::MemoryPropertyFlags as Is;
        // What is best first; Vulkan promises that the last of each list exists. Coherent memory needs no flushes.
        let coherent = Is::HOST_VISIBLE | Is::HOST_COHERENT;
        let wishes: &[Is] = match kind {
            Memory::Device => &[Is::DEVICE_LOCAL, Is::empty()],
            Memory::Upload => &[coherent],
            Memory::Readback => &[coherent | Is::HOST_CACHED, coherent],
        };
        let types = self.memory.memory_types_as_slice();
        let fits = |wish: Is| {
            (0..types.len()).find(|&i| {
                needs.memory_type_bits & (1 << i) != 0 && types[i].property_flags.contains(wish)
            })
        };
        let out_of_memory = Error::OutOfMemory { what, bytes: needs.size };
        let Some(index) = wishes.iter().find_map(|&wish| fits(wish)) else {
            return Err(out_of_memory);
        };
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(index as u32);
        // SAFETY: the device is alive and has that memory type.
        unsafe { self.raw.allocate_memory(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost,
            _ => out_of_memory,
        })
    }
}
