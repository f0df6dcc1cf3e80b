//! Colours that tell where detail comes from: a block of the file, or what lies below.

use std::ops::Range;

use mergetree::{Changes, NodeStore};
use xfm_pager::Session;

/// What vertices are coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Paint {
    #[default]
    Nothing,
    /// The block of the file that a vertex comes out of.
    Block,
    /// Whether there is finer detail, and whether it is in memory.
    Residency,
    /// The vertices' own colours.
    Own,
}

/// A vertex of the coarsest mesh, which belongs to no block.
const BASE: [u8; 4] = [150, 150, 156, 255];
/// All that is below is in memory.
const READY: [u8; 4] = [70, 160, 90, 255];
/// Some of what is below would have to be loaded.
const ON_DISK: [u8; 4] = [224, 142, 48, 255];
/// Nothing is below: this is the input.
const FINEST: [u8; 4] = [74, 124, 200, 255];

/// What the colours of [`Paint::Residency`] mean.
pub(crate) fn paint_colours() -> [([u8; 4], &'static str); 4] {
    [
        (FINEST, "finest"),
        (READY, "finer detail in memory"),
        (ON_DISK, "finer detail on disk"),
        (BASE, "coarsest mesh"),
    ]
}

/// The colours as they were last asked for.
#[derive(Debug, Default)]
pub(super) struct Painted {
    paint: Paint,
    /// Blocks that had come and gone.
    traffic: [u64; 3],
    colours: Vec<[u8; 4]>,
    fresh: Vec<[u8; 4]>,
}

impl Painted {
    /// Colours for all vertices; none where nothing is painted.
    pub(super) fn colours(&self) -> &[[u8; 4]] {
        &self.colours
    }

    /// Brings the colours up to date and tells which have changed.
    ///
    /// # Complexity
    /// Time in the number of split nodes, where anything is painted at all.
    pub(super) fn update(
        &mut self,
        session: &Session,
        paint: Paint,
        changes: &Changes,
    ) -> Vec<Range<u32>> {
        let colour: fn(&Session, mergetree::NodeId) -> [u8; 4] = match paint {
            Paint::Block => of_block,
            Paint::Residency => of_residency,
            Paint::Own => {
                self.colours = Vec::new();
                let all = 0..session.vertices().len() as u32;
                // What changes vertices changes their colours.
                return if std::mem::replace(&mut self.paint, paint) == paint {
                    changes.vertices.clone()
                } else {
                    vec![all]
                };
            }
            Paint::Nothing => {
                self.colours = Vec::new();
                self.paint = paint;
                return Vec::new();
            }
        };
        // Blocks come and go without a change of the mesh.
        let total = session.pager().stats().total;
        let traffic = [total.loads, total.read_ahead, total.evictions];
        let moved = std::mem::replace(&mut self.traffic, traffic) != traffic;
        let stale = paint != self.paint || (paint == Paint::Residency && moved);
        if !stale && changes.vertices.is_empty() && changes.triangles.is_empty() {
            return Vec::new();
        }
        self.paint = paint;
        let base = session.pager().base().vertices.len();
        self.fresh.clear();
        self.fresh.resize(session.vertices().len(), BASE);
        for (id, _) in session.front().split_nodes() {
            let slot = session.pager().node(id).and_then(|node| node.slot);
            if let Some(vertex) = slot.and_then(|slot| self.fresh.get_mut(base + slot.index())) {
                *vertex = colour(session, id);
            }
        }
        let ranges = differences(&self.colours, &self.fresh);
        std::mem::swap(&mut self.colours, &mut self.fresh);
        ranges
    }
}

fn of_block(session: &Session, id: mergetree::NodeId) -> [u8; 4] {
    distinct(session.pager().numbering().block(id).get())
}

fn of_residency(session: &Session, id: mergetree::NodeId) -> [u8; 4] {
    let pager = session.pager();
    let Some(node) = pager.node(id) else { return ON_DISK };
    let (mut below, mut there) = (0, 0);
    for child in node.children() {
        below += 1;
        there += usize::from(pager.node(child).is_some());
    }
    match (below, there) {
        (0, _) => FINEST,
        (below, there) if below == there => READY,
        _ => ON_DISK,
    }
}

/// A colour for a number, far from those of the numbers beside it.
fn distinct(number: u32) -> [u8; 4] {
    // Steps of the golden section around the circle of hues, which never come close to one another soon.
    let hue = 6.0 * (number as f32 * 0.618_034).fract();
    let value = 0.62 + 0.3 * (number as f32 * 0.381_966 + 0.37).fract();
    let saturation = 0.62;
    let channel = |shift: f32| {
        let k = (hue + shift) % 6.0;
        let share = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * share) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0), 255]
}

/// Where two arrays differ, as far as both go; close differences as one.
fn differences(old: &[[u8; 4]], new: &[[u8; 4]]) -> Vec<Range<u32>> {
    const GAP: u32 = 16;
    let mut ranges: Vec<Range<u32>> = Vec::new();
    for (i, _) in (0..).zip(old.iter().zip(new)).filter(|(_, (old, new))| old != new) {
        match ranges.last_mut() {
            Some(last) if i < last.end + GAP => last.end = i + 1,
            _ => ranges.push(i..i + 1),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ() {
        for i in 0..1000 {
            let (a, b) = (distinct(i), distinct(i + 1));
            let apart: u32 = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum();
            assert!(apart > 60, "{a:?} and {b:?}");
        }
    }

    #[test]
    fn differences_are_found_and_joined() {
        let old = [[0; 4]; 100];
        let mut new = old;
        assert_eq!(differences(&old, &new), []);
        new[3] = [1; 4];
        new[10] = [1; 4];
        new[60] = [1; 4];
        assert_eq!(differences(&old, &new), [3..11, 60..61]);
        assert_eq!(differences(&old[..5], &new), vec![3..4]);
    }
}
