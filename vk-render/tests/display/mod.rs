//! A display of its own, real keys and a real mouse: Xvfb, and the X server's extension for tests.
#![allow(dead_code, missing_docs)]

pub mod drop;
pub mod viewer;

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    self, AtomEnum, ConfigureWindowAux, ConnectionExt as _, ImageFormat, InputFocus, Window,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

const SIZE: &str = "1400x1000x24";
const PATIENCE: Duration = Duration::from_secs(60);

/// A display that is gone with this value.
pub struct Display {
    server: Child,
    name: String,
    x: RustConnection,
    root: Window,
    keys: xproto::GetKeyboardMappingReply,
    first_key: u8,
}

/// Pixels of a window, four bytes each: blue, green, red and one that means nothing.
pub struct Shot {
    pub width: u32,
    pub height: u32,
    pub bgrx: Vec<u8>,
}

impl Display {
    /// Without Xvfb this fails and says how to get it: what was not tried has not passed.
    pub fn start() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", SIZE, "-nolisten", "tcp", "-noreset"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| {
                panic!(
                    "Xvfb cannot be started ({e}); `cargo xtask test` installs it (package xvfb)"
                )
            });
        let mut line = String::new();
        let mut told = BufReader::new(server.stdout.take().expect("it is piped"));
        told.read_line(&mut line).expect("Xvfb tells its display");
        let name = format!(":{}", line.trim());
        let (x, screen) = RustConnection::connect(Some(&name)).expect("Xvfb answers");
        let (root, setup) = (x.setup().roots[screen].root, x.setup());
        let first_key = setup.min_keycode;
        let keys = x
            .get_keyboard_mapping(first_key, setup.max_keycode - first_key + 1)
            .expect("a request")
            .reply()
            .expect("a keyboard");
        Self { server, name, x, root, keys, first_key }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn x(&self) -> &RustConnection {
        &self.x
    }

    pub fn root(&self) -> Window {
        self.root
    }

    pub fn atom(&self, name: &str) -> u32 {
        let reply = self.x.intern_atom(false, name.as_bytes()).expect("a request").reply();
        reply.expect("an atom").atom
    }

    /// The window whose title ends so, once it is there.
    pub fn window(&self, title: &str) -> Window {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            let tree = self.x.query_tree(self.root).expect("a request").reply().expect("windows");
            for window in tree.children {
                let name =
                    self.x.get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 256);
                // A window may go between two questions.
                let Ok(Ok(name)) = name.map(|cookie| cookie.reply()) else { continue };
                if String::from_utf8_lossy(&name.value).ends_with(title) {
                    return window;
                }
            }
            sleep(Duration::from_millis(20));
        }
        panic!("no window is called {title}");
    }

    /// Where the window's upper left corner is on the screen.
    pub fn origin(&self, window: Window) -> [i16; 2] {
        let place = self.x.translate_coordinates(window, self.root, 0, 0);
        let place = place.expect("a request").reply().expect("a place");
        [place.dst_x, place.dst_y]
    }

    /// Gives the keyboard to a window, as a window manager would.
    pub fn focus(&self, window: Window) {
        let focus = self.x.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME);
        focus.expect("a request").check().expect("the focus");
    }

    pub fn resize(&self, window: Window, width: u32, height: u32) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.x.configure_window(window, &size).expect("a request").check().expect("a size");
    }

    pub fn hide(&self, window: Window) {
        self.x.unmap_window(window).expect("a request").check().expect("hidden");
    }

    pub fn show(&self, window: Window) {
        self.x.map_window(window).expect("a request").check().expect("shown");
    }

    fn fake(&self, kind: u8, detail: u8, [x, y]: [i16; 2]) {
        let fake = self.x.xtest_fake_input(kind, detail, 0, self.root, x, y, 0);
        fake.expect("a request").check().expect("an event");
    }

    pub fn press(&self, key: &str) {
        self.fake(xproto::KEY_PRESS_EVENT, self.code(key).0, [0, 0]);
    }

    pub fn release(&self, key: &str) {
        self.fake(xproto::KEY_RELEASE_EVENT, self.code(key).0, [0, 0]);
    }

    /// Types a key, with those that have to be held before it: `ctrl+c`, `?`, `F1`.
    pub fn key(&self, chord: &str) {
        let mut held: Vec<&str> = chord.split('+').filter(|part| !part.is_empty()).collect();
        let key = held.pop().unwrap_or("+");
        let (_, shifted) = self.code(key);
        if shifted {
            held.push("shift");
        }
        held.iter().for_each(|key| self.press(key));
        self.press(key);
        self.release(key);
        held.iter().rev().for_each(|key| self.release(key));
    }

    /// A key's code, and whether shift has to be held for it.
    fn code(&self, key: &str) -> (u8, bool) {
        let symbol = match key {
            "shift" => 0xffe1,
            "ctrl" => 0xffe3,
            "Escape" => 0xff1b,
            "F1" => 0xffbe,
            one => one.chars().next().map_or(0, u32::from),
        };
        let per_code = usize::from(self.keys.keysyms_per_keycode);
        let at = self
            .keys
            .keysyms
            .iter()
            .enumerate()
            .position(|(i, &s)| s == symbol && i % per_code < 2);
        let at = at.unwrap_or_else(|| panic!("the keyboard has no {key}"));
        (self.first_key + (at / per_code) as u8, at % per_code == 1)
    }

    /// Moves the pointer to a place in a window.
    pub fn point(&self, window: Window, [x, y]: [i16; 2]) {
        let [left, top] = self.origin(window);
        self.fake(xproto::MOTION_NOTIFY_EVENT, 0, [left + x, top + y]);
    }

    pub fn button(&self, button: u8, down: bool) {
        let kind = if down { xproto::BUTTON_PRESS_EVENT } else { xproto::BUTTON_RELEASE_EVENT };
        self.fake(kind, button, [0, 0]);
    }

    pub fn click(&self, window: Window, place: [i16; 2], button: u8) {
        self.point(window, place);
        self.button(button, true);
        self.button(button, false);
    }

    /// Drags from one place to another, in steps as a hand does.
    pub fn drag(&self, window: Window, button: u8, from: [i16; 2], to: [i16; 2]) {
        self.point(window, from);
        self.button(button, true);
        for step in 1..=10 {
            let between = |k: usize| from[k] + (to[k] - from[k]) * step / 10;
            self.point(window, [between(0), between(1)]);
            sleep(Duration::from_millis(5));
        }
        self.button(button, false);
    }

    /// What is on the screen where a window is.
    pub fn shot(&self, window: Window) -> Shot {
        let size = self.x.get_geometry(window).expect("a request").reply().expect("a size");
        let (width, height) = (size.width, size.height);
        let image = self
            .x
            .get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, u32::MAX)
            .expect("a request")
            .reply()
            .expect("a picture");
        Shot { width: width.into(), height: height.into(), bgrx: image.data }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Whether it has gone already or not, it is gone then.
        self.server.kill().unwrap_or_default();
        self.server.wait().ok();
    }
}

impl Shot {
    /// How many colours there are, few of them counted only roughly: a picture has many, an empty window one.
    pub fn num_colours(&self) -> usize {
        let mut colours: Vec<&[u8]> = self.bgrx.chunks(4).map(|pixel| &pixel[..3]).collect();
        colours.sort_unstable();
        colours.dedup();
        colours.len()
    }
}
