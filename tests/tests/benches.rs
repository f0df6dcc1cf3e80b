//! What is hot has benchmarks, and these are run once with the tests.

use xtask::bench;

/// Crates without a part that has to be fast.
const NEVER_HOT: [&str; 3] = ["xtask", "tests", "fuzz"];

#[test]
fn every_other_crate_has_benchmarks_that_are_run_with_the_tests() {
    let benches = bench::benches().unwrap();
    for package in tests::packages() {
        let name = package["name"].as_str().unwrap();
        let has = benches.iter().any(|bench| bench.krate == name);
        assert_eq!(has, !NEVER_HOT.contains(&name), "{name}");
    }
    for bench in benches {
        assert!(bench.is_tested, "{bench:?}: `test = true` is missing in its manifest");
    }
}
