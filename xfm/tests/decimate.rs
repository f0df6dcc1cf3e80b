//! `xfm decimate` from the outside.

mod common;

use std::collections::HashMap;
use std::io::Write;
use std::process::Stdio;

use common::{Folder, Ran, bumpy_square, command, torus, xfm, xfm_with_input};
use serde_json::Value;

/// A mesh as OBJ text tells it.
struct Mesh {
    positions: Vec<[f64; 3]>,
    faces: Vec<[usize; 3]>,
}

impl Mesh {
    fn parse(obj: &str) -> Self {
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for line in obj.lines() {
            let mut words = line.split_whitespace();
            let kind = words.next();
            let words: Vec<&str> = words.collect();
            match kind {
                Some("v") => positions.push([0, 1, 2].map(|i| words[i].parse().expect("a number"))),
                Some("f") => faces.push([0, 1, 2].map(|i| words[i].parse().expect("an index"))),
                _ => {}
            }
        }
        Self { positions, faces: faces.iter().map(|f: &[usize; 3]| f.map(|v| v - 1)).collect() }
    }

    fn read(path: &str) -> Self {
        Self::parse(&std::fs::read_to_string(path).expect("the output is there"))
    }

    /// As binary STL.
    fn stl(&self) -> Vec<u8> {
        let mut stl = vec![0; 80];
        stl.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            stl.extend([0; 12]);
            for v in face {
                stl.extend(self.positions[*v].iter().flat_map(|&x| (x as f32).to_le_bytes()));
            }
            stl.extend([0; 2]);
        }
        stl
    }

    fn obj(&self) -> String {
        let mut obj = String::new();
        for [x, y, z] in &self.positions {
            obj += &format!("v {x} {y} {z}\n");
        }
        for [a, b, c] in self.faces.iter().map(|face| face.map(|v| v + 1)) {
            obj += &format!("f {a} {b} {c}\n");
        }
        obj
    }

    /// As PLY with doubles.
    fn ply(&self) -> String {
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.faces.len()
        );
        for [x, y, z] in &self.positions {
            ply += &format!("{x} {y} {z}\n");
        }
        for [a, b, c] in &self.faces {
            ply += &format!("3 {a} {b} {c}\n");
        }
        ply
    }

    /// The faces in an order without any locality.
    fn shuffled(mut self) -> Self {
        let count = self.faces.len();
        let mut state = 1_u64;
        for i in (1..count).rev() {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            self.faces.swap(i, (state >> 33) as usize % (i + 1));
        }
        self
    }

    fn moved(mut self, by: [f64; 3]) -> Self {
        for position in &mut self.positions {
            *position = [0, 1, 2].map(|axis| position[axis] + by[axis]);
        }
        self
    }

    /// The Euler number, if each edge has one face on each side.
    fn closed_euler(&self) -> Option<i64> {
        let mut edges = HashMap::new();
        for [a, b, c] in &self.faces {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        let closed =
            edges.iter().all(|(&(a, b), &count)| count == 1 && edges.contains_key(&(b, a)));
        let mut used: Vec<usize> = self.faces.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let (v, e, f) = (used.len() as i64, edges.len() as i64 / 2, self.faces.len() as i64);
        closed.then_some(v - e + f)
    }
}

fn decimate(input: &str, output: &str, how: &[&str]) -> Value {
    xfm(&[&["decimate", input, output, "--json"], how].concat()).json()
}

/// The larger of both directions' largest distances.
fn distance(a: &str, b: &str) -> f64 {
    let diff = xfm(&["diff", a, b, "--samples", "20000", "--json"]).json();
    let max = |side: &str| diff[side]["max"].as_f64().expect("a distance");
    max("a_to_b").max(max("b_to_a"))
}

#[test]
fn every_method_keeps_near_the_surface_and_all_but_one_the_count() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(80, 40));
    for (method, tolerance) in [("stream", 0), ("greedy", 0), ("cluster", 60)] {
        for how in [["--faces", "640"], ["--ratio", "0.1"]] {
            let output = folder.file("out.obj");
            let report = decimate(&input, &output, &[&how[..], &["--method", method]].concat());
            assert_eq!(report["method"], method);
            assert_eq!(report["input_triangles"], 6400);
            assert_eq!(report["target_triangles"], 640);
            let count = report["output_triangles"].as_u64().expect("a count");
            assert!(count.abs_diff(640) <= tolerance, "{report}");
            let mesh = Mesh::read(&output);
            assert_eq!(mesh.faces.len() as u64, count);
            assert!(distance(&input, &output) < 0.1, "{method}");
            if method != "cluster" {
                assert_eq!(mesh.closed_euler(), Some(0), "{method}");
                assert_eq!(report["missed"], Value::Null);
            }
        }
    }
}

#[test]
fn json_has_the_promised_keys() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(40, 20));
    for method in ["stream", "greedy", "cluster"] {
        let how = ["--ratio", "0.5", "--method", method, "--buffer", "5000"];
        let report = decimate(&input, &folder.file("out.ply"), &how);
        for number in ["seconds", "buffer_triangles", "peak_buffer_triangles"] {
            assert!(report[number].as_f64().is_some_and(|value| value > 0.0), "{number}: {report}");
        }
        if cfg!(target_os = "linux") {
            assert!(report["peak_rss"].as_u64().is_some_and(|bytes| bytes > 1 << 20), "{report}");
        }
        for kind in ["degenerate", "duplicate", "non_finite", "non_manifold", "late"] {
            assert_eq!(report["repaired"][kind], 0, "{report}");
        }
        assert_eq!(report["sorted"], false);
        assert!(report["counted"].is_boolean());
        assert_eq!(report["sealed_vertices"], 0);
        assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0));
        if method == "stream" {
            assert_eq!(report["buffer_triangles"], 5000);
        }
    }
}

#[test]
fn people_are_told_on_standard_error() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(60, 30));
    let output = folder.file("out.stl");
    let ran = xfm(&["decimate", &input, &output, "--faces", "1000"]);
    assert_eq!((ran.code, ran.stdout.as_str()), (0, ""));
    for told in ["1,000 of 3,600 triangles", "per second"] {
        assert!(ran.stderr.contains(told), "{told} in {}", ran.stderr);
    }
    assert_eq!(folder.names(), ["out.stl", "torus.obj"], "nothing else is left");
    // A torus cannot be made of fewer than seven vertices and fourteen triangles.
    let ran = xfm(&["decimate", &input, &output, "--faces", "2"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("asked 2, got ") && ran.stderr.contains("topology"),
        "{}",
        ran.stderr
    );
    let report = decimate(&input, &output, &["--faces", "2"]);
    let excess = report["output_triangles"].as_u64().expect("a count") - 2;
    assert!(excess >= 12);
    let reasons = report["missed"].as_object().expect("reasons").values();
    assert_eq!(reasons.filter_map(Value::as_u64).sum::<u64>(), excess);
}

#[test]
fn the_largest_error_is_kept_and_used() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(100, 50));
    let output = folder.file("out.ply");
    for (method, most) in [("stream", 0.02_f64), ("greedy", 0.02), ("cluster", 0.2)] {
        let asked = most.to_string();
        let report = decimate(&input, &output, &["--max-error", &asked, "--method", method]);
        assert_eq!(report["target_triangles"], Value::Null);
        assert_eq!(report["missed"], Value::Null);
        let count = report["output_triangles"].as_u64().expect("a count");
        assert!(count < 8000, "{method}: {count} of 10,000");
        let apart = distance(&input, &output);
        assert!(apart <= most, "{method}: {apart}");
    }
}

#[test]
fn whole_input_comes_out_where_nothing_has_to_go() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(60, 30));
    let output = folder.file("out.obj");
    for how in [["--ratio", "1"], ["--faces", "3600"], ["--faces", "1000000000000"]] {
        for buffer in ["400000", "500"] {
            let report = decimate(&input, &output, &[&how[..], &["--buffer", buffer]].concat());
            assert_eq!(report["output_triangles"], 3600, "{how:?} {buffer}");
            assert_eq!(report["target_triangles"], 3600, "{how:?} {buffer}");
            assert_eq!(Mesh::read(&output).closed_euler(), Some(0));
            assert!(distance(&input, &output) < 1e-6);
        }
        let report = decimate(&input, &output, &[&how[..], &["--method", "greedy"]].concat());
        assert_eq!(report["output_triangles"], 3600);
    }
}

#[test]
fn the_bytes_depend_on_the_seed_but_not_on_the_threads() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(200, 100));
    let bytes = |method: &str, threads: &str, seed: &str| {
        let output = folder.file(&format!("{method}-{threads}-{seed}.stl"));
        let how = ["--ratio", "0.05", "--buffer", "6000", "--method", method];
        decimate(&input, &output, &[&how[..], &["--threads", threads, "--seed", seed]].concat());
        std::fs::read(output).expect("the output is there")
    };
    for method in ["stream", "greedy", "cluster"] {
        let one = bytes(method, "1", "0");
        assert!(one == bytes(method, "2", "0"), "{method}");
        assert!(one == bytes(method, "5", "0"), "{method}");
        if method == "stream" {
            assert!(one != bytes(method, "1", "1"));
        }
    }
}

#[test]
fn a_small_buffer_keeps_a_closed_surface_closed() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(200, 100));
    let output = folder.file("out.obj");
    let report = decimate(&input, &output, &["--ratio", "0.1", "--buffer", "4000"]);
    assert_eq!(report["output_triangles"], 4000);
    assert!(report["peak_buffer_triangles"].as_u64().is_some_and(|peak| peak <= 4000), "{report}");
    assert_eq!(Mesh::read(&output).closed_euler(), Some(0));
    assert!(distance(&input, &output) < 0.05);
}

#[test]
fn pipes_give_what_files_give() {
    let folder = Folder::new();
    let mesh = Mesh::parse(&torus(120, 60));
    let input = folder.write("torus.stl", mesh.stl());
    for method in ["stream", "greedy", "cluster"] {
        let output = folder.file("out.obj");
        let how = ["--ratio", "0.25", "--method", method];
        decimate(&input, &output, &how);
        let expected = std::fs::read_to_string(&output).expect("the output is there");

        let to_pipe = xfm(&[&["decimate", &input, "-", "--to", "obj"], &how[..]].concat());
        assert_eq!(to_pipe.code, 0, "{}", to_pipe.stderr);
        assert!(to_pipe.stdout == expected, "{method}: file to pipe");

        let pipes = ["decimate", "-", "-", "--from", "stl", "--to", "obj", "--json"];
        let ran = xfm_with_input(&[&pipes[..], &how].concat(), &mesh.stl());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert!(ran.stdout == expected, "{method}: pipe to pipe");
        let report: Value = serde_json::from_str(&ran.stderr).expect("JSON and nothing else");
        assert_eq!(report["input_triangles"], 14_400);
    }
    assert_eq!(folder.names(), ["out.obj", "torus.stl"], "nothing else is left");
}

#[test]
fn the_format_of_a_pipe_shows_in_its_content_or_has_to_be_said() {
    let folder = Folder::new();
    let mesh = Mesh::parse(&torus(20, 10));
    for content in [mesh.obj().into_bytes(), mesh.ply().into_bytes(), mesh.stl()] {
        let output = folder.file("out.ply");
        let ran = xfm_with_input(&["decimate", "-", &output, "--ratio", "0.5", "--json"], &content);
        assert_eq!(ran.json()["output_triangles"], 200);
    }
    let silent = xfm_with_input(&["decimate", "-", "out.ply", "--ratio", "0.5"], &[0xaa; 500]);
    assert!(silent.error_line().contains("--from"), "{}", silent.stderr);
}

#[test]
fn commands_follow_each_other_in_a_pipe_without_a_word_about_formats() {
    let folder = Folder::new();
    let input = folder.write("torus.stl", Mesh::parse(&torus(40, 20)).stl());
    let from = std::fs::File::open(&input).expect("it is there");
    let mut decimate = command(&["decimate", "-", "-", "--ratio", "0.5"]);
    let mut decimate =
        decimate.stdin(from).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("xfm");
    let file = folder.file("torus.xfm");
    let mut build = command(&["build", "-", &file, "--json"]);
    let pipe = decimate.stdout.take().expect("a pipe");
    let built = Ran::of(
        build.stdin(pipe).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("xfm"),
    );
    assert!(decimate.wait().is_ok_and(|status| status.success()));
    assert_eq!(built.json()["input_triangles"], 800);
    let extracted = command(&["extract", &file, "-", "--faces", "300"]).output().expect("xfm");
    assert!(extracted.status.success());
    assert!(extracted.stdout.starts_with(b"ply\nformat binary_little_endian"));
}

#[test]
fn packed_files_go_in_and_come_out() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(40, 20));
    let [plain, packed] = ["out.obj", "out.obj.gz"].map(|name| folder.file(name));
    decimate(&input, &plain, &["--ratio", "0.5"]);
    decimate(&input, &packed, &["--ratio", "0.5"]);
    assert!(std::fs::read(&packed).is_ok_and(|bytes| bytes.starts_with(&[0x1f, 0x8b])));
    assert!(distance(&plain, &packed) < 1e-12);
    let again = decimate(&packed, &folder.file("again.glb"), &["--faces", "100"]);
    assert_eq!(again["input_triangles"], 800);
    assert_eq!(again["output_triangles"], 100);
}

#[test]
fn the_input_may_be_the_output() {
    let folder = Folder::new();
    let mesh = Mesh::parse(&torus(60, 30));
    for (name, content) in [("a.ply", mesh.ply().into_bytes()), ("a.stl", mesh.stl())] {
        let file = folder.write(name, content);
        for triangles in [1800, 900] {
            let report = decimate(&file, &file, &["--ratio", "0.5", "--buffer", "1000"]);
            assert_eq!(report["output_triangles"], triangles);
        }
    }
}

#[test]
fn what_a_buffer_cannot_follow_is_counted_or_sorted() {
    let folder = Folder::new();
    let expected = 2000;
    let how = ["--faces", "2000", "--buffer", "2500"];
    let mesh = Mesh::parse(&torus(200, 100)).shuffled();
    for (name, content) in [
        ("t.stl", mesh.stl()),
        ("t.obj", mesh.obj().into_bytes()),
        ("t.ply", mesh.ply().into_bytes()),
    ] {
        let input = folder.write(name, content);
        let output = folder.file("out.obj");
        let report = decimate(&input, &output, &how);
        assert_eq!(report["input_triangles"], 40_000, "{name}");
        assert_eq!(report["output_triangles"], expected, "{name}");
        assert_eq!(report["sorted"], true, "{name}");
        assert_eq!(Mesh::read(&output).closed_euler(), Some(0), "{name}");
        let told = xfm(&[&["decimate", &input, &output], &how[..]].concat()).stderr;
        assert!(told.contains("sorted"), "{told}");
        std::fs::remove_file(input).expect("it is there");
        std::fs::remove_file(output).expect("it is there");
    }
    assert_eq!(folder.names(), Vec::<String>::new(), "no scratch file is left");
    // Sorted, the front across the torus is longer than this buffer.
    let input = folder.write("t.stl", mesh.stl());
    let ran =
        xfm(&["decimate", &input, &folder.file("out.obj"), "--ratio", "0.05", "--buffer", "100"]);
    let line = ran.error_line();
    assert!(line.contains("even sorted") && line.contains("--buffer"), "{line}");
    std::fs::remove_file(input).expect("it is there");
    // There is no second look at a pipe.
    let pipe = ["decimate", "-", &folder.file("out.obj"), "--from", "stl", "--ratio", "0.05"];
    let ran = xfm_with_input(&[&pipe[..], &["--buffer", "2500"]].concat(), &mesh.stl());
    let line = ran.error_line();
    assert!(line.contains("standard input") && line.contains("as a file"), "{line}");
    assert_eq!(folder.names(), Vec::<String>::new());
}

#[test]
fn boundaries_of_a_numbered_file_are_found_by_reading_it_once_more() {
    let folder = Folder::new();
    // Strips with gaps between them: half of the edges are boundary.
    let whole = Mesh::parse(&bumpy_square(150, 0.0));
    let strip = |(i, _): &(usize, &[usize; 3])| (i / 300) % 3 != 2;
    let faces = whole.faces.iter().enumerate().filter(strip).map(|(_, face)| *face).collect();
    let mesh = Mesh { faces, ..whole };
    let input = folder.write("strips.ply", mesh.ply());
    let output = folder.file("out.obj");
    let report = decimate(&input, &output, &["--ratio", "0.2", "--buffer", "1500"]);
    assert_eq!(report["input_triangles"], mesh.faces.len());
    assert_eq!(report["output_triangles"], mesh.faces.len() / 5);
    assert_eq!(report["repaired"]["late_cracks"], 0);
    assert!(distance(&input, &output) < 0.02);
}

#[test]
fn memory_does_not_grow_with_the_length_of_a_pipe() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let folder = Folder::new();
    let peak = |n: u32| {
        let stl = Mesh::parse(&torus(n, n / 2)).stl();
        let output = folder.file("out.stl");
        let args = ["decimate", "-", &output, "--from", "stl", "--ratio", "0.02", "--json"];
        let ran =
            xfm_with_input(&[&args[..], &["--buffer", "8000", "--threads", "2"]].concat(), &stl);
        ran.json()["peak_rss"].as_f64().expect("Linux tells")
    };
    let (short, long) = (peak(200), peak(800));
    // The longer pipe is 30 MB longer.
    assert!(long < short + 4e6, "{short} bytes for 40,000 triangles, {long} for 640,000");
    assert!(long < 4e7, "{long}");
}

#[test]
fn coordinates_far_from_zero_keep_their_place_and_their_digits() {
    let folder = Folder::new();
    let by = [512_345.678, 5_403_210.123, 0.0];
    let near = folder.write("near.obj", torus(100, 50));
    let mesh = Mesh::parse(&torus(100, 50)).moved(by);
    for (name, content) in [("far.obj", mesh.obj()), ("far.ply", mesh.ply())] {
        let input = folder.write(name, content);
        for method in ["stream", "greedy", "cluster"] {
            let output = folder.file("out.obj");
            let report = decimate(&input, &output, &["--faces", "1000", "--method", method]);
            assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0), "{report}");
            let back = Mesh::read(&output).moved(by.map(|x| -x));
            let back = folder.write("back.obj", back.obj());
            let apart = distance(&near, &back);
            assert!(apart < 0.05, "{method} {name}: {apart}");
        }
        let ply = folder.file("out.ply");
        decimate(&input, &ply, &["--faces", "1000"]);
        let header = std::fs::read(&ply).expect("the output is there");
        assert!(header[..200].windows(17).any(|word| word == b"property double x"));
        // Binary STL has no doubles.
        let ran = xfm(&["decimate", &input, &folder.file("out.stl"), "--faces", "1000"]);
        assert_eq!(ran.code, 0);
        assert!(ran.stderr.contains("warning: "), "{}", ran.stderr);
        assert!(ran.stderr.contains("steps of 0.5"), "{}", ran.stderr);
    }
    // Nor do the floats of binary STL get better by being decimated; the report says what that means.
    let stl = folder.write("far.stl", mesh.stl());
    let output = folder.file("out.ply");
    let report = decimate(&stl, &output, &["--max-error", "0.1"]);
    let warning = report["warnings"][0].as_str().expect("a warning");
    assert!(warning.contains("0.5") && warning.contains("0.1"), "{warning}");
}

#[test]
fn dirty_input_is_repaired_or_left_out_and_counted() {
    let folder = Folder::new();
    let square = bumpy_square(10, 0.0);
    let dirt = "v nan 0 0\nv 0 inf 0\nf 1 2 122\nf 1 123 2\nf 5 5 6\nf 1 2 13\n";
    let input = folder.write("dirty.obj", format!("{square}{dirt}"));
    for method in ["stream", "greedy"] {
        let report =
            decimate(&input, &folder.file("out.obj"), &["--faces", "100", "--method", method]);
        assert_eq!(report["input_triangles"], 204);
        assert_eq!(report["output_triangles"], 100);
        assert_eq!(report["repaired"]["non_finite"], 2, "{method}");
        assert_eq!(report["repaired"]["degenerate"], 1, "{method}");
        assert_eq!(report["repaired"]["duplicate"], 1, "{method}");
        let told = xfm(&[
            "decimate",
            &input,
            &folder.file("out.obj"),
            "--faces",
            "100",
            "--method",
            method,
        ]);
        assert!(told.stderr.contains("repaired: "), "{}", told.stderr);
    }
    let report =
        decimate(&input, &folder.file("out.obj"), &["--faces", "100", "--method", "cluster"]);
    assert_eq!(report["repaired"]["non_finite"], 2);
}

#[test]
fn next_to_nothing_is_no_failure() {
    let folder = Folder::new();
    let one = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let cases = [
        ("one.obj", one.as_bytes().to_vec(), 1, 1),
        ("none.obj", b"v 0 0 0\nv 1 0 0\n".to_vec(), 0, 0),
        ("none.stl", Mesh { positions: vec![], faces: vec![] }.stl(), 0, 0),
        ("nan.obj", one.replace("1 0 0", "nan 0 0").into_bytes(), 1, 0),
        // A triangle without area that names three vertices is one to an in-core method.
        ("point.obj", one.replace('1', "0").replace("0 2 3", "1 2 3").into_bytes(), 1, 1),
    ];
    for (name, content, read, most) in cases {
        let input = folder.write(name, content);
        for method in ["stream", "greedy", "cluster"] {
            for how in [["--ratio", "0.5"], ["--faces", "1"], ["--max-error", "0"]] {
                let output = folder.file("out.obj");
                let report = decimate(&input, &output, &[&how[..], &["--method", method]].concat());
                assert_eq!(report["input_triangles"], read, "{name} {method}");
                let count = Mesh::read(&output).faces.len();
                assert_eq!(report["output_triangles"], count, "{name} {method}");
                assert!(count <= most, "{name} {method}");
            }
        }
    }
}

#[test]
fn failures_name_the_file_and_the_remedy_on_one_line() {
    let folder = Folder::new();
    let mesh = Mesh::parse(&torus(20, 10));
    let good = folder.write("good.obj", mesh.obj());
    let whole = mesh.stl();
    let ply = mesh.ply();
    let out = folder.file("out.obj");
    let inputs = [
        (folder.file("missing.stl"), "cannot open"),
        (folder.write("empty.stl", ""), "empty"),
        (folder.write("empty.obj", ""), "empty"),
        (folder.write("short.stl", &whole[..whole.len() / 2]), "ends before"),
        (folder.write("short.ply", &ply[..ply.len() / 2]), "ends before"),
        (folder.write("range.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n"), "3"),
        (folder.write("words.obj", "v 0 0 zero\n"), "line 1"),
        (folder.write("mesh.step", "ISO-10303-21;"), "format"),
        (folder.path().to_str().expect("UTF-8").to_owned(), "irectory"),
    ];
    for (input, told) in inputs {
        for method in ["stream", "greedy", "cluster"] {
            let ran =
                xfm(&["decimate", &input, &out, "--ratio", "0.5", "--method", method, "--json"]);
            let line = ran.error_line();
            assert!(line.contains(&input), "{method}: {line}");
            assert!(line.contains(told), "{method}: {line}");
            assert!(line.contains(';'), "a remedy: {line}");
        }
    }
    let far = folder.file("no/such/folder.obj");
    let outputs = [
        (vec![far.as_str()], "folder.obj"),
        (vec![folder.path().to_str().expect("UTF-8")], "folder"),
        (vec!["out.step"], "out.step"),
        (vec![&out, "--scratch", "/no/such/folder"], "--scratch"),
    ];
    for (args, told) in outputs {
        for method in ["stream", "greedy", "cluster"] {
            let how = ["--ratio", "0.5", "--method", method];
            let ran = xfm(&[&["decimate", &good], &args[..], &how].concat());
            let line = ran.error_line();
            assert!(line.contains(told), "{method}: {line}");
            assert!(line.contains(';'), "a remedy: {line}");
        }
    }
    assert!(!folder.names().contains(&"out.obj".to_owned()), "a failure writes no file");
    assert!(!folder.names().iter().any(|name| name.starts_with('.')), "{:?}", folder.names());
}

#[test]
fn a_count_too_large_for_an_endless_stream_says_what_would_do() {
    let folder = Folder::new();
    let stl = Mesh::parse(&torus(100, 50)).stl();
    // The header of a pipe may say anything, and so is not believed.
    let args = ["decimate", "-", &folder.file("out.stl"), "--from", "stl", "--faces", "4000"];
    let ran = xfm_with_input(&[&args[..], &["--buffer", "5000"]].concat(), &stl);
    let line = ran.error_line();
    assert!(line.contains("8000") && line.contains("standard input"), "{line}");
    let ran = xfm_with_input(&[&args[..], &["--buffer", "8000", "--json"]].concat(), &stl);
    assert_eq!(ran.json()["output_triangles"], 4000);
}

#[test]
fn wrong_usage_exits_with_2() {
    let cases: &[&[&str]] = &[
        &[],
        &["--ratio", "0.5", "--faces", "10"],
        &["--ratio", "0"],
        &["--ratio", "1.5"],
        &["--ratio", "-0.5"],
        &["--ratio", "nan"],
        &["--ratio", "2%"],
        &["--faces", "0"],
        &["--faces", "-4"],
        &["--faces", "1.5"],
        &["--max-error", "-1"],
        &["--max-error", "inf"],
        &["--ratio", "0.5", "--buffer", "63"],
        &["--ratio", "0.5", "--buffer", "1e6"],
        &["--ratio", "0.5", "--candidates", "0"],
        &["--ratio", "0.5", "--candidates", "65"],
        &["--ratio", "0.5", "--seed", "-1"],
        &["--ratio", "0.5", "--method", "magic"],
        &["--ratio", "0.5", "--from", "step"],
        &["--ratio", "0.5", "--to", "step"],
        &["--ratio", "0.5", "--threads", "0"],
    ];
    for how in cases {
        let ran = xfm(&[&["decimate", "in.obj", "out.obj"], *how].concat());
        assert_eq!(ran.code, 2, "{how:?}: {}", ran.stderr);
        assert_eq!(ran.stdout, "", "{how:?}");
        assert!(ran.stderr.contains("--help"), "{how:?}: {}", ran.stderr);
    }
}

#[test]
fn a_reader_that_has_seen_enough_ends_the_work_quietly() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(200, 100));
    let bytes = std::fs::read(&input).expect("just written");
    for method in ["stream", "greedy", "cluster"] {
        for input in [input.as_str(), "-"] {
            let how = ["--to", "obj", "--ratio", "0.9", "--method", method];
            let mut child = command(&[&["decimate", input, "-"], &how[..]].concat())
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .spawn()
                .expect("the binary runs");
            drop(child.stdout.take());
            let mut stdin = child.stdin.take().expect("standard input is a pipe");
            if input == "-" {
                // It may well stop reading early.
                drop(stdin.write_all(&bytes));
            }
            drop(stdin);
            let output = child.wait_with_output().expect("the binary ends");
            assert_eq!(output.status.code(), Some(0), "{method} {input}");
            assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{method} {input}");
        }
    }
}

#[cfg(unix)]
#[test]
fn an_interruption_ends_at_once_and_leaves_nothing() {
    let folder = Folder::new();
    let stl = Mesh::parse(&torus(400, 200)).stl();
    for method in ["stream", "greedy", "cluster"] {
        for output in [folder.file("out.stl"), "-".to_owned()] {
            let how = ["--from", "stl", "--to", "stl", "--ratio", "0.5", "--buffer", "10000"];
            let mut child =
                command(&[&["decimate", "-", &output, "--method", method], &how[..]].concat())
                    .stdin(Stdio::piped())
                    .stdout(Stdio::piped())
                    .stderr(Stdio::piped())
                    .spawn()
                    .expect("the binary runs");
            let mut stdin = child.stdin.take().expect("standard input is a pipe");
            // The pipe stays open: without the signal the command would wait for more. It holds less than this.
            stdin.write_all(&stl[..stl.len() / 2]).expect("the command reads");
            let ran = interrupted(child);
            drop(stdin);
            assert_eq!(ran.code, 130, "{method} {output}: {}", ran.stderr);
            assert_eq!(ran.stderr, "error: interrupted; no output was written\n");
            assert_eq!(folder.names(), Vec::<String>::new(), "{method} {output}");
        }
    }
}

#[cfg(unix)]
fn interrupted(child: std::process::Child) -> Ran {
    let signal =
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signal.is_ok_and(|status| status.success()));
    Ran::of(child)
}
