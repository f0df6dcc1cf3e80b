//! Scratch space: files that are few and large and go by themselves, and spools of records that use them once the memory
//! they may take is full.
//!
//! A [`Scratch`] is a folder for such files. A [`ScratchFile`] holds items of one kind by number. A [`Store`] holds chunks,
//! in memory as long as they fit and then in one file; in it lie any number of [`Spool`]s, each a row of records that is
//! appended to, and then taken away from either end. A [`Table`] is items by number, the latest of which are in memory.
//! A [`CheckpointWriter`] writes down how far a run is, a [`CheckpointReader`] reads it in a later one.
//!
//! ```
//! use scratch::{Piece, Scratch, Spool, Store, StoreOptions};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # let folder = folder.path();
//! let mut options = StoreOptions::default();
//! options.memory_bytes = 4 << 20;
//! let mut store = Store::new(&Scratch::new(folder), &options);
//! let mut spool = Spool::<[u32; 3]>::new(&store);
//! for i in 0..1_000_000 {
//!     spool.push(&mut store, &[i, i, i])?;
//! }
//!
//! // Backwards, a piece at a time.
//! let mut piece = Piece::default();
//! let mut next = 1_000_000;
//! while spool.take_last(&mut store, &mut piece)? {
//!     for &[i, ..] in piece.items().iter().rev() {
//!         next -= 1;
//!         assert_eq!(i, next);
//!     }
//! }
//! assert_eq!(next, 0);
//! assert!(store.peak_file_bytes() < 9 << 20);
//! # Ok::<(), scratch::Error>(())
//! ```

mod checkpoint;
mod error;
mod file;
mod places;
mod spool;
mod store;
mod table;

pub use checkpoint::{CheckpointError, CheckpointReader, CheckpointWriter};
pub use error::Error;
pub use file::{Scratch, ScratchFile};
pub use spool::{Piece, SavedChunk, SavedSpool, Spool};
pub use store::{Store, StoreOptions};
pub use table::{Table, TableOptions};
