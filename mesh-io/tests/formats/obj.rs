//! OBJ as it is found in the wild.

use glam::Vec3;
use mesh_io::Format;

use crate::support::{read, refused, stream};

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn triangles(text: &str) -> Vec<[u32; 3]> {
    let mesh = read(text, Format::Obj).unwrap();
    for max in [1, 50] {
        let mut soup = stream(text.as_bytes(), Format::Obj, max).unwrap();
        let mut expected = mesh.to_soup();
        // Faces that name later vertices come last in a stream as in a mesh; the order is the same.
        soup.iter_mut().chain(&mut expected).flatten().for_each(|p| *p += 0.0);
        assert_eq!(soup, expected);
    }
    mesh.triangles
}

#[test]
fn every_way_to_write_a_face() {
    for face in [
        "f 1 2 3\nf 1 3 4",
        "f 1/1 2/2 3/3\nf 1/7 3/8 4/9",
        "f 1//1 2//1 3//1\nf 1//1 3//1 4//1",
        "f 1/1/1 2/2/1 3/3/1\r\nf 1/4/1 3/5/1 4/6/1\r\n",
        "f -4 -3 -2\nf -4/-1 -2/-1/-1 -1//-1",
        "f 1 2 3 4",
        "  f\t1  2\t3 4  ",
        "f 1 2 \\\n3 \\\r\n 4",
        "fo 1 2 3 4",
    ] {
        assert_eq!(triangles(&format!("{SQUARE}{face}")), [[0, 1, 2], [0, 2, 3]], "{face}");
    }
}

#[test]
fn other_lines_are_passed_over() {
    let text = format!(
        "\u{feff}# made by hand, in C:\\\nmtllib a b.mtl\no thing\ng\n{SQUARE}vt 0 0\nvn 0 0 1\nvp 1\n\
         s off\nusemtl red\nl 1 2\np 1\ncurv 0 1 1 2\nf 1 2\n\nf 1 2 3\nend of it\n"
    );
    assert_eq!(triangles(&text), [[0, 1, 2]]);
}

#[test]
fn colours_and_weights_are_left_alone() {
    let mesh = read("v 1 2 3 0.5 0.5 0.5\nv 4 5 6 1\n", Format::Obj).unwrap();
    assert_eq!(mesh.positions, [Vec3::new(1., 2., 3.), Vec3::new(4., 5., 6.)]);
    assert!(mesh.triangles.is_empty());
}

#[test]
fn faces_may_come_before_their_vertices() {
    let text = format!("f 1 2 3\n{SQUARE}f 1 3 4\n");
    assert_eq!(triangles(&text), [[0, 2, 3], [0, 1, 2]]);
}

#[test]
fn decimals_are_rounded_to_the_nearest() {
    for text in
        ["0.1", "1.00000005960464477540", "3.4028235e38", "1e-45", "123456789", "-7.038531e-26"]
    {
        let mesh = read(format!("v {text} 0 0\n"), Format::Obj).unwrap();
        assert_eq!(mesh.positions[0].x, text.parse::<f32>().unwrap(), "{text}");
    }
}

#[test]
fn errors_tell_the_line() {
    let cases = [
        ("f 1 2 5\n", "line 5: vertex index 5 is out of range, there are 4 vertices; "),
        ("f 1 2 -5\n", "line 5: vertex index -5 is out of range, there are 4 vertices; "),
        ("f 0 1 2\n", "line 5: vertex index 0, but OBJ counts from one; "),
        ("f 1 2 x\n", "line 5: `x` is not a number"),
        ("f 1 2 3.0\n", "line 5: `3.0` is not a number"),
        ("f 1 2 \\\n", "line 5: the file ends before the line that `\\` announces; "),
        ("f 1 2", "line 5: the file ends before the face has three corners; "),
        ("v 1 2", "line 5: the file ends before the line is complete; "),
        ("v 1 2\n", "line 5: a vertex with fewer than three coordinates; "),
        ("v 1 2 z\n", "line 5: `z` is not a number"),
        ("v\n", "line 5: a vertex with fewer"),
    ];
    for (line, expected) in cases {
        let message = refused(format!("{SQUARE}{line}"), Format::Obj);
        assert!(message.starts_with(&format!("test, {expected}")), "{message}");
    }
    assert!(refused("hello\nworld\n", Format::Obj).starts_with("test: not one line of an OBJ"));
}
