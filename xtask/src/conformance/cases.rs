//! The meshes that are judged.

use std::fs;
use std::path::{Path, PathBuf};

use super::Scope;
use crate::generate::{Generator, Options, Shape, write_file};
use crate::{Error, process};

/// A mesh, and what is done with it.
#[derive(Debug)]
pub struct Case {
    /// A short name without spaces.
    pub name: String,
    /// The mesh.
    pub input: PathBuf,
    /// Where its results go: a folder that exists.
    pub folder: PathBuf,
    /// What is known beforehand.
    pub nature: Nature,
    /// Numbers of triangles to extract fronts of.
    pub fronts: Vec<u64>,
    /// Places to look at the middle from, and extract fronts for.
    pub eyes: Vec<[f64; 3]>,
    /// A number of triangles to decimate to.
    pub decimate: Option<u64>,
    /// Whether each file format is tried on it.
    pub formats: bool,
    /// Whether it is also built within this much memory, such as `64MiB`.
    pub memory: Option<&'static str>,
}

/// What is known of a mesh before it is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nature {
    /// Closed and manifold, with this Euler number.
    Closed(i64),
    /// Manifold with boundaries.
    Open,
    /// Anything may be wrong with it.
    Dirty,
    /// Nothing is known: what the judge finds in the input holds.
    Unknown,
}

impl Nature {
    /// The word for it in the plan.
    pub fn word(self) -> &'static str {
        match self {
            Self::Closed(_) => "closed",
            Self::Open => "open",
            Self::Dirty => "dirty",
            Self::Unknown => "unknown",
        }
    }
}

/// Makes the inputs below a folder and lists them.
pub fn all(scope: Scope, folder: &Path) -> Result<Vec<Case>, Error> {
    let eyes = vec![[320.0, 40.0, 60.0], [-30.0, -150.0, 90.0]];
    let mut cases = vec![
        Case {
            fronts: vec![15_000, 8_000, 3_000, 1_000, 300],
            eyes: eyes.clone(),
            decimate: Some(2_000),
            formats: true,
            ..generated(folder, "scan", Nature::Closed(2), &options(Shape::Scan, 20_000))?
        },
        Case {
            fronts: vec![12_000, 4_000, 800],
            eyes,
            decimate: Some(1_000),
            ..generated(folder, "torus", Nature::Closed(0), &options(Shape::Torus, 20_000))?
        },
        Case {
            fronts: vec![10_000, 4_000],
            decimate: Some(4_000),
            ..generated(folder, "holes", Nature::Open, &{
                let mut options = options(Shape::Scan, 20_000);
                options.holes = 0.05;
                options
            })?
        },
        Case {
            fronts: vec![5_000, 1_000],
            ..generated(folder, "shuffled", Nature::Closed(2), &{
                let mut options = options(Shape::Scan, 10_000);
                options.shuffle = true;
                options
            })?
        },
    ];
    for (name, text) in broken() {
        let case = new_case(folder, name.trim_end_matches(".obj"), Nature::Dirty)?;
        let input = case.folder.join(name);
        fs::write(&input, text).map_err(Error::file(&input))?;
        cases.push(Case { input, ..case });
    }
    if scope == Scope::Full {
        cases.push(Case {
            fronts: vec![200_000, 20_000, 2_000],
            decimate: Some(10_000),
            memory: Some("64MiB"),
            ..generated(folder, "big-scan", Nature::Closed(2), &options(Shape::Scan, 500_000))?
        });
        let figure = options(Shape::Isosurface, 100_000);
        cases.push(Case {
            fronts: vec![50_000, 5_000],
            decimate: Some(5_000),
            ..generated(folder, "isosurface", Nature::Unknown, &figure)?
        });
        cases.extend(from_data(folder)?);
    }
    Ok(cases)
}

fn options(shape: Shape, triangles: u64) -> Options {
    let mut options = Options::new(shape, triangles);
    options.seed = 1;
    options
}

fn new_case(folder: &Path, name: &str, nature: Nature) -> Result<Case, Error> {
    let folder = folder.join(name);
    fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    Ok(Case {
        name: name.to_owned(),
        input: PathBuf::new(),
        folder,
        nature,
        fronts: Vec::new(),
        eyes: Vec::new(),
        decimate: None,
        formats: false,
        memory: None,
    })
}

fn generated(folder: &Path, name: &str, nature: Nature, options: &Options) -> Result<Case, Error> {
    let case = new_case(folder, name, nature)?;
    let shared_vertices = !options.shuffle && options.shape != Shape::Isosurface;
    let input = case.folder.join(if shared_vertices { "input.ply" } else { "input.stl" });
    write_file(&Generator::new(options)?, &input)?;
    Ok(Case { input, ..case })
}

/// Meshes of the data folder that lies beside the workspace, if there is one.
fn from_data(folder: &Path) -> Result<Vec<Case>, Error> {
    let data = process::data();
    let Ok(entries) = fs::read_dir(&data) else {
        eprintln!("conformance: no folder {}; its meshes are left out", data.display());
        return Ok(Vec::new());
    };
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|f| {
            f.extension().is_some_and(|e| ["ply", "obj", "stl"].iter().any(|known| e == *known))
        })
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|input| {
            let name = input.file_stem().map(|s| s.to_string_lossy().into_owned());
            let case = new_case(folder, &name.unwrap_or_default(), Nature::Unknown)?;
            Ok(Case { input, fronts: vec![5_000, 1_000], decimate: Some(2_000), ..case })
        })
        .collect()
}

/// Small broken meshes, written by hand.
fn broken() -> [(&'static str, String); 6] {
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    [
        // Three faces about one edge.
        (
            "fin.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n".into(),
        ),
        // Two tetrahedra that touch in one vertex.
        (
            "bow-tie.obj",
            format!(
                "{tetrahedron}v -1 0 0\nv 0 -1 0\nv 0 0 -1\nf 1 6 5\nf 1 5 7\nf 5 6 7\nf 6 1 7\n"
            ),
        ),
        // The same face twice, once more the other way round, and one without area.
        ("duplicates.obj", format!("{tetrahedron}f 1 3 2\nf 1 2 3\nf 1 2 2\n")),
        // A neighbour with the opposite winding.
        ("winding.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 4 3\n".into()),
        // A position that is no number, used by one of the faces.
        ("not-a-number.obj", format!("{tetrahedron}v nan 0 0\nf 1 2 5\n")),
        // Faces that share positions but no vertices: a soup, and one far-off face.
        (
            "soup.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 4 5 6\n\
             v 9 9 9\nv 10 9 9\nv 9 10 9\nf 7 8 9\n"
                .into(),
        ),
    ]
}
