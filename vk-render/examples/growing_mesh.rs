//! A spiral that grows every frame; only what is new travels to the device. Keys step through the shadings.

use glam::Vec3;
use std::{error::Error, sync::Arc};
use vk_render::*;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};

#[derive(Default)]
struct Growing {
    shown: Option<(Arc<Window>, WindowTarget, MeshBuffers)>,
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    shading: usize,
}

impl Growing {
    /// One step along the spiral: two vertices, and two triangles to the ones before.
    fn grow(&mut self) {
        let i = self.vertices.len() as u32;
        let turn = i as f32 * 0.025;
        let outwards = Vec3::new(turn.cos(), 0.0, -turn.sin());
        let place = outwards * (1.0 - turn * 0.006) + Vec3::Y * (turn * 0.018 - 1.0);
        for up in [0.0, 0.1] {
            self.vertices.push(Vertex::new(place + Vec3::Y * up, outwards, (i / 300) as u8));
        }
        if i > 0 {
            self.triangles.extend([[i - 2, i, i + 1], [i - 2, i + 1, i - 1]]);
        }
    }

    fn draw(&mut self) -> Result<()> {
        if self.triangles.len() < 5000 {
            (0..4).for_each(|_| self.grow());
        }
        let Some((window, target, mesh)) = &mut self.shown else { return Ok(()) };
        // No ranges: what is new at the ends of the arrays counts as changed.
        let (vertices, triangles) = (&self.vertices, &self.triangles);
        let sent = mesh.update(&MeshUpdate { vertices, triangles, ..MeshUpdate::default() })?;
        let (width, height) = target.size();
        let (eye, aspect) = (Vec3::new(1.2, 1.4, 2.8), width as f32 / height.max(1) as f32);
        let camera = Camera::perspective(eye, Vec3::ZERO, Vec3::Y, 0.8, aspect, 0.01);
        let text = format!("{} triangles\n{} bytes sent", triangles.len(), sent.bytes);
        let text = [Text::new(&text)];
        let mut scene = Scene::new(mesh, camera);
        (scene.shading, scene.text) = (Shading::ALL[self.shading % 5], &text);
        window.request_redraw();
        target.draw(&scene).map(|_| ())
    }
}

impl ApplicationHandler for Growing {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let window = events.create_window(Window::default_attributes()).expect("a window");
        let window = Arc::new(window);
        let context = Context::new(&ContextOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let target = WindowTarget::new(&context, Arc::clone(&window), (800, 600), Pacing::Display);
        let mesh = MeshBuffers::new(&context).expect("memory for a small mesh");
        self.shown = Some((window, target.expect("a display"), mesh));
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match (event, &mut self.shown) {
            (WindowEvent::CloseRequested, _) => events.exit(),
            (WindowEvent::Resized(size), Some(shown)) => shown.1.resize(size.width, size.height),
            (WindowEvent::KeyboardInput { event, .. }, _) if event.state.is_pressed() => {
                self.shading += 1;
            }
            (WindowEvent::RedrawRequested, _) => self.draw().unwrap_or_else(|e| panic!("{e}")),
            _ => {}
        }
    }
}

fn main() -> std::result::Result<(), Box<dyn Error>> {
    Ok(EventLoop::new()?.run_app(&mut Growing::default())?)
}
