//! Pipes, read so that Ctrl-C is heard while nothing comes.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::interrupt;

/// Bytes asked for at once: what a pipe holds on Linux.
const CHUNK: usize = 64 << 10;
/// Chunks read ahead at most.
const AHEAD: usize = 8;
/// How long Ctrl-C may go unheard.
const PATIENCE: Duration = Duration::from_millis(50);

/// Reads from a thread of its own, so that whoever waits for bytes can also be interrupted.
#[derive(Debug)]
pub struct PipeReader {
    chunks: Receiver<io::Result<Vec<u8>>>,
    chunk: Vec<u8>,
    /// How much of the chunk is handed out.
    taken: usize,
}

impl PipeReader {
    /// Reads from `pipe`, to its end or until this is dropped and another byte comes.
    ///
    /// # Errors
    ///
    /// When the system has no thread left.
    pub fn new(mut pipe: impl Read + Send + 'static) -> io::Result<Self> {
        let (sender, chunks) = sync_channel(AHEAD);
        let read = move || {
            loop {
                let mut chunk = vec![0; CHUNK];
                let next = match pipe.read(&mut chunk) {
                    Ok(0) => return,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                    Ok(length) => {
                        chunk.truncate(length);
                        Ok(chunk)
                    }
                    Err(error) => Err(error),
                };
                let failed = next.is_err();
                if sender.send(next).is_err() || failed {
                    return;
                }
            }
        };
        std::thread::Builder::new().name("pipe".to_owned()).spawn(read)?;
        Ok(Self { chunks, chunk: Vec::new(), taken: 0 })
    }
}

impl Read for PipeReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.chunk.len() {
            match self.chunks.recv_timeout(PATIENCE) {
                Ok(next) => (self.chunk, self.taken) = (next?, 0),
                Err(RecvTimeoutError::Timeout) if interrupt::is_requested() => {
                    return Err(io::Error::other("interrupted"));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let count = out.len().min(self.chunk.len() - self.taken);
        out[..count].copy_from_slice(&self.chunk[self.taken..self.taken + count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_bytes_come_in_order() {
        let bytes: Vec<u8> = (0..3 * CHUNK + 17).map(|i| (i % 251) as u8).collect();
        let mut read = Vec::new();
        let mut pipe = PipeReader::new(io::Cursor::new(bytes.clone())).expect("a thread");
        pipe.read_to_end(&mut read).expect("no errors");
        assert!(read == bytes);
        assert_eq!(pipe.read(&mut [0; 8]).expect("still the end"), 0);
    }

    #[test]
    fn errors_come_after_what_was_read() {
        struct Breaks(bool);
        impl Read for Breaks {
            fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
                if std::mem::replace(&mut self.0, true) {
                    return Err(io::Error::other("unplugged"));
                }
                out[..3].copy_from_slice(b"abc");
                Ok(3)
            }
        }
        let mut pipe = PipeReader::new(Breaks(false)).expect("a thread");
        let mut read = [0; 3];
        pipe.read_exact(&mut read).expect("three bytes");
        assert_eq!(&read, b"abc");
        assert_eq!(pipe.read(&mut read).expect_err("then it breaks").to_string(), "unplugged");
    }
}
