//! The loop of events: what happens in the window goes to the viewer, and frames come of it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;
use vk_render::Presented;
use winit::application::ApplicationHandler;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::PhysicalKey;
use winit::window::{Fullscreen, WindowId};

use crate::action::Action;
use crate::args::Args;
use crate::camera::path;
use crate::clipboard::Clipboard;
use crate::error::{Error, one_line};
use crate::frame_log::{self, FrameLog};
use crate::input::keys;
use crate::input::pointer::{Gesture, Pointer};
use crate::picture;
use crate::screen::Screen;
use crate::state::FrameTime;
use crate::viewer::Viewer;

/// Between two looks at something that is not in a hurry: progress, detail that does not come.
const CALM: Duration = Duration::from_millis(100);
const SOON: Duration = Duration::from_millis(15);
/// A pause longer than this is no frame time.
const PAUSE: Duration = Duration::from_millis(250);

/// Opens the window and runs until it is closed.
pub(crate) fn run(args: &Args) -> Result<(), Error> {
    let opener = args.opener();
    let events = EventLoop::<()>::with_user_event().build().map_err(Error::window)?;
    let proxy: EventLoopProxy<()> = events.create_proxy();
    let notify = Arc::new(move || {
        // It fails only where the loop has ended, and then nobody waits any more.
        proxy.send_event(()).unwrap_or_default();
    });
    let mut viewer = Viewer::new(args.state(), opener, notify);
    viewer.first_view = args.view.clone();
    if args.path.as_os_str() != "orbit" {
        viewer.state.last_path = Some(path::read(&args.path)?);
    }
    if let Some(file) = &args.file {
        // Before the window: reading and opening a device go on side by side.
        viewer.open(file.clone());
    }
    let mut app = App {
        args,
        log: args.log.as_deref().map(FrameLog::create).transpose()?,
        viewer,
        screen: None,
        pointer: Pointer::default(),
        modifiers: Default::default(),
        clipboard: Clipboard::default(),
        last_begin: None,
        last_frame: None,
        due: None,
        frames: 0,
        occluded: false,
        failures: 0,
        failed: None,
    };
    events.run_app(&mut app).map_err(Error::window)?;
    match app.failed {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

struct App<'a> {
    args: &'a Args,
    viewer: Viewer,
    screen: Option<Screen>,
    pointer: Pointer,
    modifiers: winit::keyboard::ModifiersState,
    clipboard: Clipboard,
    log: Option<FrameLog>,
    /// When the last frame began.
    last_begin: Option<Instant>,
    /// When it ended.
    last_frame: Option<Instant>,
    /// When the next one is due, if nothing happens before.
    due: Option<Instant>,
    frames: u64,
    occluded: bool,
    /// Losses of the device without a frame between them.
    failures: u32,
    failed: Option<Error>,
}

impl App<'_> {
    fn draw(&mut self, events: &ActiveEventLoop) -> Result<(), Error> {
        let Some(screen) = &mut self.screen else { return Ok(()) };
        let (width, height) = screen.target.size();
        if width == 0 || height == 0 || self.occluded {
            return Ok(());
        }
        if self.args.lose_device == Some(self.frames) {
            self.frames += 1;
            return Err(vk_render::Error::DeviceLost.into());
        }
        let begin = Instant::now();
        let passed = self.last_begin.map_or(Duration::ZERO, |last| begin - last);
        self.last_begin = Some(begin);
        self.viewer.poll();
        if std::mem::take(&mut self.viewer.is_new) {
            screen.mesh = vk_render::MeshBuffers::new(&screen.context)?;
            let name = self.viewer.model.as_ref().and_then(|model| model.source.file_name());
            let name = name.unwrap_or_default().to_string_lossy();
            screen.window.set_title(&format!("{name} - xfm-view"));
        }
        (self.viewer.state.lens.width, self.viewer.state.lens.height) = (width, height);
        let mut busy = self.viewer.step(passed);
        self.viewer.refine();
        let mut time = FrameTime { update: begin.elapsed(), ..FrameTime::default() };

        let mut uploaded = 0;
        if let Some(model) = &mut self.viewer.model {
            let start = Instant::now();
            uploaded = model.upload(&mut screen.mesh, self.viewer.state.paint())?.bytes;
            time.upload = start.elapsed();
        }
        let input = screen.egui.take_egui_input(&screen.window);
        let mut asked = Vec::new();
        let viewer = &mut self.viewer;
        let device = screen.context.device_name().to_owned();
        let ran = screen.overlay.run(&screen.context, input, |context| {
            asked = viewer.panels(context, &device);
        })?;
        screen.egui.handle_platform_output(&screen.window, ran.platform);
        busy |= ran.again || !asked.is_empty();

        let lines = picture::lines(&self.viewer.state);
        let model = self.viewer.model.as_deref();
        let pieces = screen.overlay.pieces();
        let mut scene = picture::scene(&self.viewer.state, &screen.mesh, model, &lines);
        scene.ui = screen.overlay.ui(&pieces);
        screen.window.pre_present_notify();
        busy |= screen.target.draw(&scene)? == Presented::OutOfDate;
        drop(pieces);
        self.failures = 0;

        let end = Instant::now();
        let between = self.last_frame.map(|last| end - last).filter(|between| *between < PAUSE);
        time.whole = between.unwrap_or_default().max(end - begin);
        self.viewer.state.history.add(time);
        self.last_frame = Some(end);
        self.frames += 1;
        self.log_frame(&time, uploaded)?;
        for action in asked {
            self.act(events, action)?;
        }
        self.plan(busy, end);
        if self.args.quit_after.is_some_and(|frames| self.frames >= frames) {
            events.exit();
        }
        Ok(())
    }

    fn log_frame(&mut self, time: &FrameTime, uploaded: u64) -> Result<(), Error> {
        let Some(log) = &mut self.log else { return Ok(()) };
        let state = &self.viewer.state;
        let numbers = self.viewer.numbers.unwrap_or_default();
        let mut entry = frame_log::entry(self.frames, &numbers, time, uploaded, state);
        let notices: Vec<&str> = state.notices.shown().iter().map(|n| n.text.as_str()).collect();
        let points: Vec<[f32; 3]> = state.measure.points.iter().map(|p| p.to_array()).collect();
        entry.insert("model".into(), json!(self.viewer.model.is_some()));
        entry.insert("opening".into(), json!(self.viewer.opening.is_some()));
        entry.insert("held".into(), json!(state.detail.by.name()));
        entry.insert("size".into(), json!([state.lens.width, state.lens.height]));
        entry.insert("shading".into(), json!(state.look.name()));
        entry.insert("fly".into(), json!(state.fly));
        entry.insert("frozen".into(), json!(state.frozen.is_some()));
        entry.insert("section".into(), json!(state.section.on.then_some(state.section.depth)));
        entry.insert("measuring".into(), json!(state.measure.on));
        entry.insert("points".into(), json!(points));
        entry.insert("help".into(), json!(state.panels.help));
        entry.insert("recording".into(), json!(state.recording.is_some()));
        entry.insert("replaying".into(), json!(state.replay.is_some()));
        entry.insert("notices".into(), json!(notices));
        entry.insert("settled".into(), json!(self.viewer.is_settled()));
        log.write(&entry.into())
    }

    /// Says when the next frame is due.
    fn plan(&mut self, busy: bool, now: Instant) {
        let Some(screen) = &self.screen else { return };
        let moving = self.viewer.numbers.is_some_and(|numbers| numbers.is_moving());
        let waits = self.viewer.opening.is_some()
            || !self.viewer.state.notices.shown().is_empty()
            || !self.viewer.is_settled();
        if busy || moving || self.args.quit_after.is_some() {
            screen.window.request_redraw();
            self.due = None;
        } else {
            // What comes from a disk comes soon; a thread that reads is not to be kept from it by drawing.
            let queue = self.viewer.numbers.is_some_and(|numbers| numbers.queue > 0);
            self.due = waits.then_some(now + if queue { SOON } else { CALM });
        }
    }

    /// Does what is asked for, in the window's part.
    fn act(&mut self, events: &ActiveEventLoop, action: Action) -> Result<(), Error> {
        let window_action = match self.viewer.act(action) {
            Ok(action) => action,
            // A file that cannot be written is no reason to leave.
            Err(error) => {
                self.viewer.state.notices.complain(one_line(&error));
                None
            }
        };
        match window_action {
            Some(Action::Quit) => events.exit(),
            Some(Action::Screenshot) => self.screenshot(false)?,
            Some(Action::ScreenshotWithPanels) => self.screenshot(true)?,
            Some(Action::FullScreen) => {
                if let Some(screen) = &self.screen {
                    let on = screen.window.fullscreen().is_some();
                    screen.window.set_fullscreen((!on).then_some(Fullscreen::Borderless(None)));
                }
            }
            Some(Action::CopyView) => {
                let text = path::view_text(&self.viewer.state.camera());
                let said = match self.clipboard.set(&text) {
                    Ok(()) => format!("Copied: {text}"),
                    Err(reason) => format!("{reason}. The view: {text}"),
                };
                self.viewer.state.notices.say(said);
            }
            Some(Action::PasteView) => match self.clipboard.get() {
                Ok(text) => self.viewer.paste(&text),
                Err(reason) => self.viewer.state.notices.complain(reason),
            },
            _ => {}
        }
        self.redraw();
        Ok(())
    }

    /// Takes a picture of the window into the current folder, under the first name that is free.
    fn screenshot(&mut self, with_panels: bool) -> Result<(), Error> {
        let (Some(screen), Some(model)) = (&self.screen, &self.viewer.model) else { return Ok(()) };
        let lines = picture::lines(&self.viewer.state);
        let state = &self.viewer.state;
        let pieces = screen.overlay.pieces();
        let mut scene = picture::scene(state, &screen.mesh, Some(model), &lines);
        if with_panels {
            scene.ui = screen.overlay.ui(&pieces);
        }
        let image = screen.target.screenshot(&scene)?;
        let file = self.viewer.free_name("view", "png");
        let shown = std::path::absolute(&file).unwrap_or_else(|_| file.clone());
        match picture::save(&image, &file) {
            Ok(()) => self.viewer.state.notices.say(format!("Wrote {}", shown.display())),
            Err(error) => self.viewer.state.notices.complain(one_line(&error)),
        }
        Ok(())
    }

    fn event(&mut self, events: &ActiveEventLoop, event: &WindowEvent) -> Result<(), Error> {
        let Some(screen) = &mut self.screen else { return Ok(()) };
        if let WindowEvent::RedrawRequested = event {
            return self.draw(events);
        }
        let taken = screen.egui.on_window_event(&screen.window, event);
        let over_panel = self.pointer.place().is_some_and(|place| screen.overlay.covers(place));
        let scale = screen.window.scale_factor() as f32;
        if taken.repaint {
            screen.window.request_redraw();
        }
        let shift = self.modifiers.shift_key();
        let gesture = match event {
            WindowEvent::CloseRequested => {
                events.exit();
                None
            }
            WindowEvent::Resized(size) => {
                screen.target.resize(size.width, size.height);
                None
            }
            WindowEvent::Occluded(occluded) => {
                self.occluded = *occluded;
                None
            }
            WindowEvent::Focused(false) => {
                self.viewer.held.clear();
                None
            }
            WindowEvent::ModifiersChanged(modifiers) => {
                self.modifiers = modifiers.state();
                self.viewer.shift = self.modifiers.shift_key();
                None
            }
            WindowEvent::KeyboardInput { event: key, .. } => {
                let pressed = key.state == ElementState::Pressed;
                let typing = screen.overlay.context.wants_keyboard_input();
                let command = self.modifiers.control_key() || self.modifiers.super_key();
                if let PhysicalKey::Code(code) = key.physical_key
                    && !(pressed && (typing || command))
                    && self.viewer.held.set(code, pressed)
                {
                    self.redraw();
                    return Ok(());
                }
                if let (true, false) = (pressed, typing)
                    && let Some(action) = keys::action(&key.logical_key, self.modifiers)
                {
                    return self.act(events, action);
                }
                return Ok(());
            }
            WindowEvent::CursorLeft { .. } => {
                self.pointer.left();
                None
            }
            WindowEvent::CursorMoved { position, .. } => match self.pointer.moved(*position, shift)
            {
                Some(gesture) => Some(gesture),
                // Nothing is dragged: egui says whether it looks different now.
                None => return Ok(()),
            },
            WindowEvent::MouseInput { state, button, .. } => {
                if *state == ElementState::Pressed && over_panel {
                    None
                } else {
                    self.pointer.button(*button, *state)
                }
            }
            WindowEvent::MouseWheel { delta, .. } if !over_panel => {
                Some(Pointer::scrolled(*delta, shift, scale))
            }
            WindowEvent::PinchGesture { delta, .. } if !over_panel && delta.is_finite() => {
                Some(Gesture::Zoom(8.0 * *delta as f32))
            }
            WindowEvent::RotationGesture { delta, .. } if !over_panel && delta.is_finite() => {
                let height = self.viewer.state.lens.height as f32;
                Some(Gesture::Turn(glam::Vec2::new(-delta.to_radians() * 0.25 * height, 0.0)))
            }
            WindowEvent::HoveredFile(_) => {
                self.viewer.hovering = true;
                None
            }
            WindowEvent::HoveredFileCancelled => {
                self.viewer.hovering = false;
                None
            }
            WindowEvent::DroppedFile(file) => {
                self.viewer.hovering = false;
                self.viewer.open(file.clone());
                None
            }
            _ => return Ok(()),
        };
        if let Some(gesture) = gesture {
            self.viewer.gesture(gesture, self.pointer.place());
        }
        self.redraw();
        Ok(())
    }

    fn redraw(&self) {
        if let Some(screen) = &self.screen {
            screen.window.request_redraw();
        }
    }

    /// Makes good what can be made good: a lost surface, a lost device once in a row.
    fn recover(&mut self, error: Error) -> Result<(), Error> {
        let Error::Render(lost) = &error else { return Err(error) };
        self.failures += 1;
        let Some(mut screen) = self.screen.take().filter(|_| self.failures <= 2) else {
            return Err(error);
        };
        match lost {
            vk_render::Error::SurfaceLost => screen.renew_target()?,
            vk_render::Error::DeviceLost => {
                let window = Arc::clone(&screen.window);
                drop(screen);
                screen = Screen::on(self.args, window)?;
                let text = "The graphics device was lost and has been opened again";
                self.viewer.state.notices.complain(text);
            }
            vk_render::Error::OutOfMemory { .. } => {
                // Less is drawn, and it is said why.
                self.viewer.state.detail.scale(2.0);
                let text = format!("{}; the detail was made coarser", one_line(&error));
                self.viewer.state.notices.complain(text);
            }
            _ => return Err(error),
        }
        screen.window.request_redraw();
        self.screen = Some(screen);
        Ok(())
    }

    fn fail(&mut self, events: &ActiveEventLoop, error: Error) {
        self.failed = Some(error);
        events.exit();
    }
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.screen.is_none() {
            match Screen::open(self.args, events) {
                Ok(screen) => {
                    screen.window.request_redraw();
                    self.screen = Some(screen);
                }
                Err(error) => self.fail(events, error),
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        self.redraw();
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let now = Instant::now();
        match self.due {
            Some(due) if due <= now => {
                self.due = None;
                self.redraw();
            }
            Some(due) => events.set_control_flow(ControlFlow::WaitUntil(due)),
            None => events.set_control_flow(ControlFlow::Wait),
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let mut result = self.event(events, &event).or_else(|error| self.recover(error));
        if let (Ok(()), Some(screen)) = (&result, &self.screen)
            && let Some(message) = screen.context.validation_messages().into_iter().next()
        {
            result = Err(Error::Validation(message));
        }
        if let Err(error) = result {
            self.fail(events, error);
        }
    }
}
