//! `extract --full` with less memory than the mesh takes.

mod common;

use common::{Folder, bumpy_square, torus, xfm};

/// Triangles by the bits of their corners, sorted, and how many vertices are used.
fn mesh_of(path: &str) -> (Vec<[[u32; 3]; 3]>, usize) {
    let mesh = mesh_io::read_mesh(path.as_ref()).expect("a mesh");
    let mut soup: Vec<[[u32; 3]; 3]> = mesh
        .to_soup()
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|corner| corner.to_array().map(f32::to_bits));
            [a, b, c].min([b, c, a]).min([c, a, b])
        })
        .collect();
    soup.sort_unstable();
    let mut used: Vec<u32> = mesh.triangles.into_flattened();
    used.sort_unstable();
    used.dedup();
    (soup, used.len())
}

/// A mesh in OBJ, so far along x.
fn moved(obj: &str, by: f64) -> String {
    let line = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["v", x, y, z] => format!("v {} {y} {z}\n", x.parse::<f64>().expect("a number") + by),
        _ => format!("{line}\n"),
    };
    obj.lines().map(line).collect()
}

#[test]
fn little_memory_gives_the_same_mesh_in_every_format() {
    let folder = Folder::new();
    // Two seams that only touch: vertices at one place that are not one.
    let dirty = bumpy_square(20, 0.0) + "v 0 0 9\nv 0 1 9\nv -1 0 9\nf 1 442 443\nf 1 443 444\n";
    let far = moved(&bumpy_square(40, 0.0), 512_345.25);
    for (name, obj) in [("torus", torus(70, 40)), ("dirty", dirty), ("far", far)] {
        let input = folder.write(&format!("{name}.obj"), obj);
        let file = folder.file(&format!("{name}.xfm"));
        xfm(&["build", &input, &file, "--json"]).json();
        for extension in ["ply", "obj", "stl", "gltf", "glb", "ply.gz"] {
            let [large, small] = ["large", "small"].map(|size| {
                let out = folder.file(&format!("{size}.{extension}"));
                let memory = if size == "large" { "1GiB" } else { "1MiB" };
                let args = ["extract", &file, &out, "--full", "--memory", memory, "--json"];
                let report = xfm(&args).json();
                let mode = if size == "large" { "in-core" } else { "streaming" };
                assert_eq!(report["mode"], mode);
                assert_eq!(report["error"], 0.0);
                let (soup, used) = mesh_of(&out);
                assert_eq!(report["output_triangles"], soup.len());
                if !extension.starts_with("stl") {
                    assert_eq!(report["output_vertices"], used, "{name}.{extension}");
                }
                (soup, used)
            });
            assert!(large == small, "{name}.{extension}: {} {}", large.1, small.1);
        }
    }
}

#[test]
fn a_pipe_takes_it_too_and_scratch_files_are_said_where_to_go() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(70, 40));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let args = ["extract", &file, "-", "--full", "--memory", "1MiB", "--to", "obj"];
    let ran = xfm(&args);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(ran.stdout.lines().filter(|line| line.starts_with("f ")).count(), 5600);
    assert!(ran.stderr.contains("streaming"), "{}", ran.stderr);
    let ran = xfm(&[&args[..], &["--scratch", "/no/such/folder"]].concat());
    assert!(ran.error_line().contains("--scratch"));
}
