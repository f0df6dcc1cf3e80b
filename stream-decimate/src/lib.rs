//! Decimation of triangle streams of any length in a fixed buffer: what is asked for, and what is reported.
//!
//! [`DecimateOptions`] states a target and the size of the buffer, checked once; [`DecimateReport`] says what came of
//! it, and why where a target was missed.
//!
//! # Sources
//! Wu and Kobbelt, *A Stream Algorithm for the Decimation of Massive Meshes*, 2003.
//!
//! ```
//! use stream_decimate::{DecimateOptions, Target};
//!
//! let options = DecimateOptions::new(Target::Ratio(0.02));
//! options.check()?;
//! assert_eq!(options.target.triangles(871_414), Some(17_428));
//! # Ok::<(), stream_decimate::OptionsError>(())
//! ```

mod cluster;
mod decimator;
mod deviation;
mod distance;
mod error;
mod external;
mod finality;
mod greedy;
mod insert;
mod lookup;
mod missed;
mod new_star;
mod options;
mod portion;
mod presort;
mod progress;
mod rate;
mod reorder;
mod report;
mod round;
mod run;
mod scratch;
mod sealed;
mod star;
mod write;

pub use cluster::decimate_clustered;
pub use decimator::StreamDecimator;
pub use error::Error;
pub use greedy::decimate_greedy;
pub use options::{DecimateOptions, OptionsError, Placement, Target};
pub use progress::{Observer, Progress, Stage};
pub use report::{DecimateReport, MissedTarget, Repairs};
pub use run::{decimate, decimate_file};
