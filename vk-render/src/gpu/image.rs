//! Images that are drawn into, and framebuffers of them.
#![allow(unsafe_code)]

use super::buffer::Memory;
use super::device::Device;
use super::pipeline::Pass;
use crate::error::{Check, Result};
use ash::vk;
use std::sync::Arc;

pub(crate) struct GpuImage {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    memory: vk::DeviceMemory,
    device: Arc<Device>,
}

impl GpuImage {
    pub(crate) fn new(
        device: &Arc<Device>,
        size: vk::Extent2D,
        format: vk::Format,
        samples: vk::SampleCountFlags,
        usage: vk::ImageUsageFlags,
    ) -> Result<Self> {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: size.width, height: size.height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(samples)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is alive; the size was checked against its limits by the target.
        let raw = unsafe { device.raw.create_image(&info, None) }.check("vkCreateImage")?;
        let mut image = Self {
            raw,
            view: vk::ImageView::null(),
            memory: vk::DeviceMemory::null(),
            device: Arc::clone(device),
        };
        // SAFETY: the image is the device's.
        let needs = unsafe { device.raw.get_image_memory_requirements(raw) };
        image.memory = device.allocate("a picture", needs, Memory::Device)?;
        // SAFETY: the memory is new, large enough and of a type the image takes.
        unsafe { device.raw.bind_image_memory(raw, image.memory, 0) }.check("vkBindImageMemory")?;
        let depth = usage.contains(vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT);
        let aspect = if depth { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
        image.view = device.view(raw, format, aspect)?;
        Ok(image)
    }
}

impl Drop for GpuImage {
    fn drop(&mut self) {
        // SAFETY: no submission uses the image any more (Alive); its framebuffers go before it.
        unsafe { self.device.raw.destroy_image_view(self.view, None) };
        // SAFETY: as above.
        unsafe { self.device.raw.destroy_image(self.raw, None) };
        // SAFETY: the memory belonged to that image alone.
        unsafe { self.device.raw.free_memory(self.memory, None) };
    }
}

impl Device {
    pub(super) fn view(
        &self,
        image: vk::Image,
        format: vk::Format,
        aspect: vk::ImageAspectFlags,
    ) -> Result<vk::ImageView> {
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: aspect,
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: 0,
                layer_count: 1,
            });
        // SAFETY: the image is the device's, with one level and one layer of that format.
        unsafe { self.raw.create_image_view(&info, None) }.check("vkCreateImageView")
    }
}

/// Colour, depth, and where there is more than one sample the image they are resolved into.
pub(crate) struct Framebuffer {
    pub(super) raw: vk::Framebuffer,
    pub(super) size: vk::Extent2D,
    device: Arc<Device>,
    _pass: Arc<Pass>,
    _images: Vec<Arc<GpuImage>>,
}

impl Framebuffer {
    /// Draws into `last` in the end: an image of ours, or a swapchain's, which must outlive this.
    pub(crate) fn new(
        pass: &Arc<Pass>,
        size: vk::Extent2D,
        colour: Option<&Arc<GpuImage>>,
        depth: &Arc<GpuImage>,
        last: vk::ImageView,
        mut images: Vec<Arc<GpuImage>>,
    ) -> Result<Self> {
        let device = Arc::clone(pass.device());
        let attachments: Vec<vk::ImageView> = match colour {
            Some(colour) => vec![colour.view, depth.view, last],
            None => vec![last, depth.view],
        };
        images.extend(colour.cloned());
        images.push(Arc::clone(depth));
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(pass.raw)
            .attachments(&attachments)
            .width(size.width)
            .height(size.height)
            .layers(1);
        // SAFETY: the views are the device's, of the pass's formats and of this size.
        let raw =
            unsafe { device.raw.create_framebuffer(&info, None) }.check("vkCreateFramebuffer")?;
        Ok(Self { raw, size, device, _pass: Arc::clone(pass), _images: images })
    }

    pub(crate) fn size(&self) -> vk::Extent2D {
        self.size
    }
}

impl Drop for Framebuffer {
    fn drop(&mut self) {
        // SAFETY: no submission uses the framebuffer any more (Alive).
        unsafe { self.device.raw.destroy_framebuffer(self.raw, None) };
    }
}

impl GpuImage {
    pub(crate) fn view(&self) -> vk::ImageView {
        self.view
    }
}
