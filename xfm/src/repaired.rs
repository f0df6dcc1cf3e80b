//! What was repaired in an input mesh, for reports.

use std::collections::BTreeMap;

use halfedge::RepairReport;

use crate::text;

/// Kinds of repair with their counts; every kind is there, also where it was not needed.
pub type Repaired = BTreeMap<&'static str, u64>;

/// The counts of a repair, by kind.
pub fn counts(report: &RepairReport) -> Repaired {
    report.counts().into_iter().map(|(kind, count)| (kind, count as u64)).collect()
}

/// The kinds that were needed, in words; `None` if none was.
///
/// ```
/// let repaired = [("cut_edges", 2_100), ("split_vertices", 0)].into();
/// assert_eq!(xfm::repaired::words(&repaired).as_deref(), Some("2,100 cut edges"));
/// ```
pub fn words(repaired: &Repaired) -> Option<String> {
    let needed: Vec<String> = repaired
        .iter()
        .filter(|&(_, &count)| count > 0)
        .map(|(kind, &count)| format!("{} {}", text::count(count), kind.replace('_', " ")))
        .collect();
    (!needed.is_empty()).then(|| needed.join(", "))
}
