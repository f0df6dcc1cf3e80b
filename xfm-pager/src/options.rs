//! How much memory a pager may take, and who reads for it.

/// What a pager may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PagerOptions {
    /// Above so many bytes in use, blocks that are not used any more are removed at the beginning of a frame. Below three
    /// quarters of it, all blocks of a page that was read are kept. What is above `hard_quota_bytes` counts as that.
    /// Default 256 MiB.
    pub soft_quota_bytes: usize,
    /// Memory never exceeds so many bytes: what would is not loaded. Default 512 MiB.
    pub hard_quota_bytes: usize,
    /// Threads that read and unpack pages while the caller goes on. With 0 a page is read when one of its nodes is
    /// requested, and the request waits for it. Default 0; [`PagerOptions::loaders_for_this_machine`] leaves a core to the
    /// caller.
    pub loaders: usize,
    /// Pages that a frame takes over from the loaders at most: what bounds the time that takes. Default 8.
    pub pages_per_frame: usize,
}

impl Default for PagerOptions {
    fn default() -> Self {
        Self {
            soft_quota_bytes: 256 << 20,
            hard_quota_bytes: 512 << 20,
            loaders: 0,
            pages_per_frame: 8,
        }
    }
}

impl PagerOptions {
    /// The default options with these quotas, in bytes.
    pub fn with_quotas(soft_quota_bytes: usize, hard_quota_bytes: usize) -> Self {
        Self { soft_quota_bytes, hard_quota_bytes, ..Self::default() }
    }

    /// The same with so many threads that read.
    #[must_use]
    pub fn with_loaders(self, loaders: usize) -> Self {
        Self { loaders, ..self }
    }

    /// One to four threads, a core fewer than there are where that is possible.
    pub fn loaders_for_this_machine() -> usize {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        cores.saturating_sub(1).clamp(1, 4)
    }
}
