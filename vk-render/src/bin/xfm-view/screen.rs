//! The window and what draws into it.

use std::sync::Arc;

use egui::ViewportId;
use vk_render::{Context, MeshBuffers, Pacing, WindowTarget};
use winit::dpi::PhysicalSize;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

use crate::args::Args;
use crate::error::Error;
use crate::overlay::Overlay;

pub(crate) struct Screen {
    // Dropped in this order, before the window.
    pub(crate) target: WindowTarget,
    pub(crate) mesh: MeshBuffers,
    pub(crate) overlay: Overlay,
    pub(crate) egui: egui_winit::State,
    pub(crate) context: Context,
    pub(crate) window: Arc<Window>,
}

impl Screen {
    /// Opens a window, and a device that draws into it.
    pub(crate) fn open(args: &Args, events: &ActiveEventLoop) -> Result<Self, Error> {
        let attributes = Window::default_attributes()
            .with_title("xfm-view")
            .with_inner_size(PhysicalSize::new(args.size.0, args.size.1));
        let window = events.create_window(attributes).map_err(Error::window)?;
        Self::on(args, Arc::new(window))
    }

    /// A device and a target for a window that is there: the first time, and after the device was lost.
    pub(crate) fn on(args: &Args, window: Arc<Window>) -> Result<Self, Error> {
        let mut context = Context::new(&args.context_options())?;
        if context.is_software() && args.samples.is_none() {
            // Smooth edges would cost more than half of the speed.
            context = context.with_max_samples(1);
        }
        let target = Self::target(&context, &window)?;
        let overlay = Overlay::new();
        let egui = egui_winit::State::new(
            overlay.context.clone(),
            ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(context.max_texture_side() as usize),
        );
        let mesh = MeshBuffers::new(&context)?;
        Ok(Self { target, mesh, overlay, egui, context, window })
    }

    /// Another target for the same window: its surface was lost.
    pub(crate) fn renew_target(&mut self) -> Result<(), Error> {
        self.target = Self::target(&self.context, &self.window)?;
        Ok(())
    }

    fn target(context: &Context, window: &Arc<Window>) -> Result<WindowTarget, Error> {
        let size = window.inner_size();
        let size = (size.width, size.height);
        Ok(WindowTarget::new(context, Arc::clone(window), size, Pacing::Display)?)
    }
}
