//! Opening in the background: the window is there while a mesh is being built, or a large file read.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::error::Error;
use crate::model::{Model, Opener, build};

/// How far the opening is; written by one thread, read by another.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    stage: AtomicU64,
    done: AtomicU64,
    total: AtomicU64,
    cancelled: AtomicBool,
}

impl Progress {
    pub(super) fn tell(&self, stage: u64, done: u64, total: u64) {
        // Each for itself: a picture of progress may be a little wrong.
        self.stage.store(stage + 1, Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// What is being done and how far it is: as a count, and as a share where the whole is known.
    pub(crate) fn read(&self) -> (&'static str, u64, Option<f32>) {
        let done = self.done.load(Ordering::Relaxed);
        let total = self.total.load(Ordering::Relaxed);
        let share = (total > 0).then(|| (done as f32 / total as f32).min(1.0));
        match self.stage.load(Ordering::Relaxed) {
            0 => ("opening", 0, None),
            1 => ("building: triangles read", done, share),
            _ => ("writing: nodes", done, share),
        }
    }
}

/// A file being opened.
#[derive(Debug)]
pub(crate) struct Opening {
    pub(crate) source: PathBuf,
    pub(crate) progress: Arc<Progress>,
    done: Receiver<Result<Model, Error>>,
}

/// What has come of an opening.
pub(crate) enum Opened {
    NotYet(Opening),
    Done(Box<Model>),
    Failed(Error),
    Cancelled,
}

impl Opening {
    /// Starts to open a file, building it first where it is a mesh. `notify` is called when it is done.
    pub(crate) fn start(
        source: PathBuf,
        opener: Opener,
        notify: impl FnOnce() + Send + 'static,
    ) -> Self {
        Self::run(source.clone(), notify, move |progress| {
            let is_xfm = source.extension().is_some_and(|e| e.eq_ignore_ascii_case("xfm"));
            let (file, built) = if is_xfm {
                (source.clone(), None)
            } else {
                build::find_or_build(&source, opener.cache, progress)?
            };
            Model::open(&source, &file, built, &opener)
        })
    }

    fn run(
        source: PathBuf,
        notify: impl FnOnce() + Send + 'static,
        work: impl FnOnce(&Progress) -> Result<Model, Error> + Send + 'static,
    ) -> Self {
        let progress = Arc::new(Progress::default());
        let (send, done) = mpsc::channel();
        let told = Arc::clone(&progress);
        // Only one at a time: what was cancelled has to let go of memory and disk first.
        static ONE: Mutex<()> = Mutex::new(());
        thread::spawn(move || {
            let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
            let result = work(&told);
            drop(one);
            // Nobody may be interested any more.
            if send.send(result).is_ok() {
                notify();
            }
        });
        Self { source, progress, done }
    }

    /// Looks whether it is done.
    pub(crate) fn poll(self) -> Opened {
        match self.done.try_recv() {
            Err(TryRecvError::Empty) => Opened::NotYet(self),
            Ok(result) => self.judge(result),
            Err(TryRecvError::Disconnected) => self.broke_off(),
        }
    }

    /// Waits until it is done, telling how far it is now and then.
    pub(crate) fn wait(self, mut tell: impl FnMut(&Progress)) -> Opened {
        loop {
            match self.done.recv_timeout(std::time::Duration::from_millis(100)) {
                Ok(result) => return self.judge(result),
                Err(mpsc::RecvTimeoutError::Timeout) => tell(&self.progress),
                Err(mpsc::RecvTimeoutError::Disconnected) => return self.broke_off(),
            }
        }
    }

    fn judge(&self, result: Result<Model, Error>) -> Opened {
        match result {
            Ok(model) => Opened::Done(Box::new(model)),
            Err(_) if self.progress.is_cancelled() => Opened::Cancelled,
            Err(error) => Opened::Failed(error),
        }
    }

    /// The thread has ended without a word.
    fn broke_off(&self) -> Opened {
        Opened::Failed(Error::Broken(self.source.clone()))
    }

    /// Breaks it off; what was begun is removed.
    pub(crate) fn cancel(&self) {
        self.progress.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.cancel();
    }
}
