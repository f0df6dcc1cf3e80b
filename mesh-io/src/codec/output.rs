//! The ways out: a file that appears whole, a pipe, and a spool between a format that counts at the front and a pipe.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, SpooledTempFile};

use super::packing::Packed;
use crate::{Error, Packing};

/// Bytes gathered before they are written.
const CHUNK: usize = 256 * 1024;

/// Bytes a spool keeps in memory before it goes to the disk.
const SPOOL_IN_MEMORY: usize = 8 << 20;

/// Where a sink's bytes go.
pub(crate) trait Output: Write {
    /// Whether [`Output::patch`] works here.
    fn can_patch(&self) -> bool;

    /// Replaces bytes written before.
    fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()>;

    /// Makes what was written final.
    fn commit(self: Box<Self>) -> io::Result<()>;

    /// Where scratch files may lie, if not in the system's folder for them.
    fn scratch(&self) -> Option<&Path>;
}

pub(crate) type BoxedOutput<'a> = Box<dyn Output + Send + 'a>;

impl<O: Output + ?Sized> Output for Box<O> {
    fn can_patch(&self) -> bool {
        (**self).can_patch()
    }

    fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        (**self).patch(offset, bytes)
    }

    fn commit(self: Box<Self>) -> io::Result<()> {
        (*self).commit()
    }

    fn scratch(&self) -> Option<&Path> {
        (**self).scratch()
    }
}

/// A writer that cannot go back.
pub(crate) struct Stream<W>(pub(crate) W);

impl<W: Write> Write for Stream<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<W: Write> Output for Stream<W> {
    fn can_patch(&self) -> bool {
        false
    }

    fn patch(&mut self, _offset: u64, _bytes: &[u8]) -> io::Result<()> {
        Err(io::ErrorKind::NotSeekable.into())
    }

    fn commit(mut self: Box<Self>) -> io::Result<()> {
        self.0.flush()
    }

    fn scratch(&self) -> Option<&Path> {
        None
    }
}

/// The file itself, not yet packed.
enum Place {
    /// A regular file: written beside its target under a temporary name, which is removed when this is dropped.
    Beside { file: NamedTempFile, target: PathBuf },
    /// A device or a named pipe, which must not be replaced by a file.
    Direct(File),
}

impl Write for Place {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Beside { file, .. } => file.write(bytes),
            Self::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Beside { file, .. } => file.flush(),
            Self::Direct(file) => file.flush(),
        }
    }
}

/// A file that is there whole after [`Output::commit`], or not at all.
pub(crate) struct WholeFile {
    place: Packed<Place>,
    folder: PathBuf,
}

impl WholeFile {
    pub(crate) fn create(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let failed = |error| Error::io(&name, "create", error);
        // Through a symbolic link: the file it points at is the one to be replaced.
        let target = match path.canonicalize() {
            Ok(target) => target,
            Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_path_buf(),
            Err(error) => return Err(failed(error)),
        };
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let place = match std::fs::metadata(&target) {
            Ok(metadata) if metadata.is_dir() => {
                return Err(failed(io::ErrorKind::IsADirectory.into()));
            }
            Ok(metadata) if !metadata.is_file() => {
                let file = File::options().write(true).open(&target).map_err(failed)?;
                Place::Direct(file)
            }
            _ => {
                let file = temporary_beside(&target, &folder).map_err(failed)?;
                Place::Beside { file, target }
            }
        };
        let place = Packed::new(place, Packing::from_path(path), &name)?;
        Ok(Self { place, folder })
    }

    /// As [`Output::commit`].
    pub(crate) fn commit(self) -> io::Result<()> {
        let mut place = self.place.finish()?;
        place.flush()?;
        match place {
            Place::Beside { file, target } => {
                file.persist(target).map(|_| ()).map_err(|error| error.error)
            }
            Place::Direct(_) => Ok(()),
        }
    }
}

fn temporary_beside(target: &Path, folder: &Path) -> io::Result<NamedTempFile> {
    let stem = target.file_name().and_then(|name| name.to_str()).unwrap_or("mesh");
    let stem: String = stem.chars().take(40).collect();
    let prefix = format!(".{stem}.");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The usual permissions for a new file (less the umask), not the private ones of a temporary one.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
        builder.tempfile_in(folder)
    }
    #[cfg(not(unix))]
    builder.tempfile_in(folder)
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.place.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.place.flush()
    }
}

impl Output for WholeFile {
    fn can_patch(&self) -> bool {
        matches!(self.place, Packed::Plain(Place::Beside { .. }))
    }

    fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        match &mut self.place {
            Packed::Plain(Place::Beside { file, .. }) => patch(file, offset, bytes),
            _ => Err(io::ErrorKind::NotSeekable.into()),
        }
    }

    fn commit(self: Box<Self>) -> io::Result<()> {
        (*self).commit()
    }

    fn scratch(&self) -> Option<&Path> {
        Some(&self.folder)
    }
}

fn patch(file: &mut (impl Write + Seek), offset: u64, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(offset))?;
    file.write_all(bytes)?;
    file.seek(SeekFrom::End(0))?;
    Ok(())
}

/// A scratch file that starts in memory; it has no name, so nothing remains of it.
pub(crate) fn spool(folder: Option<&Path>) -> SpooledTempFile {
    match folder {
        Some(folder) => tempfile::spooled_tempfile_in(SPOOL_IN_MEMORY, folder),
        None => tempfile::spooled_tempfile(SPOOL_IN_MEMORY),
    }
}

/// Holds everything back until the end, so that the front can still change.
struct Spooled<'a> {
    spool: SpooledTempFile,
    target: BoxedOutput<'a>,
}

/// The output itself if it can be patched, otherwise a spool before it.
pub(crate) fn patchable(output: BoxedOutput<'_>) -> BoxedOutput<'_> {
    if output.can_patch() {
        output
    } else {
        Box::new(Spooled { spool: spool(output.scratch()), target: output })
    }
}

impl Write for Spooled<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.spool.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.spool.flush()
    }
}

impl Output for Spooled<'_> {
    fn can_patch(&self) -> bool {
        true
    }

    fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        patch(&mut self.spool, offset, bytes)
    }

    fn commit(mut self: Box<Self>) -> io::Result<()> {
        self.spool.seek(SeekFrom::Start(0))?;
        copy(&mut self.spool, &mut self.target)?;
        self.target.commit()
    }

    fn scratch(&self) -> Option<&Path> {
        self.target.scratch()
    }
}

fn copy(from: &mut impl Read, to: &mut impl Write) -> io::Result<()> {
    let mut chunk = vec![0; CHUNK];
    loop {
        match from.read(&mut chunk)? {
            0 => return Ok(()),
            count => to.write_all(&chunk[..count])?,
        }
    }
}

/// Gathers bytes into large writes and puts the file's name on errors.
pub(crate) struct Pen<W> {
    writer: W,
    gathered: Vec<u8>,
    name: String,
}

impl<W: Write> Pen<W> {
    pub(crate) fn new(writer: W, name: &str) -> Self {
        Self { writer, gathered: Vec::new(), name: name.to_owned() }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Adds bytes by whatever `add` does.
    #[inline]
    pub(crate) fn put(
        &mut self,
        add: impl FnOnce(&mut Vec<u8>) -> io::Result<()>,
    ) -> Result<(), Error> {
        add(&mut self.gathered).map_err(|error| self.failed(error))?;
        if self.gathered.len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    #[inline]
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.put(|gathered| {
            gathered.extend_from_slice(bytes);
            Ok(())
        })
    }

    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        self.writer.write_all(&self.gathered).map_err(|error| self.failed(error))?;
        self.gathered.clear();
        Ok(())
    }

    /// The writer, without what is not flushed yet.
    pub(crate) fn into_writer(self) -> W {
        self.writer
    }

    pub(crate) fn failed(&self, error: io::Error) -> Error {
        Error::io(&self.name, "write", error)
    }
}

impl Pen<BoxedOutput<'_>> {
    pub(crate) fn patch(&mut self, offset: u64, bytes: &[u8]) -> Result<(), Error> {
        self.flush()?;
        self.writer.patch(offset, bytes).map_err(|error| self.failed(error))
    }

    pub(crate) fn commit(mut self) -> Result<(), Error> {
        self.flush()?;
        let name = self.name;
        self.writer.commit().map_err(|error| Error::io(&name, "write", error))
    }

    pub(crate) fn scratch(&self) -> Option<&Path> {
        self.writer.scratch()
    }
}
