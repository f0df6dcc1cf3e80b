//! Images that a user interface takes its pieces from.

use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, CommandBuffer, GpuImage, Keep, Memory, TextureSet, Work};
use ash::vk;
use std::sync::Arc;

/// An image on the device for [`Ui`](crate::Ui): red, green, blue (sRGB, multiplied with the opacity) and opacity.
pub struct Texture {
    set: Arc<TextureSet>,
    size: [u32; 2],
    context: Context,
}

impl Texture {
    /// A texture of a size in pixels with its content, four bytes to a pixel, row by row from the upper left.
    ///
    /// # Errors
    /// [`PictureSize`](Error::PictureSize) where a side is 0 or beyond the device; [`OutOfMemory`](Error::OutOfMemory).
    ///
    /// # Panics
    /// Panics where there are not four bytes for every pixel.
    pub fn new(context: &Context, size: [u32; 2], rgba: &[u8]) -> Result<Self> {
        let limit = context.max_texture_side();
        let [width, height] = size;
        if size.contains(&0) || width.max(height) > limit {
            return Err(Error::PictureSize { width, height, limit });
        }
        let extent = vk::Extent2D { width, height };
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let one = vk::SampleCountFlags::TYPE_1;
        let format = vk::Format::R8G8B8A8_UNORM;
        let image = GpuImage::new(&context.device, extent, format, one, usage)?;
        let set = Arc::new(TextureSet::new(&context.layouts, image)?);
        let mut texture = Self { set, size, context: context.clone() };
        texture.send([0, 0], size, rgba, false)?;
        Ok(texture)
    }

    /// Replaces a part of it. Pictures drawn before show it as it was, pictures drawn after as it is.
    ///
    /// # Errors
    /// [`OutOfMemory`](Error::OutOfMemory), [`DeviceLost`](Error::DeviceLost).
    ///
    /// # Panics
    /// Panics where the part does not lie within the texture, or there are not four bytes for every pixel of it.
    pub fn write(&mut self, origin: [u32; 2], size: [u32; 2], rgba: &[u8]) -> Result<()> {
        if size.contains(&0) {
            return Ok(());
        }
        self.send(origin, size, rgba, true)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    fn send(
        &mut self,
        origin: [u32; 2],
        size: [u32; 2],
        rgba: &[u8],
        was_read: bool,
    ) -> Result<()> {
        let fits = |k: usize| origin[k] <= self.size[k] && size[k] <= self.size[k] - origin[k];
        assert!(fits(0) && fits(1), "the part lies within the texture");
        assert_eq!(rgba.len() as u64, 4 * u64::from(size[0]) * u64::from(size[1]), "bytes");
        let device = &self.context.device;
        let usage = vk::BufferUsageFlags::TRANSFER_SRC;
        let mut staging =
            Buffer::new(device, "a texture", rgba.len() as u64, usage, Memory::Upload)?;
        staging.write(0, rgba);
        let mut commands = CommandBuffer::new(device)?;
        commands.begin()?;
        let place = [origin[0], origin[1], size[0], size[1]];
        commands.write_image(&staging, &self.set.image, place, was_read);
        commands.end()?;
        let raw = commands.raw();
        let keep: Vec<Keep> =
            vec![Arc::new(staging), Arc::new(commands), Arc::clone(&self.set) as Keep];
        device.submit(Work { commands: raw, keep, ..Work::default() })?;
        Ok(())
    }

    pub(crate) fn set(&self) -> &Arc<TextureSet> {
        &self.set
    }

    pub(crate) fn is_of(&self, context: &Context) -> bool {
        Arc::ptr_eq(&self.context.device, &context.device)
    }
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Texture").field("size", &self.size).finish_non_exhaustive()
    }
}
