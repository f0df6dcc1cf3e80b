//! Some inflated pages, kept because more of their blocks may be wanted soon.

use xfm_format::{Error, Page, PageReader, XfmFile};

struct CachedPage {
    number: Option<usize>,
    page: Page,
    last_used: u64,
}

/// The pages read last. There is always one, which costs what the largest page of the file does, as all do.
pub(crate) struct PageCache {
    reader: PageReader,
    pages: Vec<CachedPage>,
    uses: u64,
    page_bytes: usize,
    reader_bytes: usize,
}

impl PageCache {
    pub fn new(file: &XfmFile) -> Result<Self, Error> {
        let [page_bytes, reader_bytes] = file.largest_page_bytes();
        let mut cache = Self {
            reader: file.page_reader()?,
            pages: Vec::new(),
            uses: 0,
            page_bytes,
            reader_bytes,
        };
        cache.grow();
        Ok(cache)
    }

    /// Memory taken.
    pub fn bytes(&self) -> usize {
        self.reader_bytes + self.pages.len() * self.cost()
    }

    /// Memory that another page takes.
    pub fn cost(&self) -> usize {
        self.page_bytes + size_of::<CachedPage>()
    }

    pub fn len(&self) -> usize {
        self.pages.len()
    }

    /// Makes room for another page.
    pub fn grow(&mut self) {
        self.pages.reserve_exact(1);
        self.pages.push(CachedPage { number: None, page: Page::new(), last_used: 0 });
    }

    /// Forgets the page not used for longest, unless it is the only one.
    pub fn shrink(&mut self) -> bool {
        if self.pages.len() < 2 {
            return false;
        }
        let oldest = self.oldest();
        self.pages.swap_remove(oldest);
        self.pages.shrink_to_fit();
        true
    }

    fn oldest(&self) -> usize {
        let ages = self.pages.iter().enumerate().map(|(index, page)| (page.last_used, index));
        ages.min().map_or(0, |(_, index)| index)
    }

    /// The page, if it is here.
    pub fn find(&mut self, number: usize) -> Option<&Page> {
        self.uses += 1;
        let cached = self.pages.iter_mut().find(|cached| cached.number == Some(number))?;
        cached.last_used = self.uses;
        Some(&cached.page)
    }

    /// Reads a page that is not here in place of the one not used for longest.
    pub fn read(&mut self, file: &XfmFile, number: usize) -> Result<&Page, Error> {
        self.uses += 1;
        let oldest = self.oldest();
        let cached = &mut self.pages[oldest];
        cached.number = None;
        cached.last_used = 0;
        file.read_page_into(number, &mut self.reader, &mut cached.page)?;
        cached.number = Some(number);
        cached.last_used = self.uses;
        Ok(&cached.page)
    }
}
