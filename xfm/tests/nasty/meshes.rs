//! The meshes: those in `tests/meshes`, some that are made here, and all of them divided.

use std::collections::HashMap;
use std::f32::consts::TAU;
use std::path::Path;

use glam::{Vec3, vec3};
use mesh_io::{Format, IndexedMesh, Triangle, read_mesh, write_mesh_to};

/// A mesh as a file, and what a reader finds in it.
pub struct Nasty {
    pub name: String,
    /// The name of the file.
    pub file: String,
    pub bytes: Vec<u8>,
    /// Its triangles; none where it cannot be read.
    pub soup: Vec<Triangle>,
}

/// Files that no reader takes.
const BROKEN: [&str; 4] = ["empty.obj", "empty.stl", "cut-short.ply", "index-out-of-range.obj"];

impl Nasty {
    fn of(name: &str, mesh: &IndexedMesh) -> Self {
        let mut bytes = Vec::new();
        write_mesh_to(&mut bytes, Format::Obj, mesh).expect("memory holds it");
        Self { name: name.to_owned(), file: "in.obj".to_owned(), bytes, soup: mesh.to_soup() }
    }

    /// Whether no reader takes it.
    pub fn is_broken(&self) -> bool {
        BROKEN.contains(&self.name.as_str())
    }

    /// Whether one of its triangles has an area that is a number.
    pub fn has_area(&self) -> bool {
        self.soup.iter().any(|t| {
            let [a, b, c] = t.map(|corner| corner.as_dvec3());
            let area = (b - a).cross(c - a).length();
            area > 0.0 && area.is_finite()
        })
    }
}

fn read() -> Vec<(String, Vec<u8>, Option<IndexedMesh>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/meshes");
    let entries = folder.read_dir().expect("the folder of meshes");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let read = paths.into_iter().map(|path| {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name").to_owned();
        let bytes = std::fs::read(&path).expect("a readable file");
        (name, bytes, read_mesh(&path).ok())
    });
    read.collect()
}

/// All meshes, as they are.
pub fn all() -> Vec<Nasty> {
    let from_files = read().into_iter().map(|(name, bytes, mesh)| {
        assert_eq!(mesh.is_none(), BROKEN.contains(&name.as_str()), "{name}");
        let extension = name.rsplit('.').next().expect("an extension");
        let file = format!("in.{extension}");
        Nasty { file, bytes, soup: mesh.map(|mesh| mesh.to_soup()).unwrap_or_default(), name }
    });
    from_files.chain(made()).collect()
}

/// The same shapes with a thousand triangles or more.
pub fn fine() -> Vec<Nasty> {
    let meshes = read().into_iter().filter_map(|(name, _, mesh)| Some((name, mesh?)));
    let divided = meshes.filter(|(_, mesh)| !mesh.triangles.is_empty()).map(|(name, mut mesh)| {
        while mesh.triangles.len() < 1000 {
            divide(&mut mesh);
        }
        Nasty::of(&format!("{name}, divided"), &mesh)
    });
    divided.chain(made()).collect()
}

/// Every triangle becomes four; vertices that are one stay one.
fn divide(mesh: &mut IndexedMesh) {
    let mut middles = HashMap::new();
    let mut divided = Vec::new();
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            *middles.entry([from.min(to), from.max(to)]).or_insert_with_key(|ends| {
                let [p, q] = ends.map(|v| mesh.positions[v as usize]);
                // Halves first: the sum of large numbers is none.
                mesh.positions.push(0.5 * p + 0.5 * q);
                mesh.positions.len() as u32 - 1
            })
        });
        divided.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    mesh.triangles = divided;
}

/// What has too many triangles to be written down.
fn made() -> Vec<Nasty> {
    let spokes = 1000u32;
    let rim = |i: u32| TAU * i as f32 / spokes as f32;
    let around = (0..spokes).map(|i| vec3(rim(i).cos(), rim(i).sin(), 0.0));
    let mut positions = vec![vec3(0.0, 0.0, 0.5), vec3(0.0, 0.0, -0.5)];
    positions.extend(around);
    let corner = |i: u32| 2 + i % spokes;
    let above = (0..spokes).map(|i| [0, corner(i), corner(i + 1)]);
    let below = (0..spokes).map(|i| [1, corner(i + 1), corner(i)]);
    let fan = IndexedMesh {
        positions: positions.clone(),
        triangles: above.clone().collect(),
        ..IndexedMesh::default()
    };
    let double = IndexedMesh {
        positions,
        triangles: above.chain(below).collect(),
        ..IndexedMesh::default()
    };
    let mut many = IndexedMesh::default();
    for i in 0..1000u32 {
        let at = 3.0 * vec3((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32);
        let first = many.positions.len() as u32;
        many.positions.extend([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| at + p));
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        many.triangles.extend(faces.map(|t| t.map(|v| first + v)));
    }
    vec![
        Nasty::of("a fan of a thousand triangles", &fan),
        Nasty::of("two vertices of a thousand neighbours", &double),
        Nasty::of("a thousand components", &many),
    ]
}
