//! Every command on meshes as they should not be (`tests/meshes`, and what is too large to be written down): what comes of it is
//! right, or it is refused in one line. Each is tried as it is, and divided until it is large enough for a hierarchy.

mod common;
#[path = "nasty/meshes.rs"]
mod meshes;
#[path = "nasty/soup.rs"]
mod soup;

use std::process::Stdio;
use std::time::{Duration, Instant};

use common::{Folder, Ran};
use mesh_io::read_mesh;
use meshes::{Nasty, all, fine};
use soup::{is_balanced, is_watertight, surface, surfaces_of};

/// Nothing here takes longer than a fraction of a second.
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// Runs `xfm`; it must end by itself, with a report, or with one line that names the mesh and a remedy.
fn run(nasty: &Nasty, args: &[&str]) -> Option<serde_json::Value> {
    let what = format!("{}: xfm {}", nasty.name, args.join(" "));
    let child = common::command(args)
        .arg("--json")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = child.expect("the binary runs");
    let start = Instant::now();
    while child.try_wait().expect("it can be waited for").is_none() {
        if start.elapsed() > TIME_LIMIT {
            child.kill().expect("it can be ended");
            panic!("{what}: hangs");
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let ran = Ran::of(child);
    match ran.code {
        0 => Some(ran.json()),
        // Its report is there all the same.
        1 if args[0] == "verify" => panic!("{what}: {}", ran.stderr),
        1 => {
            let line = ran.error_line();
            let told = args.iter().any(|arg| arg.contains('/') && line.contains(arg));
            assert!(told, "{what}: no file is named: {line}");
            assert!(line.contains("; "), "{what}: no remedy: {line}");
            None
        }
        code => panic!("{what}: exit code {code}: {}", ran.stderr),
    }
}

/// Runs what must succeed.
fn succeed(nasty: &Nasty, args: &[&str]) -> serde_json::Value {
    run(nasty, args).unwrap_or_else(|| panic!("{}: xfm {}", nasty.name, args.join(" ")))
}

fn count(report: &serde_json::Value, key: &str) -> u64 {
    report[key].as_u64().unwrap_or_else(|| panic!("{key} of {report}"))
}

fn decimate(nasty: &Nasty) {
    let folder = Folder::new();
    let input = folder.write(&nasty.file, &nasty.bytes);
    let output = folder.file("out.ply");
    for method in ["stream", "greedy", "cluster"] {
        for target in
            [["--ratio", "1"], ["--ratio", "0.5"], ["--faces", "3"], ["--max-error", "0.01"]]
        {
            let args = [&["decimate", &input, &output, "--method", method], &target[..]].concat();
            let Some(report) = run(nasty, &args) else {
                assert!(nasty.is_broken(), "{}: {args:?} is refused", nasty.name);
                assert_eq!(folder.names(), [nasty.file.as_str()], "{args:?} leaves something");
                continue;
            };
            assert!(!nasty.is_broken(), "{}: {args:?} is taken", nasty.name);
            let mesh = read_mesh(output.as_ref()).expect("what was written");
            let triangles = mesh.triangles.len() as u64;
            assert_eq!(triangles, count(&report, "output_triangles"), "{args:?}");
            assert!(mesh.positions.iter().all(|p| p.is_finite()), "{}: {args:?}", nasty.name);
            let wanted = report["target_triangles"].as_u64();
            let missed = !report["missed"].is_null();
            assert!(
                method == "cluster" || missed || wanted.is_none_or(|wanted| triangles <= wanted),
                "{}: {args:?}: {triangles} triangles, and no reason",
                nasty.name
            );
            let soup = mesh.to_soup();
            assert!(
                method == "cluster" || !is_watertight(&nasty.soup) || is_balanced(&soup),
                "{}: {args:?}: it was closed",
                nasty.name
            );
            if target == ["--ratio", "1"] && method != "cluster" {
                assert_eq!(
                    surfaces_of(&soup),
                    surfaces_of(&nasty.soup),
                    "{}: {args:?}",
                    nasty.name
                );
            }
            std::fs::remove_file(&output).expect("it is there");
        }
    }
}

/// From every format into every other, by way of the first.
fn convert(nasty: &Nasty) {
    let folder = Folder::new();
    let input = folder.write(&nasty.file, &nasty.bytes);
    let first = folder.file("first.ply");
    if run(nasty, &["decimate", &input, &first, "--ratio", "1"]).is_none() {
        return;
    }
    let mesh = read_mesh(first.as_ref()).expect("what was written").to_soup();
    for format in ["stl", "stla", "ply", "plya", "plyb", "obj", "gltf", "glb"] {
        let output = folder.file("out");
        let args = ["decimate", &first, &output, "--ratio", "1", "--to", format];
        succeed(nasty, &args);
        let again = folder.file("again.ply");
        let from = format.trim_end_matches(['a', 'b']);
        let from = if format == "glb" { "glb" } else { from };
        succeed(nasty, &["decimate", &output, &again, "--ratio", "1", "--from", from]);
        let again = read_mesh(again.as_ref()).expect("what was written").to_soup();
        assert_eq!(surfaces_of(&again), surfaces_of(&mesh), "{}: {format}", nasty.name);
        std::fs::remove_file(&output).expect("it is there");
    }
    assert_eq!(folder.names().len(), 3, "{:?}", folder.names());
}

fn build(nasty: &Nasty) {
    let folder = Folder::new();
    let input = folder.write(&nasty.file, &nasty.bytes);
    let file = folder.file("out.xfm");
    for (mode, encoding) in [
        ("--in-core", "exact"),
        ("--in-core", "compact"),
        ("--streaming", "exact"),
        ("--streaming", "compact"),
    ] {
        let args = ["build", &input, &file, mode, "--encoding", encoding, "--scratch"];
        let scratch = folder.path().to_str().expect("a UTF-8 path");
        let Some(report) = run(nasty, &[&args[..], &[scratch]].concat()) else {
            let refused = nasty.is_broken()
                || surface(&nasty.soup).is_empty()
                || (encoding == "compact" && nasty.name.starts_with("largest-coordinates"));
            assert!(refused, "{}: {args:?} is refused", nasty.name);
            assert_eq!(folder.names(), [nasty.file.as_str()], "{args:?} leaves something");
            continue;
        };
        assert!(!nasty.is_broken() && !surface(&nasty.soup).is_empty(), "{}", nasty.name);
        assert_eq!(count(&report, "input_triangles"), nasty.soup.len() as u64, "{}", nasty.name);
        look_at(nasty, &folder, [&input, &file], encoding);
        std::fs::remove_file(&file).expect("it is there");
        assert_eq!(folder.names(), ["extracted.ply", nasty.file.as_str()], "{}", nasty.name);
        std::fs::remove_file(folder.file("extracted.ply")).expect("it is there");
    }
}

/// Every command that takes a `.xfm` file.
fn look_at(nasty: &Nasty, folder: &Folder, [input, file]: [&str; 2], encoding: &str) {
    let mesh = folder.file("extracted.ply");
    let info = succeed(nasty, &["info", file]);
    let triangles = count(&info, "input_triangles");
    succeed(nasty, &["verify", file]);
    // In memory, and through scratch files.
    for memory in ["1GiB", "16MiB"] {
        let verified = succeed(nasty, &["verify", file, "--against", input, "--memory", memory]);
        assert_eq!(verified["ok"], true, "{}", nasty.name);
    }
    for memory in ["1GiB", "16MiB"] {
        let full = succeed(nasty, &["extract", file, &mesh, "--full", "--memory", memory]);
        assert_eq!(count(&full, "output_triangles"), triangles, "{}", nasty.name);
        let soup = read_mesh(mesh.as_ref()).expect("what was written").to_soup();
        assert_eq!(soup.len() as u64, triangles);
        if encoding == "exact" {
            assert_eq!(surfaces_of(&soup), surfaces_of(&nasty.soup), "{}", nasty.name);
            assert!(!is_watertight(&nasty.soup) || is_balanced(&soup), "{}", nasty.name);
        }
    }
    let mut levels = vec![vec!["--faces", "400"], vec!["--error", "0.01"], vec!["--error", "1e-6"]];
    levels.push(vec!["--eye", "3,2,1", "--at", "0,0,0", "--pixels", "1", "--size", "400x300"]);
    for level in levels {
        let args = [&["extract", file, &mesh], &level[..]].concat();
        let report = succeed(nasty, &args);
        let soup = read_mesh(mesh.as_ref()).expect("what was written").to_soup();
        assert_eq!(soup.len() as u64, count(&report, "output_triangles"));
        assert!(soup.len() as u64 <= triangles, "{}: {args:?}", nasty.name);
        assert!(soup.iter().flatten().all(|p| p.is_finite()), "{}: {args:?}", nasty.name);
        assert!(
            encoding != "exact" || !is_watertight(&nasty.soup) || is_balanced(&soup),
            "{}: {args:?}: it was closed",
            nasty.name
        );
    }
    for detail in [["--pixels", "1"], ["--budget", "300"]] {
        let flown = [&["fly", file, "--frames", "4", "--size", "300x200"], &detail[..]].concat();
        let settling = &succeed(nasty, &flown)["settling"];
        assert!(settling.is_object(), "{}: {flown:?} does not come to rest", nasty.name);
    }
    // Where distances are no numbers, or averages of nothing, that is said.
    let compared = run(nasty, &["diff", &mesh, input, "--samples", "300"]);
    let compares = nasty.has_area() && nasty.soup.iter().flatten().all(|p| p.is_finite());
    assert_eq!(compared.is_some(), compares, "{}", nasty.name);
}

/// Goes through meshes with several hands.
fn each(meshes: &[Nasty], check: fn(&Nasty)) {
    let next = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |n| n.get().min(4)) {
            scope.spawn(|| {
                while let Some(nasty) =
                    meshes.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed))
                {
                    check(nasty);
                }
            });
        }
    });
}

#[test]
fn every_method_decimates_or_refuses() {
    each(&all(), decimate);
}

#[test]
fn every_method_decimates_the_same_shapes_of_more_triangles() {
    each(&fine(), decimate);
}

#[test]
fn every_format_takes_them() {
    each(&all(), convert);
}

#[test]
fn files_are_built_and_good_for_every_command() {
    each(&all(), build);
}

#[test]
fn files_with_many_levels_are_built_and_good_for_every_command() {
    each(&fine(), build);
}
