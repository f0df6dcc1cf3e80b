//! Pictures without a window.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use mergetree::{Camera, CameraPath};
use serde_json::Value;
use vk_render::{Context, MeshBuffers, Offscreen};

use crate::args::Args;
use crate::camera::{outside, path};
use crate::error::Error;
use crate::frame_log::{self, FrameLog};
use crate::model::{Opened, Opening};
use crate::output;
use crate::overlay::Overlay;
use crate::picture;
use crate::state::{FrameTime, State};
use crate::viewer::Viewer;

/// How long the detail of a single picture may take.
const SETTLE: Duration = Duration::from_secs(600);

/// Draws one picture, or all frames of a path into a folder with their `frames.json` and `frames.csv`.
pub(crate) fn run(args: &Args, out: &Path) -> Result<(), Error> {
    let is_picture = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    output::check(out, is_picture)?;
    let mut flight = Flight::new(args)?;
    let mut log = args.log.as_deref().map(FrameLog::create).transpose()?;
    if is_picture {
        let frame = flight.single(out)?;
        if let Some(log) = &mut log {
            log.write(&frame)?;
        }
    } else {
        std::fs::create_dir_all(out).map_err(Error::file(out))?;
        let bar = ProgressBar::new(args.frames.into());
        let mut frames = Vec::new();
        for number in 0..args.frames {
            let frame = flight.frame(number, out)?;
            if let Some(log) = &mut log {
                log.write(&frame)?;
            }
            if let Value::Object(frame) = frame {
                frames.push(frame);
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        output::write(&out.join("frames.csv"), frame_log::csv(&frames).as_bytes())?;
        let frames = Value::Array(frames.into_iter().map(Value::Object).collect());
        output::write(&out.join("frames.json"), format!("{frames:#}\n").as_bytes())?;
    }
    for problem in flight.viewer.model.iter().flat_map(|model| model.problems()) {
        eprintln!("warning: {problem}");
    }
    match flight.context.validation_messages().into_iter().next() {
        Some(message) => Err(Error::Validation(message)),
        None => Ok(()),
    }
}

/// A camera on its way past a model.
struct Flight<'a> {
    args: &'a Args,
    viewer: Viewer,
    path: CameraPath,
    mesh: MeshBuffers,
    inside: Offscreen,
    outside: Option<Offscreen>,
    overlay: Overlay,
    context: Context,
    uploaded: u64,
    time: FrameTime,
}

impl<'a> Flight<'a> {
    fn new(args: &'a Args) -> Result<Self, Error> {
        let file = args.file.clone().ok_or(Error::NoFile)?;
        let opening = Opening::start(file, args.opener(), || ());
        // Meanwhile, so that a missing driver is not found out after an hour of building.
        let context = Context::new(&args.context_options())?;
        let mut viewer = Viewer::new(args.state(), args.opener(), Arc::new(|| ()));
        viewer.state.panels.hint = false;
        match wait(opening) {
            Opened::Done(model) => viewer.take(model),
            Opened::Failed(error) => return Err(error),
            Opened::NotYet(_) | Opened::Cancelled => return Err(Error::NoFile),
        }
        let (width, height) = args.size;
        let target = || Offscreen::new(&context, width, height);
        Ok(Self {
            args,
            path: camera_path(args, &viewer.state)?,
            viewer,
            mesh: MeshBuffers::new(&context)?,
            inside: target()?,
            outside: if args.outside { Some(target()?) } else { None },
            overlay: Overlay::new(),
            context,
            uploaded: 0,
            time: FrameTime::default(),
        })
    }

    fn look_from(&mut self, camera: Camera) {
        let state = &mut self.viewer.state;
        state.show_replayed(Some(camera));
        if self.args.freeze {
            state.frozen.get_or_insert(camera);
        }
        if self.args.section.is_some() && !state.section.on {
            state.section.on = true;
            state.section_from_here();
        }
    }

    /// One picture, once its detail is all there.
    fn single(&mut self, out: &Path) -> Result<Value, Error> {
        let camera = self.path.camera(0.0, &self.viewer.state.lens);
        self.look_from(camera);
        let begin = Instant::now();
        let state = &self.viewer.state;
        if let Some(model) = &mut self.viewer.model {
            let detail = state.detail.detail();
            self.viewer.numbers = Some(model.settle(&state.detail_camera(), detail, SETTLE));
        }
        self.time.update = begin.elapsed();
        self.upload()?;
        self.draw(out, &out.with_extension("outside.png"))?;
        Ok(self.entry(0))
    }

    /// A frame of the path.
    fn frame(&mut self, number: u32, folder: &Path) -> Result<Value, Error> {
        let share = number as f32 / (self.args.frames - 1).max(1) as f32;
        let camera = self.path.camera(share, &self.viewer.state.lens);
        self.look_from(camera);
        let begin = Instant::now();
        self.viewer.refine();
        self.time.update = begin.elapsed();
        self.upload()?;
        self.draw(
            &folder.join(format!("frame_{number:04}.png")),
            &folder.join(format!("outside_{number:04}.png")),
        )?;
        Ok(self.entry(number.into()))
    }

    fn upload(&mut self) -> Result<(), Error> {
        let begin = Instant::now();
        if let Some(model) = &mut self.viewer.model {
            self.uploaded = model.upload(&mut self.mesh, self.viewer.state.paint())?.bytes;
        }
        self.time.upload = begin.elapsed();
        Ok(())
    }

    fn entry(&self, frame: u64) -> Value {
        let numbers = self.viewer.numbers.unwrap_or_default();
        frame_log::entry(frame, &numbers, &self.time, self.uploaded, &self.viewer.state).into()
    }

    /// Draws the user's view, and the one from outside where asked for.
    fn draw(&mut self, file: &Path, outside_file: &Path) -> Result<(), Error> {
        if self.args.overlay {
            let (width, height) = self.args.size;
            let size = egui::vec2(width as f32, height as f32);
            let input = || egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, size)),
                ..egui::RawInput::default()
            };
            let viewer = &mut self.viewer;
            let device = self.context.device_name().to_owned();
            // Twice, because panels learn their sizes in the first round.
            for _ in 0..2 {
                let mut asked = Vec::new();
                let draw = |context: &egui::Context| asked = viewer.panels(context, &device);
                self.overlay.run(&self.context, input(), draw)?;
            }
        }
        let begin = Instant::now();
        let state = &self.viewer.state;
        let model = self.viewer.model.as_deref();
        let lines = picture::lines(state);
        let pieces = self.overlay.pieces();
        let mut scene = picture::scene(state, &self.mesh, model, &lines);
        scene.ui = self.overlay.ui(&pieces);
        let image = self.inside.draw(&scene)?;
        self.time.whole = self.time.update + self.time.upload + begin.elapsed();
        picture::save(&image, file)?;
        if let Some(target) = &mut self.outside {
            let camera = state.camera();
            let from = outside::camera(&camera, state.bounds, state.navigator.up().axis());
            let lines = outside::frustum(&camera, state.radius());
            let mut scene = picture::scene(state, &self.mesh, model, &lines);
            scene.camera = picture::render_camera(&from, state.radius());
            picture::save(&target.draw(&scene)?, outside_file)?;
        }
        self.viewer.state.history.add(self.time);
        Ok(())
    }
}

/// Waits for a file, with a bar on a terminal.
fn wait(opening: Opening) -> Opened {
    let bar = ProgressBar::new(100).with_style(
        ProgressStyle::with_template("{msg:24} {wide_bar} {percent:>3} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let opened = opening.wait(|progress| {
        let (stage, _, share) = progress.read();
        bar.set_message(stage);
        bar.set_position((100.0 * share.unwrap_or(0.0)) as u64);
    });
    bar.finish_and_clear();
    opened
}

/// The path asked for: a file, a single view, or once around the model.
fn camera_path(args: &Args, state: &State) -> Result<CameraPath, Error> {
    if let Some(view) = &args.view {
        let mut path = CameraPath::default();
        path.push(&path::parse_view(view, &state.lens)?);
        return Ok(path);
    }
    if args.path.as_os_str() == "orbit" {
        let [min, max] = state.bounds;
        return Ok(CameraPath::orbit(min, max, args.frames as usize));
    }
    path::read(&args.path)
}
