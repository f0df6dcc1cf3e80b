//! What is asked of the decimator.

use std::num::NonZeroUsize;

/// How far to decimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// To this share of the input's triangles, above 0 and up to 1.
    Ratio(f64),
    /// To this number of triangles.
    Triangles(u64),
    /// As far as the surface stays within this distance of the input, in model units.
    MaxError(f64),
}

impl Target {
    /// The number of triangles asked for of an input of this size: the ratio's, rounded half up, never more than the
    /// input has. `None` for a distance.
    pub fn triangles(self, input: u64) -> Option<u64> {
        match self {
            Self::Ratio(ratio) => Some(((ratio * input as f64).round() as u64).min(input)),
            Self::Triangles(count) => Some(count.min(input)),
            Self::MaxError(_) => None,
        }
    }
}

/// Where the vertices of the output lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// At the minimum of their quadric: the best surface.
    #[default]
    Optimal,
    /// Where they were: every output vertex is one of the input, as a hierarchy needs it.
    Subset,
}

/// Options of a run. The same options and the same input give the same bytes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DecimateOptions {
    /// How far to decimate.
    pub target: Target,
    /// Triangles the buffer holds at most, 64 or more. Memory depends on this alone. Default 400,000.
    pub buffer_triangles: usize,
    /// Collapses compared per choice, 1 to 64. Default 8.
    pub candidates: usize,
    /// Seed of the random choices. Default 0.
    pub seed: u64,
    /// Where the output's vertices lie. Default [`Placement::Optimal`].
    pub placement: Placement,
    /// Threads to use at most; the result does not depend on it. Default `None`: as many as there are cores.
    pub threads: Option<NonZeroUsize>,
}

/// Options that make no sense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionsError {
    /// The ratio is not above 0 and up to 1.
    #[error("the ratio is {0}, it has to be above 0 and at most 1")]
    Ratio(f64),
    /// The distance is negative or not finite.
    #[error("the largest error is {0}, it has to be a distance in model units, 0 or more")]
    MaxError(f64),
    /// The buffer is too small to hold a neighbourhood.
    #[error("a buffer of {0} triangles is too small, give it 64 or more")]
    Buffer(usize),
    /// The weight of colours is negative, or not a number that makes sense.
    #[error("colours weigh {0}, that has to be 0 to 1,000,000")]
    ColourWeight(f32),
    /// The number of candidates is out of range.
    #[error("{0} candidates per choice, there have to be 1 to 64")]
    Candidates(usize),
}

impl DecimateOptions {
    /// The default options for a target.
    pub fn new(target: Target) -> Self {
        Self {
            target,
            buffer_triangles: 400_000,
            candidates: 8,
            seed: 0,
            placement: Placement::default(),
            threads: None,
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// The first field that is out of its range.
    pub fn check(&self) -> Result<(), OptionsError> {
        match self.target {
            Target::Ratio(r) if !(r > 0.0 && r <= 1.0) => return Err(OptionsError::Ratio(r)),
            Target::MaxError(e) if !(e >= 0.0 && e.is_finite()) => {
                return Err(OptionsError::MaxError(e));
            }
            _ => {}
        }
        if self.buffer_triangles < 64 {
            return Err(OptionsError::Buffer(self.buffer_triangles));
        }
        if !(1..=64).contains(&self.candidates) {
            return Err(OptionsError::Candidates(self.candidates));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn fields_out_of_range_are_named() {
        let with = |target| DecimateOptions::new(target).check();
        assert_eq!(with(Target::Ratio(0.0)), Err(OptionsError::Ratio(0.0)));
        assert_eq!(with(Target::Ratio(1.5)), Err(OptionsError::Ratio(1.5)));
        assert!(with(Target::Ratio(f64::NAN)).is_err());
        assert_eq!(with(Target::MaxError(-1.0)), Err(OptionsError::MaxError(-1.0)));
        assert_eq!(with(Target::Triangles(0)), Ok(()));
        let mut options = DecimateOptions::new(Target::Ratio(1.0));
        options.buffer_triangles = 63;
        assert_eq!(options.check(), Err(OptionsError::Buffer(63)));
        options.buffer_triangles = 64;
        options.candidates = 0;
        assert_eq!(options.check(), Err(OptionsError::Candidates(0)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn a_ratio_gives_the_nearest_count(ratio in 0.0001f64..=1.0, input in 0u64..1_000_000_000) {
            let count = Target::Ratio(ratio).triangles(input).unwrap();
            prop_assert!(count <= input);
            prop_assert!((count as f64 - ratio * input as f64).abs() <= 0.5);
        }
    }
}
