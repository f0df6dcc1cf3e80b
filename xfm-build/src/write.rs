//! The file, bucket by bucket.

use std::path::Path;

use xfm_format::{FileWriter, Page, WriteReport};

use crate::Error;
use crate::assemble::Assembled;
use crate::number::Numbered;
use crate::progress::{Observer, Stage};

impl Numbered {
    /// Writes the file: whole, or not at all.
    ///
    /// While the pages of a bucket are encoded, on all threads, the next bucket is read. The bytes depend neither on the
    /// number of threads nor on the memory.
    ///
    /// # Errors
    /// [`Error::Format`] when the file cannot be written; [`Error::Scratch`]; [`Error::Interrupted`].
    pub fn write(
        self,
        path: impl AsRef<Path>,
        observer: &mut Observer<'_>,
    ) -> Result<WriteReport, Error> {
        let Self { mut store, buckets, coarse, totals, write, kept, .. } = self;
        let mut writer = FileWriter::create(path, &write, &totals, &coarse.base)?;
        drop(coarse);
        let numbering = buckets.numbering();
        let mut coming = buckets.all.into_iter();
        let (mut current, mut next) = (Assembled::default(), Assembled::default());
        let mut has_current = false;
        let mut pages: Vec<Page> = Vec::new();
        let mut done = 0;
        loop {
            let bucket = coming.next();
            let has_next = bucket.is_some();
            if !has_current && !has_next {
                break;
            }
            let (filled, written) = rayon::join(
                || bucket.map_or(Ok(()), |bucket| next.fill(&mut store, bucket, numbering)),
                || match has_current {
                    true => current.each_pages(&mut pages, |pages| Ok(writer.write_pages(pages)?)),
                    false => Ok(()),
                },
            );
            written?;
            filled?;
            if has_current {
                done += current.num_nodes() as u64;
            }
            Stage::Write.tell(done, totals.nodes, observer)?;
            std::mem::swap(&mut current, &mut next);
            has_current = has_next;
        }
        let report = writer.finish()?;
        if let Some(kept) = kept {
            kept.remove()?;
        }
        Ok(report)
    }
}
