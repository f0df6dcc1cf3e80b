//! `xfm-view` as its user meets it: in a window, by keys and mouse, and by the errors it gives.
//!
//! Every viewer here runs under the validation layer, which ends it with an error if it has anything to say.
#![cfg(target_os = "linux")]

mod display;

use display::Display;
use display::drop::drop_file;
use display::viewer::{Viewer, command, torus, view};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;
use tempfile::TempDir;

const MIDDLE: [i16; 2] = [450, 330];

/// A display, and a folder with a mesh in it.
fn scene() -> (Display, TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = folder.path().join("torus.ply");
    torus(&mesh, 120, 80);
    (Display::start(), folder, mesh)
}

fn distance(frame: &Value) -> f64 {
    let v = view(frame);
    (0..3).map(|k| (v[k] - v[k + 3]).powi(2)).sum::<f64>().sqrt()
}

fn says(frame: &Value, words: &str) -> bool {
    let notices = frame["notices"].as_array().expect("a list");
    notices.iter().any(|notice| notice.as_str().is_some_and(|text| text.contains(words)))
}

fn files(folder: &Path, part: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.to_string_lossy().contains(part))
        .collect();
    found.sort();
    found
}

#[test]
fn the_mouse_turns_moves_and_zooms() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply"]);
    let first = viewer.settled();
    display.drag(viewer.window, 1, MIDDLE, [550, 360]);
    let turned = viewer.other_view(&first);
    assert_eq!(view(&turned)[3..6], view(&first)[3..6], "it turns around the same point");
    assert!((distance(&turned) - distance(&first)).abs() < 1e-3);

    display.drag(viewer.window, 3, MIDDLE, [500, 330]);
    let moved = viewer.other_view(&turned);
    assert_ne!(view(&moved)[3..6], view(&turned)[3..6]);
    assert!((distance(&moved) - distance(&turned)).abs() < 1e-3);

    display.point(viewer.window, [600, 300]);
    (0..4).for_each(|_| {
        display.button(4, true);
        display.button(4, false);
    });
    let near = viewer.other_view(&moved);
    assert!(distance(&near) < 0.65 * distance(&moved), "four notches nearer");
    display.key("f");
    let whole = viewer.other_view(&near);
    assert!((distance(&whole) - distance(&first)).abs() < 1e-3, "F shows the whole model");
    viewer.quit();
}

#[test]
fn keys_walk_stand_on_axes_and_fly() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply"]);
    let mut last = viewer.settled();
    // Front, back, left, right, top, bottom: along which axis the eye lies, and on which side.
    for (key, axis, sign) in [
        ("1", 2, 1.0),
        ("2", 2, -1.0),
        ("3", 0, -1.0),
        ("4", 0, 1.0),
        ("5", 1, 1.0),
        ("6", 1, -1.0),
    ] {
        display.key(key);
        last = viewer.other_view(&last);
        let v = view(&last);
        let along = (v[axis] - v[axis + 3]) * sign;
        assert!((along - distance(&last)).abs() < 1e-3, "{key}: {v:?}");
    }
    display.key("1");
    let front = viewer.other_view(&last);
    display.press("w");
    sleep(Duration::from_millis(300));
    display.release("w");
    let walked = viewer.other_view(&front);
    let (a, b) = (view(&front), view(&walked));
    assert!(b[2] < a[2] - 1e-3 && (b[0] - a[0]).abs() < 1e-4, "forwards: {a:?} {b:?}");

    viewer.key_until("g", "fly mode", |f| f["fly"] == true);
    display.drag(viewer.window, 1, MIDDLE, [520, 330]);
    let looked = viewer.other_view(&walked);
    let eyes = view(&looked).into_iter().zip(&b).take(3);
    assert!(eyes.into_iter().all(|(a, b)| (a - b).abs() < 1e-4), "the eye stays where it is");
    viewer.key_until("Escape", "end of flying", |f| f["fly"] == false);
    display.key("u");
    let z_up = viewer.other_view(&looked);
    assert!(view(&z_up)[8].abs() > 0.9, "z is upwards: {:?}", view(&z_up));
    viewer.quit();
}

#[test]
fn panels_are_clicked_dragged_and_hidden() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply"]);
    let first = viewer.settled();
    // The help's button is at the right end of the bar.
    display.click(viewer.window, [875, 16], 1);
    viewer.until("help", |f| f["help"] == true);
    viewer.key_until("Escape", "end of the help", |f| f["help"] == false);
    viewer.key_until("?", "help", |f| f["help"] == true);
    viewer.key_until("F1", "end of the help", |f| f["help"] == false);
    // The first slider is the error in pixels; to the right it is coarser.
    display.drag(viewer.window, 1, [70, 108], [130, 108]);
    let coarse =
        viewer.until("coarser model", |f| f["pixels"].as_f64() > Some(3.0) && f["settled"] == true);
    assert!(coarse["triangles_shown"].as_u64() < first["triangles_shown"].as_u64());
    assert_eq!(coarse["view"], first["view"], "a slider does not turn the model");
    viewer.key_until("+", "finer", |f| f["pixels"].as_f64() < coarse["pixels"].as_f64());
    // Each shading, once around.
    for name in ["Flat", "Wireframe", "Level of detail", "Blocks", "In memory", "Normals", "Smooth"]
    {
        viewer.key_until("m", name, |f| f["shading"] == name);
    }
    let with = display.shot(viewer.window);
    viewer.key_until("h", "hidden panels", |f| says(f, "H shows the panels again"));
    sleep(Duration::from_millis(300));
    let without = display.shot(viewer.window);
    let changed = with.bgrx.iter().zip(&without.bgrx).filter(|(a, b)| a != b).count();
    assert!(changed > with.bgrx.len() / 20, "{changed} bytes differ");
    assert!(without.num_colours() > 200, "the model is still there");
    viewer.quit();
}

#[test]
fn detail_is_held_by_triangles_or_time_and_kept_within_memory() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply", "--pixels", "0.2"]);
    let fine = viewer.settled();
    let quota = |f: &Value| f["hard_quota"].as_u64().expect("a number");
    let shown = |f: &Value| f["triangles_shown"].as_u64().expect("a number");
    // The second of the three is the number of triangles, which the slider takes to its least: a thousand.
    display.click(viewer.window, [130, 83], 1);
    viewer.until("triangles held", |f| f["held"] == "triangles");
    display.drag(viewer.window, 1, [120, 108], [10, 108]);
    viewer.until("few triangles", |f| shown(f) < 1_300 && f["settled"] == true);
    // The third is the time of a frame: it has all it wants.
    display.click(viewer.window, [190, 83], 1);
    viewer.until("time held", |f| f["held"] == "time");
    viewer.until("other detail", |f| shown(f) != 1_000);
    display.click(viewer.window, [50, 83], 1);
    viewer.until("error held", |f| f["held"] == "pixels");
    viewer.until("what it was", |f| shown(f) == shown(&fine) && f["settled"] == true);
    // The limit of memory, to the left: less, and it holds.
    let before = quota(&viewer.settled());
    display.drag(viewer.window, 1, [81, 357], [30, 357]);
    let less = viewer.until("less memory", |f| quota(f) < before);
    assert!(less["resident_bytes"].as_u64() <= less["hard_quota"].as_u64(), "{less}");
    viewer.settled();
    viewer.quit();
}

#[test]
fn points_are_picked_and_the_model_cut_open() {
    let (display, folder, _) = scene();
    let view_arg = ["torus.ply", "--view", "0,4,0 0,0,0 0,0,-1"];
    let viewer = Viewer::start(&display, folder.path(), &view_arg);
    viewer.settled();
    viewer.key_until("t", "measuring", |f| f["measuring"] == true);
    // From above; the tube's ridge is around one unit from the middle, which the hole is in.
    let up_px = 300.0 / (22.5_f64.to_radians().tan() * 3.65);
    let ridge = [450, 300 - up_px as i16];
    display.click(viewer.window, [450, 300], 1);
    viewer.until("word about the hole", |f| says(f, "no surface"));
    display.click(viewer.window, ridge, 1);
    let one = viewer.until("one point", |f| f["points"].as_array().map(Vec::len) == Some(1));
    // The word about the hole is in the way.
    viewer.until("picture without words", |f| f["notices"] == serde_json::json!([]));
    display.click(viewer.window, [450, 300 + up_px as i16], 1);
    let two = viewer.until("two points", |f| f["points"].as_array().map(Vec::len) == Some(2));
    let at = |i: usize, k: usize| two["points"][i][k].as_f64().expect("a number");
    assert!((at(0, 2) + 1.0).abs() < 0.1 && (at(0, 1) - 0.35).abs() < 0.08, "{one}");
    assert!((at(1, 2) - 1.0).abs() < 0.1 && at(1, 0).abs() < 0.1, "{two}");
    // Cut at the middle towards the eye, the upper half is away, and its inside is seen: red.
    let whole = display.shot(viewer.window);
    viewer.key_until("x", "section", |f| f["section"].as_f64() == Some(0.5));
    sleep(Duration::from_millis(300));
    let reds = |shot: &display::Shot| {
        let red = |p: &&[u8]| p[2] > 60 && p[2] / 2 > p[1] && p[2] / 2 > p[0];
        shot.bgrx.chunks(4).filter(red).count()
    };
    let (before, after) = (reds(&whole), reds(&display.shot(viewer.window)));
    assert!(after > before + 5000, "{before} and {after} red pixels");
    // What is cut away is not picked: the point below is.
    sleep(Duration::from_millis(500));
    display.click(viewer.window, ridge, 1);
    let below = viewer.until("new point", |f| f["points"].as_array().map(Vec::len) == Some(1));
    assert!(below["points"][0][1].as_f64() < Some(-0.2), "{}", below["points"]);
    viewer.quit();
}

#[test]
fn the_detail_is_frozen_and_seen_from_outside() {
    let (display, folder, _) = scene();
    let args = ["torus.ply", "--view", "1.6,0.2,0.4 1,0,0"];
    let viewer = Viewer::start(&display, folder.path(), &args);
    let near = viewer.settled();
    viewer.key_until("l", "frozen detail", |f| f["frozen"] == true);
    display.key("o");
    let outside = viewer.other_view(&near);
    assert!(distance(&outside) > 2.0 * distance(&near));
    assert_eq!(outside["triangles_shown"], near["triangles_shown"], "it does not follow");
    viewer.key_until("l", "detail that follows", |f| {
        f["frozen"] == false
            && f["settled"] == true
            && f["triangles_shown"] != near["triangles_shown"]
    });
    viewer.quit();
}

#[test]
fn pictures_paths_and_views_are_taken_along() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply"]);
    let first = viewer.settled();
    viewer.key_until("p", "picture", |f| says(f, "torus-view-001.png"));
    viewer.key_until("shift+p", "picture with panels", |f| says(f, "torus-view-002.png"));
    let pictures = files(folder.path(), "torus-view");
    let [plain, panels] = [0, 1].map(|i| {
        let file = fs::File::open(&pictures[i]).expect("a picture");
        let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("PNG");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut bytes).expect("pixels");
        assert_eq!((info.width, info.height), (900, 600));
        bytes
    });
    assert_ne!(plain, panels);

    viewer.key_until("ctrl+c", "copied view", |f| says(f, "Copied"));
    display.key("3");
    let left = viewer.other_view(&first);
    display.key("ctrl+v");
    let back = viewer.other_view(&left);
    for (a, b) in view(&first).iter().zip(view(&back)) {
        assert!((a - b).abs() < 1e-4, "{first} {back}");
    }

    viewer.key_until("r", "recording", |f| f["recording"] == true);
    display.drag(viewer.window, 1, MIDDLE, [650, 380]);
    let there = viewer.other_view(&back);
    sleep(Duration::from_millis(300));
    viewer.key_until("r", "written path", |f| says(f, "torus-path-001.txt"));
    let text = fs::read_to_string(folder.path().join("torus-path-001.txt")).expect("a path");
    let path = mergetree::CameraPath::parse(&text).expect("a camera path");
    assert!(path.len() > 5, "{} poses", path.len());
    display.key("1");
    let front = viewer.other_view(&there);
    viewer.key_until("y", "replay", |f| f["replaying"] == true);
    let end = viewer.until("end of the replay", |f| f["replaying"] == false);
    assert_ne!(end["view"], front["view"]);
    for (a, b) in view(&there).iter().zip(view(&end)) {
        assert!((a - b).abs() < 1e-3, "it ends where the recording did: {there} {end}");
    }
    viewer.quit();
}

#[test]
fn windows_change_their_size_go_away_and_come_back() {
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply"]);
    viewer.settled();
    for (width, height) in [(640, 400), (1203, 777), (200, 120), (900, 600)] {
        display.resize(viewer.window, width, height);
        viewer.until("new size", |f| f["size"][0] == width && f["size"][1] == height);
    }
    display.hide(viewer.window);
    sleep(Duration::from_millis(300));
    let hidden = viewer.frames().len();
    sleep(Duration::from_millis(500));
    assert!(viewer.frames().len() <= hidden + 10, "nothing is drawn that nobody sees");
    display.show(viewer.window);
    display.focus(viewer.window);
    viewer.key_until("g", "life", |f| f["fly"] == true);
    sleep(Duration::from_millis(300));
    assert!(display.shot(viewer.window).num_colours() > 200);
    viewer.quit();
}

#[test]
fn a_lost_device_is_opened_again() {
    let (display, folder, _) = scene();
    let args = ["torus.ply", "--lose-device", "4"];
    let viewer = Viewer::start(&display, folder.path(), &args);
    viewer.key_until("m", "word about the loss", |f| says(f, "has been opened again"));
    viewer.settled();
    viewer.key_until("m", "further frame", |f| f["shading"] == "Wireframe");
    sleep(Duration::from_millis(300));
    assert!(display.shot(viewer.window).num_colours() > 200, "the model is there again");
    viewer.quit();
}

#[test]
fn files_are_dropped_good_ones_and_bad_ones() {
    let (display, folder, mesh) = scene();
    let viewer = Viewer::start(&display, folder.path(), &[]);
    let empty = viewer.until("an empty window", |f| f["opening"] == false);
    assert_eq!(empty["model"], false);
    drop_file(&display, viewer.window, &mesh);
    viewer.settled();
    let bad = folder.path().join("bad.xfm");
    fs::write(&bad, b"this is no hierarchy").expect("a file");
    drop_file(&display, viewer.window, &bad);
    let after = viewer.until("word about the bad file", |f| says(f, "bad.xfm"));
    assert_eq!(after["model"], true, "what was there stays");
    viewer.quit();
}

#[test]
fn a_mesh_is_built_beside_itself_where_that_is_wanted() {
    let (display, folder, mesh) = scene();
    let built = folder.path().join("torus.ply.xfm");
    for round in 0..2 {
        let viewer = Viewer::start(&display, folder.path(), &["torus.ply", "--cache", "beside"]);
        viewer.settled();
        assert!(built.exists());
        viewer.quit();
        if round == 0 {
            // What is newer than the mesh is used as it is: the mesh is not even read.
            let time = fs::metadata(&mesh).expect("a file").modified().expect("a time");
            fs::write(&mesh, "no mesh any more").expect("a file");
            let file = fs::File::options().write(true).open(&mesh).expect("a file");
            file.set_modified(time).expect("its old time");
        }
    }
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply", "--cache", "temporary"]);
    viewer.until("word about the mesh", |f| says(f, "torus.ply"));
    viewer.quit();
}

#[test]
fn what_is_missing_is_said_with_what_to_do() {
    let (display, folder, _) = scene();
    let fails = |command: &mut std::process::Command, words: &[&str]| {
        let output = command.output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        let line = said.lines().find(|l| l.starts_with("error:") && !l.contains("XDG"));
        let line = line.unwrap_or_else(|| panic!("no error: {said}"));
        words.iter().for_each(|word| assert!(line.contains(word), "{line}"));
    };
    fails(command(folder.path()).arg("torus.ply"), &["no window", "--offscreen"]);
    let driver = [("VK_DRIVER_FILES", "/nowhere"), ("VK_ICD_FILENAMES", "/nowhere")];
    let offscreen = ["torus.ply", "--offscreen", "out.png"];
    fails(
        command(folder.path()).args(offscreen).envs(driver),
        &["no Vulkan driver", "mesa-vulkan-drivers"],
    );
    fails(
        command(folder.path()).arg("torus.ply").envs(driver).env("DISPLAY", display.name()),
        &["no Vulkan driver", "mesa-vulkan-drivers"],
    );
    fails(command(folder.path()).args(["none.xfm", "--offscreen", "out.png"]), &["none.xfm"]);
    fails(command(folder.path()).args([".", "--offscreen", "out.png"]), &["folder"]);
    fails(
        command(folder.path()).args(offscreen).args(["--view", "1 2 3"]),
        &["no view", "nine numbers"],
    );
}

/// No leak, however long it runs. Ten thousand frames: `XFM_VIEW_FRAMES=10000 cargo test -p vk-render --test viewer memory`.
#[test]
fn memory_does_not_grow_from_frame_to_frame() {
    let frames = std::env::var("XFM_VIEW_FRAMES").ok().and_then(|text| text.parse().ok());
    let frames: usize = frames.unwrap_or(400);
    let (display, folder, _) = scene();
    let viewer = Viewer::start(&display, folder.path(), &["torus.ply", "--size", "400x300"]);
    viewer.settled();
    let resident_kib = || {
        let status = fs::read_to_string(format!("/proc/{}/status", viewer.id())).expect("alive");
        let line = status.lines().find(|line| line.starts_with("VmRSS")).expect("a line");
        line.split_whitespace().nth(1).and_then(|n| n.parse::<u64>().ok()).expect("a number")
    };
    let count = || {
        let log = fs::read(folder.path().join("log.jsonl")).expect("a log");
        log.iter().filter(|&&byte| byte == b'\n').count()
    };
    // All there is, once: pipelines and fonts come when they are first used.
    (0..7).for_each(|_| {
        display.key("m");
        sleep(Duration::from_millis(150));
    });
    display.key("x");
    display.key("x");
    let mut early = None;
    let mut step = 0_i16;
    while count() < frames {
        // Around and around, now and then another shading.
        step = (step + 1) % 400;
        let x = 290 + if step < 200 { step } else { 400 - step } / 2;
        display.point(viewer.window, [x, 150]);
        if step % 200 == 1 {
            display.button(1, true);
        } else if step % 200 == 190 {
            display.button(1, false);
            display.key("m");
        }
        sleep(Duration::from_millis(4));
        if early.is_none() && count() > frames / 2 {
            early = Some(resident_kib());
        }
    }
    let (early, late) = (early.expect("half of the frames"), resident_kib());
    display.button(1, false);
    assert!(
        late < early + 12 * 1024,
        "{early} KiB after half of the frames, {late} KiB at the end"
    );
    viewer.quit();
}
