//! A build that is killed or interrupted at any moment is gone on with, to the same file.
#![cfg(unix)]

mod common;

use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{Folder, torus, xfm, xfm_with_input};

/// A build through a small buffer, with a folder for what it leaves.
struct Build {
    folder: Folder,
    scratch: Folder,
    obj: String,
    input: String,
    file: String,
    named: String,
    is_pipe: bool,
}

impl Build {
    fn new(is_pipe: bool) -> Self {
        let (folder, scratch) = (Folder::new(), Folder::new());
        let obj = torus(500, 250);
        let input = if is_pipe { "-".to_owned() } else { folder.write("torus.obj", &obj) };
        let (file, named) = (folder.file("torus.xfm"), scratch.file(""));
        Self { folder, scratch, obj, input, file, named, is_pipe }
    }

    fn args<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        let args = ["build", &self.input, &self.file, "--from", "obj", "--streaming"];
        let kept = ["--memory", "64MiB", "--scratch", &self.named, "--checkpoint-every", "0"];
        [&args[..], &kept, &["--json"], more].concat()
    }

    fn run(&self, more: &[&str]) -> common::Ran {
        match self.is_pipe {
            true => xfm_with_input(&self.args(more), self.obj.as_bytes()),
            false => xfm(&self.args(more)),
        }
    }

    /// Runs it and sends a signal a moment after it has written so many checkpoints; what it said.
    fn break_off(&self, more: &[&str], signal: &str, checkpoints: u32) -> (ExitStatus, String) {
        let mut last = self.checkpoint();
        let mut child = common::command(&self.args(more))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        let mut stdin = child.stdin.take().expect("standard input is a pipe");
        let ended = std::thread::scope(|scope| {
            // It stops reading when it is killed.
            scope.spawn(move || self.is_pipe.then(|| stdin.write_all(self.obj.as_bytes()).ok()));
            let mut seen = 0;
            while seen < checkpoints && child.try_wait().expect("it can be waited for").is_none() {
                sleep(Duration::from_millis(1));
                let now = self.checkpoint();
                seen += u32::from(now.is_some() && now != last);
                last = now;
            }
            sleep(Duration::from_millis(u64::from(7 * checkpoints % 20)));
            let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
            // It may have ended already.
            sent.expect("there is a kill");
            child.wait_with_output().expect("the binary ends")
        });
        (ended.status, String::from_utf8_lossy(&ended.stderr).into_owned())
    }

    /// What tells one checkpoint from another.
    fn checkpoint(&self) -> Option<(u64, i64)> {
        let names = self.scratch.names();
        let name = names.iter().find(|name| name.ends_with(".state"))?;
        let metadata = std::fs::metadata(self.scratch.file(name)).ok()?;
        Some((metadata.ino(), metadata.mtime_nsec()))
    }

    /// The bytes of the file that is built at once.
    fn at_once(&self) -> Vec<u8> {
        let report = self.run(&[]).json();
        assert_eq!(report["resumed"], false);
        assert!(self.scratch.names().is_empty());
        let bytes = std::fs::read(&self.file).expect("the file is there");
        std::fs::remove_file(&self.file).expect("it can be removed");
        bytes
    }
}

/// Whether there is a checkpoint, among files that may be left.
fn is_kept(names: &[String]) -> bool {
    let ends = |end: &str| names.iter().any(|name| name.ends_with(end));
    let known = |name: &&String| name.starts_with("torus.xfm-");
    assert!(names.iter().filter(known).count() == names.len(), "{names:?}");
    ends(".state")
}

fn killed_again_and_again(is_pipe: bool) {
    let build = Build::new(is_pipe);
    let expected = build.at_once();
    for step in 1..4 {
        let mut kills = 0;
        loop {
            let more: &[&str] = if kills == 0 { &[] } else { &["--resume"] };
            let (status, told) = build.break_off(more, "-KILL", step);
            if status.success() {
                break;
            }
            assert_eq!(status.code(), None, "{told}");
            if let Ok(bytes) = std::fs::read(&build.file) {
                assert!(bytes == expected, "whole, or not there");
            }
            assert!(is_kept(&build.scratch.names()));
            kills += 1;
            if kills == 4 {
                break;
            }
        }
        assert!(kills > 1, "{kills}");
        let kept = is_kept(&build.scratch.names());
        let report = build.run(&["--resume"]).json();
        assert_eq!(report["resumed"], kept, "{report}");
        assert_eq!(report["input_triangles"], 250_000);
        assert!(std::fs::read(&build.file).expect("the file is there") == expected);
        assert!(build.scratch.names().is_empty(), "{:?}", build.scratch.names());
        std::fs::remove_file(&build.file).expect("it can be removed");
    }
}

#[test]
fn a_build_of_a_file_that_is_killed_again_and_again() {
    killed_again_and_again(false);
}

#[test]
fn a_build_of_a_pipe_that_is_killed_again_and_again() {
    killed_again_and_again(true);
}

#[test]
fn an_interrupted_build_says_how_to_go_on_and_is_checked_before_it_does() {
    let build = Build::new(false);
    let expected = build.at_once();
    let (status, told) = build.break_off(&[], "-INT", 2);
    assert_eq!(status.code(), Some(130), "{told}");
    assert!(told.starts_with("error: interrupted; no output was written; "), "{told}");
    assert!(told.contains("--resume") && told.contains(&build.named), "{told}");
    assert!(is_kept(&build.scratch.names()) && !build.folder.names().contains(&"torus.xfm".into()));
    // Another length of the file, and another time.
    let other = build.folder.write("torus.obj", format!("{}\n", build.obj));
    let line = build.run(&["--resume"]).error_line().to_owned();
    assert!(line.contains("another input") && line.contains("--resume"), "{line}");
    std::fs::write(&other, &build.obj).expect("it can be written");
    let line = build.run(&["--resume"]).error_line().to_owned();
    assert!(line.contains("another input"), "it was written later: {line}");
    assert!(is_kept(&build.scratch.names()), "what is kept stays");
    // Without --resume it begins anew, and nothing is left of what was kept.
    let report = build.run(&[]).json();
    assert_eq!(report["resumed"], false);
    assert!(std::fs::read(&build.file).expect("the file is there") == expected);
    assert!(build.scratch.names().is_empty());
}

#[test]
fn two_builds_of_one_file_do_not_mix() {
    let build = Build::new(true);
    let mut child = common::command(&build.args(&[]))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    let mut stdin = child.stdin.take().expect("standard input is a pipe");
    stdin.write_all(build.obj.as_bytes()).expect("it reads all of it");
    let start = Instant::now();
    while build.scratch.names().is_empty() && start.elapsed() < Duration::from_secs(20) {
        sleep(Duration::from_millis(5));
    }
    for more in [&[][..], &["--resume"]] {
        let ran = build.run(more);
        assert!(ran.error_line().contains("in use by another run"), "{}", ran.stderr);
    }
    drop(stdin);
    assert_eq!(common::Ran::of(child).json()["resumed"], false);
    assert!(build.scratch.names().is_empty());
}
