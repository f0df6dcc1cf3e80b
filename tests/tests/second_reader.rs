//! A reader in Python, written from `FORMAT.md` alone, finds in files what ours does.

use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;
use mergetree::{Colour, Dependencies, Forest, Front, UpdateLimits};
use tests::{forest, model, triangle_set};
use xfm_format::{Encoding, WriteOptions, XfmFile, write};
use xtask::generate::Shape;

/// Python with NumPy, where there is one.
fn python() -> Option<&'static str> {
    let works = |python: &&str| {
        let ran = Command::new(python).args(["-c", "import numpy"]).output();
        ran.is_ok_and(|ran| ran.status.success())
    };
    ["python3", "python"].into_iter().find(works)
}

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>, Vec<Colour>);

fn read_in_python(python: &str, file: &Path) -> Mesh {
    let reader = Path::new(env!("CARGO_MANIFEST_DIR")).join("reader/xfm.py");
    let output = file.with_extension("mesh");
    let ran = Command::new(python).arg("-B").arg(reader).args([file, &output]).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let bytes = std::fs::read(output).unwrap();
    let (counts, rest) = bytes.split_at(16);
    let count = |at: usize| u64::from_le_bytes(counts[at..at + 8].try_into().unwrap()) as usize;
    let (positions, rest) = rest.split_at(12 * count(0));
    let (triangles, colours) = rest.split_at(12 * count(8));
    let colours: Vec<Colour> = colours.as_chunks().0.to_vec();
    assert!(colours.is_empty() || colours.len() == count(0));
    let words = |bytes: &[u8]| -> Vec<[u32; 3]> {
        let word = |at: &[u8]| u32::from_le_bytes(at.try_into().unwrap());
        bytes.chunks(12).map(|at| [word(&at[..4]), word(&at[4..8]), word(&at[8..])]).collect()
    };
    let positions = words(positions).into_iter().map(|p| p.map(f32::from_bits).into());
    (positions.collect(), words(triangles), colours)
}

/// The mesh that `xfm extract --full` writes.
fn refined(mut forest: Forest) -> Mesh {
    let mut front = Front::new(&forest, Dependencies::Order).unwrap();
    front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
    let (positions, triangles) = front.to_mesh();
    (positions, triangles, front.to_colours())
}

fn check(python: &str, path: &Path) {
    let ours = refined(XfmFile::open(path).unwrap().read_forest().unwrap());
    let theirs = read_in_python(python, path);
    assert_eq!(triangle_set(&theirs.0, &theirs.1), triangle_set(&ours.0, &ours.1));
    // Some vertices may lie in the same place.
    let coloured = |(positions, _, colours): &Mesh| {
        let bits = positions.iter().map(|p| p.to_array().map(f32::to_bits));
        let mut pairs: Vec<_> = bits.zip(colours.iter().copied()).collect();
        pairs.sort_unstable();
        pairs
    };
    assert_eq!(theirs.2.len(), ours.2.len());
    assert_eq!(coloured(&theirs), coloured(&ours));
}

/// Gives vertices colours by where they are.
fn colour(forest: &mut Forest) {
    let colour = |p: Vec3| {
        let [r, g, b] = (100.0 * p).round().as_ivec3().to_array().map(|c| c as u8);
        [r, g, b, r ^ b]
    };
    forest.colours = forest.nodes.iter().map(|node| colour(node.position)).collect();
    forest.base.colours = forest.base.vertices.iter().map(|v| colour(v.position)).collect();
}

#[test]
fn a_reader_made_from_the_specification_reads_both_encodings() {
    let Some(python) = python() else {
        eprintln!("there is no Python with NumPy here");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (shape, holes) in [(Shape::Scan, 0.0), (Shape::Torus, 0.1)] {
        let mut forest = forest(&model(shape, 6_000, holes));
        if holes > 0.0 {
            colour(&mut forest);
        }
        for (encoding, page_nodes) in
            [(Encoding::Exact, 200), (Encoding::Compact, 200), (Encoding::Compact, 1024)]
        {
            let mut options = WriteOptions::default();
            options.encoding = encoding;
            options.page_nodes = Some(page_nodes);
            let path = folder.path().join("model.xfm");
            write(&forest, &path, &options).unwrap();
            check(python, &path);
        }
    }
}

#[test]
fn it_reads_the_files_that_have_to_stay_readable() {
    let Some(python) = python() else {
        eprintln!("there is no Python with NumPy here");
        return;
    };
    let golden = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../xfm-format/tests/golden");
    let folder = tempfile::tempdir().unwrap();
    for name in ["2", "2-compact", "2-colour", "2-compact-colour"] {
        let path = folder.path().join("golden.xfm");
        std::fs::copy(golden.join(format!("version-{name}.xfm")), &path).unwrap();
        check(python, &path);
    }
}
