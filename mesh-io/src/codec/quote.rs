//! What a file says, as it may stand in a message.

/// As much of it as is worth showing, at most 40 bytes, on one line: nothing that would control a terminal.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let mut text = printable(&String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)]));
    if bytes.len() > MOST {
        text.push('…');
    }
    text
}

/// The same text with escapes for characters that control something.
pub(crate) fn printable(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        // Beside control characters those that turn the direction of writing.
        if c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}') {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_strange_texts_fit_on_a_line() {
        assert_eq!(quote(b"vertex"), "vertex");
        assert_eq!(quote(b"a\0b\nc\x1b[31m"), "a\\u{0}b\\nc\\u{1b}[31m");
        assert_eq!(quote(&[0xff; 3]), "\u{fffd}\u{fffd}\u{fffd}");
        assert_eq!(quote(&[b'x'; 50]), format!("{}…", "x".repeat(40)));
        assert_eq!(printable("ü \u{202e}"), "ü \\u{202e}");
    }
}
