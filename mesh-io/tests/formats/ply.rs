//! PLY as it is found in the wild.

use glam::Vec3;
use mesh_io::{Format, IndexedMesh, TriangleSource, open_source, read_mesh};

use crate::support::{drain, read, refused, stream};

const FORMAT: Format = Format::PlyAscii;

const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nelement face 2\nproperty list uchar int vertex_indices\n\
                      end_header\n";
const BODY: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

fn square() -> IndexedMesh {
    IndexedMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

/// Reads by every way in: from a pipe as mesh and stream, from a file as mesh and stream.
fn read_all_ways(bytes: &[u8]) -> IndexedMesh {
    let mesh = read(bytes, FORMAT).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(read_mesh(&path).unwrap(), mesh);
    for max in [1, 2, 50] {
        assert_eq!(stream(bytes, FORMAT, max).unwrap(), mesh.to_soup());
        let mut source = open_source(&path).unwrap();
        let count = source.triangle_count();
        let soup = drain(&mut *source, max).unwrap();
        assert_eq!(soup, mesh.to_soup());
        assert!(count.is_none_or(|count| count == soup.len() as u64));
        let mut beyond = Vec::new();
        source.look_up(&[[0, mesh.positions.len() as u64, 1 << 40]], &mut beyond);
        assert_eq!(beyond[0].map(|p| p.is_nan()), [false, true, true]);
    }
    mesh
}

#[test]
fn text_with_every_kind_of_line_end() {
    let text = format!("{HEADER}{BODY}");
    for end in ["\n", "\r\n", "\r"] {
        assert_eq!(read_all_ways(text.replace('\n', end).as_bytes()), square());
    }
    assert_eq!(read_all_ways(text.trim_end().as_bytes()), square());
    let spaced = text.replace("1 1 0\n", " 1\t 1.0e0  0 \n\n");
    assert_eq!(read_all_ways(spaced.as_bytes()), square());
}

#[test]
fn comments_extra_properties_and_extra_elements_are_passed_over() {
    let text = "ply\ncomment one\nformat ascii 1.0\nobj_info two\nelement camera 1\n\
        property double fov\nproperty list uchar float weights\nelement vertex 4\nproperty uchar red\n\
        property double z\nproperty list int int bones\nproperty double y\nproperty float64 x\n\
        property float confidence\ncomment three\nelement face 2\nproperty uchar flags\n\
        property list uchar uint vertex_index\nproperty list uchar float texcoord\n\
        element edge 1\nproperty int a\nend_header\n\
        1.5 2 7 7\n255 0 0 0 0 1\n255 0 2 8 9 0 1 1\n0 0 0 1 1 1\n0 0 1 5 1 0 1\n\
        9 3 0 1 2 0\n9 3 0 2 3 2 1 1\n5\n";
    assert_eq!(read_all_ways(text.as_bytes()), square());
}

/// The same content as above in binary, either byte order, with integers of several sizes.
fn binary(big: bool, crlf: bool, faces_first: bool, index: &str) -> Vec<u8> {
    let vertices = "element vertex 4\nproperty uchar red\nproperty double x\nproperty float y\n\
                    property short z\nproperty int8 pad\n";
    let faces = format!(
        "element face 2\nproperty list ushort {index} vertex_indices\nproperty uint16 flags\n"
    );
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let (first, second) =
        if faces_first { (faces.as_str(), vertices) } else { (vertices, faces.as_str()) };
    let extra = "element extra 2\nproperty list int8 double stuff\n";
    let mut header = format!("ply\nformat {order} 1.0\n{extra}{first}{second}end_header\n");
    if crlf {
        header = header.replace('\n', "\r\n");
    }
    let put = |out: &mut Vec<u8>, bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    let mut vertex_rows = Vec::new();
    for p in square().positions {
        vertex_rows.push(200);
        put(&mut vertex_rows, &f64::from(p.x).to_le_bytes());
        put(&mut vertex_rows, &p.y.to_le_bytes());
        put(&mut vertex_rows, &(p.z as i16).to_le_bytes());
        vertex_rows.push(1);
    }
    let mut face_rows = Vec::new();
    for triangle in square().triangles {
        put(&mut face_rows, &3u16.to_le_bytes());
        for v in triangle {
            let size = match index {
                "uchar" | "char" => 1,
                "short" | "uint16" => 2,
                _ => 4,
            };
            put(&mut face_rows, &v.to_le_bytes()[..size]);
        }
        put(&mut face_rows, &0xabcdu16.to_le_bytes());
    }
    let mut bytes = header.into_bytes();
    bytes.push(1);
    put(&mut bytes, &1.5f64.to_le_bytes());
    bytes.push(0);
    if faces_first {
        bytes.extend(face_rows);
        bytes.extend(vertex_rows);
    } else {
        bytes.extend(vertex_rows);
        bytes.extend(face_rows);
    }
    bytes
}

#[test]
fn binary_in_both_byte_orders_with_any_integers_in_any_order() {
    for index in ["char", "uchar", "short", "uint16", "int", "uint32"] {
        for case in 0..8 {
            let bytes = binary(case & 1 != 0, case & 2 != 0, case & 4 != 0, index);
            assert_eq!(read_all_ways(&bytes), square(), "{index} {case}");
        }
    }
}

#[test]
fn text_with_faces_first() {
    let text = "ply\nformat ascii 1.0\nelement face 2\nproperty list uchar int vertex_indices\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
        3 0 1 2\n3 0 2 3\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    assert_eq!(read_all_ways(text.as_bytes()), square());
    let bad = text.replace("3 0 2 3", "3 0 2 4");
    assert!(refused(&bad, FORMAT).contains("vertex index 4 is out of range, there are 4"));
}

#[test]
fn polygons_become_triangles_and_lines_nothing() {
    let text = format!("{HEADER}{BODY}").replace("3 0 1 2\n3 0 2 3", "4 0 1 2 3\n2 0 1");
    assert_eq!(read_all_ways(text.as_bytes()), square());
    // A dart whose fan from the first corner would turn a triangle over.
    let dart = format!("{HEADER}4 0 0\n0 2 0\n1 0 0\n0 -2 0\n4 0 1 2 3\n0\n");
    let mesh = read_all_ways(dart.as_bytes());
    assert_eq!(mesh.triangles.len(), 2);
    for triangle in mesh.to_soup() {
        let [a, b, c] = triangle;
        assert!((b - a).cross(c - a).z > 0.0);
    }
}

#[test]
fn triangle_strips() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n1 1 0\n0 1 0\n13 1 2 0 3 -1 0 1 2 -1 0 1 1 2\n";
    let mesh = read_all_ways(text.as_bytes());
    assert_eq!(mesh.triangles, [[1, 2, 0], [0, 2, 3], [0, 1, 2]]);
}

/// Text of several megabytes, with rows here and there that are not like the others.
fn long_text(num_vertices: u32) -> (String, Vec<Vec3>) {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {num_vertices}\nproperty float x\nproperty float y\n\
         property float z\nproperty float w\nelement face {num_vertices}\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    let mut positions = Vec::new();
    for v in 0..num_vertices {
        let p = Vec3::new(v as f32 * 0.37, 1.0 / (v + 1) as f32, -((v % 1000) as f32));
        positions.push(p);
        text += &match v % 9973 {
            5 => format!("\n \t {:e}  {:?}\t+{} x y\r\n", p.x, p.y, p.z).replace("+-", "-"),
            // Longer than a piece of text is.
            77 => format!("{} {} {} {}\n", p.x, p.y, p.z, "0 ".repeat(300_000)),
            _ => format!("{} {} {} 0.5\n", p.x, p.y, p.z),
        };
    }
    // Faces that look like vertices.
    (0..num_vertices).for_each(|v| text += &format!("3 {v} {} 0\n", (v + 1) % num_vertices));
    (text, positions)
}

#[test]
fn any_number_of_threads_reads_long_text_alike() {
    let (text, positions) = long_text(50_000);
    for threads in [1, 2, 3, 16] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mesh = pool.install(|| read(&text, FORMAT).unwrap());
        assert!(mesh.positions == positions, "{threads} threads");
        assert!((0..50_000).all(|v| mesh.triangles[v as usize] == [v, (v + 1) % 50_000, 0]));
    }
    // The line is right far inside, and one row too few is one row too few.
    let at = text.find("0 4").unwrap();
    let line = text[..at].matches('\n').count() + 1;
    let broken = format!("{}o{}", &text[..at], &text[at + 1..]);
    assert!(refused(&broken, FORMAT).starts_with(&format!("test, line {line}: `")));
    let short = &text[..text[..text.len() - 1].rfind('\n').unwrap()];
    assert!(refused(short, FORMAT).contains("the last of its 50000 rows of `face`"));
}

#[test]
fn points_without_faces_are_an_empty_mesh() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                property float z\nend_header\n1 2 3\n";
    let mesh = read_all_ways(text.as_bytes());
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (1, 0));
}

#[test]
fn errors_tell_the_line() {
    let text = format!("{HEADER}{BODY}");
    let cases = [
        (text.replace("3 0 2 3", "3 0 2 4"), "line 15: vertex index 4 is out of range"),
        (text.replace("3 0 2 3", "3 0 2 -1"), "line 15: vertex index -1 is out of range"),
        (text.replace("3 0 2 3", "3 0 2 x"), "line 15: `x` is not a number"),
        (text.replace("3 0 2 3", "-3 0 2 3"), "line 15: `-3` is not a number that fits"),
        (text.replace("1 1 0", "1 1"), "line 12: a row of `vertex` with too few values"),
        (text.replace("1 1 0", "1 1 0,5"), "line 12: `0,5` is not a number"),
        (text.replace("3 0 2 3\n", ""), "line 14: the file ends before the last of its 2 rows"),
        (text.replace("ascii", "utf8"), "line 2: `utf8` is not a PLY encoding"),
        (text.replace("vertex 4", "vertex -4"), "line 3: `-4` is not a count"),
        (text.replace("float y", "real y"), "line 5: `real` is not a PLY type"),
        (text.replace("float y", "float w"), "line 9: the vertices have no property `y`"),
        (text.replace("_indices", "_list"), "line 9: the element `face` has no list"),
        (text.replace("uchar int", "uchar float"), "line 9: `vertex_indices` is not a list of int"),
        (text.replace("end_header\n", ""), "line 9: `0` has no place in a PLY header"),
        (text.replace("format ascii 1.0\n", ""), "line 8: a header without a format line"),
        (text.replace("element vertex", "element vortex"), "line 9: faces but no element `vertex`"),
        ("plyx".to_owned(), "byte 0: a PLY file begins with a line `ply`"),
    ];
    for (text, expected) in cases {
        let message = refused(&text, FORMAT);
        assert!(message.starts_with(&format!("test, {expected}")), "{message}");
    }
}

#[test]
fn binary_errors_tell_the_byte() {
    let bytes = binary(false, false, false, "int");
    let faces = bytes.len() - 2 * 16;
    let mut broken = bytes.clone();
    broken[faces + 16 + 2] = 9;
    let message = refused(&broken, FORMAT);
    let expected = format!("test, byte {}: vertex index 9 is out of range", faces + 16);
    assert!(message.starts_with(&expected), "{message}");
    let message = refused(&bytes[..bytes.len() - 1], FORMAT);
    let expected = format!("test, byte {}: the file ends before", bytes.len() - 1);
    assert!(message.starts_with(&expected), "{message}");
}
