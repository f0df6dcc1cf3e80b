//! Threads that read and unpack pages, the most urgent first, while frames go on.

use std::cmp::Reverse;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use xfm_format::{Error, Page, PageReader, XfmFile};

/// A page asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Want {
    pub page: u32,
    pub urgency: f32,
}

/// A page that was read, or why it could not be.
pub(crate) struct Loaded {
    pub number: usize,
    pub page: Page,
    pub error: Option<Error>,
    pub time: Duration,
}

struct State {
    /// What is asked for, the most urgent last. Replaced as a whole by every frame.
    wanted: Vec<Want>,
    /// Pages being read.
    reading: Vec<usize>,
    done: Vec<Loaded>,
    /// Memory for pages. When it is used up, loaders wait until pages are taken over.
    spare: Vec<Page>,
    /// Pages there are, and should be.
    num_pages: usize,
    wanted_pages: usize,
    closing: bool,
}

struct Shared {
    file: Arc<XfmFile>,
    state: Mutex<State>,
    /// There is something to read, and memory for it.
    work: Condvar,
    /// A page has come.
    arrived: Condvar,
}

impl State {
    /// Frees memory for pages that should not be there.
    fn drop_spare(&mut self) {
        while self.num_pages > self.wanted_pages && self.spare.pop().is_some() {
            self.num_pages -= 1;
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Loaders hold the lock for bookkeeping only, which does not panic half way.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The threads, and what they were asked for. They end by themselves when it is dropped.
pub(crate) struct Loader {
    shared: Arc<Shared>,
    /// Memory for each page, and for everything else.
    bytes: [usize; 2],
}

impl Loader {
    /// Memory that so many threads and pages take.
    pub fn cost(file: &XfmFile, threads: usize, pages: usize) -> usize {
        let [page, others] = Self::bytes_for(file, threads);
        pages * page + others
    }

    fn bytes_for(file: &XfmFile, threads: usize) -> [usize; 2] {
        let [page, reader] = file.largest_page_bytes();
        [page + size_of::<Loaded>(), threads * reader + size_of::<Shared>()]
    }

    /// Starts threads that hold so many pages at most.
    pub fn start(file: Arc<XfmFile>, threads: usize, pages: usize) -> Result<Self, Error> {
        let bytes = Self::bytes_for(&file, threads);
        let state = State {
            wanted: Vec::new(),
            reading: Vec::with_capacity(threads),
            done: Vec::with_capacity(pages),
            spare: (0..pages).map(|_| Page::new()).collect(),
            num_pages: pages,
            wanted_pages: pages,
            closing: false,
        };
        let shared = Arc::new(Shared {
            file,
            state: Mutex::new(state),
            work: Condvar::new(),
            arrived: Condvar::new(),
        });
        let loader = Self { shared, bytes };
        for index in 0..threads {
            let reader = loader.shared.file.page_reader()?;
            let shared = Arc::clone(&loader.shared);
            std::thread::Builder::new()
                .name(format!("xfm-loader-{index}"))
                .spawn(move || work(&shared, reader))
                .map_err(|source| Error::Io {
                    file: loader.shared.file.path().into(),
                    action: "start a thread to read",
                    source,
                })?;
        }
        Ok(loader)
    }

    /// Memory taken, whatever is being read.
    pub fn bytes(&self) -> usize {
        let [page, others] = self.bytes;
        self.shared.lock().num_pages * page + others
    }

    /// Changes how many pages they hold at most; those in use go when they are given back.
    pub fn resize(&self, pages: usize) {
        let mut state = self.shared.lock();
        state.wanted_pages = pages;
        while state.num_pages < pages {
            state.spare.push(Page::new());
            state.num_pages += 1;
        }
        state.drop_spare();
        self.shared.work.notify_all();
    }

    /// Asks for pages in place of all that was asked for before and is not being read yet.
    pub fn ask(&self, mut wanted: Vec<Want>) {
        // Of two alike, the one that comes first in the file.
        wanted.sort_unstable_by(|a, b| {
            a.urgency.total_cmp(&b.urgency).then(Reverse(a.page).cmp(&Reverse(b.page)))
        });
        let mut state = self.shared.lock();
        let State { reading, done, .. } = &*state;
        wanted.retain(|want| {
            let page = want.page as usize;
            !reading.contains(&page) && done.iter().all(|loaded| loaded.number != page)
        });
        state.wanted = wanted;
        if !state.wanted.is_empty() {
            self.shared.work.notify_all();
        }
    }

    /// Takes the pages that have come, so many at most, in the order of their coming.
    pub fn take(&self, most: usize) -> Vec<Loaded> {
        let mut state = self.shared.lock();
        let count = state.done.len().min(most);
        state.done.drain(..count).collect()
    }

    /// Gives the memory of pages back.
    pub fn recycle(&self, pages: Vec<Loaded>) {
        if pages.is_empty() {
            return;
        }
        let mut state = self.shared.lock();
        state.spare.extend(pages.into_iter().map(|loaded| loaded.page));
        state.drop_spare();
        self.shared.work.notify_all();
    }

    /// Pages asked for, being read, and not yet taken.
    pub fn queue(&self) -> [usize; 3] {
        let state = self.shared.lock();
        [state.wanted.len(), state.reading.len(), state.done.len()]
    }

    /// Checks that no page is lost, and that none takes more memory than it is counted with.
    pub fn validate(&self) -> Result<(), String> {
        let state = self.shared.lock();
        let State { spare, reading, done, num_pages, .. } = &*state;
        let found = spare.len() + reading.len() + done.len();
        if found != *num_pages {
            return Err(format!("the loaders count {num_pages} pages, there are {found}"));
        }
        let pages = spare.iter().chain(done.iter().map(|loaded| &loaded.page));
        let most = pages.map(Page::memory_bytes).max().unwrap_or(0);
        if most > self.bytes[0] {
            return Err(format!("a page takes {most} bytes, counted are {}", self.bytes[0]));
        }
        Ok(())
    }

    /// Pages there are, and what one is counted with.
    pub fn pages(&self) -> [usize; 2] {
        [self.shared.lock().num_pages, self.bytes[0]]
    }

    /// Waits until a page can be taken, none is on its way, or the time is over.
    pub fn wait(&self, most: Duration) {
        let end = Instant::now() + most;
        let mut state = self.shared.lock();
        while state.done.is_empty() && !(state.wanted.is_empty() && state.reading.is_empty()) {
            let Some(left) = end.checked_duration_since(Instant::now()) else { return };
            let waited = self.shared.arrived.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Drop for Loader {
    /// Does not wait: a thread may hang on storage that does not answer.
    fn drop(&mut self) {
        self.shared.lock().closing = true;
        self.shared.work.notify_all();
    }
}

/// What a thread does.
fn work(shared: &Shared, mut reader: PageReader) {
    let mut state = shared.lock();
    loop {
        if state.closing {
            return;
        }
        let next = if state.spare.is_empty() { None } else { state.wanted.pop() };
        let (Some(want), Some(mut page)) = (next, next.and_then(|_| state.spare.pop())) else {
            state = shared.work.wait(state).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        let number = want.page as usize;
        state.reading.push(number);
        drop(state);

        let begin = Instant::now();
        // Storage may be anyone's code. What it left half done in the reader is overwritten by the next page.
        let read = catch_unwind(AssertUnwindSafe(|| {
            shared.file.read_page_into(number, &mut reader, &mut page)
        }));
        let result = read.unwrap_or_else(|_| {
            page = Page::new();
            Err(Error::Io {
                file: shared.file.path().into(),
                action: "read",
                source: std::io::Error::other("the storage panicked"),
            })
        });
        let loaded = Loaded { number, page, error: result.err(), time: begin.elapsed() };

        state = shared.lock();
        state.reading.retain(|&reading| reading != number);
        state.done.push(loaded);
        shared.arrived.notify_all();
    }
}
