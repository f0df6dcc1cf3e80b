//! What the shaders' bindings are bound to.
#![allow(unsafe_code)]

use super::buffer::Buffer;
use super::device::Device;
use super::image::GpuImage;
use crate::error::{Check, Error, Result};
use ash::vk;
use std::sync::Arc;

/// Which bindings a pipeline has besides the frame's constants, which are group 0 of all of them. No stage has more than
/// three storage buffers: four is what every device has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Group 1: vertices, triangles, colours.
    Mesh,
    /// Group 1: one array.
    Array,
    /// Group 1: corners and indices; group 2: a texture.
    Ui,
}

pub(crate) struct Layouts {
    frame: vk::DescriptorSetLayout,
    mesh: vk::DescriptorSetLayout,
    array: vk::DescriptorSetLayout,
    ui: vk::DescriptorSetLayout,
    texture: vk::DescriptorSetLayout,
    pipelines: [vk::PipelineLayout; 3],
    sampler: vk::Sampler,
    pub(super) device: Arc<Device>,
}

const UNIFORM: vk::DescriptorType = vk::DescriptorType::UNIFORM_BUFFER;
const STORAGE: vk::DescriptorType = vk::DescriptorType::STORAGE_BUFFER;
const TEXTURE: vk::DescriptorType = vk::DescriptorType::SAMPLED_IMAGE;
const SAMPLER: vk::DescriptorType = vk::DescriptorType::SAMPLER;

impl Layouts {
    pub(crate) fn new(device: &Arc<Device>) -> Result<Arc<Self>> {
        let none = vk::DescriptorSetLayout::null();
        // The drop cleans up whatever is there when a later step fails.
        let mut layouts = Self {
            frame: none,
            mesh: none,
            array: none,
            ui: none,
            texture: none,
            pipelines: [vk::PipelineLayout::null(); 3],
            sampler: vk::Sampler::null(),
            device: Arc::clone(device),
        };
        let vertex = vk::ShaderStageFlags::VERTEX;
        let fragment = vk::ShaderStageFlags::FRAGMENT;
        layouts.frame = set_layout(device, &[(UNIFORM, vertex | fragment)])?;
        layouts.mesh = set_layout(device, &[(STORAGE, vertex); 3])?;
        layouts.array = set_layout(device, &[(STORAGE, vertex)])?;
        layouts.ui = set_layout(device, &[(STORAGE, vertex); 2])?;
        layouts.texture = set_layout(device, &[(TEXTURE, fragment), (SAMPLER, fragment)])?;
        for kind in [Kind::Mesh, Kind::Array, Kind::Ui] {
            let sets = [layouts.frame, layouts.of(kind), layouts.texture];
            let used = if kind == Kind::Ui { 3 } else { 2 };
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets[..used]);
            // SAFETY: the device is alive, the set layouts are its own.
            let made = unsafe { device.raw.create_pipeline_layout(&info, None) };
            layouts.pipelines[kind as usize] = made.check("vkCreatePipelineLayout")?;
        }
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(edge)
            .address_mode_v(edge)
            .address_mode_w(edge);
        // SAFETY: the device is alive.
        layouts.sampler =
            unsafe { device.raw.create_sampler(&info, None) }.check("vkCreateSampler")?;
        Ok(Arc::new(layouts))
    }

    fn of(&self, kind: Kind) -> vk::DescriptorSetLayout {
        match kind {
            Kind::Mesh => self.mesh,
            Kind::Array => self.array,
            Kind::Ui => self.ui,
        }
    }

    pub(super) fn pipeline(&self, kind: Kind) -> vk::PipelineLayout {
        self.pipelines[kind as usize]
    }
}

impl Drop for Layouts {
    fn drop(&mut self) {
        let device = &self.device.raw;
        // SAFETY: sets that use the sampler hold an `Arc` of this, so none is left.
        unsafe { device.destroy_sampler(self.sampler, None) };
        for layout in self.pipelines {
            // SAFETY: pipelines made with these hold an `Arc` of them, so none is left.
            unsafe { device.destroy_pipeline_layout(layout, None) };
        }
        for layout in [self.texture, self.ui, self.array, self.mesh, self.frame] {
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

/// What one binding is bound to.
enum Binding<'a> {
    Buffer(vk::DescriptorType, &'a Buffer),
    Texture(&'a GpuImage),
    Sampler,
}

impl Binding<'_> {
    fn kind(&self) -> vk::DescriptorType {
        match self {
            Self::Buffer(kind, _) => *kind,
            Self::Texture(_) => TEXTURE,
            Self::Sampler => SAMPLER,
        }
    }
}

/// A descriptor set, written once, with a pool of its own.
struct Set {
    pool: vk::DescriptorPool,
    raw: vk::DescriptorSet,
    layouts: Arc<Layouts>,
}

impl Set {
    fn new(
        layouts: &Arc<Layouts>,
        layout: vk::DescriptorSetLayout,
        bindings: &[Binding<'_>],
    ) -> Result<Self> {
        let device = &layouts.device.raw;
        let sizes: Vec<_> = bindings
            .iter()
            .map(|b| vk::DescriptorPoolSize::default().ty(b.kind()).descriptor_count(1))
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
        for (binding, at) in bindings.iter().zip(0..) {
            set.write(binding, at);
        }
        Ok(set)
    }

    fn write(&self, binding: &Binding<'_>, at: u32) {
        let (buffer, image) = match binding {
            Binding::Buffer(_, buffer) => {
                let info = vk::DescriptorBufferInfo::default().buffer(buffer.raw);
                (Some(info.range(vk::WHOLE_SIZE)), None)
            }
            Binding::Texture(image) => {
                let info = vk::DescriptorImageInfo::default().image_view(image.view);
                (None, Some(info.image_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)))
            }
            Binding::Sampler => {
                (None, Some(vk::DescriptorImageInfo::default().sampler(self.layouts.sampler)))
            }
        };
        let mut write = vk::WriteDescriptorSet::default()
            .dst_set(self.raw)
            .dst_binding(at)
            .descriptor_type(binding.kind());
        if let Some(info) = &buffer {
            write = write.buffer_info(std::slice::from_ref(info));
        }
        if let Some(info) = &image {
            write = write.image_info(std::slice::from_ref(info));
        }
        // SAFETY: the set is new, so nothing uses it; the buffers' sizes are within the device's limits.
        unsafe { self.layouts.device.raw.update_descriptor_sets(&[write], &[]) };
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
    pub(crate) colours: Arc<Buffer>,
    _set: Set,
}

impl MeshSet {
    pub(crate) fn new(
        layouts: &Arc<Layouts>,
        vertices: Arc<Buffer>,
        triangles: Arc<Buffer>,
        colours: Arc<Buffer>,
    ) -> Result<Self> {
        let bound = [&*vertices, &*triangles, &*colours].map(|b| Binding::Buffer(STORAGE, b));
        let set = Set::new(layouts, layouts.mesh, &bound)?;
        Ok(Self { raw: set.raw, vertices, triangles, colours, _set: set })
    }
}

/// A frame's constants, bound.
pub(crate) struct FrameSet {
    pub(super) raw: vk::DescriptorSet,
    _set: Set,
}

impl FrameSet {
    /// The buffer must outlive the set.
    pub(crate) fn new(layouts: &Arc<Layouts>, constants: &Buffer) -> Result<Self> {
        let set = Set::new(layouts, layouts.frame, &[Binding::Buffer(UNIFORM, constants)])?;
        Ok(Self { raw: set.raw, _set: set })
    }
}

/// Arrays that a frame writes anew, bound.
pub(crate) struct ArraySet {
    pub(super) raw: vk::DescriptorSet,
    _set: Set,
}

impl ArraySet {
    /// One buffer, or two for [`Kind::Ui`]; they must outlive the set.
    pub(crate) fn new(layouts: &Arc<Layouts>, buffers: &[&Buffer]) -> Result<Self> {
        let bound: Vec<_> = buffers.iter().map(|b| Binding::Buffer(STORAGE, b)).collect();
        let layout = if buffers.len() == 1 { layouts.array } else { layouts.ui };
        let set = Set::new(layouts, layout, &bound)?;
        Ok(Self { raw: set.raw, _set: set })
    }
}

/// A texture, bound; it keeps its image.
pub(crate) struct TextureSet {
    pub(super) raw: vk::DescriptorSet,
    pub(crate) image: GpuImage,
    _set: Set,
}

impl TextureSet {
    pub(crate) fn new(layouts: &Arc<Layouts>, image: GpuImage) -> Result<Self> {
        let bound = [Binding::Texture(&image), Binding::Sampler];
        let set = Set::new(layouts, layouts.texture, &bound)?;
        Ok(Self { raw: set.raw, image, _set: set })
    }
}
