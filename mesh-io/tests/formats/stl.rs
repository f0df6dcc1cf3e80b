//! STL as it is found in the wild.

use glam::Vec3;
use mesh_io::{Error, Format, Place, TriangleSource, open_source, read_mesh, source_from};

use crate::support::{bits, bytes_of, drain, read, refused, stream, tetrahedron};

const ONE: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                   vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";

fn binary(title: &str, count: u32, triangles: usize) -> Vec<u8> {
    let mut bytes = title.as_bytes().to_vec();
    bytes.resize(80, b' ');
    bytes.extend(count.to_le_bytes());
    for t in 0..triangles {
        for i in 0..12 {
            bytes.extend(((t * 12 + i) as f32).to_le_bytes());
        }
        bytes.extend([7, 7]);
    }
    bytes
}

#[test]
fn text_with_every_kind_of_line_end_and_case() {
    let expected = read(ONE, Format::StlAscii).unwrap();
    assert_eq!(expected.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    let variants = [
        ONE.replace('\n', "\r\n"),
        ONE.replace('\n', "\r"),
        ONE.to_uppercase(),
        ONE.replace('\n', "\n\n \t"),
        format!("\u{feff}\n  {ONE}"),
        ONE.replace("vertex ", "  vertex   +").replace(" 1 ", " 1.0E+00 "),
        ONE.replace("0 0 1\n", "nan -nan(ind) 1.#QNAN\n"),
        ONE.replace("solid a", "solid"),
        ONE.trim_end().to_owned(),
    ];
    for text in variants {
        assert_eq!(read(&text, Format::StlBinary).unwrap(), expected, "{text}");
        assert_eq!(stream(text.as_bytes(), Format::StlAscii, 1).unwrap(), expected.to_soup());
    }
}

#[test]
fn several_solids_are_one_mesh() {
    let two = format!("{ONE}{}", ONE.replace("1 0 0", "2 0 0"));
    let mesh = read(&two, Format::StlAscii).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 3, 2]]);
    assert!(read("solid\nendsolid\n", Format::StlAscii).unwrap().triangles.is_empty());
}

#[test]
fn binary_that_begins_with_solid() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("solid.stl");
    for count in [0, 1, 5] {
        let bytes = binary("solid but not text", count as u32, count);
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(read_mesh(&path).unwrap().triangles.len(), count);
        assert_eq!(read(&bytes, Format::StlAscii).unwrap().triangles.len(), count, "from a pipe");
    }
}

#[test]
fn corners_are_welded_by_their_bits() {
    let mesh = tetrahedron();
    assert_eq!(read(bytes_of(&mesh, Format::StlBinary), Format::StlBinary).unwrap(), mesh);
    let zeros = ONE.replace("vertex 0 0 0", "vertex -0 0 -0.0");
    let two = format!("{ONE}{zeros}");
    assert_eq!(read(&two, Format::StlAscii).unwrap().positions.len(), 3);
}

#[test]
fn a_count_from_a_pipe_may_be_a_placeholder() {
    for count in [0, 3, 1, u32::MAX] {
        let bytes = binary("pipe", count, 3);
        let mut source = source_from(&bytes[..], Format::StlBinary, "pipe").unwrap();
        assert_eq!(source.triangle_count(), None);
        assert_eq!(drain(&mut *source, 2).unwrap().len(), 3);
    }
    // More than there are: something was lost.
    let message = refused(binary("pipe", 4, 3), Format::StlBinary);
    assert_eq!(
        message,
        "test, byte 234: the file ends before the last of its 4 triangles, there are 3; copy or export it again"
    );
}

#[test]
fn the_size_of_a_file_must_agree_with_its_count() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("size.stl");
    for (count, found) in [(3u32, Place::Byte(184)), (1, Place::Byte(134))] {
        std::fs::write(&path, binary("size", count, 2)).unwrap();
        for error in [read_mesh(&path).unwrap_err(), open_source(&path).err().unwrap()] {
            match error {
                Error::Truncated { place, .. } => assert_eq!((place, count), (found, 3)),
                Error::Malformed { place, .. } => assert_eq!((place, count), (found, 1)),
                other => panic!("{other}"),
            }
        }
    }
    std::fs::write(&path, binary("size", 2, 2)).unwrap();
    assert_eq!(open_source(&path).unwrap().triangle_count(), Some(2));
}

#[test]
fn normals_are_written_right() {
    let bytes = bytes_of(&read(ONE, Format::StlAscii).unwrap(), Format::StlBinary);
    let normal: Vec<f32> =
        bytes[84..96].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(normal, [0.0, 0.0, 1.0]);
    let text = bytes_of(&read(ONE, Format::StlAscii).unwrap(), Format::StlAscii);
    assert!(String::from_utf8(text).unwrap().contains("facet normal 0 0 1\n"));
}

#[test]
fn errors_tell_the_line() {
    let cases = [
        (ONE.replace("1 0 0", "1 x 0"), "test, line 5: `x` is not a number; "),
        (ONE.replace("1 0 0", "1 0"), "test, line 5: a vertex with fewer than three coordinates; "),
        (
            ONE.replace("vertex 1 0 0\n", ""),
            "test, line 7: a facet with 2 vertices instead of three; ",
        ),
        (ONE.replace("vertex 1", "vortex 1"), "test, line 5: `vortex` where `vertex`"),
        (ONE.replace("endloop", "vertex 1 1 1"), "test, line 7: a facet with more than three"),
        (ONE.replace("endsolid a\n", ""), "test, line 8: the file ends before `endsolid`; "),
        (ONE[..40].to_owned(), "test, line 4: the file ends before `endfacet`; "),
        ("hello".to_owned(), "test, byte 5: the file ends before the header of a binary STL"),
    ];
    for (text, expected) in cases {
        let message = refused(&text, Format::StlAscii);
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn long_text_with_odd_facets_here_and_there() {
    let mut text = "solid a name\n".to_owned();
    let mut soup = Vec::new();
    for i in 0..20_000u16 {
        let x = f32::from(i) * 0.1;
        let triangle =
            [Vec3::new(x, 1e-7, -x), Vec3::new(x + 1.0, 2.0, 0.5), Vec3::new(x, 3.0, 1e9)];
        soup.push(triangle);
        let vertex = |p: Vec3| format!("   vertex {} {} {:e}\n", p.x, p.y, p.z);
        let [a, b, c] = triangle.map(vertex);
        let facet = format!(" facet normal 0 0 1\n  outer loop\n{a}{b}{c}  endloop\n endfacet\n");
        text += &match i % 977 {
            3 => facet.to_uppercase(),
            4 => facet.replace("vertex ", "vertex\t").replace('\n', "\r\n"),
            5 => format!("endsolid\n\nsolid\n{facet}"),
            6 => facet.replace("  outer loop\n", "").replace("  endloop\n", "\n"),
            _ => facet,
        };
    }
    text += "endsolid a name\n";
    for max in [1, 4, 100_000] {
        assert_eq!(bits(&stream(text.as_bytes(), Format::StlAscii, max).unwrap()), bits(&soup));
    }
    let at = text.rfind("endloop").unwrap();
    let line = text[..at].matches('\n').count() + 1;
    let broken = format!("{}x{}", &text[..at + 7], &text[at + 7..]);
    let expected = format!("test, line {line}: `endloopx` where `vertex` or `endfacet` should be");
    assert!(refused(&broken, Format::StlAscii).starts_with(&expected));
}
