//! Pictures in a window.

use crate::context::Context;
use crate::error::Result;
use crate::gpu::{Acquired, Framebuffer, Surface, Swapchain};
use crate::offscreen::Offscreen;
use crate::painter::{FRAMES_IN_FLIGHT, Painter, Ties};
use crate::scene::{Image, Scene};
use ash::vk;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use std::rc::Rc;
use std::sync::Arc;

/// When a picture appears.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Pacing {
    /// With the display's refresh: no tearing, no frame drawn in vain.
    #[default]
    Display,
    /// As soon as it is drawn, where the driver can; for measuring.
    Unlimited,
}

/// What became of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Presented {
    /// It is on its way to the screen.
    Shown,
    /// The window has changed under it and nothing was drawn; the next picture will fit. Draw again.
    OutOfDate,
    /// The window has no area just now, so nothing was drawn.
    Minimised,
}

/// A render target on the screen. It stays on the thread that made it, as windows do.
pub struct WindowTarget {
    // In this order: framebuffers, swapchain, pass, surface; `drop` waits before any of them.
    chain: Option<Chain>,
    painter: Painter,
    surface: Rc<Surface>,
    format: vk::SurfaceFormatKHR,
    wanted: vk::Extent2D,
    /// Whether the swapchain no longer fits its window.
    stale: bool,
    pacing: Pacing,
    context: Context,
}

struct Chain {
    framebuffers: Vec<Arc<Framebuffer>>,
    swapchain: Swapchain,
}

impl WindowTarget {
    /// Draws into `window`, which the target keeps: hand it an `Arc` to go on using it. `size` is the window's inner
    /// size in pixels; either side may be 0.
    ///
    /// # Errors
    /// [`NotPresentable`](crate::Error::NotPresentable) where the device cannot show pictures there.
    pub fn new<W>(context: &Context, window: W, size: (u32, u32), pacing: Pacing) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let surface = Rc::new(Surface::new(&context.device, Box::new(window))?);
        let (format, encode) = surface.format()?;
        let layout = vk::ImageLayout::PRESENT_SRC_KHR;
        Ok(Self {
            chain: None,
            painter: Painter::new(context, format.format, encode, layout)?,
            surface,
            format,
            wanted: vk::Extent2D { width: size.0, height: size.1 },
            stale: false,
            pacing,
            context: context.clone(),
        })
    }

    /// Tells of the window's new inner size, in pixels; either side may be 0. Takes effect with the next picture.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.wanted = vk::Extent2D { width, height };
        self.stale |= self.chain.as_ref().is_some_and(|chain| chain.swapchain.size != self.wanted);
    }

    /// The pictures' width and height in pixels, for a camera's aspect ratio; 0 while the window has no area.
    pub fn size(&self) -> (u32, u32) {
        let size = match &self.chain {
            Some(chain) if !self.stale => chain.swapchain.size,
            _ => self.wanted,
        };
        (size.width, size.height)
    }

    /// Draws a scene and shows it. Waits for the picture before the last one, and for the display where it sets the
    /// pace.
    ///
    /// # Errors
    /// [`SurfaceLost`](crate::Error::SurfaceLost), [`DeviceLost`](crate::Error::DeviceLost),
    /// [`OutOfMemory`](crate::Error::OutOfMemory). After any but the first two the next call starts afresh.
    ///
    /// # Panics
    /// Panics where the scene's mesh is of another context.
    pub fn draw(&mut self, scene: &Scene<'_>) -> Result<Presented> {
        let result = self.try_draw(scene);
        if result.is_err() {
            // A semaphore may be left signalled that nobody will wait for: none of them is used again.
            self.context.device.wait_idle()?;
            self.chain = None;
        }
        result
    }

    fn try_draw(&mut self, scene: &Scene<'_>) -> Result<Presented> {
        if self.wanted.width == 0 || self.wanted.height == 0 {
            return Ok(Presented::Minimised);
        }
        if self.stale || self.chain.is_none() {
            self.rebuild()?;
        }
        let Some(chain) = &mut self.chain else { return Ok(Presented::Minimised) };
        // The semaphore that acquiring takes was last used by the same frame as the painter's slot.
        self.painter.wait_for_slot()?;
        let (index, ready, drawn) = match chain.swapchain.acquire()? {
            Acquired::Image { index, ready, drawn } => (index, ready, drawn),
            Acquired::OutOfDate => {
                self.stale = true;
                return Ok(Presented::OutOfDate);
            }
        };
        let Some(framebuffer) = chain.framebuffers.get(index as usize) else {
            self.stale = true;
            return Ok(Presented::OutOfDate);
        };
        let ties = Ties { wait: Some(ready), signal: Some(drawn), read_back: None };
        self.painter.paint(scene, framebuffer, ties)?;
        self.stale |= !chain.swapchain.present(index, drawn)?;
        Ok(Presented::Shown)
    }

    /// Makes a swapchain that fits the window; none while it has no area.
    fn rebuild(&mut self) -> Result<()> {
        self.context.device.wait_idle()?;
        let old = self.chain.take().map(|Chain { framebuffers, swapchain }| {
            drop(framebuffers);
            swapchain
        });
        let (surface, format) = (&self.surface, self.format);
        let made =
            Swapchain::new(surface, format, self.wanted, self.pacing, FRAMES_IN_FLIGHT, old)?;
        let Some(swapchain) = made else { return Ok(()) };
        let (colour, depth) = self.painter.attachments(format.format, swapchain.size)?;
        let framebuffers = swapchain
            .views()
            .map(|view| {
                let (pass, size) = (self.painter.pass(), swapchain.size);
                Framebuffer::new(pass, size, colour.as_ref(), &depth, view, Vec::new())
                    .map(Arc::new)
            })
            .collect::<Result<_>>()?;
        self.chain = Some(Chain { framebuffers, swapchain });
        self.stale = false;
        Ok(())
    }

    /// The scene as a picture in memory, of the window's size: the same as [`WindowTarget::draw`] shows.
    ///
    /// # Errors
    /// [`PictureSize`](crate::Error::PictureSize) while the window has no area; else as [`Offscreen::draw`].
    ///
    /// # Panics
    /// Panics where the scene's mesh is of another context.
    pub fn screenshot(&self, scene: &Scene<'_>) -> Result<Image> {
        let (width, height) = self.size();
        Offscreen::new(&self.context, width, height)?.draw(scene)
    }
}

impl Drop for WindowTarget {
    fn drop(&mut self) {
        if self.context.device.wait_idle().is_err() {
            // The device is lost: nothing runs on it any more, so everything may go.
        }
    }
}

impl std::fmt::Debug for WindowTarget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WindowTarget").field("size", &self.size()).finish_non_exhaustive()
    }
}
