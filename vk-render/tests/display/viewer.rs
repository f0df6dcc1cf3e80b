//! The viewer, run as its user does, and what it says of its frames.

use super::Display;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use x11rb::protocol::xproto::Window;

/// Machines are slow when they are busy.
const PATIENCE: Duration = Duration::from_secs(90);

/// A viewer in a window.
pub struct Viewer<'a> {
    pub display: &'a Display,
    pub window: Window,
    child: Child,
    log: PathBuf,
    folder: PathBuf,
}

/// The program on no display.
pub fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xfm-view"));
    command
        .current_dir(folder)
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .env_remove("DISPLAY")
        .env("XDG_RUNTIME_DIR", folder)
        .stdin(Stdio::null());
    command
}

impl<'a> Viewer<'a> {
    /// Starts it in a folder, with a window of 900 x 600 unless told and the validation layer.
    pub fn start(display: &'a Display, folder: &Path, args: &[&str]) -> Self {
        let log = folder.join("log.jsonl");
        fs::remove_file(&log).unwrap_or_default();
        let child = command(folder)
            .args(["--validation", "--log", "log.jsonl"])
            .args(if args.contains(&"--size") { &[][..] } else { &["--size", "900x600"] })
            .args(args)
            .env("DISPLAY", display.name())
            .stderr(fs::File::create(folder.join("stderr.txt")).expect("a file"))
            .spawn()
            .expect("the viewer starts");
        let window = display.window("xfm-view");
        let viewer = Self { display, window, child, log, folder: folder.to_owned() };
        viewer.until("a frame", |_| true);
        display.focus(window);
        viewer
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn frames(&self) -> Vec<Value> {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        // The last line may be on its way.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        whole.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    /// Waits for a last frame that is so.
    pub fn until(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let last = self.frames().pop();
            match last {
                Some(frame) if is_so(&frame) => return frame,
                other if start.elapsed() > PATIENCE => {
                    panic!("no {what}; last: {other:?}; {}", self.stderr());
                }
                _ => sleep(Duration::from_millis(20)),
            }
        }
    }

    /// Waits until the model is there and as fine as it should be.
    pub fn settled(&self) -> Value {
        self.until("settled model", |f| f["model"] == true && f["settled"] == true)
    }

    /// Types a key and waits for what comes of it.
    pub fn key_until(&self, key: &str, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        self.display.key(key);
        self.until(what, is_so)
    }

    /// Waits for another view than this one, and until it does not change any more.
    pub fn other_view(&self, than: &Value) -> Value {
        let mut last = self.until("other view", |f| f["view"] != than["view"]);
        loop {
            sleep(Duration::from_millis(150));
            let now = self.frames().pop().expect("frames");
            if now["view"] == last["view"] {
                return now;
            }
            last = now;
        }
    }

    pub fn stderr(&self) -> String {
        fs::read_to_string(self.folder.join("stderr.txt")).unwrap_or_default()
    }

    /// Waits for its end.
    pub fn wait(mut self) -> (ExitStatus, String) {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return (status, self.stderr());
            }
            sleep(Duration::from_millis(20));
        }
        panic!("it does not end: {}", self.stderr());
    }

    /// Quits by the keyboard; nothing may have been complained of, by the validation layer least of all.
    pub fn quit(self) {
        self.display.key("ctrl+q");
        let (status, said) = self.wait();
        assert!(status.success(), "{said}");
        assert!(!said.contains("error:") || said.contains("XDG_RUNTIME_DIR"), "{said}");
    }
}

impl Drop for Viewer<'_> {
    fn drop(&mut self) {
        self.child.kill().unwrap_or_default();
        self.child.wait().ok();
    }
}

/// Nine numbers of a frame's view: eye, point looked at, up.
pub fn view(frame: &Value) -> Vec<f64> {
    let text = frame["view"].as_str().expect("a view");
    text.split([',', ' ']).map(|number| number.parse().expect("a number")).collect()
}

/// Writes a bumpy torus of `2 * around * along` triangles as a binary PLY file.
pub fn torus(file: &Path, around: u32, along: u32) {
    coloured_torus(file, around, along, "", |_, _| Vec::new());
}

/// As [`torus`], with further properties of vertices and their bytes by where they are around the torus and the tube, 0 to 1.
pub fn coloured_torus(
    file: &Path,
    around: u32,
    along: u32,
    properties: &str,
    of: impl Fn(f32, f32) -> Vec<u8>,
) {
    use std::f32::consts::TAU;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\n{properties}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        around * along,
        2 * around * along
    )
    .into_bytes();
    for i in 0..around {
        for j in 0..along {
            let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / along as f32);
            let thick = 0.35 + 0.03 * (9.0 * u).sin() * (5.0 * v).cos();
            let out = 1.0 + thick * v.cos();
            for c in [out * u.cos(), thick * v.sin(), out * u.sin()] {
                bytes.extend(c.to_le_bytes());
            }
            bytes.extend(of(u / TAU, v / TAU));
        }
    }
    let vertex = |i: u32, j: u32| ((i % around) * along + j % along) as i32;
    for i in 0..around {
        for j in 0..along {
            let [a, b] = [vertex(i, j), vertex(i + 1, j)];
            let [c, d] = [vertex(i + 1, j + 1), vertex(i, j + 1)];
            for triangle in [[a, c, b], [a, d, c]] {
                bytes.push(3);
                triangle.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            }
        }
    }
    fs::write(file, bytes).expect("a file");
}
