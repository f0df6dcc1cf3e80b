//! Disks that are full, inputs that break off, files that change while they are read, runs that are killed: nothing is lost,
//! nothing is half written, nothing hangs, and what went wrong is said in one line.
#![cfg(target_os = "linux")]

mod common;

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use common::{Folder, Ran, command, torus, xfm};

/// What a shell makes of this, with `$XFM` for the binary.
fn shell(script: &str) -> Ran {
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(script).env("XFM", env!("CARGO_BIN_EXE_xfm")).stdin(Stdio::null());
    Ran::of(shell.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("there is a shell"))
}

/// A torus as OBJ, and as a file.
fn model(folder: &Folder) -> [String; 2] {
    let input = folder.write("torus.obj", torus(80, 40));
    let file = folder.file("torus.xfm");
    xfm(&["build", &input, &file, "--json"]).json();
    [input, file]
}

/// That a run failed in one line about one of these.
fn assert_told(ran: &Ran, what: &str, about: &[&str]) {
    let line = ran.error_line();
    assert!(about.iter().any(|name| line.contains(name)), "{what}: {line}");
}

#[test]
fn a_full_disk_is_told_and_leaves_what_was_there() {
    let folder = Folder::new();
    let [input, file] = model(&folder);
    let runs = [
        ("out.ply", format!("decimate {input} OUT --ratio 0.5")),
        ("out.stl", format!("decimate {input} OUT --ratio 0.5 --to stla")),
        ("out.glb", format!("decimate {input} OUT --ratio 0.5 --method greedy")),
        ("out.obj.gz", format!("decimate {input} OUT --ratio 0.5 --method cluster")),
        ("out.xfm", format!("build {input} OUT")),
        ("out.xfm", format!("build {input} OUT --streaming --memory 64MiB --encoding compact")),
        ("out.obj", format!("extract {file} OUT --full")),
        ("out.ply", format!("extract {file} OUT --full --memory 1MiB")),
        ("out.stl", format!("extract {file} OUT --faces 900")),
    ];
    let names = folder.names();
    for (name, run) in runs {
        let out = folder.file(name);
        let run = run.replace("OUT", &out);
        let ran = shell(&format!("$XFM {run}"));
        assert_eq!(ran.code, 0, "{run}: {}", ran.stderr);
        let size = fs::metadata(&out).expect("the output").len();
        for share in [0, 1, 3, 7, 9] {
            // Limits are in blocks of 512 bytes; what goes beyond is refused as on a full disk.
            let blocks = size * share / 10 / 512;
            fs::write(&out, "what was there before").expect("room for it");
            let ran = shell(&format!("trap '' XFSZ; ulimit -f {blocks}; exec $XFM {run}"));
            if ran.code != 0 {
                assert_told(&ran, &run, &[&out, folder.path().to_str().expect("UTF-8"), "/tmp"]);
                let there = fs::read(&out).expect("it is there still");
                assert_eq!(there, b"what was there before", "{run} with {blocks} blocks");
            }
            assert!(ran.code != 0 || share > 0, "{run} with {blocks} blocks");
            fs::remove_file(&out).expect("it is there");
            assert_eq!(folder.names(), names, "{run} with {blocks} blocks");
        }
    }
}

#[test]
fn what_cannot_be_written_to_a_device_or_stream_is_told() {
    let folder = Folder::new();
    let [input, file] = model(&folder);
    for run in [
        format!("decimate {input} /dev/full --ratio 0.5 --to ply"),
        format!("decimate {input} /dev/full --ratio 0.5 --to stl"),
        format!("decimate {input} /dev/full --ratio 0.5 --to glb --method cluster"),
        format!("extract {file} /dev/full --full --to obj"),
    ] {
        assert_told(&shell(&format!("$XFM {run}")), &run, &["/dev/full"]);
    }
    for run in [
        format!("decimate {input} - --ratio 0.5 --to stl"),
        format!("extract {file} - --full --to obj"),
        format!("info {file}"),
        format!("info {file} --json"),
        format!("verify {file} --json"),
        format!("diff {input} {input} --samples 100 --json"),
        format!("fly {file} --frames 3 --json"),
    ] {
        let ran = shell(&format!("$XFM {run} > /dev/full"));
        assert!(ran.code == 1 || run.starts_with("info") && ran.code == 0, "{run}: {}", ran.code);
        assert!(ran.code == 0 || ran.stderr.contains("error: "), "{run}: {}", ran.stderr);
    }
    // Where nothing can be said, the exit code still tells.
    for closed in ["2>/dev/full", "2>&-", ">&- 2>&-"] {
        let good = shell(&format!("$XFM verify {file} {closed}"));
        assert!([0, 1].contains(&good.code), "{closed}: {}", good.code);
        let bad = shell(&format!("$XFM verify {input} {closed}"));
        assert_eq!(bad.code, 1, "{closed}");
    }
}

#[test]
fn outputs_where_nothing_can_be_written_are_refused() {
    let folder = Folder::new();
    let [input, file] = model(&folder);
    let below = format!("{input}/out");
    let missing = folder.file("no/such/folder/out");
    let itself = folder.path().to_str().expect("UTF-8").to_owned();
    let names = folder.names();
    // As root, no permission is missing: a file in place of a folder, and file systems that take no files.
    for out in [below.as_str(), &missing, &itself, "/proc/out", "/sys/out", "/dev/null/out"] {
        for run in [
            vec!["build", &input, out],
            vec!["build", &input, out, "--streaming"],
            vec!["decimate", &input, out, "--ratio", "0.5", "--to", "ply"],
            vec!["decimate", &input, out, "--ratio", "0.5", "--to", "glb", "--method", "greedy"],
            vec!["extract", &file, out, "--full", "--to", "obj"],
        ] {
            let parent = Path::new(out).parent().and_then(Path::to_str).expect("UTF-8");
            assert_told(&xfm(&run), &format!("{run:?}"), &[out, &format!("{parent}: ")]);
        }
    }
    for scratch in [&input, &missing, "/proc", "/sys"] {
        let out = folder.file("out.xfm");
        let run = ["build", &input, &out, "--streaming", "--memory", "64MiB", "--scratch", scratch];
        let ran = xfm(&run);
        // A mesh so small may need no scratch files.
        if ran.code == 0 {
            fs::remove_file(&out).expect("it was written");
        } else {
            assert_told(&ran, &format!("{run:?}"), &[scratch]);
        }
    }
    assert_eq!(folder.names(), names);
}

#[test]
fn inputs_that_cannot_be_read_or_break_off_are_told() {
    let folder = Folder::new();
    let [input, file] = model(&folder);
    let out = folder.file("out.ply");
    let itself = folder.path().to_str().expect("UTF-8").to_owned();
    // Reading the memory of a process at its beginning is an input/output error.
    for broken in ["/proc/self/mem", &itself, "/proc/no/such/file"] {
        for run in [
            vec!["build", broken, &out, "--from", "stl"],
            vec!["decimate", broken, &out, "--ratio", "0.5", "--from", "obj"],
            vec!["decimate", broken, &out, "--ratio", "0.5", "--from", "ply", "--method", "greedy"],
            vec!["diff", broken, &input],
            vec!["info", broken],
            vec!["verify", broken],
            vec!["extract", broken, &out, "--full"],
            vec!["fly", broken],
        ] {
            assert_told(&xfm(&run), &format!("{run:?}"), &[broken]);
        }
    }
    // A writer that goes away in the middle.
    let counted = folder.file("torus.ply");
    xfm(&["decimate", &input, &counted, "--ratio", "1", "--json"]).json();
    let text = fs::read(&counted).expect("the input");
    let names = folder.names();
    let fifo = folder.file("fifo");
    for cut in [0, 10, text.len() / 3, text.len() - 5] {
        for run in [
            format!("decimate {fifo} {out} --ratio 0.5 --from ply"),
            format!("build {fifo} {out} --from ply"),
        ] {
            assert_eq!(shell(&format!("mkfifo {fifo}")).code, 0);
            let half = text[..cut].to_vec();
            let to = fifo.clone();
            let writer = thread::spawn(move || fs::write(to, half));
            let ran = shell(&format!("exec $XFM {run}"));
            assert_told(&ran, &run, &[&fifo]);
            // It may not have been read to its end.
            drop(writer.join().expect("the writer does not panic"));
            fs::remove_file(&fifo).expect("it is there");
            assert_eq!(folder.names(), names, "{run}");
        }
    }
    assert_eq!(xfm(&["verify", &file]).code, 0);
}

#[test]
fn a_killed_run_leaves_a_whole_output_or_none() {
    let folder = Folder::new();
    let input = folder.write("torus.obj", torus(240, 120));
    let runs: [(&str, &[&str]); 4] = [
        ("out.xfm", &["build", "IN", "OUT"]),
        ("out.xfm", &["build", "IN", "OUT", "--streaming", "--memory", "64MiB"]),
        ("out.ply", &["decimate", "IN", "OUT", "--ratio", "0.5"]),
        ("out.glb", &["decimate", "IN", "OUT", "--ratio", "0.9", "--method", "cluster"]),
    ];
    for (name, run) in runs {
        let out = folder.file(name);
        let args: Vec<&str> = run
            .iter()
            .map(|&arg| match arg {
                "IN" => input.as_str(),
                "OUT" => out.as_str(),
                other => other,
            })
            .collect();
        let start = Instant::now();
        assert_eq!(xfm(&args).code, 0, "{args:?}");
        let whole = start.elapsed();
        let expected = fs::read(&out).expect("the output");
        let mut killed = 0;
        const RUNS: u32 = 25;
        for turn in 0..RUNS {
            fs::remove_file(&out).ok();
            let mut child = command(&args)
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("the binary runs");
            thread::sleep(whole.mul_f64(f64::from(turn * 7 % RUNS) / f64::from(RUNS - 2)));
            child.kill().expect("a child can be killed");
            let ended = child.wait().expect("it can be waited for");
            killed += u32::from(ended.code().is_none());
            if let Ok(there) = fs::read(&out) {
                assert!(there == expected, "{args:?}: half an output");
                fs::remove_file(&out).expect("it is there");
            }
            remove_hidden(&folder);
            let names = folder.names();
            assert_eq!(names, ["torus.obj"], "{args:?}: something is left");
        }
        assert!(killed > 0, "{args:?} was never killed in {whole:?}");
        fs::remove_file(&out).ok();
    }
}

#[test]
fn readers_of_a_file_that_is_replaced_have_the_one_or_the_other() {
    let folder = Folder::new();
    let file = folder.file("model.xfm");
    let inputs = [(60, 30), (90, 40)].map(|(n, m)| {
        let input = folder.write(&format!("{n}.obj"), torus(n, m));
        (input, u64::from(2 * n * m))
    });
    xfm(&["build", &inputs[0].0, &file, "--json"]).json();
    let end = Instant::now() + Duration::from_secs(3);
    thread::scope(|scope| {
        scope.spawn(|| {
            for turn in 1.. {
                if Instant::now() > end {
                    break;
                }
                let encoding = ["exact", "compact"][turn / 2 % 2];
                let input = &inputs[turn % 2].0;
                xfm(&["build", input, &file, "--encoding", encoding, "--json"]).json();
            }
        });
        for reader in 0..3 {
            let (folder, file, inputs) = (&folder, &file, &inputs);
            scope.spawn(move || {
                let out = folder.file(&format!("out-{reader}.ply"));
                while Instant::now() < end {
                    let memory = ["1GiB", "1MiB"][reader % 2];
                    let full = ["extract", file, &out, "--full", "--memory", memory, "--json"];
                    let count = xfm(&full).json()["output_triangles"].clone();
                    assert!(inputs.iter().any(|(_, triangles)| count == *triangles), "{count}");
                    assert_eq!(xfm(&["verify", file]).code, 0);
                    assert_eq!(xfm(&["fly", file, "--frames", "3", "--size", "200x100"]).code, 0);
                    assert_eq!(xfm(&["info", file]).code, 0);
                }
            });
        }
    });
}

/// Removes what was being written when a run was ended at once: nobody was left to do it. It has a hidden name.
fn remove_hidden(folder: &Folder) {
    for name in folder.names().iter().filter(|name| name.starts_with('.') && name.ends_with(".tmp"))
    {
        fs::remove_file(folder.file(name)).expect("it is there");
    }
}

/// Cuts a file short again and again while a command reads it.
fn shorten_while(folder: &Folder, path: &str, args: &[&str], out: Option<&str>) {
    let bytes = fs::read(path).expect("the file");
    let start = Instant::now();
    assert_eq!(xfm(args).code, 0, "{args:?}");
    let whole = start.elapsed();
    let expected = out.map(|out| fs::read(out).expect("the output"));
    let mut told = 0;
    const RUNS: u32 = 20;
    for turn in 0..RUNS {
        if let Some(out) = out {
            fs::remove_file(out).ok();
        }
        let names = folder.names();
        let child = command(args)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        thread::sleep(whole.mul_f64(f64::from(turn * 7 % RUNS) / f64::from(RUNS)));
        let mut file = fs::OpenOptions::new().write(true).open(path).expect("the file");
        file.set_len(bytes.len() as u64 / 3).expect("it can be cut");
        let ran = Ran::of(child);
        file.write_all(&bytes).expect("room for it");
        drop(file);
        match ran.code {
            0 => {
                let there = out.map(|out| fs::read(out).expect("the output"));
                assert!(there == expected, "{args:?}: another output");
            }
            _ => {
                assert!(ran.stderr.contains("error: "), "{args:?}: {}", ran.stderr);
                assert_eq!(ran.code, 1, "{args:?}: {}", ran.stderr);
                remove_hidden(folder);
                assert_eq!(folder.names(), names, "{args:?}: {}", ran.stderr);
                told += 1;
            }
        }
    }
    assert!(told > 0, "{args:?}: it was never cut short in time");
}

#[test]
fn a_file_that_is_cut_short_while_it_is_read_is_told() {
    let folder = Folder::new();
    let text = folder.write("torus.obj", torus(240, 120));
    let (binary, file) = (folder.file("torus.ply"), folder.file("torus.xfm"));
    let out = folder.file("out.ply");
    xfm(&["build", &text, &file, "--json"]).json();
    // Large enough to be on more than a few pages of memory.
    let large = folder.write("large.obj", torus(600, 300));
    xfm(&["decimate", &large, &binary, "--ratio", "1", "--json"]).json();
    fs::remove_file(large).expect("it is there");
    for input in [&text, &binary] {
        let args = ["decimate", input, &out, "--ratio", "0.3"];
        shorten_while(&folder, input, &args, Some(&out));
        let args = ["build", input, &out];
        shorten_while(&folder, input, &args, Some(&out));
    }
    fs::remove_file(&out).ok();
    let args = ["extract", &file, &out, "--full", "--memory", "1MiB"];
    shorten_while(&folder, &file, &args, Some(&out));
    assert!(Path::new(&file).exists());
}

/// The pages that are gone cost their detail; the frames go on.
#[test]
fn a_file_that_is_cut_short_while_a_camera_flies_past_is_flown_past_to_the_end() {
    let folder = Folder::new();
    let (text, file) = (folder.write("torus.obj", torus(240, 120)), folder.file("torus.xfm"));
    xfm(&["build", &text, &file, "--json"]).json();
    let bytes = fs::read(&file).expect("the file");
    let slow = ["--frames", "40", "--fps", "60", "--read-delay", "10", "--pixels", "0.2"];
    let args = [&["fly", &file, "--json"], &slow[..]].concat();
    assert_eq!(xfm(&args).json()["damaged_pages"], 0);
    let mut most = 0;
    for turn in 0..8 {
        let child = command(&args)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        thread::sleep(Duration::from_millis(50 * turn));
        let cut = bytes.len() as u64 * (turn % 3) / 3;
        let there = fs::OpenOptions::new().write(true).open(&file).expect("the file");
        there.set_len(cut).expect("it can be cut");
        let start = Instant::now();
        let ran = Ran::of(child);
        assert!(start.elapsed() < Duration::from_secs(60), "it waits for what never comes");
        match ran.code {
            0 => most = most.max(ran.json()["damaged_pages"].as_u64().expect("a number")),
            // It was not open yet.
            _ => assert_told(&ran, &format!("{args:?}"), &[&file]),
        }
        fs::write(&file, &bytes).expect("room for it");
    }
    assert!(most > 0, "it was never cut short in time");
}
