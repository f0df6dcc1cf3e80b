//! Changed ranges, put in order.

use crate::error::{Error, Result};
use std::ops::Range;

/// Checks the ranges against an array of `len` elements, sorts them, and joins those that overlap or lie within `gap`
/// elements of each other: a few bytes too many cost less than another copy.
pub(crate) fn coalesce(
    what: &'static str,
    ranges: impl IntoIterator<Item = Range<u32>>,
    len: usize,
    gap: u32,
) -> Result<Vec<Range<u32>>> {
    let mut sorted = Vec::new();
    for range in ranges {
        if range.is_empty() {
            continue;
        }
        if range.end as usize > len {
            return Err(Error::RangePastEnd { what, range, len });
        }
        sorted.push(range);
    }
    sorted.sort_unstable_by_key(|range| range.start);
    let mut joined: Vec<Range<u32>> = Vec::with_capacity(sorted.len());
    for range in sorted {
        match joined.last_mut() {
            Some(last) if range.start <= last.end.saturating_add(gap) => {
                last.end = last.end.max(range.end);
            }
            _ => joined.push(range),
        }
    }
    Ok(joined)
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init)] // One range is meant, not its elements.
mod tests {
    use super::*;

    fn joined(ranges: &[Range<u32>], gap: u32) -> Vec<Range<u32>> {
        coalesce("things", ranges.iter().cloned(), 100, gap).expect("all are within")
    }

    #[test]
    fn neighbours_join_and_strangers_do_not() {
        assert_eq!(joined(&[20..30, 0..5, 6..10], 1), [0..10, 20..30]);
        assert_eq!(joined(&[20..30, 0..5, 6..10], 0), [0..5, 6..10, 20..30]);
        assert_eq!(joined(&[0..5, 5..6], 0), [0..6]);
    }

    #[test]
    fn what_lies_within_another_is_swallowed() {
        assert_eq!(joined(&[0..50, 10..20, 49..51], 0), [0..51]);
    }

    #[test]
    fn empty_ranges_are_nothing_wherever_they_are() {
        assert_eq!(joined(&[5..5, 1000..1000], 10), []);
    }

    #[test]
    fn ranges_past_the_end_are_refused() {
        let refused = coalesce("things", [0..1, 90..101], 100, 0);
        assert!(matches!(
            refused,
            Err(Error::RangePastEnd {
                what: "things",
                range: Range { start: 90, end: 101 },
                len: 100
            })
        ));
    }
}
