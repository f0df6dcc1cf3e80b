//! A file dropped on a window, as a file manager does it: the XDND protocol, version 5.

use super::Display;
use std::path::Path;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    AtomEnum, ClientMessageEvent, ConnectionExt as _, CreateWindowAux, EventMask, PropMode,
    SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, Window, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

/// Drops a file in the middle of a window and sees to it that it is fetched.
pub fn drop_file(display: &Display, target: Window, file: &Path) {
    let x = display.x();
    let atom = |name: &str| display.atom(name);
    let source = x.generate_id().expect("an id");
    let aux = CreateWindowAux::new().event_mask(EventMask::PROPERTY_CHANGE);
    let class = WindowClass::INPUT_OUTPUT;
    x.create_window(0, source, display.root(), 0, 0, 1, 1, 0, class, 0, &aux).expect("a window");
    let selection = atom("XdndSelection");
    x.set_selection_owner(source, selection, x11rb::CURRENT_TIME).expect("a selection");
    let [left, top] = display.origin(target).map(|place| place as u32);
    let list = atom("text/uri-list");
    let send = |kind: &str, data: [u32; 5]| {
        let event = ClientMessageEvent::new(32, target, atom(kind), data);
        x.send_event(false, target, EventMask::NO_EVENT, event).expect("a message");
        x.flush().expect("sent");
    };
    send("XdndEnter", [source, 5 << 24, list, 0, 0]);
    let place = ((left + 300) << 16) | (top + 300);
    send("XdndPosition", [source, 0, place, x11rb::CURRENT_TIME, atom("XdndActionCopy")]);

    // It asks for the list, and is told it.
    let uri = format!("file://{}\r\n", file.display());
    let start = Instant::now();
    let (mut fetched, mut dropped) = (false, false);
    while start.elapsed() < Duration::from_secs(30) {
        match x.poll_for_event().expect("events") {
            Some(Event::SelectionRequest(asked)) if asked.selection == selection => {
                x.change_property8(
                    PropMode::REPLACE,
                    asked.requestor,
                    asked.property,
                    list,
                    uri.as_bytes(),
                )
                .expect("the list");
                let answer = SelectionNotifyEvent {
                    response_type: SELECTION_NOTIFY_EVENT,
                    sequence: 0,
                    time: asked.time,
                    requestor: asked.requestor,
                    selection,
                    target: asked.target,
                    property: asked.property,
                };
                x.send_event(false, asked.requestor, EventMask::NO_EVENT, answer).expect("told");
                x.flush().expect("sent");
                fetched = true;
            }
            Some(Event::ClientMessage(message)) if message.type_ == atom("XdndStatus") => {
                if fetched && !dropped {
                    send("XdndDrop", [source, 0, x11rb::CURRENT_TIME, 0, 0]);
                    dropped = true;
                }
            }
            Some(Event::ClientMessage(message)) if message.type_ == atom("XdndFinished") => {
                return;
            }
            Some(_) => {}
            None => {
                std::thread::sleep(Duration::from_millis(10));
                if fetched && !dropped && start.elapsed() > Duration::from_secs(2) {
                    send("XdndDrop", [source, 0, x11rb::CURRENT_TIME, 0, 0]);
                    dropped = true;
                }
            }
        }
    }
    assert!(dropped, "nobody asked for the file; atoms of type {:?}", AtomEnum::ATOM);
}
