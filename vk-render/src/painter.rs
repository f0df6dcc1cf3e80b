//! Records a scene: background, mesh, lines, overlay. The same for every target.

use crate::context::Context;
use crate::error::Result;
use crate::gpu::{
    ArraySet, Buffer, CommandBuffer, Cut, Device, FrameSet, Framebuffer, GpuImage, Keep, Memory,
    Pass, Pipelines, Serial, Usage, Work,
};
use crate::overlay::cells;
use crate::scene::{Line, Scene, Shading};
use crate::ui::{Ui, UiPiece};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec4};
use std::ops::Range;
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
    section: Vec4,
}

const _: () = assert!(size_of::<Constants>() == 208);

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
    lines: Arrays<1>,
    cells: Arrays<1>,
    ui: Arrays<2>,
    /// The last submission that used all this.
    serial: Serial,
}

/// Arrays that are written anew for every picture, with their binding.
struct Arrays<const N: usize> {
    // Before the buffers, which must outlive it.
    set: ArraySet,
    buffers: [Buffer; N],
    what: &'static str,
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
    /// Panics where the mesh or a texture is of another context.
    pub(crate) fn paint(
        &mut self,
        scene: &Scene<'_>,
        framebuffer: &Arc<Framebuffer>,
        ties: Ties<'_>,
    ) -> Result<Serial> {
        assert!(scene.mesh.is_of(&self.context), "the mesh belongs to another context");
        self.wait_for_slot()?;
        let shading = usage(scene);
        let cut = if scene.section.is_some() { Cut::Section } else { Cut::Whole };
        let num_triangles = scene.mesh.num_triangles();
        let cells = cells(scene.text);
        let lines: Vec<GpuLine> = scene.lines.iter().map(GpuLine::from).collect();
        let size = framebuffer.size();
        let pieces = pieces(&scene.ui, size);
        let used = [
            (Usage::Background, Cut::Whole, true),
            (shading, cut, num_triangles > 0),
            (Usage::Lines, Cut::Whole, !lines.is_empty()),
            (Usage::Overlay, Cut::Whole, !cells.is_empty()),
            (Usage::Ui, Cut::Whole, !pieces.is_empty()),
        ];
        for (usage, cut, _) in used.into_iter().filter(|(_, _, used)| *used) {
            self.pipelines.prepare(usage, cut)?;
        }
        let constants = constants(scene, size, self.encode);
        let slot = &mut self.slots[self.next];
        slot.constants.write(0, bytemuck::bytes_of(&constants));
        slot.lines.fill(&self.context, [bytemuck::cast_slice(&lines)])?;
        slot.cells.fill(&self.context, [bytemuck::cast_slice(&cells)])?;
        let (corners, indices) = (scene.ui.vertices, scene.ui.indices);
        let arrays = [bytemuck::cast_slice(corners), bytemuck::cast_slice(indices)];
        slot.ui.fill(&self.context, arrays)?;

        slot.commands.begin()?;
        let mut drawing =
            slot.commands.draw(&self.pass, framebuffer, &self.context.layouts, &slot.set);
        drawing.background(&self.pipelines);
        if num_triangles > 0 {
            drawing.mesh(&self.pipelines, (shading, cut), scene.mesh.set(), num_triangles);
        }
        for (usage, array, count) in [
            (Usage::Lines, &slot.lines.set, lines.len()),
            (Usage::Overlay, &slot.cells.set, cells.len()),
        ] {
            if count > 0 {
                drawing.array(&self.pipelines, usage, array, 6 * count as u32);
            }
        }
        let mut keep = vec![Arc::clone(scene.mesh.set()) as Keep, Arc::clone(framebuffer) as Keep];
        if !pieces.is_empty() {
            drawing.ui(&self.pipelines, &slot.ui.set);
        }
        for (clip, piece, indices) in pieces {
            assert!(piece.texture.is_of(&self.context), "a texture belongs to another context");
            drawing.ui_piece(clip, piece.texture.set(), indices);
            keep.push(Arc::clone(piece.texture.set()) as Keep);
        }
        drop(drawing);
        if let Some((image, buffer)) = ties.read_back {
            slot.commands.read_back(image, size, buffer);
        }
        slot.commands.end()?;
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

/// What draws the mesh.
fn usage(scene: &Scene<'_>) -> Usage {
    match scene.shading {
        Shading::Flat => Usage::Flat,
        Shading::Wireframe => Usage::Wireframe,
        Shading::LevelOfDetail => Usage::Level,
        Shading::Normals => Usage::Normals,
        Shading::Coloured if scene.mesh.has_colours() => Usage::Coloured,
        Shading::Patches if scene.mesh.has_colours() => Usage::Patches,
        Shading::Smooth | Shading::Coloured | Shading::Patches => Usage::Smooth,
    }
}

/// What there is to draw of a user interface, each piece with its rectangle in the picture and its indices.
fn pieces<'a>(ui: &Ui<'a>, size: vk::Extent2D) -> Vec<(vk::Rect2D, &'a UiPiece<'a>, Range<u32>)> {
    let most = ui.indices.len() as u32;
    let mut pieces = Vec::new();
    for piece in ui.pieces {
        let [left, top, right, bottom] = piece.clip_px.map(|edge| edge.round().max(0.0) as u32);
        let (right, bottom) = (right.min(size.width), bottom.min(size.height));
        let indices = piece.indices.start..piece.indices.end.min(most);
        if left >= right || top >= bottom || indices.is_empty() {
            continue;
        }
        let clip = vk::Rect2D {
            offset: vk::Offset2D { x: left as i32, y: top as i32 },
            extent: vk::Extent2D { width: right - left, height: bottom - top },
        };
        pieces.push((clip, piece, indices));
    }
    pieces
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
        Ok(Self {
            commands: CommandBuffer::new(device)?,
            set: FrameSet::new(&context.layouts, &constants)?,
            constants,
            lines: Arrays::new(context, "lines")?,
            cells: Arrays::new(context, "text")?,
            ui: Arrays::new(context, "panels")?,
            serial: Serial::default(),
        })
    }
}

impl<const N: usize> Arrays<N> {
    fn new(context: &Context, what: &'static str) -> Result<Self> {
        Self::with_sizes(context, what, [1024; N])
    }

    fn with_sizes(context: &Context, what: &'static str, sizes: [u64; N]) -> Result<Self> {
        let mut made = Vec::with_capacity(N);
        for size in sizes {
            made.push(storage(&context.device, what, size)?);
        }
        let set = ArraySet::new(&context.layouts, &made.iter().collect::<Vec<_>>())?;
        let Ok(buffers) = made.try_into() else { unreachable!("one buffer was made per size") };
        Ok(Self { set, buffers, what })
    }

    /// Writes what the shaders will read; the last picture that read it is finished.
    fn fill(&mut self, context: &Context, arrays: [&[u8]; N]) -> Result<()> {
        let sizes = arrays.map(|bytes| bytes.len() as u64);
        if self.buffers.iter().zip(sizes).any(|(buffer, size)| size > buffer.size()) {
            let mut larger = sizes.map(u64::next_power_of_two);
            for (size, buffer) in larger.iter_mut().zip(&self.buffers) {
                *size = buffer.size().max(*size);
            }
            *self = Self::with_sizes(context, self.what, larger)?;
        }
        for (buffer, bytes) in self.buffers.iter_mut().zip(arrays) {
            buffer.write(0, bytes);
        }
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
        background_top: srgb(scene.background.top),
        background_bottom: srgb(scene.background.bottom),
        viewport_px: [size.width as f32, size.height as f32],
        line_width_px: scene.line_width_px.clamp(0.5, 64.0),
        max_level: scene.max_level.into(),
        encode: if encode { 1.0 } else { 0.0 },
        // A parallel projection leaves w alone.
        perspective: if scene.camera.projection.w_axis.w == 0.0 { 1.0 } else { 0.0 },
        inside_out: if scene.inside_out { 1.0 } else { 0.0 },
        padding: 0.0,
        section: scene.section.map_or(Vec4::ZERO, |section| {
            // A plane goes over to view space as the inverse transpose does; the view only turns and shifts.
            let normal = scene.camera.view.transform_vector3(section.normal);
            let shift = scene.camera.view.w_axis.truncate();
            normal.extend(-section.offset - normal.dot(shift))
        }),
    }
}

fn srgb([r, g, b]: [u8; 3]) -> Vec4 {
    Vec4::new(r.into(), g.into(), b.into(), 255.0) / 255.0
}
