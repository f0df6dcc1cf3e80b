//! The invariants of a pager, checked one by one.

use super::{Pager, Source};

impl Pager {
    /// Checks every invariant: directory, lists and counts agree, what memory is said to be taken is taken, and it is and always
    /// was within the hard quota. One that was [lowered](Self::set_quotas) may be exceeded still, but never by more than before.
    ///
    /// # Complexity
    /// Linear in the number of blocks of the file.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn validate(&self) -> Result<(), String> {
        self.residents.validate()?;
        let (bytes, hard) = (self.resident_bytes(), self.options.hard_quota_bytes);
        let exceeded = Some(bytes).filter(|&bytes| bytes > self.allowed_bytes);
        if let Some(most) = self.exceeded.max(exceeded) {
            return Err(format!("memory was {most} bytes, allowed are {hard}"));
        }
        let most_page = match &self.source {
            Source::Loaders(loader) => {
                loader.validate()?;
                0
            }
            Source::Caller(at_once) => at_once.page.memory_bytes(),
        };
        if most_page > self.page_bytes {
            return Err(format!("a page takes {most_page} bytes, counted are {}", self.page_bytes));
        }
        for root in self.file.base().roots() {
            let block = self.numbering().block(root);
            let page = self.file.block_page(block);
            let lost = page.is_none_or(|page| self.failures[page].0 > 0);
            if !self.residents.contains(block) && !lost {
                return Err(format!("the block of root {root} is not resident"));
            }
        }
        Ok(())
    }
}
