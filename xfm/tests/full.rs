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

#[test]
fn little_memory_finds_what_is_missing_and_nothing_else() {
    let folder = Folder::new();
    let far = moved(&bumpy_square(30, 0.0), 512_345.25);
    // Once more what is there, an edge of no length, a corner that is not a number.
    let dirty = torus(30, 20) + "v nan 0 0\nf 1 2 32\nf 1 1 2\nf 1 2 601\n";
    for (name, obj, left_out) in [("torus", torus(70, 40), 0), ("far", far, 0), ("dirty", dirty, 2)]
    {
        let input = folder.write(&format!("{name}.obj"), &obj);
        let file = folder.file(&format!("{name}.xfm"));
        xfm(&["build", &input, &file, "--json"]).json();
        let args = ["verify", &file, "--memory", "1MiB", "--json", "--against"];
        let verified = xfm(&[&args[..], &[&input]].concat()).json();
        assert_eq!(verified["ok"], true, "{verified}");
        let against = &verified["against"];
        assert_eq!(against["mode"], "streaming");
        assert_eq!((&against["missing"], &against["extra"]), (&0.into(), &0.into()));
        assert_eq!(against["repaired"]["triangles_without_surface"], left_out);
        assert_eq!(against["repaired"]["repeated_triangles"], u64::from(name == "dirty"));

        // The last triangle but those three is another one.
        let other = folder.write("other.obj", format!("{obj}f 5 9 14\n"));
        let ran = xfm(&[&args[..], &[&other]].concat());
        assert_eq!(ran.code, 1);
        let verified: serde_json::Value = serde_json::from_str(&ran.stdout).expect("a report");
        assert_eq!(verified["against"]["missing"], 1);
        assert_eq!(verified["against"]["extra"], 0);
        let ran = xfm(&[&args[..4], &["--against", &other]].concat());
        assert!(ran.error_line().contains("1 of"), "{}", ran.stderr);
    }
    let names = folder.names();
    assert!(names.iter().all(|name| name.ends_with(".obj") || name.ends_with(".xfm")), "{names:?}");
}

/// Python with NumPy, where there is one.
fn python() -> Option<&'static str> {
    let works = |python: &&str| {
        let ran = std::process::Command::new(python).args(["-c", "import numpy"]).output();
        ran.is_ok_and(|ran| ran.status.success())
    };
    ["python3", "python"].into_iter().find(works)
}

#[test]
fn the_reader_made_from_the_specification_finds_what_extract_writes() {
    let Some(python) = python() else {
        eprintln!("there is no Python with NumPy here");
        return;
    };
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(90, 50));
    for encoding in ["exact", "compact"] {
        let (file, full) = (folder.file("torus.xfm"), folder.file("full.ply"));
        xfm(&["build", &input, &file, "--encoding", encoding, "--json"]).json();
        xfm(&["extract", &file, &full, "--full", "--json"]).json();
        let reader = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reader/xfm.py");
        let output = folder.file("read.mesh");
        let ran = std::process::Command::new(python)
            .args(["-B", reader, &file, &output])
            .output()
            .expect("Python starts");
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        // Two counts of 64 bits, positions, triangles.
        let bytes = std::fs::read(output).expect("what it read");
        let words: Vec<u32> = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
            .collect();
        let (vertices, triangles) = (words[0] as usize, words[2] as usize);
        let corner = |v: u32| [0, 1, 2].map(|axis| words[4 + 3 * v as usize + axis]);
        let mut soup: Vec<[[u32; 3]; 3]> = words[4 + 3 * vertices..][..3 * triangles]
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(corner);
                [a, b, c].min([b, c, a]).min([c, a, b])
            })
            .collect();
        soup.sort_unstable();
        assert!((soup, vertices) == mesh_of(&full), "{encoding}");
    }
}
