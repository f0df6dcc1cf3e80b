//! A model in flight: pager, front, view and tolerance, one call per frame.

use std::time::Duration;

use mergetree::{
    Camera, Changes, Dependencies, Front, FrontVertex, NodeStore, ToleranceControl, UpdateLimits,
    View,
};

use crate::{Error, Pager};

/// What decides how fine a frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// An error in pixels.
    Pixels(f32),
    /// A number of triangles: the tolerance moves so that it is held.
    Budget(usize),
}

/// Finest and coarsest tolerance that a budget may choose, in pixels.
const TOLERANCES: (f32, f32) = (0.05, 500.0);

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
    /// Blocks loaded.
    pub blocks_loaded: u64,
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
    /// Time for reading and inflating blocks.
    pub load_time: Duration,
}

/// A paged model with its active front.
///
/// ```no_run
/// use mergetree::{Camera, Dependencies};
/// use xfm_pager::{Detail, Pager, PagerOptions, Session};
///
/// let pager = Pager::open("scan.xfm", PagerOptions::default())?;
/// let mut session = Session::new(pager, Dependencies::Order)?;
/// let stats = session.frame(&Camera::default(), Detail::Pixels(1.0));
/// println!("{} triangles", stats.triangles_shown);
/// # Ok::<(), xfm_pager::Error>(())
/// ```
#[derive(Debug)]
pub struct Session {
    pager: Pager,
    front: Front,
    control: ToleranceControl,
    inside_out: bool,
}

impl Session {
    /// Begins with the coarsest mesh.
    ///
    /// # Errors
    /// When the file's coarsest mesh is not a manifold.
    pub fn new(pager: Pager, dependencies: Dependencies) -> Result<Self, Error> {
        let front = Front::new(&pager, dependencies)
            .map_err(|source| Error::BaseMesh { file: pager.file().path().to_owned(), source })?;
        let (min, max) = TOLERANCES;
        let inside_out = pager.base().is_inside_out();
        Ok(Self { pager, front, control: ToleranceControl::new(2.0, min, max), inside_out })
    }

    /// Whether the model is inside out ([`mergetree::BaseMesh::is_inside_out`]); the view test allows for it.
    pub fn is_inside_out(&self) -> bool {
        self.inside_out
    }

    /// Moves the front towards what the camera needs, reading what is not resident as far as the quotas allow.
    pub fn frame(&mut self, camera: &Camera, detail: Detail) -> FrameStats {
        let tolerance_px = match detail {
            Detail::Pixels(pixels) => pixels,
            Detail::Budget(_) => self.control.tolerance(),
        };
        self.pager.begin_frame();
        let view = View::new(camera).inside_out(self.inside_out);
        let mut limits = UpdateLimits::with_tolerance(tolerance_px);
        if let Detail::Budget(triangles) = detail {
            limits.max_triangles = triangles;
        }
        let update = self.front.update_view(&mut self.pager, &view, &limits);
        let pager = self.pager.stats();
        let load_time = pager.frame.load_time;
        if let Detail::Budget(triangles) = detail {
            self.control.observe(self.front.num_triangles() as f32 / triangles.max(1) as f32);
        }
        FrameStats {
            triangles_shown: self.front.num_triangles(),
            updates: update.splits + update.collapses,
            tests: update.tests,
            waiting: update.waiting,
            blocks_loaded: pager.frame.loads,
            resident_blocks: pager.resident_blocks,
            resident_bytes: pager.resident_bytes,
            tolerance_px,
            test_time: update.test_time,
            // Loading happens on request of an update.
            update_time: update.update_time.saturating_sub(load_time),
            load_time,
        }
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
