//! Which key does what: the one table, for the keyboard and for the help.

use winit::keyboard::{Key, ModifiersState, NamedKey};

use crate::action::Action;
use crate::camera::standard::Standard;

/// A key with what it does.
pub(crate) struct Binding {
    /// How it is typed, the first as it is shown: a character or a name, with `Ctrl+` or `Shift+` before it.
    pub(crate) keys: &'static [&'static str],
    pub(crate) words: &'static str,
    pub(crate) action: Action,
}

const fn key(keys: &'static [&'static str], words: &'static str, action: Action) -> Binding {
    Binding { keys, words, action }
}

/// What the mouse does, and keys that are held.
pub(crate) const GESTURES: [(&str, &str); 9] = [
    ("drag", "turn (fly mode: look about)"),
    ("right drag, Shift+drag", "move"),
    ("wheel, two fingers, pinch", "nearer to the pointer, or away"),
    ("Shift+wheel", "move"),
    ("double click", "turn around this point"),
    ("click, while measuring", "pick a point; two have a distance"),
    ("W A S D, Q E", "walk; down and up"),
    ("Shift, while walking", "faster"),
    ("drop a file", "look at it"),
];

/// The keys, in groups.
pub(crate) const GROUPS: [(&str, &[Binding]); 4] = [
    (
        "Look",
        &[
            key(&["F", "Home"], "the whole model", Action::Fit),
            key(&["1"], "front", Action::Stand(Standard::Front)),
            key(&["2"], "back", Action::Stand(Standard::Back)),
            key(&["3"], "left", Action::Stand(Standard::Left)),
            key(&["4"], "right", Action::Stand(Standard::Right)),
            key(&["5"], "top", Action::Stand(Standard::Top)),
            key(&["6"], "bottom", Action::Stand(Standard::Bottom)),
            key(&["U"], "z upwards, or y", Action::OtherUp),
            key(&["G"], "fly mode on, off", Action::Fly),
        ],
    ),
    (
        "Detail",
        &[
            key(&["+", "="], "finer", Action::Finer),
            key(&["-", "_"], "coarser", Action::Coarser),
            key(&["M"], "next shading", Action::NextLook),
            key(&["L"], "freeze the detail, on, off", Action::Freeze),
            key(&["O"], "frozen detail from outside", Action::Outside),
        ],
    ),
    (
        "Tools",
        &[
            key(&["T"], "measure on, off", Action::Measure),
            key(&["X"], "section plane on, off", Action::Section),
            key(&["P", "F12"], "screenshot", Action::Screenshot),
            key(&["Shift+P"], "screenshot with the panels", Action::ScreenshotWithPanels),
            key(&["R"], "record a camera path, end it", Action::Record),
            key(&["Y"], "replay the path", Action::Replay),
            key(&["Ctrl+C"], "copy the view as text", Action::CopyView),
            key(&["Ctrl+V"], "go to a view that was copied", Action::PasteView),
        ],
    ),
    (
        "Window",
        &[
            key(&["C"], "controls on, off", Action::Controls),
            key(&["N"], "numbers on, off", Action::Numbers),
            key(&["H"], "hide all panels, show them", Action::HidePanels),
            key(&["? or F1", "?", "F1"], "this help", Action::Help),
            key(&["F11"], "whole screen", Action::FullScreen),
            key(&["Esc", "Escape"], "leave what is open", Action::Leave),
            key(&["Ctrl+Q"], "quit", Action::Quit),
        ],
    ),
];

/// What a key asks for, if anything.
pub(crate) fn action(key: &Key, modifiers: ModifiersState) -> Option<Action> {
    let name = match key {
        Key::Character(text) => text.to_uppercase(),
        Key::Named(NamedKey::Space) => "Space".to_owned(),
        Key::Named(named) => format!("{named:?}"),
        _ => return None,
    };
    let command = modifiers.control_key() || modifiers.super_key();
    if modifiers.alt_key() {
        return None;
    }
    let typed = match (command, modifiers.shift_key()) {
        (true, _) => format!("Ctrl+{name}"),
        // Shift makes another character of what is no letter; only letters are told apart by it.
        (false, true) if name.chars().all(char::is_alphabetic) && name.len() == 1 => {
            format!("Shift+{name}")
        }
        _ => name,
    };
    let all = GROUPS.iter().flat_map(|(_, bindings)| bindings.iter());
    all.into_iter().find(|b| b.keys.contains(&typed.as_str())).map(|b| b.action.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(text: &str, modifiers: ModifiersState) -> Option<Action> {
        action(&Key::Character(text.into()), modifiers)
    }

    #[test]
    fn no_key_means_two_things() {
        let mut seen: Vec<&str> = Vec::new();
        for (_, bindings) in GROUPS {
            for key in bindings.iter().flat_map(|b| b.keys) {
                assert!(!seen.contains(key), "{key}");
                // These walk.
                assert!(!["W", "A", "S", "D", "Q", "E"].contains(key), "{key}");
                seen.push(key);
            }
        }
    }

    #[test]
    fn keys_are_found_with_their_modifiers() {
        let none = ModifiersState::empty();
        assert_eq!(typed("f", none), Some(Action::Fit));
        assert_eq!(typed("?", ModifiersState::SHIFT), Some(Action::Help));
        assert_eq!(typed("p", none), Some(Action::Screenshot));
        assert_eq!(typed("P", ModifiersState::SHIFT), Some(Action::ScreenshotWithPanels));
        assert_eq!(typed("c", ModifiersState::CONTROL), Some(Action::CopyView));
        assert_eq!(typed("c", none), Some(Action::Controls));
        assert_eq!(typed("w", none), None);
        assert_eq!(action(&Key::Named(NamedKey::F1), none), Some(Action::Help));
        assert_eq!(action(&Key::Named(NamedKey::Escape), none), Some(Action::Leave));
    }
}
