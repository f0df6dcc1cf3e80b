//! The system's clipboard, opened when it is first needed.

use arboard::Clipboard as System;

#[derive(Default)]
pub(crate) struct Clipboard {
    // Kept: on X11 a text is there only as long as whoever put it there.
    system: Option<System>,
}

impl Clipboard {
    fn system(&mut self) -> Result<&mut System, String> {
        if self.system.is_none() {
            self.system = Some(System::new().map_err(|e| format!("There is no clipboard ({e})"))?);
        }
        self.system.as_mut().ok_or_else(|| "There is no clipboard".to_owned())
    }

    pub(crate) fn set(&mut self, text: &str) -> Result<(), String> {
        let put = self.system()?.set_text(text);
        put.map_err(|e| format!("The clipboard does not take it ({e})"))
    }

    pub(crate) fn get(&mut self) -> Result<String, String> {
        let got = self.system()?.get_text();
        got.map_err(|e| format!("There is no text in the clipboard ({e})"))
    }
}
