//! What `xfm-view --offscreen` cannot write is said before the work, in one line, and everything stays as it was.
#![cfg(target_os = "linux")]

mod display;

use display::viewer::{command, torus};
use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;

/// The user and group that own nothing, by convention.
const NOBODY: u32 = 65534;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Nothing can be drawn: who finds that out first has not looked at the output.
fn assert_refused(folder: &Path, out: &str, user: Option<u32>) {
    let before = names(folder);
    let mut command = command(folder);
    if let Some(user) = user {
        command.uid(user).gid(user);
    }
    let output = command
        .args(["torus.ply", "--offscreen", out])
        .envs([("VK_DRIVER_FILES", "/nowhere"), ("VK_ICD_FILENAMES", "/nowhere")])
        .output()
        .expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{out}: {said}");
    assert!(said.starts_with(&format!("error: {out}: ")), "{out}: {said}");
    assert!(said.ends_with("its permissions and the free space\n"), "{out}: {said}");
    assert_eq!(said.lines().count(), 1, "{out}: {said}");
    assert_eq!(names(folder), before, "{out}");
}

#[test]
fn outputs_where_nothing_can_be_written_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    torus(&folder.join("torus.ply"), 12, 8);
    fs::create_dir(folder.join("folder.png")).expect("a folder");
    // As root, no permission is missing: a file in place of a folder, and file systems that take no files.
    for out in ["no/a.png", "torus.ply/a.png", "folder.png", "/proc/a.png", "/sys/a.png"] {
        assert_refused(folder, out, None);
    }
    for out in ["torus.ply", "torus.ply/frames", "/proc/frames", "/sys/new/frames"] {
        assert_refused(folder, out, None);
    }
}

/// Permissions do not stop root: then the viewer runs as nobody, whom all of this belongs to.
#[test]
fn what_must_not_be_written_to_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let is_root = fs::metadata("/proc/self").expect("a process").uid() == 0;
    let user = is_root.then_some(NOBODY);
    if is_root {
        let is_nobodys = chown(folder, user, user).is_ok();
        let ran = command(folder).arg("--version").uid(NOBODY).gid(NOBODY).output();
        if !is_nobodys || !ran.is_ok_and(|ran| ran.status.success()) {
            eprintln!("skipped: permissions do not stop root, who cannot run this as nobody here");
            return;
        }
    }
    torus(&folder.join("torus.ply"), 12, 8);
    let permit = |name: &str, mode| {
        fs::set_permissions(folder.join(name), Permissions::from_mode(mode)).expect("our own");
    };
    fs::create_dir(folder.join("locked")).expect("a folder");
    for name in ["old.png", "locked/old.png"] {
        fs::write(folder.join(name), "what was there before").expect("room for it");
    }
    permit("old.png", 0o444);
    permit("locked", 0o555);
    for out in ["old.png", "locked/old.png", "locked/new.png", "locked", "locked/frames"] {
        assert_refused(folder, out, user);
    }
    permit("locked", 0o755);
    for name in ["old.png", "locked/old.png"] {
        assert_eq!(fs::read(folder.join(name)).expect("it is there"), b"what was there before");
    }
}
