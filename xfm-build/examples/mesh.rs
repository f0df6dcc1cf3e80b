//! Builds a file of a mesh: `mesh IN OUT.xfm [MEBIBYTES]`.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::PathBuf;

use mesh_io::open_source;
use xfm_build::{Input, MeshOptions, build_mesh};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let input = PathBuf::from(arguments.next().ok_or("which mesh?")?);
    let output = PathBuf::from(arguments.next().ok_or("to which file?")?);
    let mut options = MeshOptions::default();
    if let Some(mebibytes) = arguments.next() {
        options.memory_bytes = mebibytes.parse::<u64>()? << 20;
    }
    options.expected_triangles = open_source(&input)?.triangle_hint();
    let mut open = || open_source(&input);
    let report =
        build_mesh(Input::File(&mut open), &output, &std::env::temp_dir(), &options, &mut |_| {
            ControlFlow::Continue(())
        })?;
    println!("{:?}, read {:?}: {}", report.mode, report.order, report.built);
    Ok(())
}
