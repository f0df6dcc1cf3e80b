//! Jumps at random, while tolerance and quotas change: what is said of memory and of the mesh holds after every frame, and a
//! quota that was lowered is met.

mod common;

use std::time::Duration;

use common::Random;
use glam::Vec3;
use mergetree::{Camera, Dependencies};
use xfm_pager::{Detail, Error, Pager, PagerOptions, Session};

/// Least hard quota with which this file and these loaders work.
fn minimum(bytes: &[u8], loaders: usize) -> usize {
    let options = PagerOptions::with_quotas(0, 0).with_loaders(loaders);
    match Pager::new(common::open(bytes), options) {
        Err(Error::QuotaTooSmall { minimum, .. }) => minimum,
        other => panic!("{other:?}"),
    }
}

fn pose(random: &mut Random) -> Camera {
    let mut coordinate = || random.below(2001) as f32 / 1000.0 - 1.0;
    let direction = Vec3::new(coordinate(), coordinate(), coordinate());
    let at = 2.7 * Vec3::new(coordinate(), coordinate(), 0.3 * coordinate());
    let distance = [0.0, 0.02, 0.3, 1.5, 4.0, 60.0][random.below(6)];
    let up = Vec3::Y;
    match random.below(5) {
        // Away from everything.
        0 => Camera { eye: 5.0 * direction, at: 9.0 * direction, up, ..Camera::default() },
        _ => Camera { eye: at + distance * direction, at, up, ..Camera::default() },
    }
}

fn jump(bytes: &[u8], loaders: usize, seed: u64) {
    let least = minimum(bytes, loaders);
    let mut random = Random(seed);
    let mut hard = least + 200_000;
    let options = PagerOptions::with_quotas(hard / 2, hard).with_loaders(loaders);
    let pager = Pager::new(common::open(bytes), options).unwrap();
    let mut session = Session::new(pager, Dependencies::Order).unwrap();
    for jump in 0..40 {
        if jump % 2 == 1 {
            // Sometimes the same as before: what fills it has to be enough.
            if random.below(3) > 0 {
                hard = least + random.below(700_000);
            }
            // Half of the time equal, so that memory is full to the brim.
            session.set_quotas(hard / (1 + random.below(2)), hard);
            session.validate().unwrap();
        }
        let camera = pose(&mut random);
        let mut tolerance = 0.2;
        for _ in 0..1 + random.below(12) {
            if random.below(4) == 0 {
                tolerance = 0.2 * (1 + random.below(40)) as f32;
            }
            session.frame(&camera, Detail::Pixels(tolerance));
            session.validate().unwrap_or_else(|what| panic!("seed {seed}, jump {jump}: {what}"));
            session.pager().wait(Duration::from_micros(200));
        }
        if jump % 4 == 3 {
            let stats = session.settle(&camera, Detail::Pixels(tolerance), Duration::from_secs(60));
            session.validate().unwrap_or_else(|what| panic!("seed {seed}, jump {jump}: {what}"));
            assert!(stats.resident_bytes <= hard, "seed {seed}, jump {jump}: {stats:?} of {hard}");
        }
    }
}

#[test]
fn invariants_hold_wherever_the_camera_jumps_and_whatever_memory_becomes() {
    let bytes = common::bytes(&common::torus(80), 96);
    for seed in 0..6 {
        for loaders in [0, 1, 2] {
            jump(&bytes, loaders, seed);
        }
    }
}
