//! Files that other programs replace, cut short or write over while a pager has them open: what was open stays whole, what is
//! gone is named and costs its own detail, and nothing hangs.

mod common;

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::Vec3;
use mergetree::{Camera, Dependencies};
use xfm_format::{Error, XfmFile};
use xfm_pager::{Detail, Pager, PagerOptions, Session};

const LONG: Duration = Duration::from_secs(60);

/// A model in a file.
struct Model {
    folder: tempfile::TempDir,
    bytes: Vec<u8>,
    path: PathBuf,
}

impl Model {
    fn new(n: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (bytes, path) = (common::bytes(&common::torus(n), 96), folder.path().join("x.xfm"));
        fs::write(&path, &bytes).unwrap();
        Self { folder, bytes, path }
    }

    /// Where each page ends in the file.
    fn page_ends(&self) -> Vec<u64> {
        let file = common::open(&self.bytes);
        let mut end = u64::from_le_bytes(self.bytes[168..176].try_into().unwrap());
        (0..file.num_pages())
            .map(|page| {
                end += file.page_bytes(page).unwrap();
                end
            })
            .collect()
    }

    /// Its session, with a look from afar: most pages are not read yet.
    fn session(&self, loaders: usize) -> Session {
        let options = PagerOptions::default().with_loaders(loaders);
        let pager = Pager::open(&self.path, options).unwrap();
        let mut session = Session::new(pager, Dependencies::Order).unwrap();
        session.settle(&camera(90.0), Detail::Pixels(4.0), LONG);
        assert_eq!(session.pager().problems().len(), 0);
        session
    }

    fn cut(&self, len: u64) {
        File::options().write(true).open(&self.path).unwrap().set_len(len).unwrap();
    }
}

fn camera(distance: f32) -> Camera {
    Camera { eye: distance * Vec3::new(0.6, 0.4, 0.7), at: Vec3::ZERO, ..Camera::default() }
}

/// Settles near the model; the split nodes that come of it.
fn look_close(session: &mut Session) -> Vec<u32> {
    let begin = Instant::now();
    let stats = session.settle(&camera(4.0), Detail::Pixels(0.05), LONG);
    assert!(begin.elapsed() < LONG, "it waits for what never comes");
    assert_eq!(stats.waiting, 0);
    session.front().validate(session.pager()).unwrap();
    session.pager().validate().unwrap();
    assert_eq!(session.pager().stats().damaged_pages, session.pager().problems().len());
    let mut nodes: Vec<u32> = session.front().split_nodes().map(|(id, _)| id.get()).collect();
    nodes.sort_unstable();
    nodes
}

/// The pages that cannot be read, each named once.
fn damaged(session: &Session) -> Vec<usize> {
    let mut pages: Vec<usize> = session.pager().problems().iter().map(|p| p.page).collect();
    pages.sort_unstable();
    assert!(pages.windows(2).all(|two| two[0] < two[1]), "{pages:?}");
    pages
}

#[test]
#[cfg(unix)]
fn a_file_that_is_replaced_or_removed_is_read_to_its_end() {
    for loaders in [0, 2] {
        let model = Model::new(60);
        let expected = look_close(&mut model.session(loaders));
        let mut replaced = model.session(loaders);
        let other = model.folder.path().join("other");
        fs::write(&other, common::bytes(&common::torus(30), 96)).unwrap();
        fs::rename(&other, &model.path).unwrap();
        assert_eq!(look_close(&mut replaced), expected);
        assert_eq!(damaged(&replaced), [0; 0]);

        fs::write(&model.path, &model.bytes).unwrap();
        let mut removed = model.session(loaders);
        fs::remove_file(&model.path).unwrap();
        assert_eq!(look_close(&mut removed), expected);
        assert_eq!(damaged(&removed), [0; 0]);
    }
}

#[test]
fn a_file_that_is_cut_short_costs_what_was_beyond() {
    let model = Model::new(60);
    let (len, ends) = (model.bytes.len() as u64, model.page_ends());
    for loaders in [0, 2] {
        let whole = look_close(&mut model.session(loaders)).len();
        let mut shown = Vec::new();
        for share in [0, 1, 5, 8] {
            let cut = len * share / 10;
            let mut session = model.session(loaders);
            model.cut(cut);
            shown.push(look_close(&mut session).len());
            let damaged = damaged(&session);
            assert!(!damaged.is_empty(), "{share} tenths");
            for problem in session.pager().problems() {
                assert!(ends[problem.page] > cut, "page {} is there", problem.page);
                assert!(matches!(problem.error, Error::Truncated { .. }), "{}", problem.error);
            }
            // What is given up is not tried again, even if all of it comes back.
            fs::write(&model.path, &model.bytes).unwrap();
            look_close(&mut session);
            assert_eq!(self::damaged(&session), damaged);
        }
        assert!(shown.is_sorted() && shown[3] < whole, "{shown:?} of {whole}");
    }
}

#[test]
fn a_file_that_is_written_over_costs_what_has_changed() {
    let model = Model::new(60);
    for loaders in [0, 2] {
        for other in [vec![0; model.bytes.len()], common::bytes(&common::torus(64), 96)] {
            let mut session = model.session(loaders);
            // In place: what is open changes.
            fs::write(&model.path, other).unwrap();
            look_close(&mut session);
            assert!(!damaged(&session).is_empty());
            for problem in session.pager().problems() {
                assert!(matches!(problem.error, Error::Checksum { .. }), "{}", problem.error);
            }
            fs::write(&model.path, &model.bytes).unwrap();
        }
    }
}

/// As a program that writes it anew does, while frames go on.
#[test]
fn a_file_that_shrinks_and_grows_while_frames_go_on_leaves_a_whole_mesh() {
    let model = Model::new(60);
    let len = model.bytes.len() as u64;
    let mut session = model.session(2);
    let begin = Instant::now();
    for frame in 0..200u64 {
        match frame % 4 {
            0 => model.cut(len * (frame % 10) / 10),
            2 => fs::write(&model.path, &model.bytes).unwrap(),
            _ => {}
        }
        session.frame(&camera(9.0 - 0.02 * frame as f32), Detail::Pixels(0.05));
        session.pager().wait(Duration::from_millis(1));
        session.front().validate(session.pager()).unwrap();
        session.pager().validate().unwrap();
    }
    assert!(begin.elapsed() < LONG);
    look_close(&mut session);
    damaged(&session);
    assert!(is_sound(&model.path));
}

fn is_sound(path: &Path) -> bool {
    XfmFile::open(path).is_ok_and(|file| xfm_format::verify(&file, |_| {}).is_ok())
}
