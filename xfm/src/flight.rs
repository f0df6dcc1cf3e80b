//! A flight over a model without a picture: the front follows a camera, and every step is timed.

use std::time::{Duration, Instant};

use halfedge::BuildError;
use mergetree::{Camera, CameraPath, Dependencies, Front, ToleranceControl, UpdateLimits, View};
use xfm_pager::Pager;

/// What holds the number of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Detail {
    /// An error on the screen, in pixels.
    Pixels(f32),
    /// A number of triangles; the error in pixels follows. Splits that are needed for another may go a few beyond.
    Budget(usize),
}

/// One frame of a flight.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Frame {
    /// Triangles of the mesh after the frame.
    pub triangles_shown: usize,
    /// Splits and collapses.
    pub updates: usize,
    /// Nodes tested.
    pub tests: usize,
    /// Blocks loaded.
    pub blocks_loaded: u64,
    /// Nodes too coarse because something they depend on was not resident.
    pub waiting: usize,
    /// Nodes that do not fit the mesh around them.
    pub damaged: usize,
    /// The tolerance, in pixels.
    pub tolerance_px: f32,
    /// All of the frame: hand-over, tests, updates, and listing what changed for a renderer.
    pub time: Duration,
    /// Splits and collapses, with the requests that they make.
    pub update_time: Duration,
    /// View tests of the front as it was.
    pub test_time: Duration,
    /// Beginning the frame: taking over what was loaded, letting go what is over the quota.
    pub handover_time: Duration,
    /// Reading and inflating blocks.
    pub load_time: Duration,
}

/// Of the triangles allowed so many are aimed for, so that there is room for what comes into view.
const AIM: f32 = 0.9;

/// Flies along a path, and hands every frame to `each`, which says whether to go on.
///
/// # Errors
///
/// [`BuildError`] if the coarsest mesh of the file is not a manifold.
pub fn fly(
    pager: &mut Pager,
    path: &CameraPath,
    lens: &Camera,
    (frames, detail): (usize, Detail),
    mut each: impl FnMut(Frame) -> bool,
) -> Result<(), BuildError> {
    let mut front = Front::new(pager, Dependencies::Order)?;
    let mut control = ToleranceControl::new(1.0, 0.01, 1e6);
    for index in 0..frames {
        let share = index as f32 / (frames - 1).max(1) as f32;
        let camera = path.camera(share, lens);
        let start = Instant::now();
        pager.begin_frame();
        let handover_time = start.elapsed();
        let view = View::new(&camera);
        let mut limits = UpdateLimits::default();
        match detail {
            Detail::Pixels(pixels) => limits.tolerance = pixels,
            Detail::Budget(triangles) => {
                limits.tolerance = control.tolerance();
                limits.max_triangles = triangles;
            }
        }
        let stats = front.update(pager, |node| view.error_px(node), &limits);
        drop(front.take_changes());
        let time = start.elapsed();
        if let Detail::Budget(triangles) = detail {
            control.observe(front.num_triangles() as f32 / (AIM * triangles as f32));
        }
        let paged = pager.stats().frame;
        let go_on = each(Frame {
            triangles_shown: front.num_triangles(),
            updates: stats.splits + stats.collapses,
            tests: stats.tests,
            blocks_loaded: paged.loads,
            waiting: stats.waiting,
            damaged: stats.damaged,
            tolerance_px: limits.tolerance,
            time,
            update_time: stats.update_time,
            test_time: stats.test_time,
            handover_time,
            load_time: paged.load_time,
        });
        if !go_on {
            break;
        }
    }
    Ok(())
}
