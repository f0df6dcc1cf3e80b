//! Ctrl-C at any moment: nothing remains but what was there, or else the whole output.
#![cfg(unix)]

mod common;

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{Folder, torus, xfm};

/// Runs a command again and again and interrupts it at moments all over the time it takes. `output` is what it writes.
fn interrupt_often(folder: &Folder, args: &[&str], output: Option<&str>) {
    let before = folder.names();
    let start = Instant::now();
    assert_eq!(xfm(args).code, 0, "{args:?}");
    let whole = start.elapsed();
    let mut interrupted = 0;
    const RUNS: u32 = 24;
    for run in 0..RUNS {
        if let Some(output) = output {
            std::fs::remove_file(folder.file(output)).ok();
        }
        // In an order that has nothing to do with that of the stages.
        let share = f64::from(run * 7 % RUNS) / f64::from(RUNS);
        let child = common::command(args)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        sleep(whole.mul_f64(share));
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
        // It may have ended already.
        sent.expect("there is a kill");
        let ended = child.wait_with_output().expect("the binary ends");
        let told = String::from_utf8_lossy(&ended.stderr);
        let mut expected = before.clone();
        match ended.status.code() {
            Some(0) => expected.extend(output.map(str::to_owned)),
            // Before it listened to signals at all.
            None => {}
            Some(code) => {
                assert_eq!(code, 130, "{args:?}: {told}");
                assert!(told.ends_with("error: interrupted; no output was written\n"), "{told}");
                interrupted += 1;
            }
        }
        expected.sort();
        assert_eq!(folder.names(), expected, "{args:?} after {share} of {whole:?}: {told}");
    }
    assert!(interrupted > 0, "{args:?} in {whole:?}: it was never interrupted");
    if let Some(output) = output {
        std::fs::remove_file(folder.file(output)).ok();
    }
}

#[test]
fn a_build_leaves_a_whole_file_or_none() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(300, 150));
    let file = folder.file("torus.xfm");
    for way in [&[][..], &["--streaming"], &["--streaming", "--memory", "64MiB"]] {
        let args = [&["build", &input, &file], way].concat();
        interrupt_often(&folder, &args, Some("torus.xfm"));
    }
}

#[test]
fn an_extraction_leaves_a_whole_mesh_or_none() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(300, 150));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    for output in ["out.ply", "out.stl"] {
        for memory in ["1GiB", "1MiB"] {
            let out = folder.file(output);
            let args = ["extract", &file, &out, "--full", "--memory", memory];
            interrupt_often(&folder, &args, Some(output));
        }
    }
}

#[test]
fn a_comparison_leaves_no_scratch_files() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(300, 150));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    let args = ["verify", &file, "--against", &input, "--memory", "1MiB"];
    interrupt_often(&folder, &args, None);
}

#[test]
fn an_older_output_stays_until_the_new_one_is_whole() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(300, 150));
    let file = folder.write("torus.xfm", "older");
    let child = common::command(&["build", &input, &file])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    sleep(Duration::from_millis(20));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    sent.expect("there is a kill");
    let ended = child.wait_with_output().expect("the binary ends");
    if ended.status.code() != Some(0) {
        assert_eq!(std::fs::read_to_string(file).expect("it is there"), "older");
    }
}
