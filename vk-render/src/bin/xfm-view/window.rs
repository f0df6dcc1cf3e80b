//! The window: turn, move, zoom, change the tolerance and the shading.

use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec2;
use mergetree::Camera;
use vk_render::{Context, MeshBuffers, Pacing, Presented, Scene, Shading, Text, WindowTarget};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::window::{Window, WindowId};
use xfm_pager::Detail;

use crate::args::Args;
use crate::error::Error;
use crate::model::{self, Model};
use crate::offscreen::describe;
use crate::orbit::Orbit;
use crate::{outside, picture};

const HELP: &str = "\
drag           turn
right drag     move
wheel          nearer, farther
+  -           finer, coarser
S              shading
F              freeze the detail, look at it from anywhere
R              whole model
P              picture into the current folder
H              numbers on and off
F1 or ?        this help
Esc            leave";

/// Opens the window and runs until it is closed.
pub(crate) fn run(args: &Args) -> Result<(), Error> {
    let model = model::open(args)?;
    let events = EventLoop::new().map_err(|e| Error::Window(e.to_string()))?;
    let lens = args.lens();
    let mut viewer = Viewer {
        orbit: Orbit::around(model.min, model.max, &lens),
        lens,
        detail: args.detail(),
        shading: args.shading(),
        model,
        args,
        screen: None,
        drag: None,
        pointer: Vec2::ZERO,
        frozen: None,
        numbers: true,
        help: false,
        failed: None,
    };
    events.run_app(&mut viewer).map_err(|e| Error::Window(e.to_string()))?;
    match viewer.failed {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

/// The window and what draws into it.
struct Screen {
    // Dropped in this order, before the window.
    target: WindowTarget,
    mesh: MeshBuffers,
    context: Context,
    window: Arc<Window>,
}

struct Viewer<'a> {
    args: &'a Args,
    model: Model,
    screen: Option<Screen>,
    orbit: Orbit,
    lens: Camera,
    detail: Detail,
    shading: Shading,
    drag: Option<MouseButton>,
    pointer: Vec2,
    /// The camera that the detail is kept for.
    frozen: Option<Camera>,
    numbers: bool,
    help: bool,
    failed: Option<Error>,
}

impl Viewer<'_> {
    fn open_screen(&self, events: &ActiveEventLoop) -> Result<Screen, Error> {
        let name = self.args.file.file_name().unwrap_or_default().to_string_lossy();
        let attributes = Window::default_attributes()
            .with_title(format!("{name} - xfm-view"))
            .with_inner_size(PhysicalSize::new(self.args.size.0, self.args.size.1));
        let window = events.create_window(attributes).map_err(|e| Error::Window(e.to_string()))?;
        let window = Arc::new(window);
        let context = Context::new(&self.args.context_options())?;
        let size = window.inner_size();
        let target = WindowTarget::new(
            &context,
            Arc::clone(&window),
            (size.width, size.height),
            Pacing::Display,
        )?;
        Ok(Screen { target, mesh: MeshBuffers::new(&context)?, context, window })
    }

    fn draw(&mut self) -> Result<(), Error> {
        let Some(screen) = &mut self.screen else { return Ok(()) };
        let (width, height) = screen.target.size();
        if width == 0 || height == 0 {
            return Ok(());
        }
        (self.lens.width, self.lens.height) = (width, height);
        let camera = self.orbit.camera(&self.lens);
        let stats = self.model.session.frame(self.frozen.as_ref().unwrap_or(&camera), self.detail);
        picture::upload(&mut self.model.session, &mut screen.mesh)?;
        let radius = 0.5 * (self.model.max - self.model.min).length();
        let mut scene = Scene::new(&screen.mesh, picture::render_camera(&camera, radius));
        scene.shading = self.shading;
        scene.inside_out = self.model.session.is_inside_out();
        let lines = self.frozen.map_or_else(Vec::new, |frozen| outside::frustum(&frozen, radius));
        scene.lines = &lines;
        let said = describe(&stats);
        let mut text = Vec::new();
        if self.numbers {
            text.push(Text::new(&said));
        }
        if self.help {
            text.push(Text { origin_px: [12.0, 110.0], ..Text::new(HELP) });
        }
        scene.text = &text;
        if screen.target.draw(&scene)? == Presented::OutOfDate
            || stats.updates > 0
            || stats.waiting > 0
        {
            screen.window.request_redraw();
        }
        Ok(())
    }

    /// Takes a picture of the window into the current folder, under the first name that is free.
    fn screenshot(&mut self) -> Result<(), Error> {
        let Some(screen) = &self.screen else { return Ok(()) };
        let radius = 0.5 * (self.model.max - self.model.min).length();
        let camera = picture::render_camera(&self.orbit.camera(&self.lens), radius);
        let mut scene = Scene::new(&screen.mesh, camera);
        scene.shading = self.shading;
        scene.inside_out = self.model.session.is_inside_out();
        let image = screen.target.screenshot(&scene)?;
        let stem = self.args.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let file = (1..)
            .map(|n| PathBuf::from(format!("{stem}-{n:03}.png")))
            .find(|file| !file.exists())
            .unwrap_or_default();
        picture::save(&image, &file)?;
        eprintln!("wrote {}", file.display());
        Ok(())
    }

    fn key(&mut self, events: &ActiveEventLoop, key: &Key) -> Result<(), Error> {
        match key {
            Key::Named(NamedKey::Escape) => events.exit(),
            Key::Named(NamedKey::F1) => self.help = !self.help,
            Key::Character(text) => match text.to_lowercase().as_str() {
                "?" => self.help = !self.help,
                "h" => self.numbers = !self.numbers,
                "r" => {
                    self.orbit = Orbit::around(self.model.min, self.model.max, &self.lens);
                    self.frozen = None;
                }
                "f" => {
                    self.frozen = match self.frozen {
                        None => Some(self.orbit.camera(&self.lens)),
                        Some(_) => None,
                    };
                }
                "s" => {
                    let at = Shading::ALL.iter().position(|&s| s == self.shading).unwrap_or(0);
                    self.shading = Shading::ALL[(at + 1) % Shading::ALL.len()];
                }
                "p" => self.screenshot()?,
                "+" | "=" => self.refine(0.8),
                "-" | "_" => self.refine(1.25),
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }

    fn refine(&mut self, factor: f32) {
        self.detail = match self.detail {
            Detail::Pixels(pixels) => Detail::Pixels((pixels * factor).clamp(0.05, 500.0)),
            Detail::Budget(triangles) => {
                Detail::Budget(((triangles as f32 / factor) as usize).clamp(100, 100_000_000))
            }
            time @ Detail::FrameTime(_) => time,
        };
    }

    fn event(&mut self, events: &ActiveEventLoop, event: &WindowEvent) -> Result<(), Error> {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => return self.draw(),
            WindowEvent::Resized(size) => {
                if let Some(screen) = &mut self.screen {
                    screen.target.resize(size.width, size.height);
                }
            }
            WindowEvent::KeyboardInput {
                event: KeyEvent { logical_key, state: ElementState::Pressed, .. },
                ..
            } => self.key(events, logical_key)?,
            WindowEvent::MouseInput { state, button, .. } => {
                self.drag = (*state == ElementState::Pressed).then_some(*button);
            }
            WindowEvent::CursorMoved { position, .. } => {
                let pointer = Vec2::new(position.x as f32, position.y as f32);
                let moved = (pointer - self.pointer) / self.lens.height.max(1) as f32;
                self.pointer = pointer;
                match self.drag {
                    Some(MouseButton::Left) => self.orbit.turn(moved),
                    Some(_) => self.orbit.pan(moved, &self.lens),
                    None => return Ok(()),
                }
            }
            WindowEvent::MouseWheel { delta, .. } => self.orbit.zoom(match delta {
                MouseScrollDelta::LineDelta(_, lines) => *lines,
                MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 40.0,
            }),
            WindowEvent::PinchGesture { delta, .. } => self.orbit.zoom(8.0 * *delta as f32),
            _ => return Ok(()),
        }
        if let Some(screen) = &self.screen {
            screen.window.request_redraw();
        }
        Ok(())
    }
}

impl ApplicationHandler for Viewer<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        events.set_control_flow(ControlFlow::Wait);
        if self.screen.is_none() {
            match self.open_screen(events) {
                Ok(screen) => {
                    screen.window.request_redraw();
                    self.screen = Some(screen);
                }
                Err(error) => {
                    self.failed = Some(error);
                    events.exit();
                }
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let mut result = self.event(events, &event);
        if let (Ok(()), Some(screen)) = (&result, &self.screen)
            && let Some(message) = screen.context.validation_messages().into_iter().next()
        {
            result = Err(Error::Validation(message));
        }
        if let Err(error) = result {
            self.failed = Some(error);
            events.exit();
        }
    }
}
