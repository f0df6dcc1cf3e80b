//! How full blocks are and how deep nodes lie.

use mergetree::NodeId;
use xfm_format::{Page, XfmFile};

use crate::Error;

/// Counts by size: how many blocks have so many nodes, and how many nodes lie so deep, the roots at 1.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Histograms {
    pub nodes_of_blocks: Vec<u64>,
    pub depths_of_nodes: Vec<u64>,
}

fn count(counts: &mut Vec<u64>, at: usize) {
    if counts.len() <= at {
        counts.resize(at + 1, 0);
    }
    counts[at] += 1;
}

impl Histograms {
    /// Reads all pages once.
    ///
    /// # Complexity
    /// Memory: 2 bytes per block.
    ///
    /// # Errors
    /// As [`XfmFile::read_page_into`].
    pub fn of(file: &XfmFile) -> Result<Self, Error> {
        let numbering = file.numbering();
        let mut histograms = Self::default();
        // Of the first node of each block; what it hangs under comes before it.
        let mut depth_of_block = vec![1u16; file.num_blocks()];
        let mut depths: Vec<u16> = Vec::new();
        let mut reader = file.page_reader()?;
        let mut page = Page::new();
        for number in 0..file.num_pages() {
            file.read_page_into(number, &mut reader, &mut page)?;
            for block in page.blocks() {
                count(&mut histograms.nodes_of_blocks, block.nodes.len());
                depths.clear();
                depths.resize(block.nodes.len(), 0);
                if let Some(first) = depths.first_mut() {
                    *first = depth_of_block[block.id.index()];
                }
                for (slot, node) in block.nodes.iter().enumerate() {
                    let depth = depths[slot];
                    count(&mut histograms.depths_of_nodes, depth.into());
                    let mut below = |child: NodeId| {
                        let child_depth = depth.saturating_add(1);
                        let (of, at) = (numbering.block(child), numbering.slot(child) as usize);
                        if of != block.id {
                            if let Some(first) = depth_of_block.get_mut(of.index()) {
                                *first = child_depth;
                            }
                        } else if let Some(inside) = depths.get_mut(at) {
                            *inside = child_depth;
                        }
                    };
                    node.children().for_each(&mut below);
                }
            }
        }
        Ok(histograms)
    }
}

/// Eight heights of a bar, from nothing to the largest count.
pub fn bars(counts: &[u64]) -> String {
    const HEIGHTS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let bar = |&count: &u64| match count {
        0 => ' ',
        count => HEIGHTS[1 + (count * 7 / most) as usize],
    };
    counts.iter().map(bar).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_grow_with_counts_and_show_the_least() {
        assert_eq!(bars(&[0, 1, 500, 1000]), " ▁▄█");
        assert_eq!(bars(&[]), "");
    }
}
