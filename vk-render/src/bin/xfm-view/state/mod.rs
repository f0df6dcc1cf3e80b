//! What the viewer is set to and what its tools hold; nothing of windows or drawing.

mod detail;
mod history;
mod look;
mod measure;
mod notices;
mod section;

use glam::Vec3;
use mergetree::{Camera, CameraPath};
use vk_render::Shading;

pub(crate) use detail::{By, DetailChoice};
pub(crate) use history::{FrameTime, History};
pub(crate) use look::Look;
pub(crate) use measure::{Measure, length_text, position_text};
pub(crate) use notices::Notices;
pub(crate) use section::{Axis, SectionTool};

use crate::camera::navigator::Navigator;
use crate::camera::path::{Recording, Replay};
use crate::camera::standard::Up;
use crate::model::{Model, Numbers, Paint};

/// Which panels are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Panels {
    pub(crate) controls: bool,
    pub(crate) numbers: bool,
    pub(crate) help: bool,
    /// None of them.
    pub(crate) hidden: bool,
    /// What the mouse does, until it has done something.
    pub(crate) hint: bool,
}

impl Default for Panels {
    fn default() -> Self {
        Self { controls: true, numbers: true, help: false, hidden: false, hint: true }
    }
}

/// All of it.
#[derive(Debug)]
pub(crate) struct State {
    pub(crate) navigator: Navigator,
    /// Angle of view and size of the picture.
    pub(crate) lens: Camera,
    pub(crate) bounds: [Vec3; 2],
    pub(crate) detail: DetailChoice,
    /// Soft and hard, in bytes.
    pub(crate) quotas: [usize; 2],
    quotas_in_force: [usize; 2],
    pub(crate) look: Look,
    /// Whether somebody has chosen that; else it goes by the model.
    look_is_chosen: bool,
    pub(crate) fly: bool,
    /// The camera that the detail is kept for, while it is not the one that looks.
    pub(crate) frozen: Option<Camera>,
    pub(crate) section: SectionTool,
    pub(crate) measure: Measure,
    pub(crate) panels: Panels,
    pub(crate) notices: Notices,
    pub(crate) recording: Option<Recording>,
    pub(crate) replay: Option<Replay>,
    /// What [`Action::Replay`](crate::action::Action::Replay) replays.
    pub(crate) last_path: Option<CameraPath>,
    /// The camera of a replay, which may lean.
    replayed: Option<Camera>,
    pub(crate) history: History,
}

impl State {
    pub(crate) fn new(
        lens: Camera,
        detail: DetailChoice,
        look: Option<Look>,
        quotas: [usize; 2],
    ) -> Self {
        let bounds = [Vec3::NEG_ONE, Vec3::ONE];
        Self {
            navigator: Navigator::around(bounds, Up::Y, &lens),
            lens,
            bounds,
            detail,
            quotas,
            quotas_in_force: quotas,
            look: look.unwrap_or_default(),
            look_is_chosen: look.is_some(),
            fly: false,
            frozen: None,
            section: SectionTool::default(),
            measure: Measure::default(),
            panels: Panels::default(),
            notices: Notices::default(),
            recording: None,
            replay: None,
            last_path: None,
            replayed: None,
            history: History::default(),
        }
    }

    /// Looks at the whole of a model that was just opened.
    pub(crate) fn meet(&mut self, model: &Model) {
        self.bounds = model.bounds;
        self.navigator = Navigator::around(model.bounds, self.navigator.up(), &self.lens);
        self.frozen = None;
        self.replayed = None;
        self.section.on = false;
        self.measure.points.clear();
        match (model.has_colours(), self.look) {
            (true, _) if !self.look_is_chosen => self.look = Look::Own,
            (false, Look::Own) => self.look = Look::Smooth,
            _ => {}
        }
    }

    pub(crate) fn radius(&self) -> f32 {
        crate::model::radius(self.bounds)
    }

    /// The camera that looks.
    pub(crate) fn camera(&self) -> Camera {
        match self.replayed {
            Some(camera) => Camera { width: self.lens.width, height: self.lens.height, ..camera },
            None => self.navigator.camera(&self.lens),
        }
    }

    /// The camera that the detail is for.
    pub(crate) fn detail_camera(&self) -> Camera {
        self.frozen.unwrap_or_else(|| self.camera())
    }

    /// Shows a camera of a replay; with `None` it goes on from where that was.
    pub(crate) fn show_replayed(&mut self, camera: Option<Camera>) {
        if let (None, Some(last)) = (camera, self.replayed) {
            self.navigator.go_to(&last);
        }
        self.replayed = camera;
    }

    /// Ends a replay, if one is under way, because somebody takes over.
    pub(crate) fn take_over(&mut self) {
        if self.replay.take().is_some() {
            self.show_replayed(None);
        }
    }

    /// The section's plane faces the eye from now on.
    pub(crate) fn section_from_here(&mut self) {
        let camera = self.camera();
        self.section.view = (camera.eye - camera.at).normalize_or(Vec3::Z);
    }

    /// Quotas that are in force are shown, unless others are being set.
    pub(crate) fn quotas_seen(&mut self, numbers: &Numbers) {
        let in_force = [numbers.soft_quota, numbers.hard_quota];
        if self.quotas_in_force != in_force {
            self.quotas_in_force = in_force;
            self.quotas = in_force;
        }
    }

    pub(crate) fn choose_look(&mut self, look: Look) {
        self.look = look;
        self.look_is_chosen = true;
    }

    pub(crate) fn shading(&self) -> Shading {
        self.look.shading()
    }

    pub(crate) fn paint(&self) -> Paint {
        self.look.paint()
    }
}
