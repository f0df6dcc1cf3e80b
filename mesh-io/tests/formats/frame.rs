//! Coordinates that `f32` would crush keep their digits through streams.

use glam::{DVec3, Vec3};
use mesh_io::{
    Format, Frame, TriangleSource, create_sink_in, open_source, read_mesh, read_mesh_in_frame,
    sink_to, sink_to_in, source_from,
};
use proptest::prelude::*;

use crate::support::{Dribble, bits, drain};

/// Points a few centimetres apart, far out.
const POINTS: [[f64; 3]; 4] = [
    [512_345.678, -5_403_210.123, 312.5],
    [512_345.718, -5_403_210.123, 312.53],
    [512_345.718, -5_403_210.083, 312.56],
    [512_345.678, -5_403_210.083, 312.59],
];
const FACES: [[usize; 3]; 2] = [[0, 1, 2], [0, 2, 3]];
const ORIGIN: DVec3 = DVec3::new(512_346.0, -5_403_210.0, 0.0);

fn soup(points: &[[f64; 3]; 4]) -> Vec<[DVec3; 3]> {
    FACES.iter().map(|face| face.map(|v| points[v].into())).collect()
}

fn text(points: &[[f64; 3]; 4], separator: &str) -> String {
    let row = |p: &[f64; 3]| format!("{}{} {} {}\n", separator, p[0], p[1], p[2]);
    points.iter().map(row).collect()
}

fn obj(points: &[[f64; 3]; 4]) -> Vec<u8> {
    format!("# a comment\n{}f 1 2 3\nf 1 3 4\n", text(points, "v ")).into_bytes()
}

fn stl(points: &[[f64; 3]; 4]) -> Vec<u8> {
    let mut out = "solid\n".to_owned();
    for triangle in soup(points) {
        out += "facet normal 0 0 1\nouter loop\n";
        for p in triangle {
            out += &format!("vertex {} {} {}\n", p.x, p.y, p.z);
        }
        out += "endloop\nendfacet\n";
    }
    (out + "endsolid\n").into_bytes()
}

/// A PLY whose vertices have these properties, in this order.
fn ply(points: &[[f64; 3]; 4], coding: &str, properties: &[&str]) -> Vec<u8> {
    let big = coding == "binary_big_endian";
    let lines: String = properties.iter().map(|p| format!("property {p}\n")).collect();
    let mut out = format!(
        "ply\nformat {coding} 1.0\nelement vertex 4\n{lines}element face 2\n\
         property list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let put = |out: &mut Vec<u8>, bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for point in points {
        for property in properties {
            let value = match property.as_bytes() {
                [.., b'x'] => point[0],
                [.., b'y'] => point[1],
                [.., b'z'] => point[2],
                _ => 0.0,
            };
            let kind = property.split(' ').next().unwrap();
            match (coding, kind) {
                ("ascii", _) => out.extend(format!("{value} ").bytes()),
                (_, "double") => put(&mut out, &value.to_le_bytes()),
                (_, "float") => put(&mut out, &(value as f32).to_le_bytes()),
                (_, "int") => put(&mut out, &(value as i32).to_le_bytes()),
                // An empty list.
                _ => out.push(0),
            }
        }
        if coding == "ascii" {
            out.push(b'\n');
        }
    }
    for face in FACES {
        if coding == "ascii" {
            out.extend(format!("3 {} {} {}\n", face[0], face[1], face[2]).bytes());
        } else {
            out.push(3);
            face.iter().for_each(|&v| put(&mut out, &(v as i32).to_le_bytes()));
        }
    }
    out
}

/// Every way to hold doubles: the file's extension, its format and its bytes.
fn wide_files(points: &[[f64; 3]; 4]) -> Vec<(&'static str, Format, Vec<u8>)> {
    let mut files = vec![
        ("obj", Format::Obj, obj(points)),
        ("stl", Format::StlAscii, stl(points)),
        ("ply", Format::PlyAscii, ply(points, "ascii", &["float x", "float y", "float z"])),
    ];
    let rows: [&[&str]; 4] = [
        &["double x", "double y", "double z"],
        &["float nx", "double z", "double x", "int a", "double y"],
        &["double y", "list uchar int l", "double x", "double z"],
        &["double x", "double y", "float z"],
    ];
    for properties in rows {
        for coding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            files.push(("ply", Format::PlyBinaryLittle, ply(points, coding, properties)));
        }
    }
    files
}

#[test]
fn far_coordinates_come_about_a_local_origin() {
    let folder = tempfile::tempdir().unwrap();
    for (extension, format, bytes) in wide_files(&POINTS) {
        let expected: Vec<[Vec3; 3]> =
            soup(&POINTS).iter().map(|t| t.map(|p| (p - ORIGIN).as_vec3())).collect();
        let frame = Frame { origin: ORIGIN, double: true };
        let path = folder.path().join("far").with_extension(extension);
        std::fs::write(&path, &bytes).unwrap();
        let sources: [Box<dyn TriangleSource + Send>; 3] = [
            open_source(&path).unwrap(),
            source_from(&bytes[..], format, "far").unwrap(),
            source_from(Dribble(&bytes, 3), format, "far").unwrap(),
        ];
        for mut source in sources {
            assert_eq!(source.frame(), frame, "known before anything is read");
            assert_eq!(drain(&mut *source, 1).unwrap(), expected, "{extension}");
            assert_eq!(source.frame(), frame);
        }
        let (mesh, in_frame) = read_mesh_in_frame(&path, &Default::default()).unwrap();
        assert_eq!((mesh.to_soup(), in_frame), (expected, frame));
        // The in-core reader leaves them where they are.
        let crushed = soup(&POINTS).into_iter().map(|t| t.map(|p| p.as_vec3()));
        assert_eq!(read_mesh(&path).unwrap().to_soup(), crushed.collect::<Vec<_>>());
    }
}

#[test]
fn near_coordinates_and_single_precision_stay_where_they_are() {
    let near = POINTS.map(|p| p.map(|c| c / 100.0));
    for (extension, format, bytes) in wide_files(&near) {
        let mut source = source_from(&bytes[..], format, "near").unwrap();
        assert_eq!(source.frame(), Frame::default(), "{extension}");
        let expected = soup(&near).into_iter().map(|t| t.map(|p| p.as_vec3()));
        assert_eq!(drain(&mut *source, 9).unwrap(), expected.collect::<Vec<_>>());
    }
    let singles = ["float x", "float y", "float z"];
    for coding in ["binary_little_endian", "binary_big_endian"] {
        let bytes = ply(&POINTS, coding, &singles);
        let mut source = source_from(&bytes[..], Format::PlyBinaryLittle, "single").unwrap();
        assert_eq!(source.frame(), Frame::default());
        let expected = soup(&POINTS).into_iter().map(|t| t.map(|p| p.as_vec3()));
        assert_eq!(drain(&mut *source, 9).unwrap(), expected.collect::<Vec<_>>());
    }
}

#[test]
fn large_integers_are_exact_too() {
    let points = POINTS.map(|p| p.map(|c| (c * 1000.0).round()));
    let properties = ["float a", "int x", "int y", "int z"];
    let clamped = points.map(|p| p.map(|c| f64::from(c as i32)));
    for coding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let bytes = ply(&clamped, coding, &properties);
        let mut source = source_from(&bytes[..], Format::PlyBinaryLittle, "integers").unwrap();
        let origin = source.frame().origin;
        assert_eq!(origin, clamped[0].into());
        let expected = soup(&clamped).into_iter().map(|t| t.map(|p| (p - origin).as_vec3()));
        assert_eq!(drain(&mut *source, 9).unwrap(), expected.collect::<Vec<_>>(), "{coding}");
    }
}

#[test]
fn sinks_write_doubles_in_the_files_own_frame() {
    let frame = Frame { origin: ORIGIN, double: true };
    let local: Vec<[Vec3; 3]> =
        soup(&POINTS).iter().map(|t| t.map(|p| frame.from_file(p))).collect();
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("out").with_extension(format.name());
        let mut sink = create_sink_in(&path, Some(format), frame).unwrap();
        sink.write(&local).unwrap();
        sink.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let mut piped = Vec::new();
        let mut sink = sink_to_in(&mut piped, format, frame).unwrap();
        sink.write(&local).unwrap();
        sink.finish().unwrap();
        assert_eq!(bytes, piped);

        let mut source = source_from(&bytes[..], format, "out").unwrap();
        if format.holds_doubles() {
            assert_eq!(source.frame(), frame, "{format:?}");
            assert_eq!(bits(&drain(&mut *source, 9).unwrap()), bits(&local), "{format:?}");
        } else {
            assert_eq!(source.frame(), Frame::default(), "{format:?}");
            let rounded = local.iter().map(|t| t.map(|p| frame.to_file(p).as_vec3()));
            let rounded: Vec<_> = rounded.collect();
            assert_eq!(bits(&drain(&mut *source, 9).unwrap()), bits(&rounded), "{format:?}");
        }
    }
}

#[test]
fn an_empty_frame_changes_no_byte() {
    let soup = [[Vec3::new(-0.0, 1e-7, 1e20), Vec3::splat(-0.1), Vec3::splat(70_000.1)]; 2];
    for format in Format::ALL {
        let (mut with, mut without) = (Vec::new(), Vec::new());
        let sinks = [
            sink_to_in(&mut with, format, Frame::default()).unwrap(),
            sink_to(&mut without, format).unwrap(),
        ];
        for mut sink in sinks {
            sink.write(&soup).unwrap();
            sink.finish().unwrap();
        }
        assert_eq!(with, without);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn there_and_back_keeps_every_local_bit(
        origin in prop::array::uniform3(-1_000_000_000i64..1_000_000_000),
        local in prop::collection::vec(prop::array::uniform3(-0.4f32..0.4), 3),
    ) {
        // Whole numbers far out, or zero, as a source would choose them about the first vertex.
        let axis = |c: i64| if c.abs() > 70_000 { c as f64 } else { 0.0 };
        let origin = DVec3::from_array(origin.map(axis));
        let frame = Frame { origin, double: origin != DVec3::ZERO };
        let triangle = [local[0].into(), local[1].into(), local[2].into()];
        for format in Format::ALL.into_iter().filter(|format| format.holds_doubles()) {
            let mut bytes = Vec::new();
            let mut sink = sink_to_in(&mut bytes, format, frame).unwrap();
            sink.write(&[triangle]).unwrap();
            sink.finish().unwrap();
            let mut source = source_from(&bytes[..], format, "back").unwrap();
            prop_assert_eq!(source.frame(), frame);
            let back = drain(&mut *source, 9).unwrap();
            // Doubles keep 2⁻²³ of a unit this far out.
            for (a, b) in back[0].iter().zip(triangle) {
                prop_assert!((*a - b).abs().max_element() <= 1.0 / f64::from(1 << 22) as f32);
            }
        }
    }
}
