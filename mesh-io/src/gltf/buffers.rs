//! The container, and the bytes of buffers wherever they lie.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::buffer::{Buffer, Source, View};

use super::{EXPORT_AGAIN, malformed};
use crate::codec::quote::{printable, quote};
use crate::{Error, Place};

const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// The JSON of a file, and the binary chunk if it is a container that has one.
pub(super) fn split<'a>(file: &'a [u8], name: &str) -> Result<(&'a [u8], Option<&'a [u8]>), Error> {
    if !file.starts_with(b"glTF") {
        return Ok((file, None));
    }
    let truncated = |missing: &str| Error::Truncated {
        name: name.to_owned(),
        place: Place::Byte(file.len() as u64),
        missing: missing.to_owned(),
    };
    let word = |at: usize| file.get(at..)?.first_chunk().map(|&bytes| u32::from_le_bytes(bytes));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(truncated("the header of the container is complete (12 bytes)"));
    };
    if version != 2 {
        return Err(malformed(
            name,
            format!("a container of version {version}, but only 2 is known"),
            "convert it to glTF 2.0",
        ));
    }
    if length as usize > file.len() {
        return Err(truncated(&format!("its {length} bytes are complete")));
    }
    let (mut json, mut bin) = (None, None);
    let mut at = 12;
    while bin.is_none() && at < length as usize {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(truncated("the header of a chunk is complete (8 bytes)"));
        };
        let start = at + 8;
        let Some(chunk) = file.get(start..).and_then(|rest| rest.get(..size as usize)) else {
            return Err(truncated(&format!("the chunk of {size} bytes is complete")));
        };
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(chunk),
            BIN_CHUNK => bin = Some(chunk),
            _ => {}
        }
        at = start.saturating_add(size as usize);
    }
    match json {
        Some(json) => Ok((json, bin)),
        None => Err(malformed(name, "a container without a JSON chunk".to_owned(), EXPORT_AGAIN)),
    }
}

/// Buffers, fetched when first asked for, so that those of images are left alone.
pub(super) struct Buffers<'a> {
    name: &'a str,
    folder: Option<&'a Path>,
    bin: Option<&'a [u8]>,
    fetched: Vec<Option<Cow<'a, [u8]>>>,
    /// Bytes of the file and of the other files that were read.
    num_bytes: u64,
}

impl<'a> Buffers<'a> {
    /// Those of a file with so many bytes.
    pub(super) fn new(
        name: &'a str,
        folder: Option<&'a Path>,
        bin: Option<&'a [u8]>,
        num_bytes: u64,
    ) -> Self {
        Self { name, folder, bin, fetched: Vec::new(), num_bytes }
    }

    /// Bytes of the file, and of those other files that were read.
    pub(super) fn num_bytes(&self) -> u64 {
        self.num_bytes
    }

    pub(super) fn name(&self) -> &'a str {
        self.name
    }

    /// The bytes of a view.
    pub(super) fn view(&mut self, view: &View<'_>) -> Result<&[u8], Error> {
        let buffer = view.buffer();
        let index = buffer.index();
        if self.fetched.len() <= index {
            self.fetched.resize(index + 1, None);
        }
        if self.fetched[index].is_none() {
            self.fetched[index] = Some(self.fetch(&buffer)?);
        }
        let bytes = self.fetched[index].as_deref().unwrap_or_default();
        let end = view.offset().checked_add(view.length());
        end.and_then(|end| bytes.get(view.offset()..end)).ok_or_else(|| {
            let problem = format!(
                "buffer view {} reaches beyond the {} bytes of buffer {index}",
                view.index(),
                bytes.len()
            );
            malformed(self.name, problem, EXPORT_AGAIN)
        })
    }

    fn fetch(&mut self, buffer: &Buffer<'_>) -> Result<Cow<'a, [u8]>, Error> {
        let index = buffer.index();
        let bytes = match buffer.source() {
            Source::Bin => Cow::Borrowed(self.bin.ok_or_else(|| {
                let problem = format!("buffer {index} lies in a binary chunk that is not there");
                malformed(self.name, problem, EXPORT_AGAIN)
            })?),
            Source::Uri(uri) => Cow::Owned(match uri.strip_prefix("data:") {
                Some(data) => self.decode(data, index)?,
                None => {
                    let bytes = self.read_file(uri, buffer.length())?;
                    self.num_bytes += bytes.len() as u64;
                    bytes
                }
            }),
        };
        if bytes.len() < buffer.length() {
            return Err(Error::Truncated {
                name: self.name.to_owned(),
                place: Place::File,
                missing: format!(
                    "buffer {index} is complete, it has {} of {} bytes",
                    bytes.len(),
                    buffer.length()
                ),
            });
        }
        Ok(bytes)
    }

    fn decode(&self, data: &str, index: usize) -> Result<Vec<u8>, Error> {
        let problem = |what: String| {
            malformed(self.name, format!("the data of buffer {index} {what}"), EXPORT_AGAIN)
        };
        let (_, encoded) =
            data.split_once(";base64,").ok_or_else(|| problem("is not in base64".to_owned()))?;
        STANDARD.decode(encoded.trim_end()).map_err(|error| problem(format!("is broken: {error}")))
    }

    fn read_file(&self, uri: &str, length: usize) -> Result<Vec<u8>, Error> {
        let folder = self.folder.ok_or_else(|| {
            let problem = format!("its data is in another file, `{}`", quote(uri.as_bytes()));
            malformed(self.name, problem, "read it by its path, or export it as .glb")
        })?;
        if uri.contains("://") {
            let problem = format!("its data is elsewhere, at `{}`", quote(uri.as_bytes()));
            return Err(malformed(self.name, problem, "fetch it and put its local name there"));
        }
        let path = folder.join(unescape(uri));
        let name = printable(&path.display().to_string());
        let failed = |error| Error::io(&name, "open", error);
        // Before it is opened: opening a pipe would wait for whoever writes it.
        let there = std::fs::metadata(&path).map_err(failed)?;
        if !there.is_file() {
            return Err(failed(std::io::Error::other("it is not a file")));
        }
        let file = File::open(&path).map_err(failed)?;
        if there.len() < length as u64 {
            return Err(Error::Truncated {
                name,
                place: Place::Byte(there.len()),
                missing: format!("the {length} bytes of the buffer are complete"),
            });
        }
        let mut bytes = Vec::new();
        file.take(length as u64)
            .read_to_end(&mut bytes)
            .map_err(|error| Error::io(&name, "read", error))?;
        Ok(bytes)
    }
}

/// A relative path with its percent escapes resolved.
fn unescape(uri: &str) -> PathBuf {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let digit = |at: usize| tail.get(at).and_then(|&byte| (byte as char).to_digit(16));
        match (first, digit(0), digit(1)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((high * 16 + low) as u8);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    PathBuf::from(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_escapes() {
        assert_eq!(unescape("a%20b%2Ebin"), PathBuf::from("a b.bin"));
        assert_eq!(unescape("100%"), PathBuf::from("100%"));
        assert_eq!(unescape("%4"), PathBuf::from("%4"));
    }
}
