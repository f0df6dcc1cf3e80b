//! A window's surface and swapchain.
#![allow(unsafe_code)]

use super::device::Device;
use crate::error::{Check, Error, Result};
use crate::window::Pacing;
use ash::vk;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use std::rc::Rc;
use std::sync::Arc;

/// Whatever has a window's handles. The surface keeps it, so that the window outlives it.
pub(crate) trait Window: HasDisplayHandle + HasWindowHandle {}
impl<W: HasDisplayHandle + HasWindowHandle> Window for W {}

pub(crate) struct Surface {
    raw: vk::SurfaceKHR,
    device: Arc<Device>,
    // Last: the window goes after its surface.
    _window: Box<dyn Window>,
}

impl Surface {
    pub(crate) fn new(device: &Arc<Device>, window: Box<dyn Window>) -> Result<Self> {
        let instance = &device.instance;
        let not_presentable = || Error::NotPresentable { device: device.name.clone() };
        let functions = instance.surface.as_ref().ok_or_else(not_presentable)?;
        let display = window.display_handle()?.as_raw();
        let handle = window.window_handle()?.as_raw();
        // SAFETY: the handles are valid, as their traits promise, and `_window` keeps them so.
        let made = unsafe {
            ash_window::create_surface(&instance.entry, &instance.raw, display, handle, None)
        };
        let raw = match made {
            Err(vk::Result::ERROR_EXTENSION_NOT_PRESENT) => return Err(not_presentable()),
            other => other.check("vkCreateSurfaceKHR")?,
        };
        let surface = Self { raw, device: Arc::clone(device), _window: window };
        let (physical, family) = (device.physical, device.queue_family);
        // SAFETY: device, family and surface are of one instance.
        let presents =
            unsafe { functions.get_physical_device_surface_support(physical, family, raw) }
                .check("vkGetPhysicalDeviceSurfaceSupportKHR")?;
        if presents && device.swapchains.is_some() { Ok(surface) } else { Err(not_presentable()) }
    }

    /// The format to draw in, and whether the shaders have to encode to sRGB.
    pub(crate) fn format(&self) -> Result<(vk::SurfaceFormatKHR, bool)> {
        let functions = self.functions()?;
        // SAFETY: device and surface are of one instance.
        let formats = unsafe {
            functions.get_physical_device_surface_formats(self.device.physical, self.raw)
        }
        .check("vkGetPhysicalDeviceSurfaceFormatsKHR")?;
        let find = |wanted: [vk::Format; 2]| {
            wanted.into_iter().find_map(|format| {
                let space = vk::ColorSpaceKHR::SRGB_NONLINEAR;
                formats.iter().find(|f| f.format == format && f.color_space == space).copied()
            })
        };
        // A processor encodes every pixel by itself, and half of them have their colour in sRGB already.
        let encoding = [vk::Format::B8G8R8A8_SRGB, vk::Format::R8G8B8A8_SRGB];
        if let Some(format) = find(encoding).filter(|_| !self.device.software) {
            return Ok((format, false));
        }
        find([vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM])
            .map(|format| (format, true))
            .or_else(|| find(encoding).map(|format| (format, false)))
            .or_else(|| formats.first().map(|&format| (format, true)))
            .ok_or(Error::SurfaceLost)
    }

    fn functions(&self) -> Result<&ash::khr::surface::Instance> {
        self.device.instance.surface.as_ref().ok_or(Error::SurfaceLost)
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        if let Some(functions) = &self.device.instance.surface {
            // SAFETY: the swapchains made for the surface hold an `Rc` of it, so none is left.
            unsafe { functions.destroy_surface(self.raw, None) };
        }
    }
}

/// What came of asking for a picture to draw into.
pub(crate) enum Acquired {
    /// Draw into the image of this index; wait for the first semaphore, signal the second.
    Image { index: u32, ready: vk::Semaphore, drawn: vk::Semaphore },
    /// The window has changed: make another swapchain.
    OutOfDate,
}

pub(crate) struct Swapchain {
    raw: vk::SwapchainKHR,
    pub(crate) size: vk::Extent2D,
    images: Vec<SwapchainImage>,
    /// One per frame in flight, taken in turn.
    ready: Vec<vk::Semaphore>,
    next: usize,
    device: Arc<Device>,
    _surface: Rc<Surface>,
}

struct SwapchainImage {
    view: vk::ImageView,
    drawn: vk::Semaphore,
}

impl Swapchain {
    /// `None` where the window has no area just now. Nothing of `old` may be in use; it is replaced.
    pub(crate) fn new(
        surface: &Rc<Surface>,
        format: vk::SurfaceFormatKHR,
        wanted: vk::Extent2D,
        pacing: Pacing,
        frames: usize,
        old: Option<Self>,
    ) -> Result<Option<Self>> {
        let device = &surface.device;
        let functions = surface.functions()?;
        let Some(swapchains) = &device.swapchains else {
            return Err(Error::NotPresentable { device: device.name.clone() });
        };
        let physical = device.physical;
        // SAFETY: device and surface are of one instance.
        let can =
            unsafe { functions.get_physical_device_surface_capabilities(physical, surface.raw) }
                .check("vkGetPhysicalDeviceSurfaceCapabilitiesKHR")?;
        // Some systems leave the size to us and say so with the greatest number.
        let size = if can.current_extent.width == u32::MAX {
            let (min, max) = (can.min_image_extent, can.max_image_extent);
            vk::Extent2D {
                width: wanted.width.max(min.width).min(max.width),
                height: wanted.height.max(min.height).min(max.height),
            }
        } else {
            can.current_extent
        };
        if size.width == 0 || size.height == 0 {
            return Ok(None);
        }
        let most = if can.max_image_count == 0 { u32::MAX } else { can.max_image_count };
        let alpha = [
            vk::CompositeAlphaFlagsKHR::OPAQUE,
            vk::CompositeAlphaFlagsKHR::INHERIT,
            vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED,
        ]
        .into_iter()
        .find(|&alpha| can.supported_composite_alpha.contains(alpha))
        .unwrap_or(vk::CompositeAlphaFlagsKHR::POST_MULTIPLIED);
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.raw)
            .min_image_count((can.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(size)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(can.current_transform)
            .composite_alpha(alpha)
            .present_mode(present_mode(surface, functions, pacing)?)
            .clipped(true)
            .old_swapchain(old.as_ref().map_or(vk::SwapchainKHR::null(), |old| old.raw));
        // SAFETY: all values are within what the surface can do; the old swapchain is reached by value.
        let raw =
            unsafe { swapchains.create_swapchain(&info, None) }.check("vkCreateSwapchainKHR")?;
        drop(old);
        let mut swapchain = Self {
            raw,
            size,
            images: Vec::new(),
            ready: Vec::new(),
            next: 0,
            device: Arc::clone(device),
            _surface: Rc::clone(surface),
        };
        // SAFETY: the swapchain is new.
        let images =
            unsafe { swapchains.get_swapchain_images(raw) }.check("vkGetSwapchainImagesKHR")?;
        for image in images {
            let view = device.view(image, format.format, vk::ImageAspectFlags::COLOR)?;
            swapchain.images.push(SwapchainImage { view, drawn: vk::Semaphore::null() });
        }
        for i in 0..swapchain.images.len() {
            swapchain.images[i].drawn = device.semaphore()?;
        }
        for _ in 0..frames {
            swapchain.ready.push(device.semaphore()?);
        }
        Ok(Some(swapchain))
    }

    pub(crate) fn views(&self) -> impl Iterator<Item = vk::ImageView> {
        self.images.iter().map(|image| image.view)
    }

    /// The frame that used the semaphore before, `frames` frames ago, must be finished.
    pub(crate) fn acquire(&mut self) -> Result<Acquired> {
        let Some(swapchains) = &self.device.swapchains else { return Ok(Acquired::OutOfDate) };
        let ready = self.ready[self.next];
        let fence = vk::Fence::null();
        // SAFETY: the swapchain is reached through `&mut`; the semaphore's last wait is finished, as the caller saw to.
        match unsafe { swapchains.acquire_next_image(self.raw, u64::MAX, ready, fence) } {
            // A swapchain that merely fits badly has given its image all the same; presenting it says so again.
            Ok((index, _)) => {
                self.next = (self.next + 1) % self.ready.len();
                let Some(image) = self.images.get(index as usize) else {
                    return Err(Error::SurfaceLost);
                };
                Ok(Acquired::Image { index, ready, drawn: image.drawn })
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Acquired::OutOfDate),
            Err(other) => Err(other).check("vkAcquireNextImageKHR"),
        }
    }

    /// Shows an image once `drawn` is signalled. `false` where the swapchain no longer fits its window.
    pub(crate) fn present(&mut self, index: u32, drawn: vk::Semaphore) -> Result<bool> {
        let (semaphores, swapchains, indices) = ([drawn], [self.raw], [index]);
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&semaphores)
            .swapchains(&swapchains)
            .image_indices(&indices);
        match self.device.present(&info) {
            Ok(suboptimal) => Ok(!suboptimal),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(false),
            Err(other) => Err(other).check("vkQueuePresentKHR"),
        }
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        let device = &self.device.raw;
        for image in &self.images {
            // SAFETY: the owner waited until the device was idle, and its framebuffers are gone; here and below.
            unsafe { device.destroy_image_view(image.view, None) };
            // SAFETY: as above.
            unsafe { device.destroy_semaphore(image.drawn, None) };
        }
        if let Some(swapchains) = &self.device.swapchains {
            // SAFETY: as above.
            unsafe { swapchains.destroy_swapchain(self.raw, None) };
        }
        for &ready in &self.ready {
            // SAFETY: as above.
            unsafe { device.destroy_semaphore(ready, None) };
        }
    }
}

fn present_mode(
    surface: &Surface,
    functions: &ash::khr::surface::Instance,
    pacing: Pacing,
) -> Result<vk::PresentModeKHR> {
    if pacing == Pacing::Display {
        return Ok(vk::PresentModeKHR::FIFO);
    }
    let physical = surface.device.physical;
    // SAFETY: device and surface are of one instance.
    let modes =
        unsafe { functions.get_physical_device_surface_present_modes(physical, surface.raw) }
            .check("vkGetPhysicalDeviceSurfacePresentModesKHR")?;
    Ok([vk::PresentModeKHR::MAILBOX, vk::PresentModeKHR::IMMEDIATE]
        .into_iter()
        .find(|mode| modes.contains(mode))
        .unwrap_or(vk::PresentModeKHR::FIFO))
}

impl Device {
    fn semaphore(&self) -> Result<vk::Semaphore> {
        // SAFETY: the device is alive.
        unsafe { self.raw.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }
            .check("vkCreateSemaphore")
    }
}
