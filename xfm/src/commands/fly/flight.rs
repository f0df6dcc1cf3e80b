//! A session that is flown, and checked on the way.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use mergetree::{Camera, CameraPath};
use xfm_pager::{Detail, Session};

use super::FlyArgs;
use super::jumps::{Jumps, MOST_SETTLING_FRAMES, QUIET_FRAMES, Step};
use super::record::Frame;
use super::report::Settling;
use super::storage::OwnReads;
use crate::Error;

/// How long a flight is.
#[derive(Debug, Clone, Copy)]
pub enum Length {
    Frames(usize),
    Time(Duration),
}

impl Length {
    pub fn frames(self) -> Option<usize> {
        match self {
            Self::Frames(frames) => Some(frames),
            Self::Time(_) => None,
        }
    }

    /// Frames, or tenths of a second.
    pub fn units(self) -> u64 {
        match self {
            Self::Frames(frames) => frames as u64,
            Self::Time(time) => (10.0 * time.as_secs_f64()) as u64,
        }
    }

    /// Where on the path the next frame is, 0 to 1; `None` when there is none.
    pub fn share(self, flown: usize, begin: Instant) -> Option<f64> {
        match self {
            Self::Frames(frames) => {
                (flown < frames).then(|| flown as f64 / (frames - 1).max(1) as f64)
            }
            Self::Time(_) => Some(self.done(flown, begin)).filter(|&share| share < 1.0),
        }
    }

    /// How much of the flight is over.
    pub fn done(self, flown: usize, begin: Instant) -> f64 {
        match self {
            Self::Frames(frames) => flown as f64 / frames as f64,
            Self::Time(time) => begin.elapsed().as_secs_f64() / time.as_secs_f64(),
        }
    }
}

/// Where the camera goes.
#[derive(Debug)]
pub enum Route {
    Path(CameraPath, Camera),
    Jumps(Box<Jumps>),
}

impl Route {
    fn describe(&self) -> String {
        match self {
            Self::Path(..) => "the path".to_owned(),
            Self::Jumps(jumps) => format!("seed {}, jump {}", jumps.seed(), jumps.number()),
        }
    }
}

/// A session that is flown.
pub struct Flight {
    file: PathBuf,
    session: Session,
    detail: Detail,
    fps: u32,
    quotas: [usize; 2],
    /// The hard quota that the model needs at least.
    least_quota: usize,
    /// The front and the pager are checked every so many frames.
    validate: Option<usize>,
    own_reads: OwnReads,
    frame: usize,
    validations: usize,
}

impl Flight {
    pub fn new(session: Session, args: &FlyArgs, own_reads: OwnReads) -> Self {
        let options = session.pager().options();
        // Opening reads on this thread.
        own_reads.take();
        Self {
            file: args.file.clone(),
            detail: args.detail(),
            fps: args.fps,
            quotas: [options.soft_quota_bytes, options.hard_quota_bytes],
            least_quota: session.pager().least_quota_bytes().min(options.hard_quota_bytes),
            validate: args.validate.map(|every| every.get() as usize),
            own_reads,
            frame: 0,
            validations: 0,
            session,
        }
    }

    pub fn session(&self) -> &Session {
        &self.session
    }

    /// How often everything was checked; `None` where that was not asked for.
    pub fn validations(&self, asked_for: bool) -> Option<usize> {
        asked_for.then_some(self.validations)
    }

    /// Flies a frame of the route, this share of the way along a path, and checks it when it is its turn.
    pub fn follow(&mut self, route: &mut Route, share: f64) -> Result<Frame, Error> {
        let is_turn = self.validate.is_some_and(|every| self.frame.is_multiple_of(every));
        let (frame, has_settled) = match route {
            Route::Path(path, lens) => {
                (self.frame(&path.camera(share as f32, lens), self.detail), false)
            }
            Route::Jumps(jumps) => {
                let Step { camera, tolerance, quota } = jumps.step();
                if let Some(share) = quota {
                    self.set_quotas(share);
                }
                let detail = match self.detail {
                    Detail::Pixels(pixels) => Detail::Pixels(pixels * tolerance),
                    other => other,
                };
                let frame = self.frame(&camera, detail);
                let hard_quota = self.session.pager().options().hard_quota_bytes;
                (frame, jumps.observe(&frame, hard_quota))
            }
        };
        if is_turn || has_settled && self.validate.is_some() {
            self.check(route)?;
        }
        self.frame += 1;
        Ok(frame)
    }

    /// Quotas between those that the model needs at least and those asked for.
    fn set_quotas(&mut self, share: f32) {
        let [soft, hard] = self.quotas;
        let more = (hard - self.least_quota) as f64 * f64::from(share);
        let lower = (self.least_quota + more as usize).min(hard);
        let soft = (soft as f64 / hard as f64 * lower as f64) as usize;
        self.session.set_quotas(soft, lower);
    }

    fn check(&mut self, route: &Route) -> Result<(), Error> {
        self.validations += 1;
        let reads = self.own_reads.take();
        let may_read = self.session.pager().options().loaders == 0;
        let read = format!("{reads} reads within frames");
        let waited = if reads == 0 || may_read { Ok(()) } else { Err(read) };
        self.session.validate().and(waited).map_err(|what| Error::Invariant {
            file: self.file.clone(),
            frame: self.frame,
            route: route.describe(),
            what,
        })
    }

    fn frame(&mut self, camera: &Camera, detail: Detail) -> Frame {
        let start = Instant::now();
        let stats = self.session.frame(camera, detail);
        drop(self.session.take_changes());
        Frame { stats, time: start.elapsed() }
    }

    /// Waits until the next frame is due.
    pub fn wait(&self, frame: &Frame) {
        if self.fps > 0 {
            let due = Duration::from_secs(1) / self.fps;
            std::thread::sleep(due.saturating_sub(frame.time));
        }
    }

    /// Jumps to the middle of a path, or after jumps to a view of the whole, and flies on the spot until nothing changes any
    /// more.
    pub fn settle(&mut self, route: &Route) -> Result<Option<Settling>, Error> {
        let camera = match route {
            Route::Path(path, lens) => path.camera(0.5, lens),
            Route::Jumps(jumps) => {
                let [soft, hard] = self.quotas;
                self.session.set_quotas(soft, hard);
                jumps.whole()
            }
        };
        let start = Instant::now();
        let mut last_change = Duration::ZERO;
        let mut quiet = 0;
        let mut settling = None;
        for index in 0..MOST_SETTLING_FRAMES {
            let frame = self.frame(&camera, self.detail);
            if frame.is_busy(self.session.pager().options().hard_quota_bytes) {
                last_change = start.elapsed();
                quiet = 0;
            } else {
                quiet += 1;
            }
            if quiet == QUIET_FRAMES {
                let frames = (index + 1 - QUIET_FRAMES) as usize;
                settling = Some(Settling { seconds: last_change.as_secs_f64(), frames });
                break;
            }
            self.wait(&frame);
        }
        if self.validate.is_some() {
            self.check(route)?;
        }
        Ok(settling)
    }
}
