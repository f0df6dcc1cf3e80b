//! `xfm extract`: one level of detail as a mesh.

use std::fmt;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use mergetree::{Camera, View};
use mesh_io::{Format, IndexedMesh};
use serde::Serialize;

use crate::level::{self, Level, Wanted};
use crate::mesh_stream::Output;
use crate::report::{ReportTo, say};
use crate::{Error, interrupt, text, values, xfm_file};

/// Extract one level of detail as a plain, welded mesh without seams
///
/// Choose it by number of triangles, by distance from the input, or for a camera: then it is fine where the camera sees it,
/// and coarse elsewhere. --full gives the input back, welded and repaired.
#[derive(Debug, Clone, clap::Args)]
#[command(group = clap::ArgGroup::new("level").required(true).args(["full", "faces", "error", "pixels"]))]
#[command(after_help = "\
Examples:
  Ten thousand triangles
    xfm extract dragon.xfm dragon-10k.ply --faces 10000

  No farther than 0.2 units from the original
    xfm extract scan.xfm scan-coarse.stl --error 0.2

  What a camera needs, to one pixel
    xfm extract scan.xfm view.glb --eye 0,1,-4 --at 0,0.5,0 --fov 60 --size 1920x1080 --pixels 1

  The input again, into a pipe
    xfm extract scan.xfm - --full --to obj | gzip > scan.obj.gz")]
pub struct ExtractArgs {
    /// The .xfm file
    #[arg(value_name = "FILE.xfm")]
    file: PathBuf,
    /// The mesh to write (.stl, .ply, .obj, .gltf, .glb, each also as .gz or .zst); - is standard output
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// The whole input
    #[arg(long)]
    full: bool,
    /// So many triangles (one more where only a pair can be added)
    #[arg(long, value_name = "N")]
    faces: Option<NonZeroU32>,
    /// No farther from the input than this, in model units
    #[arg(long, value_name = "E", value_parser = values::positive)]
    error: Option<f64>,
    /// Looking like the input up to so many pixels, from a camera
    #[arg(long, value_name = "T", value_parser = values::positive, requires = "eye", requires = "at")]
    pixels: Option<f64>,
    /// Where the camera is
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, requires = "pixels")]
    eye: Option<DVec3>,
    /// What the camera looks at
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, requires = "pixels")]
    at: Option<DVec3>,
    /// The camera's vertical angle of view in degrees
    #[arg(long, value_name = "DEG", default_value = "45", value_parser = values::field_of_view)]
    fov: f64,
    /// Size of its picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = values::image_size)]
    size: [u32; 2],
    /// Format of the output where its name does not tell: stl, stla, ply, plya, plyb, obj, gltf, glb
    #[arg(long, value_name = "FMT", value_parser = values::format)]
    to: Option<Format>,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What `xfm extract` reports; the error in model units.
#[derive(Debug, Clone, Serialize)]
struct ExtractReport {
    input_triangles: u64,
    output_triangles: u64,
    output_vertices: u64,
    error: f64,
    seconds: f64,
    warnings: Vec<String>,
}

impl fmt::Display for ExtractReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} triangles, {} vertices, error {} by the file's bounds, {}",
            text::count(self.output_triangles),
            text::count(self.input_triangles),
            text::count(self.output_vertices),
            text::number(self.error, 4),
            text::seconds(self.seconds)
        )
    }
}

impl ExtractArgs {
    fn wanted(&self, origin: DVec3) -> Wanted {
        if let Some(faces) = self.faces {
            return Wanted::Faces(faces.get() as usize);
        }
        if let Some(error) = self.error {
            // Rounded down, so that the mesh keeps what was asked for.
            let nearest = error as f32;
            let below = if f64::from(nearest) > error { nearest.next_down() } else { nearest };
            return Wanted::Error(below);
        }
        match (self.pixels, self.eye, self.at) {
            (Some(pixels), Some(eye), Some(at)) => {
                let camera = Camera {
                    eye: (eye - origin).as_vec3(),
                    at: (at - origin).as_vec3(),
                    fov_y: self.fov.to_radians() as f32,
                    width: self.size[0],
                    height: self.size[1],
                    ..Camera::default()
                };
                Wanted::Pixels(View::new(&camera), pixels as f32)
            }
            _ => Wanted::Full,
        }
    }
}

/// Runs the command.
///
/// # Errors
///
/// A file that cannot be read or is damaged, and an output that cannot be written.
pub fn run(args: &ExtractArgs) -> Result<(), Error> {
    let start = Instant::now();
    let file = interrupt::freely(|| xfm_file::open(&args.file))?;
    let output = Output::new(&args.output, args.to)?;
    let frame = xfm_file::frame(file.header());
    let level = interrupt::freely(|| -> Result<Level, Error> {
        let wanted = args.wanted(frame.origin);
        level::extract(&mut file.read_forest()?, &wanted, |_| false)
            .map_err(|source| Error::Base { file: args.file.clone(), source })
    })?;
    if level.damaged > 0 {
        return Err(Error::DamagedNodes { file: args.file.clone(), nodes: level.damaged as u64 });
    }
    let error = f64::from(level.error);
    let mesh = IndexedMesh { positions: level.positions, triangles: level.triangles };
    match output.write(&mesh, frame) {
        // Who read the output has seen what they wanted.
        Err(_) if output.has_no_reader() => return Ok(()),
        written => written?,
    }
    let warnings: Vec<String> = output.rounding(frame).into_iter().collect();
    let report_to = match (args.json, output.is_pipe()) {
        (true, true) => ReportTo::ScriptsBesideMesh,
        (json, _) => ReportTo::new(json),
    };
    // Not into the middle of the JSON, which has them too.
    if report_to != ReportTo::ScriptsBesideMesh {
        warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
    }
    report_to.deliver(&ExtractReport {
        input_triangles: file.header().input_triangles,
        output_triangles: mesh.triangles.len() as u64,
        output_vertices: mesh.positions.len() as u64,
        error,
        seconds: start.elapsed().as_secs_f64(),
        warnings,
    })
}
