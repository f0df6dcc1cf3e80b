//! Pictures without a window.

use std::path::Path;
use std::time::Instant;

use indicatif::ProgressBar;
use mergetree::{Camera, CameraPath};
use serde_json::json;
use vk_render::{Context, MeshBuffers, Offscreen, Scene, Text};
use xfm_pager::FrameStats;

use crate::args::Args;
use crate::error::Error;
use crate::model::{self, Model};
use crate::{outside, picture};

/// Frames in which a single picture's front settles at most.
const SETTLE_FRAMES: usize = 50;

/// Draws one picture, or all frames of a path into a folder with their `frames.json`.
pub(crate) fn run(args: &Args, out: &Path) -> Result<(), Error> {
    let Model { mut session, min, max, _built } = model::open(args)?;
    let context = Context::new(&args.context_options())?;
    let mut drawing = Drawing {
        args,
        mesh: MeshBuffers::new(&context)?,
        inside: Offscreen::new(&context, args.size.0, args.size.1)?,
        outside: if args.outside {
            Some(Offscreen::new(&context, args.size.0, args.size.1)?)
        } else {
            None
        },
        bounds: [min, max],
        inside_out: session.is_inside_out(),
    };
    let lens = args.lens();
    let path = camera_path(args, [min, max])?;
    if out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let camera = path.camera(0.0, &lens);
        let mut stats = session.frame(&camera, args.detail());
        for _ in 0..SETTLE_FRAMES {
            if stats.updates == 0 && stats.waiting == 0 {
                break;
            }
            stats = session.frame(&camera, args.detail());
        }
        picture::upload(&mut session, &mut drawing.mesh)?;
        let beside = out.with_extension("outside.png");
        drawing.draw(&camera, &stats, out, &beside)?;
    } else {
        std::fs::create_dir_all(out).map_err(Error::file(out))?;
        let bar = ProgressBar::new(args.frames.into());
        let mut frames = Vec::new();
        for frame in 0..args.frames {
            let t = frame as f32 / (args.frames - 1).max(1) as f32;
            let camera = path.camera(t, &lens);
            let stats = session.frame(&camera, args.detail());
            let begin = Instant::now();
            let uploaded = picture::upload(&mut session, &mut drawing.mesh)?;
            let upload_s = begin.elapsed().as_secs_f64();
            let render_s = drawing.draw(
                &camera,
                &stats,
                &out.join(format!("frame_{frame:04}.png")),
                &out.join(format!("outside_{frame:04}.png")),
            )?;
            frames.push(json!({
                "frame": frame,
                "triangles_shown": stats.triangles_shown,
                "updates": stats.updates,
                "tests": stats.tests,
                "waiting": stats.waiting,
                "pixels": stats.tolerance_px,
                "blocks_loaded": stats.blocks_loaded,
                "resident_blocks": stats.resident_blocks,
                "resident_bytes": stats.resident_bytes,
                "uploaded_bytes": uploaded.bytes,
                "update_s": stats.update_time.as_secs_f64(),
                "test_s": stats.test_time.as_secs_f64(),
                "load_s": stats.load_time.as_secs_f64(),
                "upload_s": upload_s,
                "render_s": render_s,
            }));
            bar.inc(1);
        }
        bar.finish_and_clear();
        let file = out.join("frames.json");
        let text = format!("{:#}\n", serde_json::Value::Array(frames));
        std::fs::write(&file, text).map_err(Error::file(&file))?;
    }
    for problem in session.pager().problems() {
        eprintln!("warning: {}: its detail is not shown", crate::error::one_line(&problem.error));
    }
    match context.validation_messages().into_iter().next() {
        Some(message) => Err(Error::Validation(message)),
        None => Ok(()),
    }
}

/// The path asked for.
pub(crate) fn camera_path(args: &Args, [min, max]: [glam::Vec3; 2]) -> Result<CameraPath, Error> {
    if args.path.as_os_str() == "orbit" {
        return Ok(CameraPath::orbit(min, max, args.frames as usize));
    }
    let text = std::fs::read_to_string(&args.path).map_err(Error::file(&args.path))?;
    CameraPath::parse(&text).map_err(|source| Error::Path { path: args.path.clone(), source })
}

struct Drawing<'a> {
    args: &'a Args,
    mesh: MeshBuffers,
    inside: Offscreen,
    outside: Option<Offscreen>,
    bounds: [glam::Vec3; 2],
    inside_out: bool,
}

impl Drawing<'_> {
    /// Draws the user's view, and the one from outside where asked for. Returns the seconds that the user's took.
    fn draw(
        &mut self,
        camera: &Camera,
        stats: &FrameStats,
        file: &Path,
        outside_file: &Path,
    ) -> Result<f64, Error> {
        let [min, max] = self.bounds;
        let radius = 0.5 * (max - min).length();
        let begin = Instant::now();
        let mut scene = Scene::new(&self.mesh, picture::render_camera(camera, radius));
        scene.shading = self.args.shading();
        scene.inside_out = self.inside_out;
        let said = describe(stats);
        let text = [Text::new(&said)];
        if self.args.overlay {
            scene.text = &text;
        }
        let image = self.inside.draw(&scene)?;
        let seconds = begin.elapsed().as_secs_f64();
        picture::save(&image, file)?;
        if let Some(target) = &mut self.outside {
            let outside = outside::camera(camera, min, max);
            let lines = outside::frustum(camera, radius);
            let mut scene = Scene::new(&self.mesh, picture::render_camera(&outside, radius));
            scene.shading = self.args.shading();
            scene.inside_out = self.inside_out;
            scene.lines = &lines;
            picture::save(&target.draw(&scene)?, outside_file)?;
        }
        Ok(seconds)
    }
}

/// A frame in words, for an overlay.
pub(crate) fn describe(stats: &FrameStats) -> String {
    let ms = |time: std::time::Duration| 1e3 * time.as_secs_f64();
    format!(
        "{} triangles   {:.2} px\n{} updates   {} tests\n{} blocks   {:.1} MiB\n\
         tests {:.1} ms   updates {:.1} ms   loads {:.1} ms",
        stats.triangles_shown,
        stats.tolerance_px,
        stats.updates,
        stats.tests,
        stats.resident_blocks,
        stats.resident_bytes as f64 / f64::from(1 << 20),
        ms(stats.test_time),
        ms(stats.update_time),
        ms(stats.load_time),
    )
}
