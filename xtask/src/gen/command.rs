//! The command `gen`.

use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::time::Instant;

use super::{Generator, Options, Shape, output};
use crate::Error;

/// Bytes gathered before they are written.
const BUFFER: usize = 1 << 20;

/// Arguments of `gen`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  cargo xtask gen scan --triangles 100000000 -o - | \
    xfm decimate - small.ply --from stl --ratio 0.01")]
pub struct Arguments {
    /// The mesh.
    shape: Shape,
    /// Triangles to make, before holes are cut.
    #[arg(long, short = 'n', default_value_t = 1_000_000)]
    triangles: u64,
    /// Share of all edges that lie on the boundary of small holes.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    holes: f64,
    /// Emit small blocks in a random order instead of layer by layer.
    #[arg(long)]
    shuffle: bool,
    /// Add to each position before it is rounded to f32.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_point)]
    origin: Option<Point>,
    /// Choose noise, holes and order.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where to write: .stl or .ply, or - for a binary STL on standard output.
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

#[derive(Debug, Clone, Copy)]
struct Point([f64; 3]);

fn parse_point(text: &str) -> Result<Point, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.map_err(|e| e.to_string())?.as_slice() {
        &[x, y, z] if [x, y, z].iter().all(|c: &f64| c.is_finite()) => Ok(Point([x, y, z])),
        _ => Err("three finite numbers with commas between them are needed".into()),
    }
}

/// Generates a mesh.
///
/// # Errors
/// When the options cannot be met or the output fails.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    let options = Options {
        holes: arguments.holes,
        shuffle: arguments.shuffle,
        origin: arguments.origin.map_or([0.0; 3], |p| p.0),
        seed: arguments.seed,
        ..Options::new(arguments.shape, arguments.triangles)
    };
    let start = Instant::now();
    let generator = Generator::new(&options)?;
    let written = if arguments.output.as_os_str() == "-" {
        if io::stdout().is_terminal() {
            return Err(Error::Unsupported(
                "not writing a binary STL to a terminal; use -o FILE".into(),
            ));
        }
        let mut out = BufWriter::with_capacity(BUFFER, io::stdout().lock());
        output::write_stl(&generator, &mut out)
    } else {
        write_file(&generator, &arguments.output)
    };
    let count = match written {
        Err(error) if output::is_closed_pipe(&error) => return Ok(()),
        other => other?,
    };
    let seconds = start.elapsed().as_secs_f64();
    eprintln!(
        "{count} triangles in {seconds:.2} s ({:.2} M/s)",
        count as f64 / seconds.max(1e-9) / 1e6
    );
    Ok(())
}

/// Writes a mesh to a file in the format that its extension names.
///
/// # Errors
/// When the extension is unknown or the file cannot be written.
pub fn write_file(generator: &Generator, path: &std::path::Path) -> Result<u64, Error> {
    let write = match path.extension().and_then(|e| e.to_str()) {
        Some("stl") => output::write_stl,
        Some("ply") => output::write_ply,
        _ => {
            return Err(Error::Unsupported(format!(
                "{}: unknown extension; use .stl or .ply",
                path.display()
            )));
        }
    };
    let file = File::create(path).map_err(Error::file(path))?;
    let mut out = BufWriter::with_capacity(BUFFER, file);
    let count = write(generator, &mut out)?;
    out.flush().map_err(Error::file(path))?;
    Ok(count)
}
