//! Keys that are held to walk.

use std::time::Duration;

use glam::Vec3;
use winit::keyboard::KeyCode;

/// By place on the keyboard, so that they lie together in any language.
const WALKING: [(KeyCode, Vec3); 6] = [
    (KeyCode::KeyW, Vec3::Z),
    (KeyCode::KeyS, Vec3::NEG_Z),
    (KeyCode::KeyD, Vec3::X),
    (KeyCode::KeyA, Vec3::NEG_X),
    (KeyCode::KeyE, Vec3::Y),
    (KeyCode::KeyQ, Vec3::NEG_Y),
];

/// Radii of the model per second.
const SPEED: f32 = 0.5;
const FAST: f32 = 4.0;
/// A frame that took longer than this counts as this long: nobody flies through a wall because of a hiccup.
const LONGEST: Duration = Duration::from_millis(100);

/// Which of them are held.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Held {
    keys: [bool; 6],
}

impl Held {
    /// Notes a key; whether it is one of them.
    pub(crate) fn set(&mut self, code: KeyCode, pressed: bool) -> bool {
        let Some(at) = WALKING.iter().position(|(key, _)| *key == code) else { return false };
        self.keys[at] = pressed;
        true
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(crate) fn any(&self) -> bool {
        self.keys.contains(&true)
    }

    /// How far they lead in a time: to the right, upwards, forwards, in radii of the model.
    pub(crate) fn steps(&self, passed: Duration, fast: bool, slow_near: f32) -> Vec3 {
        let held = WALKING.iter().zip(self.keys).filter(|(_, held)| *held);
        let direction: Vec3 = held.map(|((_, direction), _)| *direction).sum();
        let speed = SPEED * slow_near * if fast { FAST } else { 1.0 };
        direction.normalize_or_zero() * speed * passed.min(LONGEST).as_secs_f32()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_keys_cancel_and_two_are_no_faster_than_one() {
        let mut held = Held::default();
        let step = Duration::from_millis(50);
        assert!(held.set(KeyCode::KeyW, true) && !held.set(KeyCode::KeyF, true));
        let one = held.steps(step, false, 1.0);
        held.set(KeyCode::KeyD, true);
        assert!((held.steps(step, false, 1.0).length() - one.length()).abs() < 1e-6);
        held.set(KeyCode::KeyA, true);
        assert_eq!(held.steps(step, false, 1.0), one);
        held.set(KeyCode::KeyS, true);
        assert_eq!(held.steps(step, true, 1.0), Vec3::ZERO);
        held.clear();
        assert!(!held.any());
    }
}
