//! What is written reads back bit for bit, as a mesh and as a stream, by path and through pipes.

use glam::Vec3;
use mesh_io::{
    Format, IndexedMesh, TriangleSource, create_sink_as, open_source_with, read_mesh_from,
    read_mesh_with, sink_to, source_from, write_mesh_as,
};
use proptest::prelude::*;

use crate::support::{Dribble, bits, bytes_of, drain, read, stream, tetrahedron};

fn is_stl(format: Format) -> bool {
    matches!(format, Format::StlBinary | Format::StlAscii)
}

#[test]
fn meshes_come_back_bit_for_bit() {
    let mesh = tetrahedron();
    for format in Format::ALL {
        assert_eq!(read(bytes_of(&mesh, format), format).unwrap(), mesh, "{format:?}");
    }
}

#[test]
fn unused_vertices_stay_where_the_format_has_vertices() {
    let mut mesh = tetrahedron();
    mesh.positions.insert(0, Vec3::splat(-9.0));
    mesh.positions.push(Vec3::splat(9.0));
    mesh.triangles.iter_mut().flatten().for_each(|v| *v += 1);
    for format in Format::ALL.into_iter().filter(|&format| !is_stl(format)) {
        assert_eq!(read(bytes_of(&mesh, format), format).unwrap(), mesh, "{format:?}");
    }
}

#[test]
fn streams_give_the_triangles_in_order_whatever_the_batch() {
    let mesh = tetrahedron();
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        for max in [1, 2, 3, 4, 100] {
            let soup = stream(&bytes, format, max).unwrap();
            assert_eq!(bits(&soup), bits(&mesh.to_soup()), "{format:?}");
        }
    }
}

#[test]
fn slow_pipes_change_nothing() {
    let mesh = tetrahedron();
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        for step in [1, 7] {
            assert_eq!(read_mesh_from(Dribble(&bytes, step), format, "pipe").unwrap(), mesh);
            let mut source = source_from(Dribble(&bytes, step), format, "pipe").unwrap();
            assert_eq!(drain(&mut *source, 3).unwrap(), mesh.to_soup(), "{format:?}");
        }
    }
}

#[test]
fn sinks_weld_and_count_in_files_and_pipes() {
    let mesh = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join(format!("sink.{}", format.name()));
        let mut sink = create_sink_as(&path, Some(format)).unwrap();
        for pair in mesh.to_soup().chunks(3) {
            sink.write(pair).unwrap();
        }
        assert!(!path.exists(), "not there before it is finished");
        sink.finish().unwrap();
        let options = mesh_io::ReadOptions::default().with_format(format);
        assert_eq!(read_mesh_with(&path, &options).unwrap(), mesh, "{format:?}");

        let mut piped = Vec::new();
        let mut sink = sink_to(&mut piped, format).unwrap();
        sink.write(&mesh.to_soup()).unwrap();
        sink.finish().unwrap();
        assert_eq!(piped, std::fs::read(&path).unwrap(), "{format:?}: a pipe gets the same bytes");
    }
}

#[test]
fn files_are_streamed_and_counted() {
    let mesh = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("mesh");
        write_mesh_as(&path, Some(format), &mesh).unwrap();
        let mut source = open_source_with(&path, Some(format)).unwrap();
        let count = source.triangle_count();
        assert_eq!(drain(&mut *source, 3).unwrap(), mesh.to_soup(), "{format:?}");
        match format {
            Format::StlAscii | Format::PlyAscii | Format::Obj => assert_eq!(count, None),
            _ => assert_eq!(count, Some(4), "{format:?}"),
        }
    }
}

#[test]
fn vertex_numbers_are_those_of_the_file() {
    let mut mesh = tetrahedron();
    mesh.positions.insert(0, Vec3::splat(-9.0));
    mesh.triangles.iter_mut().flatten().for_each(|v| *v += 1);
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        for max in [1, 3, 100] {
            let mut source = source_from(&bytes[..], format, "test").unwrap();
            let (mut soup, mut numbers) = (Vec::new(), Vec::new());
            while source.read_numbered(&mut soup, &mut numbers, max).unwrap() > 0 {}
            assert_eq!(bits(&soup), bits(&mesh.to_soup()), "{format:?}");
            assert_eq!(source.has_vertex_numbers(), !is_stl(format));
            if is_stl(format) {
                assert!(numbers.is_empty());
            } else {
                let expected: Vec<_> = mesh.triangles.iter().map(|t| t.map(u64::from)).collect();
                assert_eq!(numbers, expected, "{format:?}");
                let mut again = Vec::new();
                source.look_up(&numbers, &mut again);
                assert_eq!(bits(&again), bits(&soup), "{format:?}");
                again.clear();
                source.look_up(&[[0, 5, u64::MAX]], &mut again);
                assert_eq!(again[0].map(|p| p.is_nan()), [false, true, true]);
            }
        }
    }
}

#[test]
fn no_triangles_are_no_error() {
    let mesh = IndexedMesh::default();
    for format in Format::ALL {
        assert_eq!(read(bytes_of(&mesh, format), format).unwrap(), mesh, "{format:?}");
        let mut piped = Vec::new();
        sink_to(&mut piped, format).unwrap().finish().unwrap();
        assert_eq!(read(&piped, format).unwrap(), mesh, "{format:?}");
        assert!(stream(&piped, format, 10).unwrap().is_empty());
    }
}

#[test]
fn large_meshes_cross_every_buffer() {
    let n = 150u32;
    let mut mesh = IndexedMesh::default();
    for y in 0..n {
        for x in 0..n {
            mesh.positions.push(Vec3::new(x as f32 * 0.1, y as f32 / 7.0, (x * y) as f32 * 1e-3));
        }
    }
    for y in 0..n - 1 {
        for x in 0..n - 1 {
            let v = y * n + x;
            mesh.triangles.extend([[v, v + 1, v + n], [v + 1, v + n + 1, v + n]]);
        }
    }
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        let back = read(&bytes, format).unwrap();
        assert_eq!(bits(&back.to_soup()), bits(&mesh.to_soup()), "{format:?}");
        assert_eq!(back.positions.len(), mesh.positions.len(), "{format:?}");
        assert_eq!(stream(&bytes, format, 777).unwrap(), mesh.to_soup(), "{format:?}");
    }
}

#[test]
fn non_finite_coordinates_pass_through_where_the_format_has_them() {
    let mut mesh = tetrahedron();
    mesh.positions[1] = Vec3::new(f32::INFINITY, f32::NEG_INFINITY, 1.0);
    mesh.positions[2].y = f32::NAN;
    for format in Format::ALL {
        if matches!(format, Format::Gltf | Format::Glb) {
            let error = mesh_io::write_mesh_to(Vec::new(), format, &mesh).unwrap_err();
            assert!(error.to_string().contains("vertex 1 is not finite"), "{error}");
        } else {
            let back = read(bytes_of(&mesh, format), format).unwrap();
            assert_eq!(bits(&back.to_soup()), bits(&mesh.to_soup()), "{format:?}");
        }
    }
}

prop_compose! {
    fn any_mesh()(
        positions in prop::collection::vec(any::<[u32; 3]>(), 1..20),
    )(
        triangles in prop::collection::vec(
            prop::array::uniform3(0..positions.len() as u32), 1..30),
        positions in Just(positions),
    ) -> IndexedMesh {
        // NaN payloads do not survive text.
        let real = |bits: u32| {
            let value = f32::from_bits(bits);
            if value.is_finite() { value } else { f32::from_bits(bits & 0x3fff_ffff) }
        };
        let positions = positions.into_iter().map(|p| Vec3::from_array(p.map(real))).collect();
        IndexedMesh { positions, triangles, ..Default::default() }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn any_mesh_survives_every_format(mesh in any_mesh(), max in 1usize..40) {
        for format in Format::ALL {
            let bytes = bytes_of(&mesh, format);
            let back = read(&bytes, format).unwrap();
            prop_assert_eq!(bits(&back.to_soup()), bits(&mesh.to_soup()));
            if !is_stl(format) {
                prop_assert_eq!(&back.triangles, &mesh.triangles);
            }
            let mut source = source_from(&bytes[..], format, "test").unwrap();
            let frame = source.frame();
            let expected = match format {
                // Decimals mean what they say, far from zero.
                Format::StlAscii | Format::PlyAscii | Format::Obj if frame.double => {
                    let exact = |c: f32| format!("{c:e}").parse::<f64>().unwrap();
                    let place = |p: Vec3| frame.from_file(p.to_array().map(exact).into());
                    mesh.to_soup().into_iter().map(|triangle| triangle.map(place)).collect()
                }
                _ => mesh.to_soup(),
            };
            prop_assert_eq!(bits(&drain(&mut *source, max).unwrap()), bits(&expected));
        }
    }

    #[test]
    fn any_bytes_are_an_error_or_a_mesh(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for format in Format::ALL {
            if let Ok(mesh) = read(&bytes, format) {
                prop_assert_eq!(mesh.first_bad_index(), None);
            }
        }
    }
}
