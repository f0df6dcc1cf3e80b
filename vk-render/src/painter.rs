//! Records a scene: background, mesh, lines, overlay. The same for every target.

use crate::context::Context;
use crate::error::Result;
use crate::gpu::{
    Buffer, CommandBuffer, Device, FrameSet, Framebuffer, GpuImage, Keep, Layouts, Memory, Pass,
    Pipelines, Serial, Usage, Work,
};
use crate::overlay::cells;
use crate::scene::{Line, Scene, Shading};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;

/// Pictures being drawn at one time: one by the device, one by us.
pub(crate) const FRAMES_IN_FLIGHT: usize = 2;

/// As `Frame` in `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Constants {
    view: Mat4,
    projection: Mat4,
    background_top: Vec4,
    background_bottom: Vec4,
    viewport_px: [f32; 2],
    line_width_px: f32,
    max_level: f32,
    encode: f32,
    perspective: f32,
    inside_out: f32,
    padding: f32,
}

const _: () = assert!(size_of::<Constants>() == 192);

/// As `Line` in `lines.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuLine {
    a: [f32; 3],
    rgba: [u8; 4],
    b: [f32; 3],
    padding: u32,
}

const _: () = assert!(size_of::<GpuLine>() == 32);

impl From<&Line> for GpuLine {
    fn from(line: &Line) -> Self {
        Self { a: line.a.to_array(), rgba: line.rgba, b: line.b.to_array(), padding: 0 }
    }
}

/// One frame in flight: its commands and what its shaders read.
struct Slot {
    commands: CommandBuffer,
    set: FrameSet,
    constants: Buffer,
    lines: Buffer,
    cells: Buffer,
    /// The last submission that used all this.
    serial: Serial,
}

pub(crate) struct Painter {
    slots: [Slot; FRAMES_IN_FLIGHT],
    next: usize,
    pipelines: Pipelines,
    pass: Arc<Pass>,
    encode: bool,
    context: Context,
}

/// How a picture is tied into what else happens on the queue.
#[derive(Default)]
pub(crate) struct Ties<'a> {
    pub(crate) wait: Option<vk::Semaphore>,
    pub(crate) signal: Option<vk::Semaphore>,
    pub(crate) read_back: Option<(&'a GpuImage, &'a Buffer)>,
}

impl Painter {
    /// `encode` where the format stores colours as they are, so that the shaders have to encode to sRGB.
    pub(crate) fn new(
        context: &Context,
        format: vk::Format,
        encode: bool,
        last_layout: vk::ImageLayout,
    ) -> Result<Self> {
        let device = &context.device;
        let samples = device.samples(context.max_samples);
        let pass = Pass::new(device, format, samples, last_layout)?;
        Ok(Self {
            slots: [Slot::new(context)?, Slot::new(context)?],
            next: 0,
            pipelines: Pipelines::new(&pass, &context.layouts),
            pass,
            encode,
            context: context.clone(),
        })
    }

    pub(crate) fn pass(&self) -> &Arc<Pass> {
        &self.pass
    }

    /// Colour with several samples (where there are any) and depth, for pictures of one size.
    pub(crate) fn attachments(
        &self,
        format: vk::Format,
        size: vk::Extent2D,
    ) -> Result<(Option<Arc<GpuImage>>, Arc<GpuImage>)> {
        let device = &self.context.device;
        let samples = device.samples(self.context.max_samples);
        let passing = vk::ImageUsageFlags::TRANSIENT_ATTACHMENT;
        let colour = if samples == vk::SampleCountFlags::TYPE_1 {
            None
        } else {
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | passing;
            Some(Arc::new(GpuImage::new(device, size, format, samples, usage)?))
        };
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | passing;
        let depth = GpuImage::new(device, size, device.depth_format, samples, usage)?;
        Ok((colour, Arc::new(depth)))
    }

    /// Waits until the slot for the next picture is free: until the picture before the last one is finished.
    pub(crate) fn wait_for_slot(&self) -> Result<()> {
        self.context.device.wait(self.slots[self.next].serial)
    }

    /// Draws a scene and submits it.
    ///
    /// # Panics
    /// Panics where the mesh is of another context.
    pub(crate) fn paint(
        &mut self,
        scene: &Scene<'_>,
        framebuffer: &Arc<Framebuffer>,
        ties: Ties<'_>,
    ) -> Result<Serial> {
        assert!(scene.mesh.is_of(&self.context), "the mesh belongs to another context");
        self.wait_for_slot()?;
        let shading = match scene.shading {
            Shading::Smooth => Usage::Smooth,
            Shading::Flat => Usage::Flat,
            Shading::Wireframe => Usage::Wireframe,
            Shading::LevelOfDetail => Usage::Level,
            Shading::Normals => Usage::Normals,
        };
        let num_triangles = scene.mesh.num_triangles();
        let cells = cells(scene.text);
        let lines: Vec<GpuLine> = scene.lines.iter().map(GpuLine::from).collect();
        let used = [
            (Usage::Background, true),
            (shading, num_triangles > 0),
            (Usage::Lines, !lines.is_empty()),
            (Usage::Overlay, !cells.is_empty()),
        ];
        for (usage, _) in used.into_iter().filter(|(_, used)| *used) {
            self.pipelines.prepare(usage)?;
        }
        let size = framebuffer.size();
        let constants = constants(scene, size, self.encode);
        let slot = &mut self.slots[self.next];
        slot.fill(&self.context, &constants, &lines, bytemuck::cast_slice(&cells))?;

        slot.commands.begin()?;
        let mut drawing =
            slot.commands.draw(&self.pass, framebuffer, &self.context.layouts, &slot.set);
        drawing.vertices(&self.pipelines, Usage::Background, 3);
        if num_triangles > 0 {
            drawing.mesh(&self.pipelines, shading, scene.mesh.set(), num_triangles);
        }
        if !lines.is_empty() {
            drawing.vertices(&self.pipelines, Usage::Lines, 6 * lines.len() as u32);
        }
        if !cells.is_empty() {
            drawing.vertices(&self.pipelines, Usage::Overlay, 6 * cells.len() as u32);
        }
        drop(drawing);
        if let Some((image, buffer)) = ties.read_back {
            slot.commands.read_back(image, size, buffer);
        }
        slot.commands.end()?;
        let keep = vec![Arc::clone(scene.mesh.set()) as Keep, Arc::clone(framebuffer) as Keep];
        let commands = slot.commands.raw();
        slot.serial = self.context.device.submit(Work {
            commands,
            wait: ties.wait,
            signal: ties.signal,
            keep,
        })?;
        self.next = (self.next + 1) % FRAMES_IN_FLIGHT;
        Ok(slot.serial)
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        if self.slots.iter().any(|slot| self.context.device.wait(slot.serial).is_err()) {
            // The device is lost: nothing runs on it any more, so everything may go.
        }
    }
}

impl Slot {
    fn new(context: &Context) -> Result<Self> {
        let device = &context.device;
        let usage = vk::BufferUsageFlags::UNIFORM_BUFFER;
        let size = size_of::<Constants>() as u64;
        let constants = Buffer::new(device, "constants", size, usage, Memory::Upload)?;
        let lines = storage(device, "lines", 1024)?;
        let cells = storage(device, "text", 1024)?;
        let set = FrameSet::new(&context.layouts, &constants, &lines, &cells)?;
        let commands = CommandBuffer::new(device)?;
        Ok(Self { commands, set, constants, lines, cells, serial: Serial::default() })
    }

    /// Writes what the shaders will read; the slot's last picture is finished.
    fn fill(
        &mut self,
        context: &Context,
        constants: &Constants,
        lines: &[GpuLine],
        cells: &[u8],
    ) -> Result<()> {
        let lines: &[u8] = bytemuck::cast_slice(lines);
        let layouts: &Arc<Layouts> = &context.layouts;
        let short = |buffer: &Buffer, bytes: &[u8]| bytes.len() as u64 > buffer.size();
        if short(&self.lines, lines) || short(&self.cells, cells) {
            let larger = |what, buffer: &Buffer, bytes: &[u8]| {
                let size = buffer.size().max((bytes.len() as u64).next_power_of_two());
                storage(&context.device, what, size)
            };
            let new_lines = larger("lines", &self.lines, lines)?;
            let new_cells = larger("text", &self.cells, cells)?;
            self.set = FrameSet::new(layouts, &self.constants, &new_lines, &new_cells)?;
            self.lines = new_lines;
            self.cells = new_cells;
        }
        self.constants.write(0, bytemuck::bytes_of(constants));
        self.lines.write(0, lines);
        self.cells.write(0, cells);
        Ok(())
    }
}

fn storage(device: &Arc<Device>, what: &'static str, size: u64) -> Result<Buffer> {
    Buffer::new(device, what, size, vk::BufferUsageFlags::STORAGE_BUFFER, Memory::Upload)
}

fn constants(scene: &Scene<'_>, size: vk::Extent2D, encode: bool) -> Constants {
    Constants {
        view: scene.camera.view,
        projection: scene.camera.projection,
        background_top: linear(scene.background.top).extend(1.0),
        background_bottom: linear(scene.background.bottom).extend(1.0),
        viewport_px: [size.width as f32, size.height as f32],
        line_width_px: scene.line_width_px.clamp(0.5, 64.0),
        max_level: scene.max_level.into(),
        encode: if encode { 1.0 } else { 0.0 },
        // A parallel projection leaves w alone.
        perspective: if scene.camera.projection.w_axis.w == 0.0 { 1.0 } else { 0.0 },
        inside_out: if scene.inside_out { 1.0 } else { 0.0 },
        padding: 0.0,
    }
}

fn linear(srgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(|byte| {
        let x = f32::from(byte) / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_srgb_stay_where_they_are() {
        assert_eq!(linear([0; 3]), Vec3::ZERO);
        assert!((linear([255; 3]) - Vec3::ONE).length() < 1e-6);
        assert!((linear([188; 3]).x - 0.5029).abs() < 1e-3);
    }
}
