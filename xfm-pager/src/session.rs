//! A model in flight: pager, front, view and tolerance, one call per frame.

use std::time::{Duration, Instant};

use mergetree::{
    BaseMesh, Camera, Changes, Dependencies, Front, FrontVertex, Node, NodeId, NodeStore, SlotId,
    ToleranceControl, UpdateLimits, View, ViewTest,
};

use crate::{Error, Pager};

/// What decides how fine a frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// An error in pixels.
    Pixels(f32),
    /// A number of triangles: the tolerance moves so that it is held.
    Budget(usize),
    /// The time that a frame takes: the tolerance moves so that it is held. It is what
    /// [`Session::report_frame_time`] was told, or else what [`Session::frame`] took.
    FrameTime(Duration),
}

/// Finest and coarsest tolerance that a budget may choose, in pixels.
const TOLERANCES: (f32, f32) = (0.05, 500.0);
/// How far above a tolerance that memory did not suffice for to stay at least, as a share of it.
const LEAST_DISTANCE: f32 = 0.01;
/// How far ahead of the camera's motion detail is requested, in frames.
const FRAMES_AHEAD: f32 = 12.0;

/// How a session goes about its frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SessionOptions {
    /// What a split or collapse waits for. Default [`Dependencies::Order`].
    pub dependencies: Dependencies,
    /// What of a node is compared with a pixel. Default [`ViewTest::Deviation`].
    pub test: ViewTest,
    /// Splits and collapses of a frame at most; what is left, the least wrong, is done in the next ones. Default 4000.
    pub max_updates: usize,
    /// Time for splits, and half as much for collapses, of a frame at most, where loaders read: without them frames wait
    /// anyway, and are the same on every machine. Default 1.25 ms.
    pub max_update_time: Duration,
    /// Frames that a vertex takes to its place after a split, and back before a collapse; 0, the default, for none.
    pub geomorph_frames: u32,
}

impl Default for SessionOptions {
    fn default() -> Self {
        Self {
            dependencies: Dependencies::Order,
            test: ViewTest::Deviation,
            max_updates: 4000,
            max_update_time: Duration::from_micros(1250),
            geomorph_frames: 0,
        }
    }
}

/// What one frame took and showed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct FrameStats {
    /// Triangles of the active mesh.
    pub triangles_shown: usize,
    /// Splits and collapses.
    pub updates: usize,
    /// Nodes tested against the view.
    pub tests: usize,
    /// Nodes that are too coarse because they, or what they depend on, are not resident.
    pub waiting: usize,
    /// Nodes that do not fit the mesh around them: the file is damaged.
    pub damaged: usize,
    /// Vertices on their way to their place, or back.
    pub morphing: usize,
    /// Whether there was more to do than a frame may.
    pub is_limited: bool,
    /// Whether the tolerance is above the one asked for, because memory is used up.
    pub is_short_of_memory: bool,
    /// Blocks loaded.
    pub blocks_loaded: u64,
    /// Requests for a node that was resident, and for one that was not.
    pub requests: [u64; 2],
    /// Pages asked for that no loader reads yet.
    pub queued_pages: usize,
    /// Blocks resident after the frame.
    pub resident_blocks: usize,
    /// Bytes resident after the frame, as the quotas count them.
    pub resident_bytes: usize,
    /// The tolerance used, in pixels.
    pub tolerance_px: f32,
    /// Time for view tests.
    pub test_time: Duration,
    /// Time for splits and collapses.
    pub update_time: Duration,
    /// Time for taking blocks over and letting others go.
    pub handover_time: Duration,
    /// Time for reading and unpacking pages: the loaders' where there are some, else part of the frame.
    pub load_time: Duration,
    /// All that the frame took.
    pub frame_time: Duration,
}

/// A paged model with its active front.
///
/// ```no_run
/// use mergetree::Camera;
/// use xfm_pager::{Detail, Pager, PagerOptions, Session, SessionOptions};
///
/// let pager = Pager::open("scan.xfm", PagerOptions::default().with_loaders(2))?;
/// let mut session = Session::with_options(pager, SessionOptions::default())?;
/// let stats = session.frame(&Camera::default(), Detail::Pixels(1.0));
/// println!("{} triangles", stats.triangles_shown);
/// # Ok::<(), xfm_pager::Error>(())
/// ```
#[derive(Debug)]
pub struct Session {
    pager: Pager,
    front: Front,
    options: SessionOptions,
    control: ToleranceControl,
    /// Tolerance below which memory does not suffice, in pixels; 0 while it does.
    memory_tolerance: f32,
    /// The largest tolerance that memory did not suffice for since the camera moved, and how far above it to stay: the
    /// more often it was tried in vain, the farther.
    refused_tolerance: f32,
    distance: f32,
    /// Whether the front lets go of whatever it can, because a hard quota that was lowered is not met otherwise.
    lets_go: bool,
    /// The camera of the last frame.
    last: Option<Camera>,
    reported_time: Option<Duration>,
    inside_out: bool,
}

impl Session {
    /// Begins with the coarsest mesh.
    ///
    /// # Errors
    /// When the file's coarsest mesh is not a manifold.
    pub fn new(pager: Pager, dependencies: Dependencies) -> Result<Self, Error> {
        Self::with_options(pager, SessionOptions { dependencies, ..SessionOptions::default() })
    }

    /// Begins with the coarsest mesh.
    ///
    /// # Errors
    /// When the file's coarsest mesh is not a manifold.
    pub fn with_options(pager: Pager, options: SessionOptions) -> Result<Self, Error> {
        let mut front = Front::new(&pager, options.dependencies)
            .map_err(|source| Error::BaseMesh { file: pager.file().path().to_owned(), source })?;
        front.set_geomorph(options.geomorph_frames);
        let (min, max) = TOLERANCES;
        let inside_out = pager.base().is_inside_out();
        Ok(Self {
            pager,
            front,
            options,
            control: ToleranceControl::new(2.0, min, max),
            memory_tolerance: 0.0,
            refused_tolerance: 0.0,
            distance: LEAST_DISTANCE,
            lets_go: false,
            last: None,
            reported_time: None,
            inside_out,
        })
    }

    /// Whether the model is inside out ([`mergetree::BaseMesh::is_inside_out`]); the view test allows for it.
    pub fn is_inside_out(&self) -> bool {
        self.inside_out
    }

    /// Moves the front towards what the camera needs, as far as it is resident, and requests what is not.
    ///
    /// With [loaders](crate::PagerOptions::loaders) it never waits for the disk.
    pub fn frame(&mut self, camera: &Camera, detail: Detail) -> FrameStats {
        let begin = Instant::now();
        let wanted = match detail {
            Detail::Pixels(pixels) => pixels,
            Detail::Budget(_) | Detail::FrameTime(_) => self.control.tolerance(),
        };
        let tolerance_px = wanted.max(self.memory_tolerance);
        self.pager.begin_frame();
        let mut limits = UpdateLimits::with_tolerance(match self.lets_go {
            true => f32::INFINITY,
            false => tolerance_px,
        });
        limits.max_updates = self.options.max_updates;
        if self.pager.options().loaders > 0 {
            limits.max_time = self.options.max_update_time;
        }
        if let Detail::Budget(triangles) = detail {
            limits.max_triangles = triangles;
        }
        let view = self.view(camera);
        let mut update = self.front.update_view(&mut self.pager, &view, &limits);
        self.prefetch(camera, tolerance_px, &mut update.test_time);
        self.pager.end_frame();
        let pager = self.pager.stats();
        self.raise_tolerance_if_memory_is_short(tolerance_px);
        let frame_time = begin.elapsed();
        let share = match detail {
            Detail::Pixels(_) => None,
            Detail::Budget(triangles) => {
                Some(self.front.num_triangles() as f32 / triangles.max(1) as f32)
            }
            Detail::FrameTime(time) => {
                let taken = self.reported_time.take().unwrap_or(frame_time);
                Some(taken.as_secs_f32() / time.as_secs_f32().max(1e-4))
            }
        };
        // While detail of this tolerance is still to come, no finer one is asked for.
        let is_coming = update.waiting > 0 || update.limited;
        if let Some(share) = share.filter(|&share| share > 1.0 || !is_coming) {
            self.control.observe(share);
        }
        let load_in_frame = if self.pager.options().loaders == 0 {
            pager.frame.load_time + pager.frame.handover_time
        } else {
            Duration::ZERO
        };
        FrameStats {
            triangles_shown: self.front.num_triangles(),
            updates: update.splits + update.collapses,
            tests: update.tests,
            waiting: update.waiting,
            damaged: update.damaged,
            morphing: update.morphing,
            is_limited: update.limited,
            is_short_of_memory: self.memory_tolerance > wanted,
            blocks_loaded: pager.frame.loads,
            requests: [pager.frame.hits, pager.frame.misses],
            queued_pages: pager.queued_pages + pager.pages_in_flight,
            resident_blocks: pager.resident_blocks,
            resident_bytes: pager.resident_bytes,
            tolerance_px,
            test_time: update.test_time,
            // Without loaders, loading happens on request of an update.
            update_time: update.update_time.saturating_sub(load_in_frame),
            handover_time: pager.frame.handover_time,
            load_time: pager.frame.load_time,
            frame_time,
        }
    }

    fn view(&self, camera: &Camera) -> View {
        View::new(camera).inside_out(self.inside_out).with_test(self.options.test)
    }

    /// Requests what the camera will need if it moves on as it does, after all that it needs now.
    fn prefetch(&mut self, camera: &Camera, tolerance_px: f32, time: &mut Duration) {
        let Some(last) = self.last.replace(*camera) else { return };
        if last == *camera {
            return;
        }
        self.refused_tolerance = 0.0;
        self.distance = LEAST_DISTANCE;
        self.pager.view_changed();
        if self.pager.options().loaders == 0 {
            return;
        }
        let begin = Instant::now();
        let ahead = Camera {
            eye: camera.eye + FRAMES_AHEAD * (camera.eye - last.eye),
            at: camera.at + FRAMES_AHEAD * (camera.at - last.at),
            ..*camera
        };
        let view = self.view(&ahead);
        self.front.prefetch(&mut self.pager, &view, tolerance_px);
        *time += begin.elapsed();
    }

    fn exceeds_quota(&self) -> bool {
        self.pager.resident_bytes() > self.pager.options().hard_quota_bytes
    }

    /// Memory that is used up makes the picture coarser, until less is needed; then slowly finer again, but for a still
    /// camera not to where memory was used up before: the view settles.
    fn raise_tolerance_if_memory_is_short(&mut self, tolerance_px: f32) {
        let pager = self.pager.stats();
        let hard = self.pager.options().hard_quota_bytes as f32;
        let exceeded = self.exceeds_quota();
        // Where the eye is inside of what a node can change its error is above any tolerance.
        self.lets_go = exceeded && tolerance_px >= TOLERANCES.1;
        if pager.frame.refusals > 0 || exceeded {
            if self.refused_tolerance > 0.0 && tolerance_px > self.refused_tolerance {
                self.distance = (2.0 * self.distance).min(1.0);
            }
            self.refused_tolerance = self.refused_tolerance.max(tolerance_px);
            self.memory_tolerance = (1.1 * tolerance_px).clamp(TOLERANCES.0, TOLERANCES.1);
        } else if self.memory_tolerance > (1.0 + self.distance) * self.refused_tolerance
            && (pager.held_bytes as f32) < 0.85 * hard
        {
            self.memory_tolerance *= 0.98;
            if self.memory_tolerance < TOLERANCES.0 {
                self.memory_tolerance = 0.0;
            }
        }
    }

    /// Checks every invariant: [`Front::validate`], [`Pager::validate`], and that both know of the same split nodes, all of them
    /// resident. Does not count as use of what it looks at: frames go on as they would have.
    ///
    /// # Complexity
    /// Linear in the size of the active mesh and in the number of blocks of the file.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn validate(&self) -> Result<(), String> {
        let store = Unmoved(&self.pager);
        self.front.validate(&store).map_err(|error| format!("the front: {error}"))?;
        self.pager.validate().map_err(|error| format!("the pager: {error}"))?;
        let (split, marked) = (self.front.num_split_nodes(), self.pager.num_split());
        if split != marked {
            return Err(format!("the front has split {split} nodes, the pager knows of {marked}"));
        }
        Ok(())
    }

    /// Runs frames until nothing is left to do or to come, or the time is over. Returns the last one, with the updates,
    /// tests and loads of all.
    pub fn settle(&mut self, camera: &Camera, detail: Detail, most: Duration) -> FrameStats {
        let end = Instant::now() + most;
        let mut all = FrameStats::default();
        let mut quiet_frames = 0;
        loop {
            let mut stats = self.frame(camera, detail);
            let is_quiet = stats.updates == 0
                && !stats.is_limited
                && stats.morphing == 0
                && (self.lets_go || !self.exceeds_quota())
                && self.pager.is_idle();
            // A page that was not given is asked for again in the frame after the next.
            quiet_frames = if is_quiet { quiet_frames + 1 } else { 0 };
            let is_settled = quiet_frames == 3;
            all.updates += stats.updates;
            all.tests += stats.tests;
            all.blocks_loaded += stats.blocks_loaded;
            all.test_time += stats.test_time;
            all.update_time += stats.update_time;
            all.handover_time += stats.handover_time;
            all.load_time += stats.load_time;
            all.frame_time += stats.frame_time;
            let now = Instant::now();
            if is_settled || now >= end {
                let FrameStats { updates, tests, blocks_loaded, .. } = all;
                stats = FrameStats { updates, tests, blocks_loaded, ..stats };
                stats.test_time = all.test_time;
                stats.update_time = all.update_time;
                stats.handover_time = all.handover_time;
                stats.load_time = all.load_time;
                stats.frame_time = all.frame_time;
                return stats;
            }
            if stats.updates == 0 && !stats.is_limited {
                self.pager.wait(end - now);
            }
        }
    }

    /// Tells how long the last frame took with all that the caller does in it; for [`Detail::FrameTime`].
    pub fn report_frame_time(&mut self, time: Duration) {
        self.reported_time = Some(time);
    }

    /// Sets how a session goes about its frames; dependencies stay what they are.
    pub fn set_options(&mut self, options: SessionOptions) {
        self.options = SessionOptions { dependencies: self.options.dependencies, ..options };
        self.front.set_geomorph(options.geomorph_frames);
    }

    /// How it goes about its frames.
    pub fn options(&self) -> SessionOptions {
        self.options
    }

    /// Changes the quotas; see [`Pager::set_quotas`].
    pub fn set_quotas(&mut self, soft_quota_bytes: usize, hard_quota_bytes: usize) {
        self.pager.set_quotas(soft_quota_bytes, hard_quota_bytes);
        self.refused_tolerance = 0.0;
        self.distance = LEAST_DISTANCE;
    }

    /// The pager.
    pub fn pager(&self) -> &Pager {
        &self.pager
    }

    /// The front.
    pub fn front(&self) -> &Front {
        &self.front
    }

    /// All vertices of the active mesh; see [`Front::vertices`].
    pub fn vertices(&self) -> &[FrontVertex] {
        self.front.vertices()
    }

    /// All triangles of the active mesh; see [`Front::triangles`].
    pub fn triangles(&self) -> &[[u32; 3]] {
        self.front.triangles()
    }

    /// What changed since this was last called.
    pub fn take_changes(&mut self) -> Changes {
        self.front.take_changes()
    }
}

/// A pager that is looked at without noticing.
struct Unmoved<'a>(&'a Pager);

impl NodeStore for Unmoved<'_> {
    fn base(&self) -> &BaseMesh {
        self.0.base()
    }

    fn node(&self, id: NodeId) -> Option<&Node> {
        self.0.peek(id)
    }

    fn request(&mut self, id: NodeId, _urgency: f32) -> bool {
        self.node(id).is_some()
    }

    fn set_slot(&mut self, id: NodeId, _slot: Option<SlotId>) {
        unreachable!("node {id} is only looked at")
    }
}
