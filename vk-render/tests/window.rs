//! Drawing into a real window: frames, changes of size, no area, screenshots. Without a display it starts Xvfb.
#![cfg(target_os = "linux")]
// One changed range is a list of one range.
#![allow(clippy::single_range_in_vec_init)]

mod common;
mod display;

use common::{assert_valid, ball, camera, context};
use std::sync::Arc;
use vk_render::{
    Context, Error, MeshBuffers, MeshUpdate, Offscreen, Pacing, Presented, Scene, Shading,
    WindowTarget,
};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::platform::x11::EventLoopBuilderExtX11;
use winit::window::{Window, WindowId};

const FRAMES: u32 = 90;

struct App {
    context: Context,
    open: Option<(Arc<Window>, WindowTarget, MeshBuffers)>,
    frame: u32,
    shown: u32,
    sizes: Vec<(u32, u32)>,
}

impl App {
    fn draw(&mut self) -> vk_render::Result<()> {
        let Some((window, target, mesh)) = &mut self.open else { return Ok(()) };
        let (vertices, triangles) = ball(4 + self.frame);
        let triangle_ranges = [0..triangles.len() as u32];
        let vertex_ranges = [0..vertices.len() as u32];
        mesh.update(&MeshUpdate {
            vertices: &vertices,
            vertex_ranges: &vertex_ranges,
            triangles: &triangles,
            triangle_ranges: &triangle_ranges,
            ..MeshUpdate::default()
        })?;
        let (width, height) = target.size();
        let mut scene = Scene::new(mesh, camera(width.max(1), height.max(1)));
        scene.shading = Shading::ALL[self.frame as usize % 5];
        match target.draw(&scene)? {
            Presented::Shown => self.shown += 1,
            Presented::OutOfDate => {}
            Presented::Minimised => panic!("the window has an area"),
        }
        if self.sizes.last() != Some(&target.size()) {
            self.sizes.push(target.size());
        }
        match self.frame {
            20 => {
                let asked = window.request_inner_size(PhysicalSize::new(401, 207));
                assert!(asked.is_none(), "X11 answers later");
            }
            50 => {
                // As if minimised; then back.
                let size = target.size();
                target.resize(0, 0);
                assert_eq!(target.draw(&scene)?, Presented::Minimised);
                assert!(matches!(target.screenshot(&scene), Err(Error::PictureSize { .. })));
                target.resize(size.0, size.1);
            }
            70 => {
                let (width, height) = target.size();
                let mut offscreen = Offscreen::new(&self.context, width, height)?;
                assert!(target.screenshot(&scene)? == offscreen.draw(&scene)?);
            }
            _ => {}
        }
        self.frame += 1;
        window.request_redraw();
        Ok(())
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let attributes = Window::default_attributes().with_inner_size(PhysicalSize::new(320, 240));
        let window = Arc::new(events.create_window(attributes).expect("a window"));
        let size = window.inner_size().into();
        let target = WindowTarget::new(&self.context, Arc::clone(&window), size, Pacing::Unlimited)
            .expect("a target");
        let mesh = MeshBuffers::new(&self.context).expect("a mesh");
        window.request_redraw();
        self.open = Some((window, target, mesh));
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match (event, &mut self.open) {
            (WindowEvent::Resized(size), Some((_, target, _))) => {
                target.resize(size.width, size.height);
            }
            (WindowEvent::RedrawRequested, _) => {
                self.draw().expect("a frame");
                if self.frame >= FRAMES {
                    self.open = None;
                    events.exit();
                }
            }
            _ => {}
        }
    }
}

/// Runs this test in another process, because a display is named by its environment.
fn again_on_a_display() {
    let display = display::Display::start();
    let mut test = std::process::Command::new(std::env::current_exe().expect("this program"));
    let status = test.args(["--nocapture"]).env("DISPLAY", display.name()).status();
    assert!(status.expect("it runs").success());
}

#[test]
fn a_window_shows_every_frame_through_changes_of_size() {
    if std::env::var_os("DISPLAY").is_none() {
        again_on_a_display();
        return;
    }
    let events = EventLoop::builder().with_x11().with_any_thread(true).build().expect("a loop");
    let mut app = App { context: context(), open: None, frame: 0, shown: 0, sizes: Vec::new() };
    events.run_app(&mut app).expect("the loop ends by itself");
    assert_eq!(app.frame, FRAMES);
    assert!(app.shown >= FRAMES - 5, "{} of {FRAMES} frames were shown", app.shown);
    assert_eq!(app.sizes.first(), Some(&(320, 240)));
    assert_eq!(app.sizes.last(), Some(&(401, 207)));
    assert_valid(&app.context);
}
