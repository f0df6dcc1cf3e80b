//! `xfm diff` from the outside.

mod common;

use common::{Folder, bumpy_square, flat_square, xfm};

fn close(value: &serde_json::Value, expected: f64) -> bool {
    value.as_f64().is_some_and(|value| (value - expected).abs() <= 1e-9 * expected.abs())
}

#[test]
fn json_has_the_promised_keys_and_the_right_numbers() {
    let folder = Folder::new();
    let a = folder.write("a.obj", flat_square(0.0));
    let b = folder.write("b.obj", flat_square(0.5));
    let ran = xfm(&["diff", &a, &b, "--samples", "2000", "--json"]);
    let report = ran.json();
    assert_eq!(ran.stderr, "", "no bar where there is no terminal");
    assert!(close(&report["diagonal"], 2_f64.sqrt()));
    for side in ["a_to_b", "b_to_a"] {
        for value in ["max", "mean", "rms"] {
            assert!(close(&report[side][value], 0.5), "{report}");
            let percent = &report[side][format!("{value}_percent")];
            assert!(close(percent, 50.0 / 2_f64.sqrt()), "{report}");
        }
    }
    assert_eq!(report["samples"], 2000);
    assert_eq!(report["a_triangles"], 2);
    assert!(report["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0));
}

#[test]
fn people_get_a_table_on_standard_error() {
    let folder = Folder::new();
    let a = folder.write("a.obj", flat_square(0.0));
    let b = folder.write("b.obj", flat_square(0.5));
    let ran = xfm(&["diff", &a, &b, "--samples", "2000"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(ran.stdout, "");
    for told in ["diagonal of A", "A to B", "B to A", "0.5 (35.36 %)", "2,000 samples"] {
        assert!(ran.stderr.contains(told), "{told} in {}", ran.stderr);
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    let a = folder.write("a.obj", bumpy_square(40, 0.0));
    let b = folder.write("b.obj", bumpy_square(9, 0.0));
    let with = |threads: &str| {
        let ran = xfm(&["diff", &a, &b, "--samples", "30000", "--threads", threads, "--json"]);
        let mut report = ran.json();
        report["seconds"] = serde_json::Value::Null;
        report
    };
    let reference = with("1");
    assert_eq!(with("2"), reference);
    assert_eq!(with("5"), reference);
}

#[test]
fn failures_name_the_file_and_the_remedy_on_one_line() {
    let folder = Folder::new();
    let good = folder.write("good.obj", flat_square(0.0));
    let cases = [
        (folder.file("missing.obj"), "missing.obj"),
        (folder.write("vertices.obj", "v 0 0 0\nv 1 0 0\n"), "no triangles"),
        (folder.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "zero area"),
        (folder.write("range.obj", "v 0 0 0\nf 1 1 9\n"), "9"),
        (folder.write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "not finite"),
    ];
    for (bad, told) in cases {
        for args in [["diff", &good, &bad], ["diff", &bad, &good]] {
            let ran = xfm(&args);
            let line = ran.error_line();
            assert!(line.contains(&bad), "{line}");
            assert!(line.contains(told), "{line}");
            assert!(line.contains(';'), "a remedy: {line}");
        }
    }
}
