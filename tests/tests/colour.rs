//! Colours count in the order of collapses: edges of colours stay where they are.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use glam::Vec3;
use mergetree::{Dependencies, Front, UpdateLimits};
use mesh_io::{Colour, IndexedMesh, MeshSource, TriangleSource};
use stream_decimate::ReadOrder;
use xfm_build::{Input, MeshOptions, Mode, build_mesh};
use xfm_format::XfmFile;

/// A sphere of `2 · 6 · n²` triangles with the colours of a checkerboard.
fn checkerboard(n: u32) -> IndexedMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut number = BTreeMap::new();
    for side in 0..6 {
        let mut vertex = |i: u32, j: u32| {
            let on_side =
                |i: u32| (std::f32::consts::FRAC_PI_4 * (2.0 * i as f32 / n as f32 - 1.0)).tan();
            let (x, y, z) = (on_side(i), on_side(j), if side % 2 == 0 { 1.0 } else { -1.0 });
            let (x, y) = if side % 2 == 0 { (x, y) } else { (y, x) };
            let p = [Vec3::new(x, y, z), Vec3::new(z, x, y), Vec3::new(y, z, x)][side / 2];
            let key = p.to_array().map(|c| (c * 1e5).round() as i32);
            *number.entry(key).or_insert_with(|| {
                positions.push(p.normalize());
                positions.len() as u32 - 1
            })
        };
        for j in 0..n {
            for i in 0..n {
                let [a, b, c, d] =
                    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| vertex(i + x, j + y));
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let colours = positions.iter().map(|&p| board(p)).collect();
    IndexedMesh { positions, triangles, colours }
}

fn board(p: Vec3) -> Colour {
    let cell = |angle: f32| (angle * 3.0 / std::f32::consts::PI).floor() as i32;
    match (cell(p.y.atan2(p.x)) + cell(p.z.clamp(-1.0, 1.0).asin())).rem_euclid(2) {
        0 => [20, 60, 200, 255],
        _ => [230, 40, 30, 255],
    }
}

fn build(mesh: &IndexedMesh, path: &Path, options: &MeshOptions) {
    let mut open = || Ok(Box::new(MeshSource::new(mesh.clone(), "mesh")) as _);
    let go_on = &mut |_| ControlFlow::Continue(());
    build_mesh(Input::File(&mut open), path, path.parent().unwrap(), options, go_on).unwrap();
}

/// A level of so many triangles, backwards along the collapses.
fn level(path: &Path, faces: usize) -> IndexedMesh {
    let mut forest = XfmFile::open(path).unwrap().read_forest().unwrap();
    let mut front = Front::new(&forest, Dependencies::Order).unwrap();
    let mut limits = UpdateLimits::with_tolerance(-1.0);
    limits.max_triangles = faces;
    front.update(&mut forest, |node| node.order as f32, &limits);
    let (positions, triangles) = front.to_mesh();
    IndexedMesh { positions, triangles, colours: front.to_colours() }
}

/// The root of the mean squared difference between the colour of the surface, which is interpolated, and that of the board.
fn colour_error(mesh: &IndexedMesh) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        let of = (b - a).cross(c - a).length() as f64;
        let steps = 8u32;
        let mut squares = 0.0;
        let mut count = 0.0;
        for i in 0..steps {
            for j in 0..steps - i {
                let k = steps - 1 - i - j;
                let weights = [i, j, k].map(|w| (w as f32 + 1.0 / 3.0) / steps as f32);
                let mix = |component: usize| -> f32 {
                    let corner = |v: u32| f32::from(mesh.colours[v as usize][component]);
                    (0..3).map(|i| weights[i] * corner(t[i])).sum()
                };
                let expected = board(weights[0] * a + weights[1] * b + weights[2] * c);
                let difference = |i: usize| f64::from((mix(i) - f32::from(expected[i])) / 255.0);
                squares += (0..3).map(|i| difference(i).powi(2)).sum::<f64>();
                count += 1.0;
            }
        }
        sum += of * squares / count;
        area += of;
    }
    (sum / area).sqrt()
}

fn weighing(weight: f32, mode: Mode) -> MeshOptions {
    let mut options = MeshOptions::default();
    options.mode = Some(mode);
    options.colour_weight = weight;
    if mode == Mode::Streaming {
        options.memory_bytes = 1;
    }
    options
}

#[test]
fn edges_of_colours_are_kept_where_colours_count() {
    let mesh = checkerboard(100);
    let faces = mesh.triangles.len() / 20;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board.xfm");
    for mode in [Mode::InCore, Mode::Streaming] {
        let error = |weight: f32| {
            build(&mesh, &path, &weighing(weight, mode));
            let level = level(&path, faces);
            assert!(level.triangles.len() <= faces + 1);
            colour_error(&level)
        };
        let without = error(0.0);
        let default = error(MeshOptions::default().colour_weight);
        assert!(default < 0.7 * without, "{default} with the weight, {without} without, {mode:?}");
    }
}

#[test]
fn the_file_does_not_depend_on_the_number_of_threads() {
    let mesh = checkerboard(80);
    let folder = tempfile::tempdir().unwrap();
    for mode in [Mode::InCore, Mode::Streaming] {
        let files = [1, 3].map(|threads| {
            let mut options = weighing(0.002, mode);
            options.threads = std::num::NonZeroUsize::new(threads);
            let path = folder.path().join(format!("{threads}.xfm"));
            build(&mesh, &path, &options);
            std::fs::read(path).unwrap()
        });
        assert!(files[0] == files[1]);
    }
}

#[test]
fn colours_come_along_where_triangles_have_to_be_sorted() {
    let mut mesh = checkerboard(70);
    // Far from any order.
    let count = mesh.triangles.len();
    let shuffled = (0..count).map(|i| mesh.triangles[i * 7919 % count]);
    mesh.triangles = shuffled.collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board.xfm");
    for numbered in [true, false] {
        let mut open = || -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error> {
            let source = MeshSource::new(mesh.clone(), "mesh");
            Ok(if numbered { Box::new(source) } else { Box::new(Unnumbered(source)) })
        };
        let go_on = &mut |_| ControlFlow::Continue(());
        let options = weighing(0.002, Mode::Streaming);
        let input = Input::File(&mut open);
        let report = build_mesh(input, &path, folder.path(), &options, go_on).unwrap();
        assert_eq!(report.order, ReadOrder::Sorted);
        let full = level(&path, count);
        assert_eq!(full.triangles.len(), count);
        for (&p, &colour) in full.positions.iter().zip(&full.colours) {
            assert_eq!(colour, board(p));
        }
    }
}

/// A source that says it has no numbers, so that it is sorted.
struct Unnumbered(MeshSource);

impl TriangleSource for Unnumbered {
    fn read(
        &mut self,
        out: &mut Vec<mesh_io::Triangle>,
        max: usize,
    ) -> Result<usize, mesh_io::Error> {
        self.0.read(out, max)
    }

    fn triangle_count(&self) -> Option<u64> {
        self.0.triangle_count()
    }

    fn read_numbered(
        &mut self,
        out: &mut Vec<mesh_io::Triangle>,
        numbers: &mut Vec<[u64; 3]>,
        max: usize,
    ) -> Result<usize, mesh_io::Error> {
        self.0.read_numbered(out, numbers, max)
    }

    fn has_colours(&self) -> bool {
        true
    }

    fn look_up_colours(&mut self, numbers: &[[u64; 3]], out: &mut Vec<[Colour; 3]>) {
        self.0.look_up_colours(numbers, out);
    }
}
