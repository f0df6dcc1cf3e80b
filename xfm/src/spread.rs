//! How a measured quantity is spread over frames.

use serde::Serialize;

/// Mean, median, 99th percentile and maximum.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Spread {
    /// The sum over the number of values.
    pub mean: f64,
    /// Half of the values are no larger.
    pub median: f64,
    /// 99 of 100 values are no larger.
    pub p99: f64,
    /// No value is larger.
    pub max: f64,
}

impl Spread {
    /// The spread of some values, each figure but the mean being one of them; zeros where there are none.
    ///
    /// ```
    /// use xfm::spread::Spread;
    /// let spread = Spread::of(vec![3.0, 1.0, 2.0]);
    /// assert_eq!(spread, Spread { mean: 2.0, median: 2.0, p99: 3.0, max: 3.0 });
    /// ```
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        // The least value that so many of a hundred do not exceed.
        let at = |percent: usize| {
            let rank = (values.len() * percent).div_ceil(100).max(1);
            values.get(rank - 1).copied().unwrap_or(0.0)
        };
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self { mean, median: at(50), p99: at(99), max: at(100) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let hundred = (1..=100).rev().map(f64::from).collect();
        assert_eq!(Spread::of(hundred), Spread { mean: 50.5, median: 50.0, p99: 99.0, max: 100.0 });
        let two_hundred = (1..=200).map(f64::from).collect();
        assert_eq!(
            Spread::of(two_hundred),
            Spread { mean: 100.5, median: 100.0, p99: 198.0, max: 200.0 }
        );
        assert_eq!(Spread::of(vec![7.0]), Spread { mean: 7.0, median: 7.0, p99: 7.0, max: 7.0 });
        assert_eq!(Spread::of(vec![]), Spread::default());
    }
}
