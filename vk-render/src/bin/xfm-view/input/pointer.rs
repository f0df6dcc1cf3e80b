//! What the mouse and the touchpad do.

use glam::Vec2;
use winit::dpi::PhysicalPosition;
use winit::event::{ElementState, MouseButton, MouseScrollDelta};

/// A press that moves the pointer no farther is a click, in pixels.
const CLICK_PX: f32 = 4.0;
/// Two clicks within this time are a double click.
const DOUBLE: std::time::Duration = std::time::Duration::from_millis(400);

/// Something that was done with it over the picture; drags and places in pixels, from the upper left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Gesture {
    Turn(Vec2),
    Move(Vec2),
    /// Notches nearer, negative for farther.
    Zoom(f32),
    Click(Vec2),
    DoubleClick(Vec2),
}

/// Where the pointer is and what is pressed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pointer {
    place: Option<Vec2>,
    /// The button that a drag began with, where, and whether it has moved since.
    pressed: Option<(MouseButton, Vec2, bool)>,
    last_click: Option<(std::time::Instant, Vec2)>,
}

impl Pointer {
    pub(crate) fn place(&self) -> Option<Vec2> {
        self.place
    }

    pub(crate) fn left(&mut self) {
        if self.pressed.is_none() {
            self.place = None;
        }
    }

    /// It has moved; `shift` is whether that key is held.
    pub(crate) fn moved(
        &mut self,
        position: PhysicalPosition<f64>,
        shift: bool,
    ) -> Option<Gesture> {
        let place = Vec2::new(position.x as f32, position.y as f32);
        let from = self.place.replace(place)?;
        let (button, start, dragged) = self.pressed.as_mut()?;
        let drag = if *dragged { place - from } else { place - *start };
        if !*dragged && drag.length() < CLICK_PX {
            return None;
        }
        *dragged = true;
        Some(match button {
            MouseButton::Left if !shift => Gesture::Turn(drag),
            _ => Gesture::Move(drag),
        })
    }

    /// A button went down over the picture, or up anywhere.
    pub(crate) fn button(&mut self, button: MouseButton, state: ElementState) -> Option<Gesture> {
        let place = self.place?;
        match (state, self.pressed) {
            (ElementState::Pressed, None) => {
                self.pressed = Some((button, place, false));
                None
            }
            (ElementState::Released, Some((pressed, _, dragged))) if pressed == button => {
                self.pressed = None;
                if dragged || button != MouseButton::Left {
                    return None;
                }
                let now = std::time::Instant::now();
                let again = self.last_click.take().is_some_and(|(then, there)| {
                    now - then < DOUBLE && there.distance(place) < 2.0 * CLICK_PX
                });
                if again {
                    return Some(Gesture::DoubleClick(place));
                }
                self.last_click = Some((now, place));
                Some(Gesture::Click(place))
            }
            _ => None,
        }
    }

    /// A wheel was turned, or two fingers moved.
    pub(crate) fn scrolled(delta: MouseScrollDelta, shift: bool, scale: f32) -> Gesture {
        let (moved_px, notches) = match delta {
            MouseScrollDelta::LineDelta(x, y) => (60.0 * scale * Vec2::new(x, y), y),
            MouseScrollDelta::PixelDelta(p) => {
                (Vec2::new(p.x as f32, p.y as f32), p.y as f32 / (40.0 * scale))
            }
        };
        if shift { Gesture::Move(moved_px) } else { Gesture::Zoom(notches) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> PhysicalPosition<f64> {
        PhysicalPosition::new(x, y)
    }

    #[test]
    fn a_press_that_stays_is_a_click_and_one_that_moves_a_drag() {
        let mut pointer = Pointer::default();
        assert_eq!(pointer.moved(at(10.0, 10.0), false), None);
        assert_eq!(pointer.button(MouseButton::Left, ElementState::Pressed), None);
        assert_eq!(pointer.moved(at(11.0, 12.0), false), None);
        assert_eq!(
            pointer.button(MouseButton::Left, ElementState::Released),
            Some(Gesture::Click(Vec2::new(11.0, 12.0)))
        );
        pointer.button(MouseButton::Left, ElementState::Pressed);
        assert_eq!(pointer.moved(at(21.0, 12.0), false), Some(Gesture::Turn(Vec2::new(10.0, 0.0))));
        assert_eq!(pointer.moved(at(22.0, 12.0), true), Some(Gesture::Move(Vec2::X)));
        assert_eq!(pointer.button(MouseButton::Left, ElementState::Released), None);
    }

    #[test]
    fn two_clicks_in_one_place_are_a_double_click() {
        let mut pointer = Pointer::default();
        pointer.moved(at(5.0, 5.0), false);
        let mut click = || {
            pointer.button(MouseButton::Left, ElementState::Pressed);
            pointer.button(MouseButton::Left, ElementState::Released)
        };
        let place = Vec2::splat(5.0);
        assert_eq!(click(), Some(Gesture::Click(place)));
        assert_eq!(click(), Some(Gesture::DoubleClick(place)));
        assert_eq!(click(), Some(Gesture::Click(place)));
    }

    #[test]
    fn the_wheel_zooms_and_with_shift_moves() {
        let one = MouseScrollDelta::LineDelta(0.0, 1.0);
        assert_eq!(Pointer::scrolled(one, false, 1.0), Gesture::Zoom(1.0));
        assert_eq!(Pointer::scrolled(one, true, 1.0), Gesture::Move(Vec2::new(0.0, 60.0)));
        let fingers = MouseScrollDelta::PixelDelta(at(0.0, -20.0));
        assert_eq!(Pointer::scrolled(fingers, false, 1.0), Gesture::Zoom(-0.5));
    }
}
