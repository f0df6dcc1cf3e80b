//! Camera paths that are recorded and replayed, and single views as text.
//!
//! Both are the text that `xfm fly --path` reads: nine numbers per pose, `eye x y z, at x y z, up x y z`, relative to the
//! file's origin. A view is one such line.

use std::path::Path;
use std::time::Duration;

use mergetree::{Camera, CameraPath};

use crate::error::Error;

/// Poses of a recording per second.
pub(crate) const POSES_PER_SECOND: f32 = 30.0;

/// A path being recorded.
#[derive(Clone, Debug, Default)]
pub(crate) struct Recording {
    path: CameraPath,
    time: Duration,
}

impl Recording {
    /// Notes where the camera is after `passed` more time: a pose for every thirtieth of a second.
    pub(crate) fn note(&mut self, camera: &Camera, passed: Duration) {
        if !self.path.is_empty() {
            self.time += passed;
        }
        let due = 1 + (self.time.as_secs_f32() * POSES_PER_SECOND) as usize;
        while self.path.len() < due {
            self.path.push(camera);
        }
    }

    pub(crate) fn seconds(&self) -> f32 {
        self.time.as_secs_f32()
    }

    /// The path, and the text of its file.
    pub(crate) fn finish(self) -> (CameraPath, String) {
        let head = "# A camera path: eye x y z, at x y z, up x y z, one pose a line, 30 lines a second.\n\
                    # Replay it with: xfm-view FILE --path THIS, or xfm fly FILE.xfm --path THIS\n";
        let text = format!("{head}{}", self.path.to_text());
        (self.path, text)
    }
}

/// A path being replayed.
#[derive(Clone, Debug)]
pub(crate) struct Replay {
    path: CameraPath,
    /// Seconds since it began; `None` before that.
    time: Option<f32>,
    ended: bool,
}

impl Replay {
    pub(crate) fn new(path: CameraPath) -> Self {
        Self { path, time: None, ended: false }
    }

    /// The camera after `passed` more time, the first and the last pose among them; `None` once the path has ended.
    pub(crate) fn step(&mut self, passed: Duration, lens: &Camera) -> Option<Camera> {
        if self.ended {
            return None;
        }
        // What passed before it began does not count.
        let time = self.time.map_or(0.0, |time| time + passed.as_secs_f32());
        self.time = Some(time);
        let length = (self.path.len() - 1) as f32 / POSES_PER_SECOND;
        self.ended = time >= length;
        Some(self.path.camera(if length > 0.0 { time / length } else { 0.0 }, lens))
    }
}

/// Reads a path's file.
pub(crate) fn read(file: &Path) -> Result<CameraPath, Error> {
    let text = std::fs::read_to_string(file).map_err(Error::file(file))?;
    CameraPath::parse(&text).map_err(|source| Error::Path { path: file.to_owned(), source })
}

/// A view as text, to be read back by [`parse_view`].
pub(crate) fn view_text(camera: &Camera) -> String {
    let Camera { eye, at, up, .. } = camera;
    let three = |v: &glam::Vec3| format!("{},{},{}", v.x, v.y, v.z);
    format!("{} {} {}", three(eye), three(at), three(up))
}

/// Reads a view: six or nine numbers.
pub(crate) fn parse_view(text: &str, lens: &Camera) -> Result<Camera, Error> {
    let short = || {
        let text: String = text.trim().chars().take(60).collect();
        if text.is_empty() { "nothing".to_owned() } else { format!("{text:?}") }
    };
    match CameraPath::parse(text) {
        Ok(path) if path.len() == 1 => {
            let camera = path.camera(0.0, lens);
            if camera.eye == camera.at { Err(Error::View(short())) } else { Ok(camera) }
        }
        _ => Err(Error::View(short())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn views_survive_as_text() {
        let lens = Camera::default();
        let camera =
            Camera { eye: Vec3::new(0.1, -2.5e-7, 3e8), at: Vec3::new(1.0, 1.5, -3.0), ..lens };
        assert_eq!(parse_view(&view_text(&camera), &lens).unwrap(), camera);
        assert_eq!(parse_view("0 0 5 0 0 0", &lens).unwrap().up, Vec3::Y);
        for bad in ["", "hello", "1 2 3", "0 0 5 0 0 0\n0 0 5 0 0 1", "1 1 1 1 1 1"] {
            assert!(matches!(parse_view(bad, &lens), Err(Error::View(_))), "{bad}");
        }
    }

    #[test]
    fn a_recording_is_replayed_in_its_own_time() {
        let lens = Camera::default();
        let mut recording = Recording::default();
        for i in 0..=60 {
            let camera = Camera { eye: Vec3::X * i as f32, at: Vec3::Y, ..lens };
            recording.note(&camera, Duration::from_millis(if i == 0 { 0 } else { 20 }));
        }
        let (path, text) = recording.finish();
        assert!((36..=37).contains(&path.len()), "{}", path.len());
        assert_eq!(CameraPath::parse(&text).unwrap(), path);
        let mut replay = Replay::new(path);
        let mut eyes = Vec::new();
        while let Some(camera) = replay.step(Duration::from_millis(100), &lens) {
            eyes.push(camera.eye.x);
        }
        assert!((13..=14).contains(&eyes.len()) && eyes[0] == 0.0, "{eyes:?}");
        assert!(eyes.windows(2).all(|w| w[1] > w[0]));
    }

    #[test]
    fn a_path_of_one_pose_ends() {
        let path = CameraPath::parse("0 0 1 0 0 0").unwrap();
        let mut replay = Replay::new(path);
        let lens = Camera::default();
        assert!(replay.step(Duration::ZERO, &lens).is_some());
        assert!(replay.step(Duration::ZERO, &lens).is_none());
    }
}
