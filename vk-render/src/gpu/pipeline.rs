//! The render pass and the pipelines that draw in it.
#![allow(unsafe_code)]

use super::device::Device;
use super::sets::{Kind, Layouts};
use crate::error::{Check, Error, Result};
use ash::vk;
use std::ffi::CStr;
use std::sync::{Arc, Mutex, PoisonError};

/// One subpass: clear, draw, resolve, and leave the picture in `last_layout`.
pub(crate) struct Pass {
    pub(super) raw: vk::RenderPass,
    samples: vk::SampleCountFlags,
    device: Arc<Device>,
}

impl Pass {
    pub(crate) fn new(
        device: &Arc<Device>,
        format: vk::Format,
        samples: vk::SampleCountFlags,
        last_layout: vk::ImageLayout,
    ) -> Result<Arc<Self>> {
        let single = samples == vk::SampleCountFlags::TYPE_1;
        let attachment = |format, samples, store, layout| {
            vk::AttachmentDescription::default()
                .format(format)
                .samples(samples)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(store)
                .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
                .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
                .initial_layout(vk::ImageLayout::UNDEFINED)
                .final_layout(layout)
        };
        let colour_layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
        let depth_layout = vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
        let (keep, drop) = (vk::AttachmentStoreOp::STORE, vk::AttachmentStoreOp::DONT_CARE);
        let mut attachments = vec![
            if single {
                attachment(format, samples, keep, last_layout)
            } else {
                attachment(format, samples, drop, colour_layout)
            },
            attachment(device.depth_format, samples, drop, depth_layout),
        ];
        if !single {
            let one = vk::SampleCountFlags::TYPE_1;
            let last = attachment(format, one, keep, last_layout);
            attachments.push(last.load_op(vk::AttachmentLoadOp::DONT_CARE));
        }
        let reference = |attachment, layout| vk::AttachmentReference { attachment, layout };
        let colours = [reference(0, colour_layout)];
        let depth = reference(1, depth_layout);
        let resolves = [reference(2, colour_layout)];
        let mut subpass = vk::SubpassDescription::default()
            .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
            .color_attachments(&colours)
            .depth_stencil_attachment(&depth);
        if !single {
            subpass = subpass.resolve_attachments(&resolves);
        }
        let drawing = vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT
            | vk::PipelineStageFlags::EARLY_FRAGMENT_TESTS
            | vk::PipelineStageFlags::LATE_FRAGMENT_TESTS;
        let writing = vk::AccessFlags::COLOR_ATTACHMENT_WRITE
            | vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_WRITE;
        let reading =
            vk::AccessFlags::COLOR_ATTACHMENT_READ | vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_READ;
        let copying = vk::PipelineStageFlags::TRANSFER;
        let dependencies = [
            // The frame before drew into the same images, and may have been copied out.
            vk::SubpassDependency::default()
                .src_subpass(vk::SUBPASS_EXTERNAL)
                .dst_subpass(0)
                .src_stage_mask(drawing | copying)
                .src_access_mask(writing)
                .dst_stage_mask(drawing)
                .dst_access_mask(writing | reading),
            // This one may be copied out.
            vk::SubpassDependency::default()
                .src_subpass(0)
                .dst_subpass(vk::SUBPASS_EXTERNAL)
                .src_stage_mask(drawing)
                .src_access_mask(writing)
                .dst_stage_mask(copying)
                .dst_access_mask(vk::AccessFlags::TRANSFER_READ),
        ];
        let subpasses = [subpass];
        let info = vk::RenderPassCreateInfo::default()
            .attachments(&attachments)
            .subpasses(&subpasses)
            .dependencies(&dependencies);
        // SAFETY: the device is alive; the references above name attachments that exist.
        let raw =
            unsafe { device.raw.create_render_pass(&info, None) }.check("vkCreateRenderPass")?;
        Ok(Arc::new(Self { raw, samples, device: Arc::clone(device) }))
    }

    pub(crate) fn device(&self) -> &Arc<Device> {
        &self.device
    }
}

impl Drop for Pass {
    fn drop(&mut self) {
        // SAFETY: framebuffers and pipelines made for the pass hold an `Arc` of it.
        unsafe { self.device.raw.destroy_render_pass(self.raw, None) };
    }
}

/// What a pipeline draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Usage {
    Background,
    Smooth,
    Flat,
    Wireframe,
    Level,
    Normals,
    Coloured,
    Patches,
    Lines,
    Overlay,
    Ui,
}

/// Whether a mesh is drawn whole, or what lies beyond a plane cut away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    Whole,
    Section,
}

impl Usage {
    const COUNT: usize = 11;

    /// The bindings it has.
    pub(super) fn kind(self) -> Kind {
        match self {
            Self::Lines | Self::Overlay => Kind::Array,
            Self::Ui => Kind::Ui,
            _ => Kind::Mesh,
        }
    }

    /// Whether the shader pulls each triangle's corners itself.
    pub(super) fn by_corner(self) -> bool {
        matches!(self, Self::Wireframe | Self::Level | Self::Patches)
    }

    fn entries(self) -> (&'static CStr, &'static CStr) {
        match self {
            Self::Background => (c"vs_background", c"fs_background"),
            Self::Smooth => (c"vs_shared", c"fs_smooth"),
            Self::Flat => (c"vs_shared", c"fs_flat"),
            Self::Wireframe => (c"vs_corner", c"fs_wireframe"),
            Self::Level => (c"vs_corner", c"fs_level"),
            Self::Normals => (c"vs_shared", c"fs_normals"),
            Self::Coloured => (c"vs_coloured", c"fs_coloured"),
            Self::Patches => (c"vs_patch", c"fs_patch"),
            Self::Lines => (c"vs_line", c"fs_line"),
            Self::Overlay => (c"vs_overlay", c"fs_overlay"),
            Self::Ui => (c"vs_ui", c"fs_ui"),
        }
    }

    fn shader(self, cut: Cut) -> &'static [u8] {
        match self {
            Self::Background => include_bytes!(concat!(env!("OUT_DIR"), "/background.spv")),
            Self::Lines => include_bytes!(concat!(env!("OUT_DIR"), "/lines.spv")),
            Self::Overlay => include_bytes!(concat!(env!("OUT_DIR"), "/overlay.spv")),
            Self::Ui => include_bytes!(concat!(env!("OUT_DIR"), "/ui.spv")),
            _ if cut == Cut::Section => {
                include_bytes!(concat!(env!("OUT_DIR"), "/mesh_cut.spv"))
            }
            _ => include_bytes!(concat!(env!("OUT_DIR"), "/mesh.spv")),
        }
    }

    fn is_mesh(self) -> bool {
        !matches!(self, Self::Background | Self::Lines | Self::Overlay | Self::Ui)
    }
}

/// The pipelines of one pass, each made when it is first asked for.
pub(crate) struct Pipelines {
    made: Mutex<[[vk::Pipeline; Usage::COUNT]; 2]>,
    layouts: Arc<Layouts>,
    pass: Arc<Pass>,
}

impl Pipelines {
    pub(crate) fn new(pass: &Arc<Pass>, layouts: &Arc<Layouts>) -> Self {
        Self {
            made: Mutex::new([[vk::Pipeline::null(); Usage::COUNT]; 2]),
            layouts: Arc::clone(layouts),
            pass: Arc::clone(pass),
        }
    }

    /// Makes a pipeline if it is not there yet.
    pub(crate) fn prepare(&self, usage: Usage, cut: Cut) -> Result<()> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let slot = &mut made[cut as usize][usage as usize];
        if *slot == vk::Pipeline::null() {
            *slot = self.create(usage, cut)?;
        }
        Ok(())
    }

    /// # Panics
    /// Panics where the pipeline was not prepared.
    pub(super) fn get(&self, usage: Usage, cut: Cut) -> vk::Pipeline {
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let pipeline = made[cut as usize][usage as usize];
        assert!(pipeline != vk::Pipeline::null(), "a pipeline is prepared before it is used");
        pipeline
    }

    fn create(&self, usage: Usage, cut: Cut) -> Result<vk::Pipeline> {
        let device = &self.layouts.device;
        let words: Vec<u32> = usage
            .shader(cut)
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect();
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the words are SPIR-V that the build wrote and checked.
        let module = unsafe { device.raw.create_shader_module(&info, None) }
            .check("vkCreateShaderModule")?;
        let result = self.create_with(usage, module);
        // SAFETY: a pipeline needs its modules only while it is made.
        unsafe { device.raw.destroy_shader_module(module, None) };
        result
    }

    fn create_with(&self, usage: Usage, module: vk::ShaderModule) -> Result<vk::Pipeline> {
        let (vertex, fragment) = usage.entries();
        let stage = |stage, name| {
            vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(name)
        };
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, vertex),
            stage(vk::ShaderStageFlags::FRAGMENT, fragment),
        ];
        let input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport =
            vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(self.pass.samples);
        // Reversed: what is nearer has the greater depth.
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(usage.is_mesh() || usage == Usage::Lines)
            .depth_write_enable(usage.is_mesh())
            .depth_compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let blend = [vk::PipelineColorBlendAttachmentState::default()
            .color_write_mask(vk::ColorComponentFlags::RGBA)
            .blend_enable(matches!(usage, Usage::Lines | Usage::Overlay | Usage::Ui))
            .src_color_blend_factor(if usage == Usage::Ui {
                // Its colours come multiplied with their opacity.
                vk::BlendFactor::ONE
            } else {
                vk::BlendFactor::SRC_ALPHA
            })
            .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .color_blend_op(vk::BlendOp::ADD)
            .src_alpha_blend_factor(vk::BlendFactor::ONE)
            .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .alpha_blend_op(vk::BlendOp::ADD)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blend);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(self.layouts.pipeline(usage.kind()))
            .render_pass(self.pass.raw)
            .subpass(0)];
        let device = &self.layouts.device;
        // SAFETY: layout and pass are the device's; the shaders use the layout's bindings and no others.
        let made = unsafe { device.raw.create_graphics_pipelines(device.cache, &info, None) };
        match made {
            Ok(pipelines) => pipelines
                .first()
                .copied()
                .ok_or(Error::OutOfMemory { what: "a pipeline", bytes: 0 }),
            Err((_, result)) => Err(result).check("vkCreateGraphicsPipelines"),
        }
    }
}

impl Drop for Pipelines {
    fn drop(&mut self) {
        for &pipeline in self.made.get_mut().unwrap_or_else(PoisonError::into_inner).as_flattened()
        {
            // SAFETY: no submission uses the pipelines any more (Alive); null is allowed.
            unsafe { self.layouts.device.raw.destroy_pipeline(pipeline, None) };
        }
    }
}
