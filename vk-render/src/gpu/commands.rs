//! Command buffers, and the few commands that this crate records.
#![allow(unsafe_code)]

use super::buffer::Buffer;
use super::device::Device;
use super::image::{Framebuffer, GpuImage};
use super::pipeline::{Cut, Pass, Pipelines, Usage};
use super::sets::{ArraySet, FrameSet, Kind, Layouts, MeshSet, TextureSet};
use crate::error::{Check, Result};
use ash::vk;
use std::ops::Range;
use std::sync::Arc;

/// Bytes to copy, from one offset to another.
pub(crate) type BufferCopy = vk::BufferCopy;

/// One command buffer with a pool of its own, so that resetting the pool resets it.
pub(crate) struct CommandBuffer {
    pool: vk::CommandPool,
    raw: vk::CommandBuffer,
    device: Arc<Device>,
}

impl CommandBuffer {
    pub(crate) fn new(device: &Arc<Device>) -> Result<Self> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue_family);
        // SAFETY: the device is alive and has that family.
        let pool =
            unsafe { device.raw.create_command_pool(&info, None) }.check("vkCreateCommandPool")?;
        let mut commands =
            Self { pool, raw: vk::CommandBuffer::null(), device: Arc::clone(device) };
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is new and ours alone.
        let buffers = unsafe { device.raw.allocate_command_buffers(&info) }
            .check("vkAllocateCommandBuffers")?;
        if let Some(&raw) = buffers.first() {
            commands.raw = raw;
        }
        Ok(commands)
    }

    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }

    /// Starts anew. What was recorded before must be finished: the owner waits for its serial.
    pub(crate) fn begin(&mut self) -> Result<()> {
        let flags = vk::CommandPoolResetFlags::empty();
        // SAFETY: the pool is reached through `&mut`, and its one buffer is not in use (Alive).
        unsafe { self.device.raw.reset_command_pool(self.pool, flags) }
            .check("vkResetCommandPool")?;
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is in its initial state after the reset.
        unsafe { self.device.raw.begin_command_buffer(self.raw, &info) }
            .check("vkBeginCommandBuffer")
    }

    pub(crate) fn end(&mut self) -> Result<()> {
        // SAFETY: the buffer is being recorded, outside a render pass.
        unsafe { self.device.raw.end_command_buffer(self.raw) }.check("vkEndCommandBuffer")
    }

    /// Makes later copies into mesh buffers wait until everything before has read or written them.
    pub(crate) fn before_mesh_writes(&mut self) {
        let reads = vk::PipelineStageFlags::VERTEX_INPUT | vk::PipelineStageFlags::VERTEX_SHADER;
        self.barrier(
            (reads | vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            (
                vk::PipelineStageFlags::TRANSFER,
                vk::AccessFlags::TRANSFER_WRITE | vk::AccessFlags::TRANSFER_READ,
            ),
        );
    }

    /// Makes later draws see what was copied into mesh buffers.
    pub(crate) fn after_mesh_writes(&mut self) {
        let reads = vk::PipelineStageFlags::VERTEX_INPUT | vk::PipelineStageFlags::VERTEX_SHADER;
        self.barrier(
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            (reads, vk::AccessFlags::INDEX_READ | vk::AccessFlags::SHADER_READ),
        );
    }

    fn barrier(
        &mut self,
        from: (vk::PipelineStageFlags, vk::AccessFlags),
        to: (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        let barriers = [vk::MemoryBarrier::default().src_access_mask(from.1).dst_access_mask(to.1)];
        let flags = vk::DependencyFlags::empty();
        // SAFETY: the buffer is being recorded, outside a render pass.
        unsafe {
            self.device.raw.cmd_pipeline_barrier(
                self.raw,
                from.0,
                to.0,
                flags,
                &barriers,
                &[],
                &[],
            );
        }
    }

    /// # Panics
    /// Panics where a copy reaches past either buffer.
    pub(crate) fn copy(&mut self, from: &Buffer, to: &Buffer, copies: &[BufferCopy]) {
        let within = |offset: u64, size: u64, buffer: &Buffer| {
            offset <= buffer.size() && size <= buffer.size() - offset && size > 0
        };
        assert!(copies.iter().all(|copy| {
            within(copy.src_offset, copy.size, from) && within(copy.dst_offset, copy.size, to)
        }));
        if copies.is_empty() {
            return;
        }
        // SAFETY: being recorded, outside a render pass; every copy is within both buffers, checked above.
        unsafe { self.device.raw.cmd_copy_buffer(self.raw, from.raw, to.raw, copies) };
    }

    /// Copies a drawn picture out; its pass has left it in the layout for that.
    pub(crate) fn read_back(&mut self, image: &GpuImage, size: vk::Extent2D, to: &Buffer) {
        assert!(u64::from(size.width) * u64::from(size.height) * 4 <= to.size());
        let region = [vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            },
            image_extent: vk::Extent3D { width: size.width, height: size.height, depth: 1 },
            ..Default::default()
        }];
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: being recorded, outside a render pass; the picture has that size, and the buffer holds it.
        unsafe {
            self.device.raw.cmd_copy_image_to_buffer(self.raw, image.raw, layout, to.raw, &region);
        }
        self.barrier(
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            (vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ),
        );
    }

    /// Copies rows of bytes into a part of a texture: `place` is its upper left corner, then width and height. Where the
    /// texture was read before, the copy waits for that; what is drawn later sees it.
    pub(crate) fn write_image(
        &mut self,
        from: &Buffer,
        to: &GpuImage,
        place: [u32; 4],
        was_read: bool,
    ) {
        let [x, y, width, height] = place;
        assert!(u64::from(width) * u64::from(height) * 4 <= from.size(), "past the buffer");
        let writable = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let readable = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
        let before = if was_read { readable } else { vk::ImageLayout::UNDEFINED };
        let reads = (vk::PipelineStageFlags::FRAGMENT_SHADER, vk::AccessFlags::SHADER_READ);
        let write = (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE);
        self.image_barrier(to, (before, writable), (reads.0, vk::AccessFlags::empty()), write);
        let region = [vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            },
            image_offset: vk::Offset3D { x: x as i32, y: y as i32, z: 0 },
            image_extent: vk::Extent3D { width, height, depth: 1 },
            ..Default::default()
        }];
        // SAFETY: being recorded, outside a render pass; the part lies within the image, and the buffer holds it.
        unsafe {
            self.device.raw.cmd_copy_buffer_to_image(self.raw, from.raw, to.raw, writable, &region);
        }
        self.image_barrier(to, (writable, readable), write, reads);
    }

    fn image_barrier(
        &mut self,
        image: &GpuImage,
        (old, new): (vk::ImageLayout, vk::ImageLayout),
        from: (vk::PipelineStageFlags, vk::AccessFlags),
        to: (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        let barrier = vk::ImageMemoryBarrier::default()
            .src_access_mask(from.1)
            .dst_access_mask(to.1)
            .old_layout(old)
            .new_layout(new)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image.raw)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: 0,
                layer_count: 1,
            });
        let flags = vk::DependencyFlags::empty();
        let barriers = [barrier];
        let device = &self.device.raw;
        // SAFETY: the buffer is being recorded, outside a render pass.
        unsafe { device.cmd_pipeline_barrier(self.raw, from.0, to.0, flags, &[], &[], &barriers) };
    }

    /// Begins drawing a picture; the rest is done through what this returns.
    pub(crate) fn draw<'a>(
        &'a mut self,
        pass: &Pass,
        framebuffer: &Framebuffer,
        layouts: &'a Layouts,
        frame: &FrameSet,
    ) -> Drawing<'a> {
        let size = framebuffer.size;
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: size };
        let colour = vk::ClearValue { color: vk::ClearColorValue { float32: [0.0; 4] } };
        let depth = vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 };
        let clears = [colour, vk::ClearValue { depth_stencil: depth }];
        let info = vk::RenderPassBeginInfo::default()
            .render_pass(pass.raw)
            .framebuffer(framebuffer.raw)
            .render_area(area)
            .clear_values(&clears);
        let contents = vk::SubpassContents::INLINE;
        // SAFETY: being recorded, outside a render pass; the framebuffer was made for a compatible pass.
        unsafe { self.device.raw.cmd_begin_render_pass(self.raw, &info, contents) };
        let viewport = [vk::Viewport {
            x: 0.0,
            y: 0.0,
            width: size.width as f32,
            height: size.height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        }];
        // SAFETY: being recorded.
        unsafe { self.device.raw.cmd_set_viewport(self.raw, 0, &viewport) };
        // SAFETY: being recorded.
        unsafe { self.device.raw.cmd_set_scissor(self.raw, 0, &[area]) };
        let drawing = Drawing { commands: self, layouts };
        // Group 0 is the same in all layouts, so it stays bound.
        drawing.bind_set(Kind::Mesh, 0, frame.raw);
        drawing
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        // SAFETY: the owner waited for what it submitted (Alive); the pool takes its buffer along.
        unsafe { self.device.raw.destroy_command_pool(self.pool, None) };
    }
}

/// A render pass being recorded; it ends with this value.
pub(crate) struct Drawing<'a> {
    commands: &'a mut CommandBuffer,
    layouts: &'a Layouts,
}

impl Drawing<'_> {
    fn bind_set(&self, kind: Kind, index: u32, set: vk::DescriptorSet) {
        let commands = &*self.commands;
        // SAFETY: being recorded; the set was made with the layout that stands at this index.
        unsafe {
            commands.device.raw.cmd_bind_descriptor_sets(
                commands.raw,
                vk::PipelineBindPoint::GRAPHICS,
                self.layouts.pipeline(kind),
                index,
                &[set],
                &[],
            );
        }
    }

    fn bind_pipeline(&self, pipelines: &Pipelines, usage: Usage, cut: Cut) {
        let point = vk::PipelineBindPoint::GRAPHICS;
        let raw = pipelines.get(usage, cut);
        // SAFETY: being recorded; the pipeline was made for a compatible pass.
        unsafe { self.commands.device.raw.cmd_bind_pipeline(self.commands.raw, point, raw) };
    }

    fn draw(&mut self, vertices: Range<u32>) {
        let (count, first) = (vertices.len() as u32, vertices.start);
        // SAFETY: within the pass, with pipeline, viewport, scissor and sets bound.
        unsafe { self.commands.device.raw.cmd_draw(self.commands.raw, count, 1, first, 0) };
    }

    /// Draws the background.
    pub(crate) fn background(&mut self, pipelines: &Pipelines) {
        self.bind_pipeline(pipelines, Usage::Background, Cut::Whole);
        self.draw(0..3);
    }

    /// Draws vertices that the shader makes of an array of the frame's.
    pub(crate) fn array(
        &mut self,
        pipelines: &Pipelines,
        usage: Usage,
        array: &ArraySet,
        vertices: u32,
    ) {
        self.bind_set(usage.kind(), 1, array.raw);
        self.bind_pipeline(pipelines, usage, Cut::Whole);
        self.draw(0..vertices);
    }

    /// Draws a mesh: vertex by vertex or, where the shading needs it, corner by corner.
    pub(crate) fn mesh(
        &mut self,
        pipelines: &Pipelines,
        (usage, cut): (Usage, Cut),
        mesh: &MeshSet,
        num_triangles: u32,
    ) {
        self.bind_set(Kind::Mesh, 1, mesh.raw);
        self.bind_pipeline(pipelines, usage, cut);
        let count = num_triangles * 3;
        if usage.by_corner() {
            self.draw(0..count);
            return;
        }
        let device = &self.commands.device.raw;
        let kind = vk::IndexType::UINT32;
        // SAFETY: within the pass; the buffer was made as an index buffer.
        unsafe { device.cmd_bind_index_buffer(self.commands.raw, mesh.triangles.raw, 0, kind) };
        // SAFETY: as above; the mesh has uploaded that many triangles.
        unsafe { device.cmd_draw_indexed(self.commands.raw, count, 1, 0, 0, 0) };
    }

    /// Begins to draw pieces of a user interface out of two arrays of the frame's.
    pub(crate) fn ui(&mut self, pipelines: &Pipelines, arrays: &ArraySet) {
        self.bind_set(Kind::Ui, 1, arrays.raw);
        self.bind_pipeline(pipelines, Usage::Ui, Cut::Whole);
    }

    /// Draws one piece, only within `clip`, which lies within the picture.
    pub(crate) fn ui_piece(&mut self, clip: vk::Rect2D, texture: &TextureSet, indices: Range<u32>) {
        // SAFETY: being recorded; the rectangle has no negative corner.
        unsafe { self.commands.device.raw.cmd_set_scissor(self.commands.raw, 0, &[clip]) };
        self.bind_set(Kind::Ui, 2, texture.raw);
        self.draw(indices);
    }
}

impl Drop for Drawing<'_> {
    fn drop(&mut self) {
        // SAFETY: `CommandBuffer::draw` began the pass, and nothing else ends it.
        unsafe { self.commands.device.raw.cmd_end_render_pass(self.commands.raw) };
    }
}
