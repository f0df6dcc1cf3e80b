//! Outputs and scratch folders that must not be written to, of every command that writes: this is said before the work, in one
//! line with a remedy, and everything stays as it was.
//!
//! Permissions do not stop root: then the binary runs as nobody.
#![cfg(target_os = "linux")]

mod common;

use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use common::{Folder, Ran, torus, xfm};

/// The user and group that own nothing, by convention.
const NOBODY: u32 = 65534;

/// Somebody whom permissions stop.
struct User {
    binary: String,
    is_nobody: bool,
}

impl User {
    /// Who runs this test, or nobody if that is root; in a folder that is then nobody's. `None`, and a line that says so, where
    /// root cannot become anybody else.
    fn in_folder(folder: &Folder) -> Option<Self> {
        let is_nobody = fs::metadata("/proc/self").expect("a process").uid() == 0;
        let mut user = Self { binary: env!("CARGO_BIN_EXE_xfm").to_owned(), is_nobody };
        if !is_nobody {
            return Some(user);
        }
        chown(folder.path(), Some(NOBODY), Some(NOBODY)).ok()?;
        if user.can_run() {
            return Some(user);
        }
        // What root builds may lie where only root may look.
        let copy = folder.file("xfm");
        fs::copy(&user.binary, &copy).expect("room for it");
        user.binary = copy;
        let can = user.can_run();
        if !can {
            eprintln!("skipped: permissions do not stop root, who cannot become nobody here");
        }
        can.then_some(user)
    }

    fn can_run(&self) -> bool {
        let ran = self.command(&["--version"]).output();
        ran.is_ok_and(|ran| ran.status.success())
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(&self.binary);
        command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        if self.is_nobody {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }

    fn xfm(&self, args: &[&str]) -> Ran {
        Ran::of(self.command(args).spawn().expect("the binary runs"))
    }
}

fn permit(path: &str, mode: u32) {
    fs::set_permissions(path, Permissions::from_mode(mode)).expect("our own file");
}

impl Drop for Place {
    /// So that it can be removed.
    fn drop(&mut self) {
        fs::set_permissions(self.folder.file("locked"), Permissions::from_mode(0o755)).ok();
    }
}

/// Everything below a folder, with its content.
fn content(folder: &Path) -> Vec<(String, Option<Vec<u8>>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(content(&path));
        }
        found.push((path.display().to_string(), fs::read(&path).ok()));
    }
    found.sort();
    found
}

/// A folder with a model as OBJ and as file.
struct Place {
    folder: Folder,
    input: String,
    file: String,
}

impl Place {
    fn new() -> Self {
        let folder = Folder::new();
        let input = folder.write("torus.obj", torus(80, 40));
        let file = folder.file("torus.xfm");
        xfm(&["build", &input, &file, "--json"]).json();
        Self { folder, input, file }
    }

    /// A folder in it that takes no files, with one that is there already.
    fn locked(&self) -> [String; 2] {
        let locked = self.folder.file("locked");
        fs::create_dir(&locked).expect("a folder");
        let old = format!("{locked}/old");
        fs::write(&old, "what was there before").expect("room for it");
        // The file itself may be written to.
        permit(&old, 0o666);
        permit(&locked, 0o555);
        [locked, old]
    }

    /// Every way to write to `out`, scratch files wherever they go by themselves or into `scratch`.
    fn runs(&self, out: &str, scratch: &str) -> Vec<Vec<String>> {
        let Self { input, file, .. } = self;
        let runs = [
            format!("decimate {input} {out} --ratio 0.5 --to ply"),
            format!("decimate {input} {out} --ratio 0.5 --to stl --method greedy"),
            format!("decimate {input} {out} --ratio 0.5 --to glb --method cluster"),
            format!("decimate {input} {out} --ratio 0.5 --to obj --scratch {scratch}"),
            format!("build {input} {out}"),
            format!("build {input} {out} --streaming --memory 64MiB --encoding compact"),
            format!("build {input} {out} --scratch {scratch}"),
            format!("build {input} {out} --scratch {scratch} --resume"),
            format!("extract {file} {out} --full --to ply"),
            format!("extract {file} {out} --faces 900 --to obj"),
            format!("extract {file} {out} --full --memory 1 --scratch {scratch} --to stl"),
        ];
        runs.iter().map(|run| run.split(' ').map(str::to_owned).collect()).collect()
    }

    /// That each of these fails with a line that begins with `name` and has one of `remedies`, and changes nothing.
    fn assert_refused(&self, user: &User, runs: &[Vec<String>], name: &str, remedies: &[&str]) {
        let before = content(self.folder.path());
        for run in runs {
            let ran = user.xfm(&run.iter().map(String::as_str).collect::<Vec<_>>());
            let line = ran.error_line();
            assert!(line.starts_with(&format!("{name}: ")), "{run:?}: {line}");
            assert!(remedies.iter().any(|remedy| line.contains(remedy)), "{run:?}: {line}");
            assert!(content(self.folder.path()) == before, "{run:?} left something behind");
        }
    }
}

#[test]
fn a_folder_that_takes_no_files_is_told() {
    let place = Place::new();
    let Some(user) = User::in_folder(&place.folder) else { return };
    let [locked, old] = place.locked();
    let scratch = place.folder.path().to_str().expect("UTF-8");
    for out in [&format!("{locked}/new"), &old] {
        let remedies = ["check the folder's permissions and free space, or choose another one"];
        place.assert_refused(&user, &place.runs(out, scratch), out, &remedies);
    }
    permit(&locked, 0o777);
    for out in [&format!("{locked}/new"), &old] {
        for run in place.runs(out, scratch) {
            assert_ran(&user, &run);
        }
    }
}

/// That nothing else is in the way.
fn assert_ran(user: &User, run: &[String]) {
    let ran = user.xfm(&run.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(ran.code, 0, "{run:?}: {}", ran.stderr);
}

#[test]
fn a_file_that_must_not_be_written_to_stays() {
    let place = Place::new();
    let Some(user) = User::in_folder(&place.folder) else { return };
    let old = place.folder.write("old", "what was there before");
    let link = place.folder.file("link");
    std::os::unix::fs::symlink(&old, &link).expect("a link");
    permit(&old, 0o444);
    let scratch = place.folder.path().to_str().expect("UTF-8");
    for out in [&old, &link] {
        let remedies = ["change its permissions, or choose another name"];
        place.assert_refused(&user, &place.runs(out, scratch), out, &remedies);
    }
}

#[test]
fn a_folder_that_is_not_there_or_in_place_of_the_output_is_told() {
    let place = Place::new();
    let Some(user) = User::in_folder(&place.folder) else { return };
    let scratch = place.folder.path().to_str().expect("UTF-8");
    let missing = place.folder.file("no/such/out");
    place.assert_refused(&user, &place.runs(&missing, scratch), &missing, &["create it first"]);
    let [locked, _] = place.locked();
    for folder in [scratch, &locked] {
        let remedies = ["give the mesh a name of its own", "give it a name of its own"];
        place.assert_refused(&user, &place.runs(folder, scratch), folder, &remedies);
    }
}

#[test]
fn a_scratch_folder_that_takes_no_files_is_told() {
    let place = Place::new();
    let Some(user) = User::in_folder(&place.folder) else { return };
    let [locked, _] = place.locked();
    let missing = place.folder.file("no/such/folder");
    for scratch in [&locked, &missing] {
        let mut runs = place.runs(&place.folder.file("out"), scratch);
        runs.retain(|run| run.iter().any(|arg| arg == "--scratch"));
        let Place { input, file, .. } = &place;
        let against = format!("verify {file} --against {input} --memory 1 --scratch {scratch}");
        runs.push(against.split(' ').map(str::to_owned).collect());
        place.assert_refused(
            &user,
            &runs,
            scratch,
            &["another folder with --scratch", "another one with --scratch"],
        );
    }
}

/// What an earlier run has left must be written to, to go on.
#[test]
fn what_is_kept_in_a_folder_that_is_locked_by_then_stays() {
    let place = Place::new();
    let Some(user) = User::in_folder(&place.folder) else { return };
    let [locked, _] = place.locked();
    permit(&locked, 0o777);
    let large = place.folder.write("large.obj", torus(500, 250));
    let out = place.folder.file("out");
    let args = ["build", &large, &out, "--streaming", "--memory", "64MiB", "--scratch", &locked];
    let args = [&args[..], &["--checkpoint-every", "0"]].concat();
    let mut child = user.command(&args).spawn().expect("the binary runs");
    while !has_state(&locked) && child.try_wait().expect("our own child").is_none() {
        std::thread::yield_now();
    }
    child.kill().expect("a child can be killed");
    child.wait().expect("it can be waited for");
    assert!(has_state(&locked), "it ended before it was killed");
    permit(&locked, 0o555);
    let resume = [&args[..], &["--resume"]].concat();
    let runs = [resume.iter().map(|&arg| arg.to_owned()).collect::<Vec<_>>()];
    place.assert_refused(&user, &runs, &locked, &["another folder with --scratch"]);
    permit(&locked, 0o777);
    assert_ran(&user, &runs[0]);
}

fn has_state(folder: &str) -> bool {
    let entries = fs::read_dir(folder).expect("a folder");
    entries.flatten().any(|entry| entry.path().extension().is_some_and(|end| end == "state"))
}

/// A device or a named pipe is no place for a file that appears whole: it would be replaced.
#[test]
fn what_is_neither_file_nor_folder_is_not_replaced_by_a_file() {
    let place = Place::new();
    let fifo = place.folder.file("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().is_ok_and(|status| status.success()));
    let ran = xfm(&["build", &place.input, &fifo]);
    assert!(ran.error_line().starts_with(&format!("{fifo}: ")), "{}", ran.stderr);
    assert!(!fs::metadata(&fifo).expect("it is there").is_file());
}
