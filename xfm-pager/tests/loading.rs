//! Loading beside the frames: whatever storage does, frames go on, the mesh is whole, and memory is held.

mod common;

use std::io;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use common::{Random, Unreliable};
use glam::Vec3;
use mergetree::{Camera, Dependencies};
use xfm_format::{Storage, XfmFile};
use xfm_pager::{Detail, Error, Pager, PagerOptions, Session, SessionOptions};

const LONG: Duration = Duration::from_secs(60);

fn file(storage: impl Storage + 'static) -> XfmFile {
    XfmFile::from_storage(Box::new(storage), "x.xfm").unwrap()
}

fn session(storage: impl Storage + 'static, options: PagerOptions) -> Session {
    Session::new(Pager::new(file(storage), options).unwrap(), Dependencies::Order).unwrap()
}

fn camera(eye: Vec3) -> Camera {
    Camera { eye, at: Vec3::ZERO, ..Camera::default() }
}

fn validate(session: &Session) {
    session.validate().unwrap();
}

fn split_nodes(session: &Session) -> Vec<u32> {
    let mut nodes: Vec<u32> = session.front().split_nodes().map(|(id, _)| id.get()).collect();
    nodes.sort_unstable();
    nodes
}

/// Least hard quota with which this file and these loaders work.
fn minimum(bytes: &[u8], loaders: usize) -> usize {
    let options = PagerOptions::with_quotas(0, 0).with_loaders(loaders);
    match Pager::new(common::open(bytes), options) {
        Err(Error::QuotaTooSmall { minimum, .. }) => minimum,
        other => panic!("{other:?}"),
    }
}

/// Storage that answers when it is let.
#[derive(Clone)]
struct Gated {
    bytes: Arc<Vec<u8>>,
    open: Arc<(Mutex<bool>, Condvar)>,
}

impl Gated {
    fn new(bytes: Vec<u8>) -> Self {
        Self { bytes: Arc::new(bytes), open: Arc::new((Mutex::new(true), Condvar::new())) }
    }

    fn set_open(&self, open: bool) {
        *self.open.0.lock().unwrap() = open;
        self.open.1.notify_all();
    }
}

impl Storage for Gated {
    fn len(&self) -> io::Result<u64> {
        Storage::len(&*self.bytes)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let open = self.open.0.lock().unwrap();
        drop(self.open.1.wait_while(open, |open| !*open).unwrap());
        self.bytes.read_at(offset, buffer)
    }
}

/// Storage that now and then fails, reads little, is slow, or panics.
#[derive(Clone)]
struct Moody {
    bytes: Arc<Vec<u8>>,
    calls: Arc<AtomicU64>,
    panics: bool,
}

fn is_loader(name: &str) -> bool {
    name.starts_with("xfm-loader")
}

impl Storage for Moody {
    fn len(&self) -> io::Result<u64> {
        Storage::len(&*self.bytes)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let call = self.calls.fetch_add(1, Relaxed);
        let is_page = buffer.len() > 500 && call > 6;
        match Random(call).below(12) {
            0 if is_page => Err(io::ErrorKind::TimedOut.into()),
            1 => Err(io::ErrorKind::Interrupted.into()),
            2 if is_page => {
                std::thread::sleep(Duration::from_millis(3));
                self.bytes.read_at(offset, buffer)
            }
            3 if self.panics && std::thread::current().name().is_some_and(is_loader) => {
                panic!("a back end that crashes")
            }
            _ => {
                let count = buffer.len().min(1 + Random(call ^ 77).below(4000));
                self.bytes.read_at(offset, &mut buffer[..count])
            }
        }
    }
}

#[test]
fn loaders_come_to_the_same_mesh_as_reading_at_once() {
    let bytes = common::bytes(&common::torus(60), 96);
    let at_once = PagerOptions::default();
    for pixels in [4.0, 1.0, 0.1] {
        let camera = camera(Vec3::new(3.0, 2.0, 4.0));
        let mut plain = session(bytes.clone(), at_once);
        plain.settle(&camera, Detail::Pixels(pixels), LONG);
        for loaders in [1, 3] {
            let mut loaded = session(bytes.clone(), at_once.with_loaders(loaders));
            let stats = loaded.settle(&camera, Detail::Pixels(pixels), LONG);
            assert_eq!(stats.waiting, 0);
            assert_eq!(split_nodes(&loaded), split_nodes(&plain));
            validate(&loaded);
        }
    }
}

#[test]
fn a_frame_never_waits_for_storage() {
    let storage = Gated::new(common::bytes(&common::torus(60), 96));
    let mut session = session(storage.clone(), PagerOptions::default().with_loaders(2));
    let coarsest = session.front().num_triangles();
    storage.set_open(false);
    for step in 0..50 {
        // Were one to wait, this would not come to an end.
        let eye = Vec3::new(3.0, 0.1 * step as f32, 3.0);
        let stats = session.frame(&camera(eye), Detail::Pixels(0.5));
        validate(&session);
        assert!(stats.waiting > 0 && stats.queued_pages > 0);
    }
    storage.set_open(true);
    let still = camera(Vec3::new(3.0, 5.0, 3.0));
    let stats = session.settle(&still, Detail::Pixels(0.5), LONG);
    assert!(stats.waiting == 0 && stats.triangles_shown > 4 * coarsest);
    storage.set_open(false);
    drop(session);
    storage.set_open(true);
}

#[test]
fn every_mood_of_storage_leaves_a_whole_mesh() {
    let bytes = common::bytes(&common::torus(60), 96);
    for panics in [false, true] {
        let storage = Moody { bytes: Arc::new(bytes.clone()), calls: Arc::default(), panics };
        let mut session = session(storage, PagerOptions::default().with_loaders(2));
        let mut random = Random(5);
        for _ in 0..60 {
            let angle = random.below(628) as f32 / 100.0;
            let distance = 2.5 + random.below(40) as f32 / 10.0;
            let eye = distance * Vec3::new(angle.cos(), 0.4, angle.sin());
            session.frame(&camera(eye), Detail::Pixels(0.3));
            session.pager().wait(Duration::from_millis(2));
            validate(&session);
        }
        session.settle(&camera(Vec3::new(3.0, 2.0, 3.0)), Detail::Pixels(0.3), LONG);
        validate(&session);
        // A page is given up only after three attempts.
        assert!(session.pager().problems().len() < session.pager().file().num_pages() / 4);
    }
}

#[test]
fn a_hard_quota_holds_on_any_path_and_the_view_settles() {
    let bytes = common::bytes(&common::torus(80), 96);
    let least = minimum(&bytes, 2);
    for room in [0, 30_000, 100_000, 300_000, 5_000_000] {
        let options = PagerOptions::with_quotas(least + room / 2, least + room).with_loaders(2);
        let mut session = session(bytes.clone(), options);
        let mut random = Random(room as u64);
        let mut eye = Vec3::new(3.0, 1.0, 3.0);
        for step in 0..150 {
            if step % 25 == 0 {
                // A jump.
                let angle = random.below(628) as f32 / 100.0;
                eye = (1.5 + random.below(30) as f32 / 10.0)
                    * Vec3::new(angle.cos(), 0.2, angle.sin());
            }
            eye += Vec3::new(0.01, 0.005, -0.01);
            session.frame(&camera(eye), Detail::Pixels(0.2));
            validate(&session);
            if step % 3 == 0 {
                session.pager().wait(Duration::from_millis(1));
            }
        }
        // It settles: nothing moves, nothing is loaded, nothing is asked for.
        let still = camera(eye);
        let mut quiet = 0;
        for _ in 0..4000 {
            let stats = session.frame(&still, Detail::Pixels(0.2));
            session.pager().wait(Duration::from_millis(5));
            quiet = if stats.updates == 0 && stats.blocks_loaded == 0 { quiet + 1 } else { 0 };
            if quiet == 50 {
                break;
            }
        }
        validate(&session);
        assert_eq!(quiet, 50, "a still view never settles with {room} bytes to spare");
        if room == 5_000_000 {
            assert!(!session.frame(&still, Detail::Pixels(0.2)).is_short_of_memory);
        }
    }
}

#[test]
fn what_memory_takes_away_comes_back_with_it() {
    let bytes = common::bytes(&common::torus(80), 96);
    let least = minimum(&bytes, 1);
    let ample = PagerOptions::with_quotas(least + 4_000_000, least + 8_000_000).with_loaders(1);
    let mut session = session(bytes, ample);
    let camera = camera(Vec3::new(3.0, 1.0, 3.0));
    let fine = session.settle(&camera, Detail::Pixels(0.2), LONG).triangles_shown;
    session.set_quotas(least + 50_000, least + 100_000);
    let mut stats = session.frame(&camera, Detail::Pixels(0.2));
    for _ in 0..600 {
        stats = session.frame(&camera, Detail::Pixels(0.2));
        session.pager().wait(Duration::from_millis(1));
    }
    assert!(
        stats.is_short_of_memory && stats.triangles_shown < fine / 2,
        "{stats:?} {fine} {:?}",
        session.pager().stats()
    );
    assert!(stats.resident_bytes <= least + 100_000, "{}", stats.resident_bytes - least);
    session.set_quotas(least + 4_000_000, least + 8_000_000);
    for _ in 0..1000 {
        stats = session.frame(&camera, Detail::Pixels(0.2));
        session.pager().wait(Duration::from_millis(1));
    }
    assert!(!stats.is_short_of_memory && stats.triangles_shown == fine);
}

#[test]
fn a_damaged_page_is_named_and_costs_its_own_detail() {
    damage_pages(common::bytes(&common::torus(100), 96));
    damage_pages(common::compact_bytes(&common::torus(100), 96));
}

fn damage_pages(whole: Vec<u8>) {
    let file = common::open(&whole);
    let pages_at = u64::from_le_bytes(whole[168..176].try_into().unwrap());
    let mut shown = Vec::new();
    for page in (0..file.num_pages()).step_by(7) {
        let mut bytes = whole.clone();
        let before: u64 = (0..page).map(|page| file.page_bytes(page).unwrap()).sum();
        bytes[(pages_at + before) as usize + 10] ^= 1;
        let mut session = session(bytes, PagerOptions::default().with_loaders(2));
        let camera = camera(Vec3::new(0.1, 9.0, 0.1));
        let stats = session.settle(&camera, Detail::Pixels(0.01), LONG);
        validate(&session);
        shown.push(stats.triangles_shown);
        let named: Vec<_> = session.pager().problems().iter().map(|p| p.page).collect();
        assert_eq!(named, [page]);
    }
    let mut session = session(whole, PagerOptions::default());
    let camera = camera(Vec3::new(0.1, 9.0, 0.1));
    let stats = session.settle(&camera, Detail::Pixels(0.01), LONG);
    // What is in a page, what hangs below it, and what depends on that: much for the pages of the roots, little for most.
    shown.sort_unstable();
    let median = shown[shown.len() / 2];
    assert!(4 * median > 3 * stats.triangles_shown, "{shown:?} of {}", stats.triangles_shown);
}

#[test]
fn storage_that_stops_answering_costs_nothing_once_it_is_given_up() {
    let storage = Unreliable::new(common::bytes(&common::torus(40), 96));
    let mut session = session(storage.clone(), PagerOptions::default().with_loaders(2));
    storage.fails.store(true, Relaxed);
    let camera = camera(Vec3::new(3.0, 1.0, 3.0));
    session.settle(&camera, Detail::Pixels(0.1), LONG);
    assert!(!session.pager().problems().is_empty());
    let reads = storage.reads.load(Relaxed);
    for _ in 0..20 {
        session.frame(&camera, Detail::Pixels(0.1));
        session.pager().wait(Duration::from_millis(1));
    }
    assert_eq!(storage.reads.load(Relaxed), reads);
}

#[test]
fn vertices_move_to_their_places_and_back_and_end_there() {
    let bytes = common::bytes(&common::torus(60), 96);
    let camera = camera(Vec3::new(3.0, 2.0, 3.0));
    let mut plain = session(bytes.clone(), PagerOptions::default());
    plain.settle(&camera, Detail::Pixels(0.5), LONG);
    let mut options = SessionOptions::default();
    options.geomorph_frames = 6;
    let pager = Pager::new(common::open(&bytes), PagerOptions::default()).unwrap();
    let mut morphing = Session::with_options(pager, options).unwrap();
    let first = morphing.frame(&camera, Detail::Pixels(0.5));
    assert!(first.morphing > 100);
    let mut frames = 0;
    while morphing.frame(&camera, Detail::Pixels(0.5)).morphing > 0 {
        validate(&morphing);
        frames += 1;
        assert!(frames < 60);
    }
    assert_eq!(split_nodes(&morphing), split_nodes(&plain));
    let positions = |session: &Session| {
        let mut all: Vec<_> =
            session.front().to_mesh().0.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(positions(&morphing), positions(&plain));
    // Away: everything goes back to the coarsest, level by level.
    let away = Camera { eye: Vec3::new(0.0, 0.0, 500.0), at: Vec3::ZERO, ..camera };
    for _ in 0..600 {
        morphing.frame(&away, Detail::Pixels(0.5));
    }
    validate(&morphing);
    assert_eq!(morphing.frame(&away, Detail::Pixels(0.5)).morphing, 0);
    plain.settle(&away, Detail::Pixels(0.5), LONG);
    assert_eq!(split_nodes(&morphing), split_nodes(&plain));
}

#[test]
fn a_frame_time_and_a_budget_are_held() {
    let bytes = common::bytes(&common::torus(120), 400);
    let mut session = session(bytes, PagerOptions::default());
    let camera = camera(Vec3::new(2.5, 1.0, 2.5));
    let mut stats = session.frame(&camera, Detail::Budget(4000));
    for _ in 0..200 {
        stats = session.frame(&camera, Detail::Budget(4000));
    }
    assert!((3000..4400).contains(&stats.triangles_shown), "{}", stats.triangles_shown);
    // A frame said to take a millisecond for every 500 triangles.
    for _ in 0..300 {
        let time = Duration::from_micros(2 * stats.triangles_shown as u64);
        session.report_frame_time(time);
        stats = session.frame(&camera, Detail::FrameTime(Duration::from_millis(4)));
    }
    assert!((1400..2400).contains(&stats.triangles_shown), "{}", stats.triangles_shown);
}
