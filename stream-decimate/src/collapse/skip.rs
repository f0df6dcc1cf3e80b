//! Reading once more what an earlier run has read.

use mesh_io::{Colour, Triangle};

use crate::collapse::collapser::crc_with;
use crate::finality::{Feed, Finality};
use crate::run::{BATCH, Known};
use crate::{Error, Observer, Progress, Stage};

/// What is left of a feed after its beginning.
pub(crate) struct Rest<'a> {
    feed: &'a mut dyn Feed,
    /// What is left of the last batch that was read.
    first: Vec<Triangle>,
    /// And the colours of that, if there are any.
    first_colours: Vec<[Colour; 3]>,
    known: Known,
    /// Whether that is what was given last.
    gave_first: bool,
    read: u64,
}

/// Reads so many triangles, which have this checksum. Batches are those of the run that read them first: what is known of the
/// last triangles of vertices is known after each.
pub(crate) fn skip<'a>(
    feed: &'a mut dyn Feed,
    (read, crc): (u64, u32),
    observer: &mut Observer<'_>,
) -> Result<Rest<'a>, Error> {
    let (mut left, mut found) = (read, 0);
    let mut triangles = Vec::new();
    while left > 0 {
        triangles.clear();
        let count = feed.read(&mut triangles, BATCH)?;
        if count == 0 {
            return Err(Error::OtherInput { read });
        }
        let skipped = left.min(count as u64);
        let colours = feed.colours().get(..skipped as usize).unwrap_or_default();
        found = crc_with(found, &triangles[..skipped as usize], colours);
        left -= skipped;
        triangles.drain(..skipped as usize);
        let stage = Stage::Skipping;
        Progress { stage, read: read - left, expected: Some(read), ..Default::default() }
            .tell(observer)?;
    }
    if found != crc {
        return Err(Error::OtherInput { read });
    }
    let known = match feed.finality() {
        // Of the triangles that are left.
        Finality::Corners(tags) => {
            let from = tags.len().saturating_sub(triangles.len());
            Known::new(Finality::Corners(&tags[from..]))
        }
        finality => Known::new(finality),
    };
    let colours = feed.colours();
    let first_colours = colours[colours.len().saturating_sub(triangles.len())..].to_vec();
    Ok(Rest { feed, first: triangles, first_colours, known, gave_first: false, read })
}

impl Rest<'_> {
    /// Makes sure that nothing is left.
    pub(crate) fn check_end(&mut self) -> Result<(), Error> {
        let mut more = Vec::new();
        match self.read(&mut more, 1)? {
            0 => Ok(()),
            _ => Err(Error::OtherInput { read: self.read }),
        }
    }
}

impl Feed for Rest<'_> {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, Error> {
        self.gave_first = !self.first.is_empty();
        if self.gave_first {
            // As a whole: what is known of it is known after it.
            let count = self.first.len();
            out.append(&mut self.first);
            return Ok(count);
        }
        self.feed.read(out, max)
    }

    fn colours(&self) -> &[[Colour; 3]] {
        if self.gave_first { &self.first_colours } else { self.feed.colours() }
    }

    fn finality(&self) -> Finality<'_> {
        if self.gave_first { self.known.finality() } else { self.feed.finality() }
    }
}
