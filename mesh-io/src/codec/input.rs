//! A window over a byte stream: the one way in for every format.

use std::fmt::Display;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::sync::Arc;

use crate::{Error, Place};

/// Bytes asked for at a time; fits the second-level cache.
const CHUNK: usize = 256 * 1024;

/// The longest line of text that is taken for one.
const MAX_LINE: usize = 1 << 28;

/// What a line ended with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineEnd {
    Lf,
    CrLf,
    Cr,
    /// The end of the file.
    None,
}

/// A buffered stream that knows its name, its offset, its line, and its length where there is one.
///
/// The window grows only with bytes that have arrived, never with a count from the file.
pub(crate) struct Input<R> {
    reader: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    ended: bool,
    /// Offset of `buffer[0]` in the stream.
    base: u64,
    line: u64,
    line_end: LineEnd,
    length: Option<u64>,
    name: Arc<str>,
}

impl<R: Read> Input<R> {
    /// `length` is the number of bytes the reader will give, where that is certain.
    pub(crate) fn new(reader: R, name: &str, length: Option<u64>) -> Self {
        Self {
            reader,
            buffer: Vec::new(),
            start: 0,
            end: 0,
            ended: false,
            base: 0,
            line: 0,
            line_end: LineEnd::None,
            length,
            name: name.into(),
        }
    }

    /// The same stream behind another type of reader.
    pub(crate) fn map_reader<S>(self, map: impl FnOnce(R) -> S) -> Input<S> {
        Input {
            reader: map(self.reader),
            buffer: self.buffer,
            start: self.start,
            end: self.end,
            ended: self.ended,
            base: self.base,
            line: self.line,
            line_end: self.line_end,
            length: self.length,
            name: self.name,
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn length(&self) -> Option<u64> {
        self.length
    }

    /// Offset of the next byte.
    pub(crate) fn offset(&self) -> u64 {
        self.base + self.start as u64
    }

    fn read_so_far(&self) -> u64 {
        self.base + self.end as u64
    }

    /// Bytes from here to the end, where the length is certain.
    pub(crate) fn remaining(&self) -> Option<u64> {
        self.length.map(|length| length.saturating_sub(self.offset()))
    }

    /// How many items of at least `item_bytes` can follow, at most `count`: the safe capacity to reserve.
    pub(crate) fn plausible(&self, count: u64, item_bytes: u64) -> usize {
        let limit = match self.remaining() {
            Some(bytes) => bytes / item_bytes.max(1),
            None => 1 << 16,
        };
        usize::try_from(count.min(limit)).unwrap_or(0)
    }

    /// The bytes at hand.
    pub(crate) fn window(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// Brings at least `want` bytes to hand unless the stream ends first; returns how many there are.
    #[inline]
    pub(crate) fn fill(&mut self, want: usize) -> Result<usize, Error> {
        while self.end - self.start < want && !self.ended {
            self.read_more()?;
        }
        Ok(self.end - self.start)
    }

    /// Passes over bytes at hand.
    #[inline]
    pub(crate) fn consume(&mut self, count: usize) {
        debug_assert!(count <= self.end - self.start);
        self.start = (self.start + count).min(self.end);
    }

    /// Passes over whole lines at hand.
    pub(crate) fn consume_lines(&mut self, bytes: usize, lines: u64) {
        if lines > 0 {
            self.consume(bytes);
            self.line += lines;
            self.line_end = LineEnd::Lf;
        }
    }

    /// Passes over `count` bytes, wherever they are.
    pub(crate) fn skip(&mut self, mut count: u64, missing: impl Display) -> Result<(), Error> {
        while count > 0 {
            let there = self.fill(1)?;
            if there == 0 {
                return Err(self.truncated(missing));
            }
            let step = usize::try_from(count).map_or(there, |count| count.min(there));
            self.consume(step);
            count -= step as u64;
        }
        Ok(())
    }

    /// Reads what is left of a pipe or of packed data, whose checksum comes last; a plain file is left alone.
    pub(crate) fn drain(&mut self) -> Result<(), Error> {
        while self.length.is_none() && !self.ended {
            self.start = self.end;
            self.read_more()?;
        }
        Ok(())
    }

    /// Everything from here to the end, in memory.
    pub(crate) fn read_to_end(&mut self) -> Result<Vec<u8>, Error> {
        let mut all = self.window().to_vec();
        while !self.ended {
            self.start = self.end;
            self.read_more()?;
            all.extend_from_slice(self.window());
        }
        self.start = self.end;
        Ok(all)
    }

    fn read_more(&mut self) -> Result<(), Error> {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.base += self.start as u64;
            self.end -= self.start;
            self.start = 0;
        }
        if self.end == self.buffer.len() {
            let grown = (2 * self.buffer.len()).max(CHUNK);
            self.buffer.resize(grown, 0);
        }
        loop {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Ok(0) => {
                    self.ended = true;
                    if let Some(length) = self.length.filter(|&length| length > self.read_so_far())
                    {
                        return Err(self.truncated(format_args!(
                            "its {length} bytes, which it had when it was opened, are read"
                        )));
                    }
                }
                Ok(count) => self.end += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    return Err(self.truncated("its packed data is complete"));
                }
                // Only the unpackers make up errors of their own.
                Err(error) if error.raw_os_error().is_none() && self.length.is_none() => {
                    return Err(self.malformed(
                        Place::Byte(self.base + self.end as u64),
                        format!("cannot be unpacked or read: {error}"),
                        "copy it again",
                    ));
                }
                Err(error) => return Err(Error::io(&self.name, "read", error)),
            }
            return Ok(());
        }
    }

    /// The next line without its end (`\n`, `\r\n` or `\r`), as a range for [`Input::text`]; `None` at the end.
    #[inline]
    pub(crate) fn next_line(&mut self) -> Result<Option<Range<usize>>, Error> {
        let mut searched = 0;
        loop {
            let window = &self.buffer[self.start + searched..self.end];
            if let Some(found) = memchr::memchr2(b'\n', b'\r', window) {
                let stop = self.start + searched + found;
                let mut next = stop + 1;
                let mut end = LineEnd::Lf;
                if self.buffer[stop] == b'\r' {
                    end = LineEnd::Cr;
                    if next == self.end && !self.ended {
                        searched += found;
                        self.read_more()?;
                        continue;
                    }
                    if next < self.end && self.buffer[next] == b'\n' {
                        next += 1;
                        end = LineEnd::CrLf;
                    }
                }
                let line = self.start..stop;
                self.start = next;
                self.line += 1;
                self.line_end = end;
                return Ok(Some(line));
            }
            searched = self.end - self.start;
            if self.ended {
                if searched == 0 {
                    return Ok(None);
                }
                let line = self.start..self.end;
                self.start = self.end;
                self.line += 1;
                self.line_end = LineEnd::None;
                return Ok(Some(line));
            }
            if searched > MAX_LINE {
                self.line += 1;
                return Err(self.malformed_line(
                    format!("a line of more than {MAX_LINE} bytes"),
                    "this is not text in that format, check what the file is",
                ));
            }
            self.read_more()?;
        }
    }

    /// The text of a line, valid until more input is asked for.
    #[inline]
    pub(crate) fn text(&self, line: Range<usize>) -> &[u8] {
        &self.buffer[line]
    }

    /// Number of the line handed out last, from one.
    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// How the line handed out last ended.
    pub(crate) fn line_end(&self) -> LineEnd {
        self.line_end
    }

    /// Gives the last byte of the line end back, which turns out to be data.
    pub(crate) fn give_back_line_feed(&mut self) {
        if self.line_end == LineEnd::CrLf && self.start > 0 {
            self.start -= 1;
            self.line_end = LineEnd::Cr;
        }
    }

    pub(crate) fn empty(&self) -> Error {
        Error::Empty { name: self.name.to_string() }
    }

    /// The file ends here, in bytes.
    pub(crate) fn truncated(&self, missing: impl Display) -> Error {
        Error::Truncated {
            name: self.name.to_string(),
            place: Place::Byte(self.base + self.end as u64),
            missing: missing.to_string(),
        }
    }

    /// The text ends after (or within) the line handed out last.
    pub(crate) fn truncated_line(&self, missing: impl Display) -> Error {
        Error::Truncated {
            name: self.name.to_string(),
            place: Place::Line(self.line),
            missing: missing.to_string(),
        }
    }

    pub(crate) fn malformed(&self, place: Place, problem: String, remedy: &'static str) -> Error {
        Error::Malformed { name: self.name.to_string(), place, problem, remedy }
    }

    pub(crate) fn malformed_line(&self, problem: String, remedy: &'static str) -> Error {
        self.malformed(Place::Line(self.line), problem, remedy)
    }

    pub(crate) fn out_of_range(&self, place: Place, index: i64, num_vertices: u64) -> Error {
        Error::IndexOutOfRange { name: self.name.to_string(), place, index, num_vertices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives one byte at a time, as a slow pipe may.
    struct Dribble<'a>(&'a [u8]);

    impl Read for Dribble<'_> {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.len().min(out.len()).min(1);
            out[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn lines(reader: impl Read) -> Vec<Vec<u8>> {
        let mut input = Input::new(reader, "test", None);
        let mut lines = Vec::new();
        while let Some(line) = input.next_line().unwrap() {
            lines.push(input.text(line).to_vec());
        }
        assert_eq!(input.line(), lines.len() as u64);
        lines
    }

    #[test]
    fn lines_end_in_three_ways() {
        let text = b"a\nbc\r\n\rd\r\r\n\ne";
        let expected: [&[u8]; 7] = [b"a", b"bc", b"", b"d", b"", b"", b"e"];
        assert_eq!(lines(&text[..]), expected);
        assert_eq!(lines(Dribble(text)), expected);
        assert_eq!(lines(Dribble(b"a\r")), [b"a"]);
        assert!(lines(Dribble(b"")).is_empty());
    }

    #[test]
    fn long_lines_cross_the_window() {
        let mut text = vec![b'x'; 3 * CHUNK];
        text.push(b'\n');
        text.extend(vec![b'y'; 2 * CHUNK]);
        let lines = lines(&text[..]);
        assert_eq!((lines[0].len(), lines[1].len()), (3 * CHUNK, 2 * CHUNK));
    }

    #[test]
    fn a_file_that_became_shorter_is_told() {
        let mut input = Input::new(&b"v 0 0 0\n"[..], "test", Some(20));
        assert!(input.next_line().unwrap().is_some());
        let message = input.next_line().unwrap_err().to_string();
        assert!(
            message.starts_with("test, byte 8: the file ends before its 20 bytes"),
            "{message}"
        );
    }

    #[test]
    fn offsets_count_from_the_start_of_the_stream() {
        let bytes = vec![7u8; 5 * CHUNK];
        let mut input = Input::new(&bytes[..], "test", Some(bytes.len() as u64));
        for _ in 0..5 {
            assert!(input.fill(10).unwrap() >= 10);
            input.consume(10);
        }
        assert_eq!(input.offset(), 50);
        assert_eq!(input.remaining(), Some(bytes.len() as u64 - 50));
    }
}
