//! Collapses tell the colours of vertices, in whatever order a file is read.

use std::ops::ControlFlow;

use glam::Vec3;
use mesh_io::{Colour, IndexedMesh, MeshSource, TriangleSource};
use stream_decimate::{CollapseOptions, Collapsed, Error, ReadOrder, collapse_file};

fn colour_at(p: Vec3) -> Colour {
    let mix = |hash: u32, c: &f32| (hash ^ c.to_bits()).wrapping_mul(0x9e37_79b1).rotate_left(9);
    (p + Vec3::ZERO).to_array().iter().fold(7, mix).to_le_bytes()
}

/// A wavy sheet, `2 · n²` triangles in no good order.
fn sheet(n: u32) -> IndexedMesh {
    let m = n + 1;
    let point = |i: u32| {
        let (x, y) = ((i % m) as f32, (i / m) as f32);
        Vec3::new(x, 1.3 * y, 3.0 * (0.1 * x).sin() * (0.13 * y).cos())
    };
    let positions: Vec<Vec3> = (0..m * m).map(point).collect();
    let cells = (0..n * n).map(|cell| cell % n + cell / n * m);
    let triangles: Vec<[u32; 3]> =
        cells.flat_map(|v| [[v, v + 1, v + m + 1], [v, v + m + 1, v + m]]).collect();
    let count = triangles.len();
    let triangles = (0..count).map(|i| triangles[i * 7919 % count]).collect();
    let colours = positions.iter().map(|&p| colour_at(p)).collect();
    IndexedMesh { positions, triangles, colours }
}

/// The collapses, and what is left.
fn collapsed(mesh: &IndexedMesh, order: ReadOrder, weight: f32) -> (Vec<Collapsed>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut open =
        || Ok(Box::new(MeshSource::new(mesh.clone(), "sheet")) as Box<dyn TriangleSource + Send>);
    let mut options = CollapseOptions::default();
    options.buffer_triangles = 30_000;
    options.colour_weight = weight;
    let mut collapses = Vec::new();
    let mut tell = |collapse: &Collapsed| {
        collapses.push(*collapse);
        Ok::<(), Error>(())
    };
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let (rest, report) =
        collapse_file(&mut open, order, folder.path(), &options, &mut tell, go_on).unwrap();
    assert_eq!(report.repaired.recoloured, 0);
    for vertex in &rest.vertices {
        let expected = (!mesh.colours.is_empty()).then(|| colour_at(vertex.position));
        assert_eq!(vertex.colour, expected);
    }
    (collapses, rest.vertices.len())
}

#[test]
fn every_vertex_has_its_colour() {
    let mesh = sheet(110);
    for order in [ReadOrder::AsIs, ReadOrder::Counted, ReadOrder::Sorted] {
        let (collapses, rest) = collapsed(&mesh, order, 0.002);
        assert_eq!(collapses.len() + rest, mesh.positions.len());
        for collapse in collapses {
            assert_eq!(collapse.colour, Some(colour_at(collapse.position)), "{order:?}");
        }
    }
}

#[test]
fn without_a_weight_collapses_are_those_of_the_mesh_without_colours() {
    let mesh = sheet(60);
    let plain = IndexedMesh { colours: Vec::new(), ..mesh.clone() };
    let (expected, _) = collapsed(&plain, ReadOrder::AsIs, 0.002);
    let (mut found, _) = collapsed(&mesh, ReadOrder::AsIs, 0.0);
    let (weighed, _) = collapsed(&mesh, ReadOrder::AsIs, 0.002);
    found.iter_mut().for_each(|collapse| collapse.colour = None);
    assert_eq!(found, expected);
    assert_ne!(weighed.len(), 0);
    assert!(weighed.iter().zip(&expected).any(|(a, b)| a.removed != b.removed));
}

#[test]
fn a_weight_that_is_none_is_refused() {
    let mut options = CollapseOptions::default();
    options.check().unwrap();
    for weight in [-1.0, f32::NAN, f32::INFINITY] {
        options.colour_weight = weight;
        assert!(options.check().unwrap_err().to_string().contains("colours weigh"));
    }
}
