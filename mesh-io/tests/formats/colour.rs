//! Colours of vertices, in and out.

use base64::Engine;
use glam::Vec3;
use mesh_io::{
    Colour, Format, IndexedMesh, TriangleSource, open_source, open_source_with, read_mesh,
    source_from, write_mesh_as,
};

use crate::support::{bytes_of, read, refused, tetrahedron};

const COLOURS: [Colour; 4] = [[0, 1, 2, 255], [255, 128, 127, 255], [7, 77, 200, 255], [3; 4]];

/// A tetrahedron with colours, and alpha as the format has it.
fn coloured(format: Format) -> IndexedMesh {
    let alpha = |[r, g, b, a]: Colour| [r, g, b, if format == Format::Obj { 255 } else { a }];
    IndexedMesh { colours: COLOURS.map(alpha).to_vec(), ..tetrahedron() }
}

fn has_colours(format: Format) -> bool {
    !matches!(format, Format::StlBinary | Format::StlAscii)
}

/// The colours of all corners, by way of the numbers of their vertices.
fn corner_colours(source: &mut dyn TriangleSource, max: usize) -> Vec<[Colour; 3]> {
    let (mut soup, mut numbers, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    while source.read_numbered(&mut soup, &mut numbers, max).unwrap() > 0 {
        source.look_up_colours(&numbers, &mut colours);
        numbers.clear();
    }
    colours
}

/// Reads by every way in: from a pipe as mesh and stream, from a file as mesh and stream.
fn read_all_ways(bytes: &[u8], format: Format) -> IndexedMesh {
    let mesh = read(bytes, format).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("a.{}", format.name()));
    std::fs::write(&path, bytes).unwrap();
    let expected: Vec<_> = match mesh.colours.is_empty() {
        true => Vec::new(),
        false => mesh.triangles.iter().map(|t| t.map(|v| mesh.colours[v as usize])).collect(),
    };
    for max in [1, 3, 50] {
        let piped = source_from(bytes, format, "pipe").unwrap();
        for mut source in [piped, open_source_with(&path, Some(format)).unwrap()] {
            assert_eq!(source.has_colours(), !mesh.colours.is_empty());
            assert_eq!(corner_colours(&mut *source, max), expected);
            let mut beyond = Vec::new();
            source.look_up_colours(&[[0, mesh.positions.len() as u64, 1 << 40]], &mut beyond);
            assert!(beyond.iter().all(|corners| corners[1..] == [[255; 4]; 2]));
        }
    }
    mesh
}

#[test]
fn colours_come_back() {
    for format in Format::ALL {
        let mesh = coloured(format);
        let back = read_all_ways(&bytes_of(&mesh, format), format);
        if has_colours(format) {
            assert_eq!(back, mesh, "{format:?}");
        } else {
            assert_eq!(back, tetrahedron(), "{format:?}");
        }
    }
}

#[test]
fn every_byte_comes_back() {
    let count = 256;
    let mesh = IndexedMesh {
        positions: (0..count).map(|i| Vec3::new(i as f32, 0.5, 0.0)).collect(),
        triangles: (0..count - 2).map(|i| [i, i + 1, i + 2]).collect(),
        colours: (0..count).map(|i| [i as u8, 255 - i as u8, 9, 255]).collect(),
    };
    for format in Format::ALL.into_iter().filter(|&format| has_colours(format)) {
        assert_eq!(read_all_ways(&bytes_of(&mesh, format), format), mesh, "{format:?}");
    }
}

#[test]
fn without_colours_nothing_is_written_of_them() {
    for format in Format::ALL {
        let plain = bytes_of(&tetrahedron(), format);
        assert!(read_all_ways(&plain, format).colours.is_empty());
        for word in ["red", "COLOR"] {
            assert!(!String::from_utf8_lossy(&plain).contains(word), "{format:?}");
        }
    }
}

#[test]
fn colours_for_some_vertices_only_are_refused() {
    let mut mesh = coloured(Format::PlyAscii);
    mesh.colours.pop();
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("x");
        let error = write_mesh_as(&path, Some(format), &mesh).unwrap_err().to_string();
        assert!(error.contains("3 colours for 4 vertices"), "{error}");
    }
}

const FACE: &str = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

fn ply(properties: &str, rows: &str) -> Vec<Colour> {
    let text =
        format!("ply\nformat ascii 1.0\nelement vertex 3\n{properties}{FACE}{rows}3 0 1 2\n");
    read_all_ways(text.as_bytes(), Format::PlyAscii).colours
}

#[test]
fn ply_types_and_places_of_colours() {
    const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
    let rgb = |kind: &str, names: [&str; 3]| -> String {
        names.iter().map(|name| format!("property {kind} {name}\n")).collect()
    };
    let names = ["red", "green", "blue"];
    let expected = [[255, 0, 128, 255], [1, 2, 3, 255], [0, 0, 0, 255]];
    let bytes = "0 0 0 255 0 128\n1 0 0 1 2 3\n0 1 0 0 0 0\n";
    assert_eq!(ply(&format!("{XYZ}{}", rgb("uchar", names)), bytes), expected);
    assert_eq!(ply(&format!("{XYZ}{}", rgb("int", names)), bytes), expected);
    assert_eq!(ply(&format!("{XYZ}{}", rgb("uint8", ["r", "g", "b"])), bytes), expected);
    let diffuse = ["diffuse_red", "diffuse_green", "diffuse_blue"];
    assert_eq!(ply(&format!("{XYZ}{}", rgb("uchar", diffuse)), bytes), expected);
    let shorts = "0 0 0 65535 0 32896\n1 0 0 257 514 771\n0 1 0 0 0 0\n";
    assert_eq!(ply(&format!("{XYZ}{}", rgb("ushort", names)), shorts), expected);
    let reals = "0 0 0 1 -3 0.502\n1 0 0 0.0039 0.0078 0.0118\n0 1 0 nan 0 0\n";
    for kind in ["float", "double"] {
        assert_eq!(ply(&format!("{XYZ}{}", rgb(kind, names)), reals), expected);
    }
    // With alpha, other properties between, and in another order.
    let odd = "property uchar blue\nproperty float x\nproperty float y\nproperty uchar alpha\n\
               property float z\nproperty float nx\nproperty uchar red\nproperty uchar green\n";
    let rows = "128 0 0 9 0 0.5 255 0\n3 1 0 8 0 0.5 1 2\n0 0 1 7 0 0.5 0 0\n";
    assert_eq!(ply(odd, rows), [[255, 0, 128, 9], [1, 2, 3, 8], [0, 0, 0, 7]]);
    // After a list, and after normals.
    let listed = format!("{XYZ}property list uchar int bones\n{}", rgb("uchar", names));
    let rows = "0 0 0 2 7 7 255 0 128\n1 0 0 0 1 2 3\n0 1 0 1 9 0 0 0\n";
    assert_eq!(ply(&listed, rows), expected);
    let normals = format!("{XYZ}{}{}", rgb("float", ["nx", "ny", "nz"]), rgb("uchar", names));
    let rows = "0 0 0 0 0 1 255 0 128\n1 0 0 0 0 1 1 2 3\n0 1 0 0 0 1 0 0 0\n";
    assert_eq!(ply(&normals, rows), expected);
    // Two of three are no colour.
    assert!(ply(&format!("{XYZ}property uchar red\nproperty uchar blue\n"), bytes).is_empty());
}

#[test]
fn ply_rows_of_any_size_in_binary() {
    for big in [false, true] {
        let real = |c: f32| if big { c.to_be_bytes() } else { c.to_le_bytes() };
        let int = |c: u32| if big { c.to_be_bytes() } else { c.to_le_bytes() };
        for (list, kind) in [(false, "uchar"), (true, "uchar"), (false, "float"), (true, "float")] {
            let order = if big { "big" } else { "little" };
            let bones = if list { "property list uchar uchar bones\n" } else { "" };
            let mut bytes = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty {kind} green\n{bones}\
                 property float x\nproperty float y\nproperty float z\nproperty {kind} red\n\
                 property {kind} blue\n{FACE}"
            )
            .into_bytes();
            let mut expected = Vec::new();
            for i in 0..3u8 {
                let colour = [50 * i + 1, 100 - i, 7 * i, 255];
                let component = |byte: u8| match kind {
                    "uchar" => vec![byte],
                    _ => real(f32::from(byte) / 255.0).to_vec(),
                };
                bytes.extend(component(colour[1]));
                if list {
                    bytes.push(i);
                    bytes.extend(vec![9; i.into()]);
                }
                bytes.extend([f32::from(i), f32::from(i * i), 0.0].map(real).as_flattened());
                bytes.extend(component(colour[0]));
                bytes.extend(component(colour[2]));
                expected.push(colour);
            }
            bytes.push(3);
            bytes.extend([0, 1, 2].map(int).as_flattened());
            let mesh = read_all_ways(&bytes, Format::PlyBinaryLittle);
            assert_eq!(mesh.colours, expected, "{order} {list} {kind}");
            assert_eq!(mesh.positions[2], Vec3::new(2.0, 4.0, 0.0));
        }
    }
}

#[test]
fn long_texts_are_read_alike_on_all_threads() {
    let count = 100_000u32;
    let mesh = IndexedMesh {
        positions: (0..count).map(|i| Vec3::new(i as f32, (i % 7) as f32, 0.25)).collect(),
        triangles: vec![[0, 1, count - 1]],
        colours: (0..count).map(|i| [(i >> 8) as u8, i as u8, (i % 3) as u8, 255]).collect(),
    };
    for format in [Format::PlyAscii, Format::Obj] {
        assert!(read(bytes_of(&mesh, format), format).unwrap() == mesh);
    }
}

#[test]
fn obj_colours_follow_positions() {
    let obj = |text: &str| read_all_ways(text.as_bytes(), Format::Obj).colours;
    let faces = "f 1 2 3\n";
    let text = "v 0 0 0 1 0 0.5\nv 1 0 0 0.25 2 -1\n# one without\nv 0 1 0\n";
    let expected = [[255, 0, 128, 255], [64, 255, 0, 255], [255; 4]];
    assert_eq!(obj(&format!("{text}{faces}")), expected);
    // The careful way.
    let odd = "v\t0 0 0 +1 0 5e-1\r\nv 1 0 0 \\\n0.25 2 -1 1\nv 0 1 0 junk\n";
    assert_eq!(obj(&format!("{odd}{faces}")), expected);
    // A weight is no colour, and the first vertex decides.
    assert!(obj(&format!("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\n{faces}")).is_empty());
    assert!(obj(&format!("v 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\n{faces}")).is_empty());
}

/// A scene of two primitives of a triangle each, with the same positions.
fn gltf(component: u32, shape: &str, normalized: bool, colours: &[u8], second: &str) -> String {
    let mut data: Vec<u8> = Vec::new();
    for c in [0., 0., 0., 1., 0., 0., 0., 1., 0.] as [f32; 9] {
        data.extend(c.to_le_bytes());
    }
    data.extend(colours);
    let text = base64::engine::general_purpose::STANDARD.encode(&data);
    let length = colours.len();
    format!(
        r#"{{"asset":{{"version":"2.0"}},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{second}}}}},
            {{"attributes":{{"POSITION":0,"COLOR_0":1}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
            {{"bufferView":1,"componentType":{component},"normalized":{normalized},"count":3,"type":"{shape}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},
            {{"buffer":0,"byteOffset":36,"byteLength":{length}}}],
        "buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{text}"}}]}}"#,
        36 + length
    )
}

#[test]
fn gltf_types_of_colours() {
    let expected = [[255, 0, 128, 255], [1, 2, 3, 255], [0, 0, 0, 255]];
    let bytes = [255, 0, 128, 255, 1, 2, 3, 255, 0, 0, 0, 255];
    let shorts: Vec<u8> = bytes.iter().flat_map(|&b| (u16::from(b) * 257).to_le_bytes()).collect();
    let reals: Vec<u8> = bytes.iter().flat_map(|&b| (f32::from(b) / 255.0).to_le_bytes()).collect();
    let threes: Vec<u8> = reals.chunks(16).flat_map(|colour| colour[..12].to_vec()).collect();
    for (component, shape, normalized, colours) in [
        (5121, "VEC4", true, &bytes[..]),
        (5123, "VEC4", true, &shorts),
        (5126, "VEC4", false, &reals),
        (5126, "VEC3", false, &threes),
    ] {
        let text = gltf(component, shape, normalized, colours, "");
        let mesh = read_all_ways(text.as_bytes(), Format::Gltf);
        // The first primitive has none.
        assert_eq!(mesh.colours, [&[[255; 4]; 3][..], &expected].concat(), "{component} {shape}");
        let both = gltf(component, shape, normalized, colours, r#","COLOR_0":1"#);
        assert_eq!(read_all_ways(both.as_bytes(), Format::Gltf).colours, expected);
    }
    let none = gltf(5121, "VEC2", true, &bytes, "");
    assert!(refused(none, Format::Gltf).contains("accessor 1"));
    let few = gltf(5121, "VEC4", true, &bytes, "");
    let few = few.replace(r#""normalized":true,"count":3"#, r#""normalized":true,"count":2"#);
    assert!(refused(few, Format::Gltf).contains("not as many"));
}

#[test]
fn files_of_all_formats_keep_colours_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ply", "b.obj", "c.gltf", "d.glb", "e.ply.gz"] {
        let path = folder.path().join(name);
        let format = Format::from_path(&path).unwrap();
        let mesh = coloured(format);
        mesh_io::write_mesh(&path, &mesh).unwrap();
        assert_eq!(read_mesh(&path).unwrap(), mesh);
        assert!(open_source(&path).unwrap().has_colours());
    }
}
