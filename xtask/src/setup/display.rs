//! A display that needs no screen, for tests of windows.

use std::process::Command;

use super::packages::{self, Names};
use crate::{Error, process};

const XVFB: Names = Names {
    apt: &["xvfb", "libxkbcommon-x11-0", "libxcursor1", "libxi6", "libx11-xcb1"],
    dnf: &["xorg-x11-server-Xvfb", "libxkbcommon-x11", "libXcursor", "libXi", "libX11-xcb"],
    pacman: &["xorg-server-xvfb", "libxkbcommon-x11", "libxcursor", "libxi", "libx11"],
    zypper: &["xorg-x11-server-Xvfb", "libxkbcommon-x11-0", "libXcursor1", "libXi6", "libX11-xcb1"],
    brew: &[],
};

/// Makes sure of Xvfb, and of the libraries with which windows are opened in it. Where windows are not X11's, nothing is
/// needed: the tests that want it are not built there.
///
/// # Errors
/// [`Error::Missing`] when it could not be installed.
pub fn virtual_display() -> Result<(), Error> {
    if !cfg!(target_os = "linux") || (process::find_program("Xvfb").is_some() && has_libraries()) {
        return Ok(());
    }
    packages::install("Xvfb, a display without a screen", &XVFB)
}

/// Whether the libraries are known that are looked for only when a window is opened; where nobody can tell, they are.
fn has_libraries() -> bool {
    const NAMES: [&str; 4] = ["libxkbcommon-x11.so", "libXcursor.so", "libXi.so", "libX11-xcb.so"];
    let known = ["ldconfig", "/sbin/ldconfig"]
        .iter()
        .find_map(|program| process::capture(Command::new(program).arg("-p")).ok());
    known.is_none_or(|known| {
        let known = String::from_utf8_lossy(&known.stdout).into_owned();
        NAMES.iter().all(|name| known.contains(name))
    })
}
