//! Exit codes, help and usage errors of the command line as a whole.

mod common;

use common::{Folder, flat_square, xfm};

#[test]
fn help_goes_to_standard_output_and_succeeds() {
    for args in [&["--help"][..], &["diff", "--help"], &["help", "diff"], &["--version"]] {
        let ran = xfm(args);
        assert_eq!(ran.code, 0, "{args:?}");
        assert_ne!(ran.stdout, "", "{args:?}");
        assert_eq!(ran.stderr, "", "{args:?}");
    }
}

#[test]
fn wrong_usage_exits_with_2_and_says_what_is_wrong() {
    let cases: [(&[&str], &str); 10] = [
        (&[], "Usage"),
        (&["melt"], "melt"),
        (&["diff"], "<A>"),
        (&["diff", "a.obj"], "<B>"),
        (&["diff", "a.obj", "b.obj", "--samples", "0"], "--samples"),
        (&["diff", "a.obj", "b.obj", "--threads", "x"], "--threads"),
        (&["build", "a.obj", "a.xfm", "--resume"], "--scratch"),
        (&["build", "a.obj", "a.xfm", "--in-core", "--streaming"], "--streaming"),
        (&["build", "a.obj", "a.xfm", "--checkpoint-every", "5"], "--scratch"),
        (&["build", "a.obj", "a.xfm", "--scratch", ".", "--checkpoint-every", "x"], "seconds"),
    ];
    for (args, told) in cases {
        let ran = xfm(args);
        assert_eq!(ran.code, 2, "{args:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{args:?}: {}", ran.stderr);
        assert_eq!(ran.stdout, "", "{args:?}");
    }
}

#[test]
fn a_reader_that_closes_the_report_early_is_no_failure() {
    let folder = Folder::new();
    let square = folder.write("square.obj", flat_square(0.0));
    let mut child = common::command(&["diff", &square, &square, "--samples", "1000", "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the binary runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the binary ends");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(output.stderr, b"");
}

#[cfg(unix)]
#[test]
fn an_interruption_ends_at_once_and_leaves_nothing() {
    use std::io::Write;
    use std::process::{Command, Stdio};

    let folder = Folder::new();
    let mut child = common::command(&["build", "-", &folder.file("out.xfm"), "--from", "obj"])
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    // The pipe stays open: without the signal the command would wait for more.
    let mut stdin = child.stdin.take().expect("standard input is a pipe");
    // More than a pipe holds: once it is all written, the command is reading.
    stdin.write_all(&b"v 0 0 0\n".repeat(1 << 17)).expect("the command reads");
    let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signal.is_ok_and(|status| status.success()));
    let output = child.wait_with_output().expect("the binary ends");
    drop(stdin);
    assert_eq!(output.status.code(), Some(130));
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(told, "error: interrupted; no output was written\n");
    assert_eq!(folder.names(), Vec::<String>::new());
}
