//! `xfm extract`: one level of detail as a mesh.

use std::fmt;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use mergetree::{Camera, View};
use mesh_io::{Format, Frame, IndexedMesh, IndexedSource};
use scratch::Scratch;
use serde::Serialize;
use xfm_format::{Encoding, Header, XfmFile};

use crate::level::{self, Level, Wanted, Way};
use crate::memory::AnonymousPeak;
use crate::mesh_stream::{Output, scratch_folder};
use crate::report::{ReportTo, say};
use crate::{Error, full, interrupt, text, values, xfm_file};

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
    /// Anonymous memory that --full may use at most, like 512MiB or 4G; what does not fit goes through scratch files
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = values::size)]
    memory: u64,
    /// Folder for scratch files [default: that of the output, or the system's]
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Format of the output where its name does not tell: stl, stla, ply, plya, plyb, obj, gltf, glb. Default of a pipe: ply
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
    mode: &'static str,
    seconds: f64,
    peak_anon: Option<u64>,
    scratch_bytes: u64,
    /// Whether vertices have colours in the output.
    colours: bool,
    warnings: Vec<String>,
}

impl fmt::Display for ExtractReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} triangles, {} vertices, error {} by the file's bounds, {} ({}{}{})",
            text::count(self.output_triangles),
            text::count(self.input_triangles),
            text::count(self.output_vertices),
            text::number(self.error, 4),
            text::seconds(self.seconds),
            self.mode,
            self.peak_anon.map(|peak| format!(", peak {}", text::size(peak))).unwrap_or_default(),
            match self.scratch_bytes {
                0 => String::new(),
                bytes => format!(", {} of scratch files", text::size(bytes)),
            }
        )
    }
}

impl ExtractArgs {
    fn wanted(&self, header: &Header) -> Wanted {
        if let Some(faces) = self.faces {
            let way = match header.encoding {
                Encoding::Exact => Way::Build,
                // What it keeps of the order is less than the build's.
                _ => Way::Deviation,
            };
            return Wanted::Faces(faces.get() as usize, way);
        }
        if let Some(error) = self.error {
            // Rounded down, so that the mesh keeps what was asked for.
            let nearest = error as f32;
            let below = if f64::from(nearest) > error { nearest.next_down() } else { nearest };
            return Wanted::Error(below);
        }
        match (self.pixels, self.eye, self.at) {
            (Some(pixels), Some(eye), Some(at)) => {
                let origin = xfm_file::frame(header).origin;
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

/// What was extracted.
struct Extracted {
    triangles: u64,
    vertices: u64,
    error: f64,
    mode: &'static str,
    scratch_bytes: u64,
    /// Whether all of it was: nobody may have read it to the end.
    is_written: bool,
}

impl Extracted {
    fn new(mesh: &dyn IndexedSource, error: f64, mode: &'static str, is_written: bool) -> Self {
        let (triangles, vertices) = (mesh.num_triangles(), mesh.num_vertices());
        Self { triangles, vertices, error, mode, scratch_bytes: 0, is_written }
    }

    fn with_scratch_bytes(self, scratch_bytes: u64) -> Self {
        Self { scratch_bytes, ..self }
    }
}

/// Writes a mesh; `false` where who read it had seen what they wanted before its end.
fn write(output: &Output, mesh: &mut dyn IndexedSource, frame: Frame) -> Result<bool, Error> {
    match output.write(mesh, frame) {
        Err(_) if output.has_no_reader() => Ok(false),
        written => Ok(written.map(|()| true)?),
    }
}

/// A level of a file that is wholly in memory. Nothing is on the disk, so Ctrl-C may end the process at once.
fn in_core(file: &XfmFile, wanted: &Wanted) -> Result<Level, Error> {
    let name = || file.path().to_owned();
    let level = interrupt::freely(|| -> Result<Level, Error> {
        level::extract(&mut file.read_forest()?, wanted, |_| false)
            .map_err(|source| Error::Base { file: name(), source })
    })?;
    match level.damaged {
        0 => Ok(level),
        nodes => Err(Error::DamagedNodes { file: name(), nodes: nodes as u64 }),
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
    let peak = AnonymousPeak::watch();
    let extracted = match args.wanted(file.header()) {
        Wanted::Full if !full::fits_in_core(&file, args.memory) => {
            let best = || output.scratch_folder();
            let scratch = Scratch::new(scratch_folder(args.scratch.as_deref(), best)?);
            let mut mesh = full::full_mesh(&file, &scratch, args.memory)?;
            let written = write(&output, &mut mesh, frame)?;
            Extracted::new(&mesh, 0.0, "streaming", written)
                .with_scratch_bytes(mesh.scratch_bytes())
        }
        wanted => {
            let level = in_core(&file, &wanted)?;
            let error = f64::from(level.error);
            let mesh = IndexedMesh {
                positions: level.positions,
                triangles: level.triangles,
                colours: level.colours,
            };
            let written = write(&output, &mut &mesh, frame)?;
            Extracted::new(&&mesh, error, "in-core", written)
        }
    };
    if !extracted.is_written {
        return Ok(());
    }
    let has_colours = file.header().has_colour();
    let warnings: Vec<String> =
        output.rounding(frame).into_iter().chain(output.colourless(has_colours)).collect();
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
        output_triangles: extracted.triangles,
        output_vertices: extracted.vertices,
        error: extracted.error,
        mode: extracted.mode,
        peak_anon: peak.so_far(),
        scratch_bytes: extracted.scratch_bytes,
        seconds: start.elapsed().as_secs_f64(),
        colours: has_colours && output.holds_colours(),
        warnings,
    })
}
