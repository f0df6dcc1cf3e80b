//! The viewer without its window: state, model, and what actions and gestures do to them.

use std::path::PathBuf;
use std::time::Duration;

use glam::Vec2;

use crate::action::Action;
use crate::camera::path::{Recording, Replay};
use crate::camera::{outside, path};
use crate::error::{Error, one_line};
use crate::input::held::Held;
use crate::input::pointer::Gesture;
use crate::model::{Model, Numbers, Opened, Opener, Opening};
use crate::output;
use crate::panels::{self, Facts};
use crate::pick;
use crate::state::{Axis, State};

/// Calls the window when a thread is done.
pub(crate) type Notify = std::sync::Arc<dyn Fn() + Send + Sync>;

pub(crate) struct Viewer {
    pub(crate) state: State,
    pub(crate) model: Option<Box<Model>>,
    pub(crate) opening: Option<Opening>,
    pub(crate) opener: Opener,
    pub(crate) numbers: Option<Numbers>,
    pub(crate) held: Held,
    /// Whether walking is fast and drags move: Shift.
    pub(crate) shift: bool,
    pub(crate) hovering: bool,
    /// Where to look first, instead of at the whole.
    pub(crate) first_view: Option<String>,
    /// A model was opened that has not been seen yet.
    pub(crate) is_new: bool,
    problems_said: usize,
    notify: Notify,
}

impl Viewer {
    pub(crate) fn new(state: State, opener: Opener, notify: Notify) -> Self {
        Self {
            state,
            model: None,
            opening: None,
            opener,
            numbers: None,
            held: Held::default(),
            shift: false,
            hovering: false,
            first_view: None,
            is_new: false,
            problems_said: 0,
            notify,
        }
    }

    /// Begins to open a file; what was being opened is broken off.
    pub(crate) fn open(&mut self, file: PathBuf) {
        let notify = std::sync::Arc::clone(&self.notify);
        self.opening = Some(Opening::start(file, self.opener, move || notify()));
    }

    /// Takes over what has been opened.
    pub(crate) fn poll(&mut self) {
        let Some(opening) = self.opening.take() else { return };
        match opening.poll() {
            Opened::NotYet(opening) => self.opening = Some(opening),
            Opened::Done(model) => self.take(model),
            Opened::Failed(error) => self.state.notices.complain(one_line(&error)),
            Opened::Cancelled => self.state.notices.say("Cancelled"),
        }
    }

    pub(crate) fn take(&mut self, model: Box<Model>) {
        self.state.meet(&model);
        if let Some(text) = self.first_view.take() {
            self.go_to_text(&text);
        }
        self.model = Some(model);
        self.numbers = None;
        self.is_new = true;
        self.problems_said = 0;
    }

    /// Lets time pass: walking, recording, replaying. Whether anything moves, so that another frame is due.
    pub(crate) fn step(&mut self, passed: Duration) -> bool {
        let state = &mut self.state;
        state.notices.step(passed);
        if self.held.any() {
            state.take_over();
            let near = state.navigator.nearness();
            let steps = self.held.steps(passed, self.shift, near);
            state.navigator.walk(steps);
            state.panels.hint = false;
        }
        if let Some(mut replay) = state.replay.take() {
            match replay.step(passed, &state.lens) {
                Some(camera) => {
                    state.show_replayed(Some(camera));
                    state.replay = Some(replay);
                }
                None => state.show_replayed(None),
            }
        }
        let camera = state.camera();
        if let Some(recording) = &mut state.recording {
            recording.note(&camera, passed);
        }
        self.held.any() || state.replay.is_some() || state.recording.is_some()
    }

    /// Moves the model's detail towards what the camera needs.
    pub(crate) fn refine(&mut self) {
        let Some(model) = &mut self.model else { return };
        model.set_gliding(self.state.detail.glides);
        if let Some(time) = self.state.history.last() {
            model.report_frame_time(time.whole);
        }
        let numbers = model.frame(&self.state.detail_camera(), self.state.detail.detail());
        self.state.quotas_seen(&numbers);
        self.numbers = Some(numbers);
        let problems: Vec<String> = model.problems().skip(self.problems_said).collect();
        self.problems_said += problems.len();
        for problem in problems {
            self.state.notices.complain(problem);
        }
    }

    /// Whether the picture is as fine as it is going to be.
    pub(crate) fn is_settled(&self) -> bool {
        self.numbers.is_none_or(|numbers| numbers.is_settled())
    }

    pub(crate) fn panels(&mut self, context: &egui::Context, device: &str) -> Vec<Action> {
        let facts = Facts {
            model: self.model.as_deref(),
            opening: self.opening.as_ref(),
            numbers: self.numbers.as_ref(),
            device,
            hovering: self.hovering,
        };
        panels::show(context, &mut self.state, facts)
    }

    /// Does what a drag, a wheel or a click asks for.
    pub(crate) fn gesture(&mut self, gesture: Gesture, pointer: Option<Vec2>) {
        if self.model.is_none() {
            return;
        }
        let height = self.state.lens.height.max(1) as f32;
        if !matches!(gesture, Gesture::Click(_)) {
            self.state.take_over();
            self.state.panels.hint = false;
        }
        match gesture {
            Gesture::Turn(drag) if self.state.fly => {
                self.state.navigator.look(drag / height, &self.state.lens);
            }
            Gesture::Turn(drag) => self.state.navigator.turn(drag / height),
            Gesture::Move(drag) => self.state.navigator.pan(drag / height, &self.state.lens),
            Gesture::Zoom(notches) => {
                let towards = pointer.map_or_else(
                    || self.state.camera().at,
                    |place| self.surface_at(place).unwrap_or_else(|| self.beyond(place)),
                );
                self.state.navigator.zoom(notches, towards);
            }
            Gesture::Click(place) => {
                if self.state.measure.on {
                    match self.surface_at(place) {
                        Some(point) => self.state.measure.pick(point),
                        None => self.state.notices.say("There is no surface at this place"),
                    }
                }
            }
            Gesture::DoubleClick(place) => {
                if !self.state.measure.on
                    && let Some(point) = self.surface_at(place)
                {
                    self.state.navigator.centre_on(point);
                }
            }
        }
    }

    fn share(&self, place: Vec2) -> Vec2 {
        let lens = &self.state.lens;
        place / Vec2::new(lens.width.max(1) as f32, lens.height.max(1) as f32)
    }

    /// The point of the surface that is seen at a place in the picture.
    pub(crate) fn surface_at(&self, place: Vec2) -> Option<glam::Vec3> {
        let ray = self.state.navigator.ray(self.share(place), &self.state.lens);
        let (position, triangles) = self.model.as_ref()?.surface();
        pick::first_hit(ray, position, triangles, self.state.section.plane(self.state.bounds))
    }

    /// Where there is no surface: the point as far away as what is looked at.
    fn beyond(&self, place: Vec2) -> glam::Vec3 {
        let (eye, direction) = self.state.navigator.ray(self.share(place), &self.state.lens);
        eye + direction
    }

    fn go_to_text(&mut self, text: &str) {
        match path::parse_view(text, &self.state.lens) {
            Ok(camera) => {
                self.state.take_over();
                self.state.navigator.go_to(&camera);
            }
            Err(error) => self.state.notices.complain(one_line(&error)),
        }
    }

    /// Goes to a view that was pasted.
    pub(crate) fn paste(&mut self, text: &str) {
        if self.model.is_some() {
            self.go_to_text(text);
        }
    }

    /// Does what is asked for. What needs the window or the device is given back.
    pub(crate) fn act(&mut self, action: Action) -> Result<Option<Action>, Error> {
        let state = &mut self.state;
        match action {
            Action::Fit => {
                state.take_over();
                state.navigator.fit(&state.lens);
            }
            Action::Stand(view) => {
                state.take_over();
                state.navigator.stand(view, &state.lens);
            }
            Action::OtherUp => {
                state.take_over();
                state.navigator.set_up(state.navigator.up().other(), &state.lens);
            }
            Action::Fly => state.fly = !state.fly,
            Action::Finer => state.detail.scale(0.8),
            Action::Coarser => state.detail.scale(1.25),
            Action::NextLook => {
                let has_colours = self.model.as_ref().is_some_and(|model| model.has_colours());
                state.choose_look(state.look.next(has_colours));
            }
            Action::Look(look) => state.choose_look(look),
            Action::Freeze => {
                state.frozen = match state.frozen {
                    None => Some(state.camera()),
                    Some(_) => None,
                };
            }
            Action::Outside => {
                state.take_over();
                let inner = *state.frozen.get_or_insert(state.navigator.camera(&state.lens));
                let camera = outside::camera(&inner, state.bounds, state.navigator.up().axis());
                state.navigator.go_to(&camera);
            }
            Action::Section => {
                state.section.on = !state.section.on;
                if state.section.on && state.section.axis == Axis::View {
                    state.section_from_here();
                }
            }
            Action::SectionFromHere => state.section_from_here(),
            Action::Measure => {
                state.measure.on = !state.measure.on;
                if !state.measure.on {
                    state.measure.points.clear();
                }
            }
            Action::Record => return self.record().map(|()| None),
            Action::Replay => {
                if state.replay.is_some() {
                    state.take_over();
                } else if let Some(path) = &state.last_path {
                    state.replay = Some(Replay::new(path.clone()));
                } else {
                    state.notices.say("There is no path yet: R records one");
                }
            }
            Action::Controls => state.panels.controls = !state.panels.controls,
            Action::Numbers => state.panels.numbers = !state.panels.numbers,
            Action::HidePanels => {
                state.panels.hidden = !state.panels.hidden;
                if state.panels.hidden {
                    state.notices.say("H shows the panels again");
                }
            }
            Action::Help => {
                state.panels.help = !state.panels.help;
                state.panels.hidden = false;
            }
            Action::Leave => self.leave(),
            Action::Quotas(quotas) => self.set_quotas(quotas),
            Action::CancelOpening => {
                if let Some(opening) = &self.opening {
                    opening.cancel();
                }
            }
            Action::DismissNotice(text) => state.notices.dismiss(&text),
            other => return Ok(Some(other)),
        }
        Ok(None)
    }

    /// Leaves what is open, the latest kind of thing first.
    fn leave(&mut self) {
        let state = &mut self.state;
        if state.panels.help {
            state.panels.help = false;
        } else if state.replay.is_some() {
            state.take_over();
        } else if state.measure.on {
            state.measure.on = false;
            state.measure.points.clear();
        } else if state.fly {
            state.fly = false;
        } else if state.section.on {
            state.section.on = false;
        } else if state.frozen.is_some() {
            state.frozen = None;
        } else {
            state.notices.say("Ctrl+Q or closing the window leaves");
        }
    }

    fn record(&mut self) -> Result<(), Error> {
        let state = &mut self.state;
        let Some(recording) = state.recording.take() else {
            state.recording = Some(Recording::default());
            return Ok(());
        };
        let (path, text) = recording.finish();
        let poses = path.len();
        state.last_path = Some(path);
        let file = self.free_name("path", "txt");
        output::write(&file, text.as_bytes())?;
        let shown = file.display();
        self.state.notices.say(format!("Wrote {shown}: {poses} poses. Y replays it"));
        Ok(())
    }

    fn set_quotas(&mut self, quotas: [usize; 2]) {
        [self.opener.pager.soft_quota_bytes, self.opener.pager.hard_quota_bytes] = quotas;
        if let Some(model) = &mut self.model {
            model.set_quotas(quotas);
        }
    }

    /// The first name in the current folder that is free.
    pub(crate) fn free_name(&self, kind: &str, extension: &str) -> PathBuf {
        let stem = self.model.as_ref().and_then(|model| model.source.file_stem());
        let stem = stem.unwrap_or_default().to_string_lossy();
        (1..)
            .map(|n| PathBuf::from(format!("{stem}-{kind}-{n:03}.{extension}")))
            .find(|file| !file.exists())
            .unwrap_or_default()
    }
}
