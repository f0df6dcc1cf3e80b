//! How much memory a pager may take.

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
    /// Inflated pages kept because more of their blocks may be wanted soon, at least 1, in no more than a quarter of the
    /// soft quota. All but one of them go first when memory is short. Default 256.
    pub cached_pages: usize,
}

impl Default for PagerOptions {
    fn default() -> Self {
        Self { soft_quota_bytes: 256 << 20, hard_quota_bytes: 512 << 20, cached_pages: 256 }
    }
}

impl PagerOptions {
    /// The default options with these quotas, in bytes.
    pub fn with_quotas(soft_quota_bytes: usize, hard_quota_bytes: usize) -> Self {
        Self { soft_quota_bytes, hard_quota_bytes, ..Self::default() }
    }
}
