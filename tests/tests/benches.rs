//! What is hot has benchmarks, and these are run once with the tests.

use std::process::Command;

use xtask::bench;

/// Crates without a part that has to be fast.
const NEVER_HOT: [&str; 3] = ["xtask", "tests", "fuzz"];

#[test]
fn every_other_crate_has_benchmarks_that_are_run_with_the_tests() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let benches = bench::benches().unwrap();
    for package in metadata["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        let has = benches.iter().any(|bench| bench.krate == name);
        assert_eq!(has, !NEVER_HOT.contains(&name), "{name}");
    }
    for bench in benches {
        assert!(bench.is_tested, "{bench:?}: `test = true` is missing in its manifest");
    }
}
