//! What the shaders' bindings are bound to.
#![allow(unsafe_code)]

use super::buffer::Buffer;
use super::device::Device;
use crate::error::{Check, Error, Result};
use ash::vk;
use std::sync::Arc;

/// Group 0 is the frame's, group 1 the mesh's; the same for all pipelines.
pub(crate) struct Layouts {
    frame: vk::DescriptorSetLayout,
    mesh: vk::DescriptorSetLayout,
    pub(super) pipeline: vk::PipelineLayout,
    pub(super) device: Arc<Device>,
}

const UNIFORM: vk::DescriptorType = vk::DescriptorType::UNIFORM_BUFFER;
const STORAGE: vk::DescriptorType = vk::DescriptorType::STORAGE_BUFFER;

impl Layouts {
    pub(crate) fn new(device: &Arc<Device>) -> Result<Arc<Self>> {
        let mut layouts = Self {
            frame: vk::DescriptorSetLayout::null(),
            mesh: vk::DescriptorSetLayout::null(),
            pipeline: vk::PipelineLayout::null(),
            device: Arc::clone(device),
        };
        let vertex = vk::ShaderStageFlags::VERTEX;
        let both = vertex | vk::ShaderStageFlags::FRAGMENT;
        layouts.frame =
            set_layout(device, &[(UNIFORM, both), (STORAGE, vertex), (STORAGE, vertex)])?;
        layouts.mesh = set_layout(device, &[(STORAGE, vertex), (STORAGE, vertex)])?;
        let sets = [layouts.frame, layouts.mesh];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: the device is alive, the set layouts are its own.
        layouts.pipeline = unsafe { device.raw.create_pipeline_layout(&info, None) }
            .check("vkCreatePipelineLayout")?;
        Ok(Arc::new(layouts))
    }
}

impl Drop for Layouts {
    fn drop(&mut self) {
        let device = &self.device.raw;
        // SAFETY: pipelines and sets made with these hold an `Arc` of them, so none is left.
        unsafe { device.destroy_pipeline_layout(self.pipeline, None) };
        for layout in [self.mesh, self.frame] {
            // SAFETY: as above.
            unsafe { device.destroy_descriptor_set_layout(layout, None) };
        }
    }
}

fn set_layout(
    device: &Device,
    kinds: &[(vk::DescriptorType, vk::ShaderStageFlags)],
) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = kinds
        .iter()
        .zip(0..)
        .map(|(&(kind, stages), binding)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive.
    unsafe { device.raw.create_descriptor_set_layout(&info, None) }
        .check("vkCreateDescriptorSetLayout")
}

/// One descriptor set, written once, with a pool of its own.
struct Set {
    pool: vk::DescriptorPool,
    raw: vk::DescriptorSet,
    layouts: Arc<Layouts>,
}

impl Set {
    fn new(
        layouts: &Arc<Layouts>,
        layout: vk::DescriptorSetLayout,
        buffers: &[(vk::DescriptorType, &Buffer)],
    ) -> Result<Self> {
        let device = &layouts.device.raw;
        let sizes: Vec<_> = buffers
            .iter()
            .map(|&(kind, _)| vk::DescriptorPoolSize::default().ty(kind).descriptor_count(1))
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { device.create_descriptor_pool(&info, None) }
            .check("vkCreateDescriptorPool")?;
        let mut set = Self { pool, raw: vk::DescriptorSet::null(), layouts: Arc::clone(layouts) };
        let wanted = [layout];
        let info =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&wanted);
        // SAFETY: the pool is new and was made for exactly this.
        let sets =
            unsafe { device.allocate_descriptor_sets(&info) }.check("vkAllocateDescriptorSets")?;
        set.raw = *sets.first().ok_or(Error::OutOfMemory { what: "bindings", bytes: 0 })?;
        let infos: Vec<_> = buffers
            .iter()
            .map(|(_, buffer)| {
                [vk::DescriptorBufferInfo::default().buffer(buffer.raw).range(vk::WHOLE_SIZE)]
            })
            .collect();
        let writes: Vec<_> = buffers
            .iter()
            .zip(&infos)
            .zip(0..)
            .map(|((&(kind, _), info), binding)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set.raw)
                    .dst_binding(binding)
                    .descriptor_type(kind)
                    .buffer_info(info)
            })
            .collect();
        // SAFETY: the set is new, so nothing uses it; the buffers' sizes are within the device's limits.
        unsafe { device.update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }
}

impl Drop for Set {
    fn drop(&mut self) {
        // SAFETY: no submission uses the set any more (Alive).
        unsafe { self.layouts.device.raw.destroy_descriptor_pool(self.pool, None) };
    }
}

/// A mesh's buffers, bound; immutable, so that a frame in flight may go on using it while the mesh has moved to a
/// bigger one.
pub(crate) struct MeshSet {
    pub(super) raw: vk::DescriptorSet,
    pub(crate) vertices: Arc<Buffer>,
    pub(crate) triangles: Arc<Buffer>,
    _set: Set,
}

impl MeshSet {
    pub(crate) fn new(
        layouts: &Arc<Layouts>,
        vertices: Arc<Buffer>,
        triangles: Arc<Buffer>,
    ) -> Result<Self> {
        let buffers = [(STORAGE, &*vertices), (STORAGE, &*triangles)];
        let set = Set::new(layouts, layouts.mesh, &buffers)?;
        Ok(Self { raw: set.raw, vertices, triangles, _set: set })
    }
}

/// A frame's buffers, bound.
pub(crate) struct FrameSet {
    pub(super) raw: vk::DescriptorSet,
    _set: Set,
}

impl FrameSet {
    /// The buffers must outlive the set.
    pub(crate) fn new(
        layouts: &Arc<Layouts>,
        constants: &Buffer,
        lines: &Buffer,
        cells: &Buffer,
    ) -> Result<Self> {
        let buffers = [(UNIFORM, constants), (STORAGE, lines), (STORAGE, cells)];
        let set = Set::new(layouts, layouts.frame, &buffers)?;
        Ok(Self { raw: set.raw, _set: set })
    }
}
