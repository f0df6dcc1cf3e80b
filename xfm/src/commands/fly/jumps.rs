//! A camera that jumps at random: what no path does, at every scale, and with little mercy.

use std::time::Instant;

use glam::Vec3;
use mergetree::Camera;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use xfm_format::XfmFile;

use super::record::Frame;
use crate::spread::Spread;

/// Frames that a view has to settle after a jump.
pub const MOST_SETTLING_FRAMES: u32 = 1200;
/// A view is settled when nothing changed for so many frames.
pub const QUIET_FRAMES: u32 = 10;
/// The finest and the coarsest error on the screen, as multiples of the one asked for.
const TOLERANCES: [f32; 2] = [0.5, 20.0];
/// The first jumps are to all of the model, in all detail: memory is used up early, so that growth is growth.
const NUM_FULL: u64 = 3;
/// Places on the surface to go close to.
const MOST_PLACES: usize = 512;

/// What the next frame is to show.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    pub camera: Camera,
    /// The error on the screen, as a multiple of the one asked for.
    pub tolerance: f32,
    /// New quotas, as a share of those asked for: 0 is what the model needs at least.
    pub quota: Option<f32>,
}

/// Where a jump goes, how, and for how long.
#[derive(Debug)]
struct Leg {
    from: Camera,
    to: Camera,
    /// Frames on the way; 0 to be there at once.
    way: u32,
    /// Frames to stay; `None` until the view has settled.
    stay: Option<u32>,
    tolerance: f32,
    /// Whether the tolerance changes with every frame but those of a view that is to settle.
    is_restless: bool,
    quota: Option<f32>,
    /// Frames flown.
    flown: u32,
    arrived: Option<Instant>,
    last_change_s: f64,
    quiet: u32,
    random: Xoshiro256PlusPlus,
}

/// What came of the jumps.
#[derive(Debug, Clone, Serialize)]
pub struct JumpReport {
    seed: u64,
    /// Jumps, those after a flight in a straight line included.
    jumps: u64,
    flights: u64,
    quota_changes: u64,
    /// Views that were watched until nothing changed any more, and those that always did.
    settled: usize,
    pub unsettled: usize,
    settle_s: Spread,
    settle_frames: Spread,
}

/// The jumps of a seed. Where they go does not depend on how long frames take; when, may.
#[derive(Debug)]
pub struct Jumps {
    seed: u64,
    lens: Camera,
    center: Vec3,
    half: Vec3,
    /// Points of the surface with their normals.
    places: Vec<[Vec3; 2]>,
    num_legs: u64,
    leg: Leg,
    flights: u64,
    quota_changes: u64,
    unsettled: usize,
    /// Seconds and frames that views took to settle.
    settled: Vec<[f64; 2]>,
}

impl Jumps {
    pub fn new(file: &XfmFile, seed: u64, lens: &Camera) -> Self {
        let [min, max] = file.header().bounds;
        let vertices = &file.base().vertices;
        let step = vertices.len().div_ceil(MOST_PLACES).max(1);
        let places = vertices.iter().step_by(step);
        let places = places.map(|vertex| [vertex.position, vertex.normal.to_vec3()]).collect();
        let whole = lens.framing(min, max, Vec3::NEG_Z);
        let mut jumps = Self {
            seed,
            lens: whole,
            center: 0.5 * (min + max),
            half: 0.5 * (max - min).max(Vec3::splat(f32::MIN_POSITIVE)),
            places,
            num_legs: 0,
            leg: Leg {
                from: whole,
                to: whole,
                way: 0,
                stay: Some(0),
                tolerance: 1.0,
                is_restless: false,
                quota: None,
                flown: 0,
                arrived: None,
                last_change_s: 0.0,
                quiet: 0,
                random: Xoshiro256PlusPlus::seed_from_u64(seed),
            },
            flights: 0,
            quota_changes: 0,
            unsettled: 0,
            settled: Vec::new(),
        };
        jumps.begin_leg();
        jumps
    }

    /// All of the model, from in front.
    pub fn whole(&self) -> Camera {
        self.lens
    }

    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The number of the present jump, from 1.
    pub fn number(&self) -> u64 {
        self.num_legs
    }

    fn begin_leg(&mut self) {
        // Every one has a sequence of its own: how many frames those before took has no influence.
        let mut random = Xoshiro256PlusPlus::seed_from_u64(
            self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ self.num_legs,
        );
        let to = self.pose(&mut random);
        let flies = random.random_range(0..3) == 0;
        let way = if flies { random.random_range(5..90) } else { 0 };
        let stay = match random.random_range(0..4) {
            0 => None,
            1 => Some(random.random_range(20..120)),
            _ => Some(random.random_range(1..12)),
        };
        let [finest, coarsest] = TOLERANCES.map(f32::ln);
        let tolerance = random.random_range(finest..coarsest).exp();
        let is_restless = random.random_range(0..5) == 0;
        let quota = match random.random_range(0..6) {
            0 => Some(random.random_range(0.1..1.0)),
            1 => Some(1.0),
            _ => None,
        };
        let (to, way, stay, tolerance, quota) = match self.num_legs < NUM_FULL {
            true => (self.near(&to), 0, None, TOLERANCES[0], None),
            false => (to, way, stay, tolerance, quota),
        };
        self.flights += u64::from(way > 0);
        self.num_legs += 1;
        self.quota_changes += u64::from(quota.is_some());
        self.leg = Leg {
            from: self.leg.to,
            to,
            way,
            stay,
            tolerance,
            is_restless,
            quota,
            flown: 0,
            arrived: None,
            last_change_s: 0.0,
            quiet: 0,
            random,
        };
    }

    /// All of the model, from as near as can be on this side.
    fn near(&self, camera: &Camera) -> Camera {
        let away = (camera.eye - self.center).normalize_or(Vec3::Z);
        let eye = self.center + 1.2 * self.half.length() * away;
        Camera { eye, at: self.center, ..*camera }
    }

    fn pose(&self, random: &mut Xoshiro256PlusPlus) -> Camera {
        let radius = self.half.length();
        let direction = direction(random);
        let at = match self.places.get(random.random_range(0..self.places.len().max(1))) {
            Some(&[at, normal]) => [at, normal],
            None => [self.center, direction],
        };
        let inside = |random: &mut Xoshiro256PlusPlus| {
            let [x, y, z] = [0; 3].map(|_| random.random_range(-1.0..1.0f32));
            self.center + self.half * Vec3::new(x, y, z)
        };
        let ([place, normal], far) = (at, random.random_range(0.0..1.0f32));
        let (eye, at) = match random.random_range(0..12) {
            // From far outside, to where all of it is a few pixels.
            0 => (self.center + direction * radius * (3.0 * 100f32.powf(far)), self.center),
            // All of it.
            1 | 2 => (self.center + direction * radius * (1.1 + 2.0 * far), self.center),
            // Close to the surface, looking down on it.
            3..=6 => (place + normal * radius * 0.0001f32.powf(far), place),
            // Along the surface.
            7 | 8 => {
                let along = normal.cross(direction).normalize_or(normal.any_orthonormal_vector());
                let eye = place + normal * radius * 0.05 * 0.01f32.powf(far);
                (eye, eye + along * radius)
            }
            // Inside the box, in any direction.
            9 => {
                let eye = inside(random);
                (eye, eye + direction * radius)
            }
            // On the surface itself.
            10 => (place, place + direction * radius),
            // Away from the model.
            _ => {
                let eye = self.center + direction * radius * (1.5 + 4.0 * far);
                (eye, eye + direction * radius)
            }
        };
        Camera { eye, at, ..self.lens }
    }

    /// What the next frame shows.
    pub fn step(&mut self) -> Step {
        let leg = &mut self.leg;
        let is_under_way = leg.flown < leg.way;
        let camera = if is_under_way {
            let share = leg.flown as f32 / leg.way as f32;
            let between = |from: Vec3, to: Vec3| from.lerp(to, share);
            Camera {
                eye: between(leg.from.eye, leg.to.eye),
                at: between(leg.from.at, leg.to.at),
                ..leg.to
            }
        } else {
            leg.arrived.get_or_insert_with(Instant::now);
            leg.to
        };
        if leg.is_restless && (is_under_way || leg.stay.is_some()) {
            let [finest, coarsest] = TOLERANCES;
            leg.tolerance = leg.random.random_range(finest..coarsest);
        }
        leg.flown += 1;
        Step { camera, tolerance: leg.tolerance, quota: leg.quota.take() }
    }

    /// Takes in what came of a frame. Returns whether the view has settled with it.
    pub fn observe(&mut self, frame: &Frame, hard_quota: usize) -> bool {
        let leg = &mut self.leg;
        let Some(arrived) = leg.arrived else { return false };
        let stayed = leg.flown - leg.way;
        if let Some(stay) = leg.stay {
            if stayed >= stay {
                self.begin_leg();
            }
            return false;
        }
        if frame.is_busy(hard_quota) {
            leg.last_change_s = arrived.elapsed().as_secs_f64();
            leg.quiet = 0;
        } else {
            leg.quiet += 1;
        }
        let has_settled = leg.quiet == QUIET_FRAMES;
        if has_settled {
            self.settled.push([leg.last_change_s, f64::from(stayed - QUIET_FRAMES)]);
        }
        let gives_up = stayed == MOST_SETTLING_FRAMES && !has_settled;
        self.unsettled += usize::from(gives_up);
        if has_settled || gives_up {
            self.begin_leg();
        }
        has_settled
    }

    pub fn report(&self) -> JumpReport {
        let spread = |which: usize| Spread::of(self.settled.iter().map(|all| all[which]).collect());
        JumpReport {
            seed: self.seed,
            jumps: self.num_legs,
            flights: self.flights,
            quota_changes: self.quota_changes,
            settled: self.settled.len(),
            unsettled: self.unsettled,
            settle_s: spread(0),
            settle_frames: spread(1),
        }
    }
}

impl std::fmt::Display for JumpReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        use crate::text;
        let Spread { median, max, .. } = self.settle_s;
        write!(
            f,
            "{} jumps of seed {} ({} in flight, {} with other quotas); of the views that could, {} settled, in {} (at most {}, {} frames), {} did not",
            text::count(self.jumps),
            self.seed,
            text::count(self.flights),
            text::count(self.quota_changes),
            text::count(self.settled as u64),
            text::seconds(median),
            text::seconds(max),
            text::count(self.settle_frames.max as u64),
            text::count(self.unsettled as u64),
        )
    }
}

fn direction(random: &mut Xoshiro256PlusPlus) -> Vec3 {
    let z = random.random_range(-1.0..1.0f32);
    let angle = random.random_range(0.0..std::f32::consts::TAU);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}
