//! Pictures in memory.

use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Framebuffer, GpuImage, Memory};
use crate::painter::{Painter, Ties};
use crate::scene::{Image, Scene};
use ash::vk;
use std::sync::Arc;

const FORMAT: vk::Format = vk::Format::R8G8B8A8_SRGB;

/// A render target that no display has to exist for.
pub struct Offscreen {
    // First: its drop waits until the rest is no longer in use.
    painter: Painter,
    picture: Picture,
    context: Context,
}

/// What depends on the size.
struct Picture {
    framebuffer: Arc<Framebuffer>,
    image: Arc<GpuImage>,
    pixels: Buffer,
    size: vk::Extent2D,
}

impl Offscreen {
    /// A target for pictures of this size, in pixels.
    ///
    /// # Errors
    /// [`PictureSize`](Error::PictureSize) where a side is 0 or beyond the device;
    /// [`OutOfMemory`](Error::OutOfMemory).
    pub fn new(context: &Context, width: u32, height: u32) -> Result<Self> {
        let painter = Painter::new(context, FORMAT, false, vk::ImageLayout::TRANSFER_SRC_OPTIMAL)?;
        let picture = Picture::new(context, &painter, width, height)?;
        Ok(Self { painter, picture, context: context.clone() })
    }

    /// Draws a scene and waits for the picture.
    ///
    /// # Errors
    /// [`DeviceLost`](Error::DeviceLost), [`OutOfMemory`](Error::OutOfMemory).
    ///
    /// # Panics
    /// Panics where the scene's mesh is of another context.
    pub fn draw(&mut self, scene: &Scene<'_>) -> Result<Image> {
        let picture = &self.picture;
        let read_back = Some((&*picture.image, &picture.pixels));
        let ties = Ties { read_back, ..Ties::default() };
        let serial = self.painter.paint(scene, &picture.framebuffer, ties)?;
        self.context.device.wait(serial)?;
        let vk::Extent2D { width, height } = picture.size;
        let bytes = 4 * width as usize * height as usize;
        Ok(Image { width, height, rgba: picture.pixels.read(bytes).to_vec() })
    }

    /// Draws a scene for nobody to see: for measuring. Waits only for the picture before the last one.
    ///
    /// # Errors
    /// As [`Offscreen::draw`].
    ///
    /// # Panics
    /// Panics where the scene's mesh is of another context.
    pub fn render(&mut self, scene: &Scene<'_>) -> Result<()> {
        self.painter.paint(scene, &self.picture.framebuffer, Ties::default())?;
        Ok(())
    }

    /// Gives later pictures another size. After an error the size is what it was.
    ///
    /// # Errors
    /// As [`Offscreen::new`].
    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        if (width, height) != self.size() {
            let picture = Picture::new(&self.context, &self.painter, width, height)?;
            // What was submitted keeps the old images alive; the old buffer was waited for when it was read.
            self.picture = picture;
        }
        Ok(())
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.picture.size.width, self.picture.size.height)
    }
}

impl Picture {
    fn new(context: &Context, painter: &Painter, width: u32, height: u32) -> Result<Self> {
        let limits = &context.device.limits;
        let limit = limits
            .max_image_dimension2_d
            .min(limits.max_framebuffer_width)
            .min(limits.max_framebuffer_height)
            .min(limits.max_viewport_dimensions[0])
            .min(limits.max_viewport_dimensions[1]);
        if width == 0 || height == 0 || width > limit || height > limit {
            return Err(Error::PictureSize { width, height, limit });
        }
        let device = &context.device;
        let size = vk::Extent2D { width, height };
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let one = vk::SampleCountFlags::TYPE_1;
        let image = Arc::new(GpuImage::new(device, size, FORMAT, one, usage)?);
        let (colour, depth) = painter.attachments(FORMAT, size)?;
        let framebuffer = Arc::new(Framebuffer::new(
            painter.pass(),
            size,
            colour.as_ref(),
            &depth,
            image.view(),
            vec![Arc::clone(&image)],
        )?);
        let bytes = 4 * u64::from(width) * u64::from(height);
        let usage = vk::BufferUsageFlags::TRANSFER_DST;
        let pixels = Buffer::new(device, "a picture's pixels", bytes, usage, Memory::Readback)?;
        Ok(Self { framebuffer, image, pixels, size })
    }
}

impl std::fmt::Debug for Offscreen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Offscreen").field("size", &self.size()).finish_non_exhaustive()
    }
}
