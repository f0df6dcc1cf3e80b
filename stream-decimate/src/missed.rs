//! Why there are more triangles left than were asked for.

use crate::MissedTarget;
use crate::portion::{Portion, state};
use crate::rate::{self, Forbidden, Rules};

/// Divides the triangles beyond the target by what kept them: each vertex left is asked why it did not go.
pub(crate) fn reasons(portion: &mut Portion, excess: u64, rules: &Rules) -> MissedTarget {
    let (mut boundary, mut topology, mut flips) = (0, 0, 0);
    let count = portion.num_slots() as u32;
    let window = portion.whole();
    for v in (0..count).filter(|&v| window.state(v) & state::MAY_GO != 0) {
        match rate::forbidden(&window, v, rules) {
            Forbidden::Boundary => boundary += 1,
            Forbidden::Topology => topology += 1,
            Forbidden::Flip => flips += 1,
        }
    }
    if excess == 1 && boundary == 0 {
        // A closed surface has an even number of triangles.
        return MissedTarget { topology: 1, ..Default::default() };
    }
    let all: u64 = boundary + topology + flips;
    let share = |part: u64| (excess * part).checked_div(all).unwrap_or(0);
    let mut missed =
        MissedTarget { boundary: share(boundary), flips: share(flips), ..Default::default() };
    missed.topology = excess - missed.boundary - missed.flips;
    missed
}
