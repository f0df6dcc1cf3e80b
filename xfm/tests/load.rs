//! A camera that jumps at random in almost no memory, for a short time: `cargo xtask load` does it for a long one.

mod common;

use common::{Folder, torus, xfm};
use serde_json::Value;

/// A model, and the least memory it can be flown in with so many loaders.
fn model(folder: &Folder, loaders: &str) -> (String, u64) {
    let file = folder.file("torus.xfm");
    if !std::path::Path::new(&file).exists() {
        let input = folder.write("torus.obj", torus(240, 120));
        xfm(&["build", &input, &file, "--json"]).json();
    }
    let opened = xfm(&["fly", &file, "--frames", "1", "--loaders", loaders, "--json"]).json();
    (file, opened["least_quota"].as_u64().expect("a number of bytes"))
}

fn jump(file: &str, hard_quota: u64, more: &[&str]) -> Value {
    let quota = hard_quota.to_string();
    let quotas = ["--hard-quota", &quota, "--soft-quota", &quota];
    let args = [&["fly", file, "--jumps", "--size", "640x360", "--json"], &quotas[..], more];
    let flown = xfm(&args.concat()).json();
    let number = |path: &str| flown.pointer(path).and_then(Value::as_f64).expect(path);
    assert!(number("/resident_bytes") <= hard_quota as f64);
    // The front has nodes of the pager only.
    assert!(number("/front_bytes") <= 6.0 * hard_quota as f64);
    flown
}

#[test]
fn everything_holds_wherever_the_camera_jumps() {
    let folder = Folder::new();
    for (loaders, fps, seed) in [("2", "240", "1"), ("2", "0", "2"), ("0", "0", "3")] {
        let (file, least) = model(&folder, loaders);
        let usual = ["--loaders", loaders, "--fps", fps, "--seed", seed, "--read-delay", "1"];
        let length = ["--seconds", "3", "--validate=3"];
        let flown = jump(&file, least + 200_000, &[&usual[..], &length].concat());
        let number = |path: &str| flown.pointer(path).and_then(Value::as_f64).expect(path);
        assert!(number("/validations") >= number("/frames") / 3.0);
        assert!(number("/jumps/jumps") > 3.0);
        assert_eq!(number("/damaged_pages"), 0.0);
        assert_eq!(number("/jumps/seed").to_string(), seed);
        // As many frames as there can be are over before the blocks have come.
        assert!(flown["settling"]["frames"].is_u64() || fps == "0" && loaders == "2", "{flown}");
        let samples = flown["memory"]["samples"].as_array().expect("samples");
        // A frame without loaders may take longer than a sample.
        assert!((40..=60).contains(&samples.len()) || loaders == "0", "{}", samples.len());
        // In so few seconds not all has been seen, but what grows by the frame would show.
        let growth = flown["memory"]["anonymous"]["growth"].as_f64();
        assert!(growth.is_none_or(|growth| growth < 0.5), "{}", flown["memory"]);
    }
}

#[test]
fn jumps_of_a_seed_are_the_same_every_time_and_of_another_are_not() {
    let folder = Folder::new();
    let (file, least) = model(&folder, "0");
    let fly = |seed: &str| {
        let more = ["--loaders", "0", "--fps", "0", "--frames", "150", "--seed", seed];
        let flown = jump(&file, least + 150_000, &more);
        let path = ["/jumps/jumps", "/blocks_loaded", "/blocks_evicted", "/triangles_shown"];
        path.map(|path| flown.pointer(path).and_then(Value::as_f64).expect(path))
    };
    let first = fly("7");
    assert_eq!(fly("7"), first);
    assert_ne!(fly("8"), first);
}

#[test]
fn everything_holds_over_damaged_files() {
    let folder = Folder::new();
    for loaders in ["0", "2"] {
        let (file, least) = model(&folder, loaders);
        let mut bytes = std::fs::read(&file).expect("the file is there");
        let length = bytes.len();
        for place in (length / 5..length * 4 / 5).step_by(length / 8) {
            bytes[place] ^= 4;
        }
        let damaged = folder.write("damaged.xfm", bytes);
        let more = ["--loaders", loaders, "--fps", "0", "--frames", "300", "--validate", "--seed"];
        let flown = jump(&damaged, least + 300_000, &[&more[..], &["4"]].concat());
        assert!(flown["damaged_pages"].as_u64().is_some_and(|pages| pages > 0), "{flown}");
        assert!(flown["validations"].as_u64().is_some_and(|checks| checks >= 300));
    }
}

#[test]
fn what_cannot_be_meant_is_wrong_usage() {
    let cases: [&[&str]; 5] = [
        &["--seed", "3"],
        &["--jumps", "--path", "orbit"],
        &["--frames", "5", "--seconds", "1"],
        &["--seconds", "0"],
        &["--validate=0"],
    ];
    for args in cases {
        let ran = xfm(&[&["fly", "a.xfm"], args].concat());
        assert_eq!(ran.code, 2, "{args:?}: {}", ran.stderr);
    }
}
