//! `build`, `info`, `verify` and `extract` from the outside.

mod common;

use common::{Folder, bumpy_square, torus, xfm, xfm_with_input};

#[test]
fn a_torus_goes_in_and_comes_out_whole() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(60, 30));
    let file = folder.file("torus.xfm");
    let built = xfm(&["build", &input, &file, "--json"]).json();
    assert_eq!(built["input_triangles"], 3600);
    assert_eq!(built["mode"], "in-core");
    assert_eq!(built["scratch_bytes"], 0);
    assert!(
        built["repaired"].as_object().is_some_and(|repaired| repaired.values().all(|n| n == 0))
    );
    for positive in ["seconds", "file_bytes", "tree_depth", "blocks", "fill"] {
        assert!(built[positive].as_f64().is_some_and(|value| value > 0.0), "{positive}: {built}");
    }
    if cfg!(target_os = "linux") {
        let [anon, rss] = ["peak_anon", "peak_rss"].map(|key| built[key].as_u64().expect(key));
        assert!(anon > 0 && anon <= rss);
    }
    assert_eq!(folder.names(), ["torus.obj", "torus.xfm"], "nothing else is left");

    let info = xfm(&["info", &file, "--json"]).json();
    assert_eq!(info["version"], 2);
    assert_eq!(info["origin"], serde_json::json!([0.0, 0.0, 0.0]));
    assert_eq!(info["precision"], "single");
    assert_eq!(info["encoding"], "exact");
    assert_eq!(info["input_triangles"], 3600);
    for same in ["nodes", "blocks", "pages", "tree_depth", "fill", "file_bytes"] {
        assert_eq!(info[same], built[same], "{same}");
    }
    let on_disk = std::fs::metadata(&file).expect("the file is there").len();
    assert_eq!(info["file_bytes"], on_disk);
    assert!(info["bytes"]["position"].as_u64().is_some_and(|bytes| bytes > 0));
    assert_eq!(info["attributes"][0]["name"], "position");
    assert!(info["bounds"]["min"][2].as_f64().is_some_and(|z| (-0.36..-0.34).contains(&z)));

    let verified = xfm(&["verify", &file, "--against", &input, "--json"]).json();
    assert_eq!(verified["ok"], true);
    assert_eq!(verified["errors"].as_array().map(Vec::len), Some(0));
    assert_eq!(verified["against"]["missing"], 0);
    assert_eq!(verified["against"]["extra"], 0);

    let full = folder.file("full.ply");
    let extracted = xfm(&["extract", &file, &full, "--full", "--json"]).json();
    assert_eq!(extracted["output_triangles"], 3600);
    assert_eq!(extracted["error"], 0.0);
    let diff = xfm(&["diff", &input, &full, "--samples", "5000", "--json"]).json();
    for side in ["a_to_b", "b_to_a"] {
        assert!(diff[side]["max"].as_f64().is_some_and(|max| max < 1e-9), "{diff}");
    }
}

#[test]
fn a_level_of_a_compact_file_is_about_as_good() {
    let folder = Folder::new();
    let input = folder.write("square.obj", bumpy_square(90, 0.0));
    let rms = |encoding: &str| {
        let file = folder.file("square.xfm");
        xfm(&["build", &input, &file, "--encoding", encoding, "--json"]).json();
        let level = folder.file("level.ply");
        xfm(&["extract", &file, &level, "--faces", "800", "--json"]).json();
        let diff = xfm(&["diff", &input, &level, "--samples", "20000", "--json"]).json();
        ["a_to_b", "b_to_a"].map(|side| diff[side]["rms"].as_f64().expect("a distance"))
    };
    let (exact, compact) = (rms("exact"), rms("compact"));
    for side in 0..2 {
        assert!(compact[side] < 1.2 * exact[side], "{compact:?} of {exact:?}");
    }
}

#[test]
fn levels_come_by_faces_by_error_and_for_a_camera() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(80, 40));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let extract = |how: &[&str]| {
        let out = folder.file("out.obj");
        let report = xfm(&[&["extract", &file, &out, "--json"], how].concat()).json();
        let diff = xfm(&["diff", &input, &out, "--samples", "5000", "--json"]).json();
        let triangles = report["output_triangles"].as_u64().expect("a count");
        assert_eq!(diff["b_triangles"], triangles);
        (triangles, report["error"].as_f64().expect("an error"))
    };
    assert_eq!(extract(&["--faces", "2000"]).0, 2000);
    let (coarse, error) = extract(&["--error", "0.05"]);
    assert!(error <= 0.05);
    let (fine, error) = extract(&["--error", "0.01"]);
    assert!(error <= 0.01);
    assert!(coarse < fine && fine < 6400, "{coarse} {fine}");
    let seen =
        extract(&["--eye", "-4,0,1", "--at", "-1,0,0", "--pixels", "2", "--size", "640x480"]).0;
    assert!(seen < 6400);
}

#[test]
fn a_pipe_goes_in_and_a_mesh_comes_out_of_one() {
    let folder = Folder::new();
    let file = folder.file("field.xfm");
    let obj = bumpy_square(30, 0.0);
    let built = xfm_with_input(&["build", "-", &file, "--from", "obj", "--json"], obj.as_bytes());
    assert_eq!(built.json()["input_triangles"], 1800);
    let again = xfm(&["extract", &file, "-", "--full", "--to", "obj", "--json"]);
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert_eq!(again.stdout.lines().filter(|line| line.starts_with("f ")).count(), 1800);
    let report: serde_json::Value =
        serde_json::from_str(&again.stderr).expect("the report is beside the mesh");
    assert_eq!(report["output_triangles"], 1800);
    let verified =
        xfm_with_input(&["verify", &file, "--against", "-", "--from", "obj"], obj.as_bytes());
    assert_eq!(verified.code, 0, "{}", verified.stderr);
}

#[cfg(unix)]
#[test]
fn the_format_of_a_pipe_shows_in_its_content() {
    let folder = Folder::new();
    let input = folder.write("field.obj", bumpy_square(10, 0.0));
    let file = folder.file("field.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let ply = folder.file("field.ply");
    xfm(&["extract", &file, &ply, "--full", "--json"]).json();
    let bytes = std::fs::read(&ply).expect("the mesh is there");
    let built = xfm_with_input(&["build", "-", &file, "--json"], &bytes);
    assert_eq!(built.json()["input_triangles"], 200);
}

#[test]
fn a_flight_reports_every_step() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(120, 60));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let flown = xfm(&["fly", &file, "--frames", "20", "--pixels", "2", "--json"]).json();
    assert_eq!(flown["frames"], 20);
    for number in ["triangles_shown", "updates", "tests", "blocks_loaded", "resident_bytes"] {
        assert!(flown[number].as_f64().is_some_and(|value| value > 0.0), "{number}: {flown}");
    }
    for spread in ["frame_s", "update_s", "test_s", "handover_s", "load_s"] {
        let [median, p99, max] =
            ["median", "p99", "max"].map(|key| flown[spread][key].as_f64().expect(key));
        assert!(0.0 <= median && median <= p99 && p99 <= max, "{spread}: {flown}");
    }
    let told = xfm(&["fly", &file, "--frames", "5"]);
    assert_eq!((told.code, told.stdout.as_str()), (0, ""));
    for column in ["triangles shown", "(U)", "(VT)", "(BL)", "median", "p99", "max"] {
        assert!(told.stderr.contains(column), "{column} in {}", told.stderr);
    }
}

#[test]
fn a_flight_keeps_its_budget_and_its_quota() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(150, 80));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let flown = xfm(&["fly", &file, "--frames", "40", "--budget", "3000", "--json"]).json();
    let most = flown["per_frame"]["triangles_shown"]["max"].as_f64().expect("a count");
    assert!(most <= 3000.0 * 1.1 && most > 1500.0, "{flown}");
    let quota = ["--soft-quota", "600KiB", "--hard-quota", "700KiB"];
    let args = [&["fly", &file, "--frames", "40", "--pixels", "0.5", "--json"][..], &quota];
    let flown = xfm(&args.concat()).json();
    assert!(flown["resident_bytes"].as_u64().is_some_and(|bytes| bytes <= 700 << 10), "{flown}");
    let ran = xfm(&["fly", &file, "--hard-quota", "1KiB"]);
    let line = ran.error_line();
    assert!(line.contains("torus.xfm") && line.contains("hard quota"), "{line}");
}

#[test]
fn a_flight_follows_a_path_from_a_file() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(40, 20));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let path = folder.write("path.txt", "# there and back\n0 0 5 0 0 0\n0 1 3 0 0 0 0 1 0\n");
    let flown = xfm(&["fly", &file, "--path", &path, "--frames", "7", "--json"]).json();
    assert_eq!(flown["frames"], 7);
    let bad = folder.write("bad.txt", "0 0 5 0 0 0\n0 1\n");
    let ran = xfm(&["fly", &file, "--path", &bad]);
    let line = ran.error_line();
    assert!(line.contains("bad.txt") && line.contains("line 2"), "{line}");
    let ran = xfm(&["fly", &file, "--path", &folder.file("none.txt")]);
    assert!(ran.error_line().contains("none.txt"));
}

#[test]
fn the_file_is_the_same_for_any_number_of_threads() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(50, 40));
    let with = |threads: &str| {
        let file = folder.file("torus.xfm");
        xfm(&["build", &input, &file, "--threads", threads, "--json"]).json();
        std::fs::read(file).expect("the file is there")
    };
    let reference = with("1");
    assert!(with("2") == reference);
    assert!(with("5") == reference);
}

#[test]
fn dirty_input_is_repaired_counted_and_verified() {
    let folder = Folder::new();
    // Three triangles on one edge, one twice, one with an edge of no length, one with a corner that is not a number.
    let input = folder.write(
        "dirty.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv nan 0 0\n\
         f 1 2 3\nf 2 1 4\nf 1 2 5\nf 1 2 3\nf 1 1 2\nf 1 2 6\n",
    );
    let file = folder.file("dirty.xfm");
    let built = xfm(&["build", &input, &file, "--json"]).json();
    let repaired = &built["repaired"];
    for kind in ["non_finite", "duplicate", "degenerate", "non_manifold"] {
        assert_eq!(repaired[kind], 1, "{kind}: {built}");
    }
    let verified = xfm(&["verify", &file, "--against", &input, "--json"]).json();
    assert_eq!(verified["against"]["repaired_triangles"], 3);
    let told = xfm(&["build", &input, &file]);
    assert!(told.stderr.contains("1 duplicate"), "{}", told.stderr);
}

#[test]
fn damage_is_found_named_and_fails() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(60, 30));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let whole = std::fs::read(&file).expect("the file is there");
    let bad = folder.file("bad.xfm");
    for place in (0..whole.len()).step_by(whole.len() / 37) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x10;
        std::fs::write(&bad, bytes).expect("written");
        let ran = xfm(&["verify", &bad]);
        assert_eq!(ran.code, 1, "byte {place}");
        let line = ran.stderr.lines().last().expect("an error line");
        assert!(line.starts_with("error: ") && line.contains("bad.xfm"), "byte {place}: {line}");
    }
    // In the middle lie the pages.
    let mut bytes = whole.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x01;
    std::fs::write(&bad, bytes).expect("written");
    let ran = xfm(&["verify", &bad, "--json"]);
    assert_eq!(ran.code, 1);
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).expect("a report as well");
    assert_eq!(report["ok"], false);
    assert!(report["errors"][0]["page"].is_u64(), "{report}");
    assert!(report["errors"][0]["message"].is_string());
    std::fs::write(&bad, &whole[..whole.len() - 1]).expect("written");
    let ran = xfm(&["verify", &bad, "--json"]);
    assert_eq!(ran.code, 1);
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).expect("a report as well");
    assert!(report["errors"][0]["field"].is_string(), "{report}");
}

#[test]
fn verify_tells_one_mesh_from_another() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(40, 20));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let mut other = torus(40, 20);
    other = other.replacen("f 1 2 42\n", "", 1);
    let other = folder.write("other.obj", other);
    let ran = xfm(&["verify", &file, "--against", &other]);
    let line = ran.error_line();
    assert!(line.contains("triangles: 0 of 1,599 are missing and 1 are not in"), "{line}");
}

#[test]
fn failures_name_the_file_and_the_remedy_on_one_line() {
    let folder = Folder::new();
    let square = folder.write("square.obj", common::flat_square(0.0));
    let out = folder.file("out.xfm");
    let empty = folder.write("empty.obj", "v 0 0 0\n");
    let missing = folder.file("missing.xfm");
    let nowhere = folder.file("no/such/folder.xfm");
    let folder_itself = folder.file("");
    let large = folder.write("large.obj", torus(60, 30));
    let cases: [(&[&str], &str, &str); 9] = [
        (&["build", &folder.file("missing.ply"), &out], "missing.ply", "check"),
        (&["build", &empty, &out], "empty.obj", "no triangle"),
        (&["build", &square, &nowhere], "folder.xfm", "create it first"),
        (&["build", &square, &folder_itself], &folder_itself, "name"),
        (&["build", &large, &out, "--in-core", "--memory", "1MiB"], "large.obj", "raise --memory"),
        (
            &["build", &square, &out, "--encoding", "compact", "--position-error", "1e-9"],
            "too far",
            "error",
        ),
        (&["info", &square], "square.obj", "xfm build"),
        (&["verify", &missing], "missing.xfm", "open"),
        (&["extract", &missing, &out, "--full"], "missing.xfm", "open"),
    ];
    for (args, name, told) in cases {
        let ran = xfm(args);
        let line = ran.error_line();
        assert!(line.contains(name) && line.contains(told), "{args:?}: {line}");
    }
    assert!(!folder.names().contains(&"out.xfm".to_owned()), "{:?}", folder.names());
}

#[test]
fn wrong_usage_exits_with_2() {
    let cases: [&[&str]; 11] = [
        &["fly", "a.xfm", "--pixels", "1", "--budget", "5"],
        &["fly", "a.xfm", "--hard-quota", "much"],
        &["build", "a.obj"],
        &["build", "a.obj", "b.xfm", "--memory", "lots"],
        &["build", "a.obj", "b.xfm", "--levels", "6"],
        &["build", "a.obj", "b.xfm", "--encoding", "tiny"],
        &["build", "a", "b.xfm", "--from", "step"],
        &["extract", "a.xfm", "b.obj"],
        &["extract", "a.xfm", "b.obj", "--full", "--faces", "5"],
        &["extract", "a.xfm", "b.obj", "--pixels", "1"],
        &["verify", "a.xfm", "--from", "ply"],
    ];
    for args in cases {
        let ran = xfm(args);
        assert_eq!(ran.code, 2, "{args:?}: {}", ran.stderr);
    }
}

/// The vertices of an OBJ text, in order of their coordinates.
fn vertices(obj: &str) -> Vec<[f64; 3]> {
    let lines = obj.lines().filter_map(|line| line.strip_prefix("v "));
    let mut vertices: Vec<[f64; 3]> = lines
        .map(|line| {
            let numbers: Vec<f64> =
                line.split(' ').map(|word| word.parse().expect("a number")).collect();
            [numbers[0], numbers[1], numbers[2]]
        })
        .collect();
    vertices.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    vertices
}

#[test]
fn coordinates_far_from_zero_keep_their_place_and_their_digits() {
    let folder = Folder::new();
    let near = torus(60, 30);
    let mut far = String::new();
    for line in near.lines() {
        match line.strip_prefix("v ") {
            Some(line) => {
                // Steps of 1/4096, which the sums hold exactly.
                let numbers = line.split(' ').map(|word| word.parse::<f64>().expect("a number"));
                let by = [512_345.0, -5_403_210.0, 0.0];
                let moved = numbers.zip(by).map(|(x, by)| (x * 4096.0).round() / 4096.0 + by);
                let words: Vec<String> = moved.map(|x| x.to_string()).collect();
                far += &format!("v {}\n", words.join(" "));
            }
            None => far += &format!("{line}\n"),
        }
    }
    let input = folder.write("far.obj", &far);
    let file = folder.file("far.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let info = xfm(&["info", &file, "--json"]).json();
    assert_eq!(info["origin"], serde_json::json!([512_346.0, -5_403_210.0, 0.0]));
    assert_eq!(info["precision"], "double");
    let least = info["bounds"]["min"][1].as_f64().expect("a number");
    assert!((-5_403_211.39..-5_403_211.3).contains(&least), "{least}");
    let told = xfm(&["info", &file]).stderr;
    assert!(told.contains("origin     512346, -5403210, 0, input in double precision"), "{told}");

    let full = folder.file("full.obj");
    let report = xfm(&["extract", &file, &full, "--full", "--json"]).json();
    assert_eq!(report["warnings"], serde_json::json!([]));
    let text = std::fs::read_to_string(&full).expect("the mesh is there");
    assert_eq!(vertices(&text), vertices(&far));
    let verified = xfm(&["verify", &file, "--against", &input, "--json"]).json();
    assert_eq!((&verified["against"]["missing"], &verified["ok"]), (&0.into(), &true.into()));

    // The same mesh, told from another vertex on, has another origin.
    let from_the_middle: String = {
        let (mut vertices, faces): (Vec<&str>, Vec<&str>) =
            far.lines().partition(|line| line.starts_with("v "));
        let (count, skip) = (vertices.len(), 15 * 60 + 30);
        vertices.rotate_left(skip);
        let face = |line: &&str| {
            let corners = line[2..].split(' ').map(|word| word.parse::<usize>().expect("a corner"));
            let corners: Vec<String> =
                corners.map(|v| ((v - 1 + count - skip) % count + 1).to_string()).collect();
            format!("f {}\n", corners.join(" "))
        };
        let rotated = vertices.iter().map(|line| format!("{line}\n"));
        rotated.chain(faces.iter().map(face)).collect()
    };
    let other = folder.write("other.obj", from_the_middle);
    let other_file = folder.file("other.xfm");
    xfm(&["build", &other, &other_file, "--json"]).json();
    let other_info = xfm(&["info", &other_file, "--json"]).json();
    assert_ne!(other_info["origin"], info["origin"]);
    let verified = xfm(&["verify", &file, "--against", &other, "--json"]).json();
    assert_eq!(verified["ok"], true);

    // A camera stands in the input's frame.
    let out = folder.file("seen.obj");
    let seen = |eye: &str, at: &str| {
        let args = ["extract", &file, &out, "--pixels", "2", "--eye", eye, "--at", at, "--json"];
        xfm(&args).json()["output_triangles"].as_u64().expect("a count")
    };
    let beside = seen("512341,-5403210,1", "512344,-5403210,0");
    assert!(beside > seen("-4,0,1", "-1,0,0"));
    // Formats without doubles lose digits, which is said.
    let ran = xfm(&["extract", &file, &folder.file("full.stl"), "--full"]);
    assert!(ran.stderr.contains("warning: ") && ran.stderr.contains("steps of 0.5"));
}

#[test]
fn a_build_says_how_long_each_stage_took() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(60, 30));
    let file = folder.file("torus.xfm");
    let built = xfm(&["build", &input, &file, "--in-core", "--json"]).json();
    assert_eq!(built["resumed"], false);
    let stages = ["read", "collapse", "number", "write"]
        .map(|stage| built["stages"][stage].as_f64().expect(stage));
    assert!(stages[1] > 0.0 && stages[2] > 0.0 && stages[3] > 0.0, "{built}");
    assert!(stages.iter().sum::<f64>() <= built["seconds"].as_f64().expect("a time"));
    let told = xfm(&["build", &input, &file]);
    assert!(told.stderr.contains("collapsed in"), "{}", told.stderr);
    let folder = ["--scratch", "/no/such/folder"];
    let ran = xfm(&[&["build", &input, &file][..], &folder].concat());
    assert!(ran.error_line().contains("--scratch"));
}

#[test]
fn both_ways_of_building_keep_every_triangle() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(200, 100));
    let file = folder.file("torus.xfm");
    for way in ["--in-core", "--streaming"] {
        let built = xfm(&["build", &input, &file, way, "--json"]).json();
        assert_eq!(built["mode"], way.trim_start_matches("--"));
        assert_eq!(built["input_triangles"], 40_000);
        for memory in ["1GiB", "1MiB"] {
            let args = ["verify", &file, "--against", &input, "--memory", memory];
            let ran = xfm(&args);
            assert_eq!(ran.code, 0, "{way} {memory}: {}", ran.stderr);
        }
    }
    // Of a pipe nobody knows how long it is.
    let obj = torus(20, 20);
    let built = xfm_with_input(&["build", "-", &file, "--from", "obj", "--json"], obj.as_bytes());
    assert_eq!(built.json()["mode"], "streaming");
}
