//! `xfm decimate` and what follows it, in pipes.

mod common;

use std::io::Write;
use std::process::Stdio;

use common::mesh::Mesh;
use common::{Folder, Ran, command, decimate, torus, xfm, xfm_with_input};
use serde_json::Value;

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
