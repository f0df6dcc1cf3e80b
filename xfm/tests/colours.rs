//! Colours of vertices from a mesh through a file back to meshes, by way of the program.

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use common::{Folder, torus, xfm};
use mesh_io::{Colour, Format, IndexedMesh, read_mesh, read_mesh_from, write_mesh};

/// A torus with a colour of its own for each vertex, as the format has it.
fn coloured(format: Format) -> IndexedMesh {
    let mut mesh = read_mesh_from(torus(48, 24).as_bytes(), Format::Obj, "torus").unwrap();
    let alpha = |i: u8| if format == Format::Obj { 255 } else { 255 - i % 7 };
    mesh.colours = (0..mesh.positions.len() as u32)
        .map(|i| [i as u8, (i >> 3) as u8, (i * i) as u8, alpha(i as u8)])
        .collect();
    mesh
}

/// The colour at each place.
fn by_place(mesh: &IndexedMesh) -> BTreeMap<[u32; 3], Colour> {
    assert_eq!(mesh.positions.len(), mesh.colours.len());
    let places = mesh.positions.iter().map(|p| p.to_array().map(f32::to_bits));
    places.zip(mesh.colours.iter().copied()).collect()
}

fn written(folder: &Folder, name: &str, mesh: &IndexedMesh) -> String {
    let path = folder.file(name);
    write_mesh(Path::new(&path), mesh).unwrap();
    path
}

fn read(path: &str) -> IndexedMesh {
    read_mesh(Path::new(path)).unwrap()
}

#[test]
fn the_input_comes_back_with_its_colours_whatever_the_format_and_the_memory() {
    let folder = Folder::new();
    for name in ["in.ply", "in.obj", "in.gltf", "in.glb"] {
        let mesh = coloured(Format::from_path(Path::new(name)).unwrap());
        let input = written(&folder, name, &mesh);
        let xfm_file = folder.file("a.xfm");
        for way in ["--in-core", "--streaming"] {
            let built = xfm(&["build", &input, &xfm_file, way, "--json"]).json();
            assert_eq!(built["repaired"]["recoloured"], 0, "{name}");
            let info = xfm(&["info", &xfm_file, "--json"]).json();
            let attribute = &info["attributes"][5];
            assert_eq!(attribute["name"], "colour");
            assert_eq!(attribute["type"], "u8");
            assert_eq!(attribute["components"], 4);
            assert!(info["bytes"]["colour"].as_u64().unwrap() > 1000);
            for memory in ["1GiB", "1KiB"] {
                let checked =
                    xfm(&["verify", &xfm_file, "--against", &input, "--memory", memory, "--json"]);
                assert_eq!(checked.json()["against"]["recoloured"], 0, "{name} {way} {memory}");
                for output in ["out.ply", "out.obj", "out.glb"] {
                    let output = folder.file(output);
                    let full =
                        ["extract", &xfm_file, &output, "--full", "--memory", memory, "--json"];
                    assert_eq!(xfm(&full).json()["colours"], true);
                    let mut expected = mesh.clone();
                    if output.ends_with("obj") {
                        expected.colours.iter_mut().for_each(|[.., a]| *a = 255);
                    }
                    assert_eq!(by_place(&read(&output)), by_place(&expected), "{name} {output}");
                }
            }
        }
    }
}

#[test]
fn every_level_has_the_colours_of_its_vertices() {
    let folder = Folder::new();
    let mesh = coloured(Format::Glb);
    let input = written(&folder, "in.glb", &mesh);
    let xfm_file = folder.file("a.xfm");
    assert_eq!(xfm(&["build", &input, &xfm_file]).code, 0);
    let all = by_place(&mesh);
    let output = folder.file("out.ply");
    let camera = ["--eye", "0,0,3", "--at", "0,0,0", "--pixels", "4"];
    for level in [&["--faces", "300"][..], &["--error", "0.02"], &camera] {
        let args = [&["extract", &xfm_file, &output], level].concat();
        assert_eq!(xfm(&args).code, 0);
        let found = by_place(&read(&output));
        assert!(found.len() < all.len() && found.len() > 100);
        for (place, colour) in found {
            assert_eq!(all[&place], colour, "{level:?}");
        }
    }
}

#[test]
fn the_compact_encoding_keeps_every_bit_of_colours() {
    let folder = Folder::new();
    let mesh = coloured(Format::PlyBinaryLittle);
    let input = written(&folder, "in.ply", &mesh);
    let (xfm_file, output) = (folder.file("a.xfm"), folder.file("out.ply"));
    assert_eq!(xfm(&["build", &input, &xfm_file, "--encoding", "compact"]).code, 0);
    let info = xfm(&["info", &xfm_file, "--json"]).json();
    assert_eq!(info["attributes"][5]["coding"], "symbols");
    assert_eq!(xfm(&["extract", &xfm_file, &output, "--full"]).code, 0);
    let sorted = |mut colours: Vec<Colour>| {
        colours.sort_unstable();
        colours
    };
    assert_eq!(sorted(read(&output).colours), sorted(mesh.colours));
}

#[test]
fn other_colours_are_found_and_where_they_are() {
    let folder = Folder::new();
    let mut mesh = coloured(Format::PlyBinaryLittle);
    let input = written(&folder, "in.ply", &mesh);
    let xfm_file = folder.file("a.xfm");
    assert_eq!(xfm(&["build", &input, &xfm_file]).code, 0);
    mesh.colours[17][1] ^= 1;
    let other = written(&folder, "other.ply", &mesh);
    let plain = IndexedMesh { colours: Vec::new(), ..mesh.clone() };
    let plain = written(&folder, "plain.ply", &plain);
    let plain_file = folder.file("plain.xfm");
    assert_eq!(xfm(&["build", &plain, &plain_file]).code, 0);
    for memory in ["1GiB", "1KiB"] {
        let against =
            |file: &str, mesh: &str| xfm(&["verify", file, "--against", mesh, "--memory", memory]);
        let found = against(&xfm_file, &other);
        let place = mesh.positions[17].x.to_string();
        assert!(found.error_line().contains("1 vertices have other colours"), "{}", found.stderr);
        assert!(found.stderr.contains(&place), "{place} {}", found.stderr);
        // A mesh without colours says nothing about them; a file without has lost them.
        assert_eq!(against(&xfm_file, &plain).code, 0);
        assert!(against(&plain_file, &input).error_line().contains("these have none"));
    }
}

#[test]
fn colours_that_differ_at_one_place_are_counted_and_the_first_one_counts() {
    let folder = Folder::new();
    // Two triangles that share an edge by place and not by number, one red and one blue.
    let text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0 1 0 0\nv 0 0 0 0 0 1\nv 1 1 0 0 0 1\nv 0 1 0 0 0 1\n\
                f 1 2 3\nf 4 5 6\n";
    let input = folder.write("two.obj", text);
    let (xfm_file, output) = (folder.file("a.xfm"), folder.file("out.ply"));
    let built = xfm(&["build", &input, &xfm_file, "--json"]).json();
    assert_eq!(built["repaired"]["recoloured"], 2);
    assert_eq!(xfm(&["extract", &xfm_file, &output, "--full"]).code, 0);
    let mesh = read(&output);
    let mut colours = mesh.colours;
    colours.sort_unstable();
    assert_eq!(colours, [[0, 0, 255, 255], [255, 0, 0, 255], [255, 0, 0, 255], [255, 0, 0, 255]]);
}

#[test]
fn a_format_without_colours_is_told_of() {
    let folder = Folder::new();
    let input = written(&folder, "in.ply", &coloured(Format::PlyBinaryLittle));
    let (xfm_file, output) = (folder.file("a.xfm"), folder.file("out.stl"));
    assert_eq!(xfm(&["build", &input, &xfm_file]).code, 0);
    let ran = xfm(&["extract", &xfm_file, &output, "--full"]);
    assert!(ran.stderr.contains("the colours are left out"), "{}", ran.stderr);
    let report = xfm(&["extract", &xfm_file, &output, "--full", "--json"]).json();
    assert_eq!(report["colours"], false);
    let wrong = xfm(&["build", &input, &xfm_file, "--colour-weight", "-1"]);
    assert_eq!(wrong.code, 2);
}

#[test]
fn decimation_tells_that_it_leaves_colours_out() {
    let folder = Folder::new();
    let mesh = coloured(Format::PlyBinaryLittle);
    let input = written(&folder, "in.ply", &mesh);
    let grey = written(&folder, "grey.ply", &IndexedMesh { colours: Vec::new(), ..mesh });
    let output = folder.file("out.ply");
    for method in ["stream", "greedy", "cluster"] {
        let decimate =
            |input: &str| xfm(&["decimate", input, &output, "--faces", "200", "--method", method]);
        let ran = decimate(&input);
        assert!(ran.stderr.contains("the colours are left out"), "{method}: {}", ran.stderr);
        assert!(read(&output).colours.is_empty());
        assert!(!decimate(&grey).stderr.contains("colours"), "{method}");
    }
    let pipe = std::fs::read(&input).unwrap();
    let ran =
        common::xfm_with_input(&["decimate", "-", "-", "--faces", "200", "--to", "obj"], &pipe);
    assert!(ran.stderr.contains("the colours are left out"), "{}", ran.stderr);
}
