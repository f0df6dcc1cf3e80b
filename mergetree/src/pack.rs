//! Which pieces of trees share a page, decided from the roots down.

/// No page.
const NONE: u32 = u32::MAX;

/// A page as it is being filled.
#[derive(Clone, Copy, Debug)]
struct Draft {
    nodes: u32,
    blocks: u32,
    /// The first and the last of the pages that hold what hangs under this one.
    first_child: u32,
    last_child: u32,
    /// The next page under the same one.
    next: u32,
}

/// Puts pieces of trees into pages, parents before children.
///
/// A page holds pieces that hang under the same page and follow each other in the order in which they are placed. When that
/// order is from the last collapse to the first, a page covers a part of the surface at about one level of detail, and the
/// pages under it cover the same part at the next finer one: whoever refines a view goes down a few layers of pages, and
/// needs hardly more of each than is shown. How many times finer a layer is than the one above depends on the size of
/// pieces.
#[derive(Clone, Debug)]
pub struct PagePacker {
    page_nodes: u32,
    drafts: Vec<Draft>,
    first_root: u32,
    last_root: u32,
}

/// Where a piece was put, as long as pages are being filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DraftPlace {
    /// The page, in the order of their beginning.
    pub draft: u32,
    /// Blocks that were put there before.
    pub block: u32,
}

/// A page that is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedPage {
    /// Number of its first block; blocks are numbered through all pages.
    pub first_block: u32,
    /// Number of its blocks.
    pub blocks: u32,
    /// Number of its nodes.
    pub nodes: u32,
}

/// All pages, in the order in which they are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedPages {
    /// The pages, layer by layer.
    pub pages: Vec<PackedPage>,
    /// Per draft the page that it became, or a part of, and the number of its first block.
    drafts: Vec<(u32, u32)>,
}

impl PackedPages {
    /// The page that a draft is in, and the number of the block put there after so many; `None` for no draft.
    #[inline]
    pub fn block(&self, place: DraftPlace) -> Option<(u32, u32)> {
        let &(page, first) = self.drafts.get(place.draft as usize)?;
        Some((page, first + place.block))
    }
}

impl PagePacker {
    /// Pages of so many nodes at most; a piece that is larger has one for itself.
    pub fn new(page_nodes: u32) -> Self {
        Self { page_nodes, drafts: Vec::new(), first_root: NONE, last_root: NONE }
    }

    /// Bytes of memory for each page, in the end too.
    pub const PAGE_BYTES: usize = size_of::<Draft>() + size_of::<PackedPage>() + 16;

    /// Number of pages begun so far.
    pub fn num_drafts(&self) -> usize {
        self.drafts.len()
    }

    /// Puts a piece of so many nodes and blocks below the page `above`, or among the roots.
    ///
    /// # Panics
    /// When there is no page `above`.
    pub fn place(&mut self, above: Option<u32>, nodes: u32, blocks: u32) -> DraftPlace {
        let last = above.map_or(self.last_root, |page| self.drafts[page as usize].last_child);
        let fits = self
            .drafts
            .get(last as usize)
            .is_some_and(|draft| draft.nodes.saturating_add(nodes) <= self.page_nodes);
        let draft = if fits { last } else { self.begin(above, last) };
        let page = &mut self.drafts[draft as usize];
        let place = DraftPlace { draft, block: page.blocks };
        page.nodes += nodes;
        page.blocks += blocks;
        place
    }

    fn begin(&mut self, above: Option<u32>, last: u32) -> u32 {
        let new = self.drafts.len() as u32;
        let children = (NONE, NONE);
        self.drafts.push(Draft {
            nodes: 0,
            blocks: 0,
            first_child: children.0,
            last_child: children.1,
            next: NONE,
        });
        if let Some(last) = self.drafts.get_mut(last as usize) {
            last.next = new;
        } else if let Some(above) = above {
            self.drafts[above as usize].first_child = new;
        } else {
            self.first_root = new;
        }
        match above {
            Some(above) => self.drafts[above as usize].last_child = new,
            None => self.last_root = new,
        }
        new
    }

    /// Ends filling. Pages that stayed small share one with the next small one of their layer, the last of a layer also with
    /// those of the next, as long as they fit.
    ///
    /// # Complexity
    /// Time and memory linear in the number of pages.
    pub fn finish(self) -> PackedPages {
        let Self { page_nodes, drafts, first_root, .. } = self;
        let siblings = |first: u32| {
            std::iter::successors(Some(first).filter(|&first| first != NONE), |&page| {
                Some(drafts[page as usize].next).filter(|&next| next != NONE)
            })
        };
        let mut places = vec![(NONE, 0); drafts.len()];
        let mut pages: Vec<PackedPage> = Vec::with_capacity(drafts.len());
        let mut layer: Vec<u32> = siblings(first_root).collect();
        let mut small = None;
        while !layer.is_empty() {
            for &draft in &layer {
                let Draft { nodes, blocks, .. } = drafts[draft as usize];
                let is_small = nodes < page_nodes / 4 * 3;
                let shared = small.filter(|&page: &usize| {
                    is_small && pages[page].nodes.saturating_add(nodes) <= page_nodes
                });
                let page = shared.unwrap_or(pages.len());
                if page == pages.len() {
                    pages.push(PackedPage { first_block: 0, blocks: 0, nodes: 0 });
                    small = if is_small { Some(page) } else { small };
                }
                places[draft as usize] = (page as u32, pages[page].blocks);
                pages[page].blocks += blocks;
                pages[page].nodes += nodes;
            }
            // In the next layer only the last one can be shared: pages come after all that they hang under.
            small = small.filter(|&page| page + 1 == pages.len());
            layer = layer
                .iter()
                .flat_map(|&page| siblings(drafts[page as usize].first_child))
                .collect();
        }
        let mut block = 0;
        for page in &mut pages {
            page.first_block = block;
            block += page.blocks;
        }
        for (page, first) in &mut places {
            *first += pages[*page as usize].first_block;
        }
        PackedPages { pages, drafts: places }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn siblings_share_pages_and_layers_follow_each_other() {
        let mut packer = PagePacker::new(10);
        let root = packer.place(None, 4, 1);
        let other = packer.place(None, 6, 2);
        assert_eq!(
            (root, other),
            (DraftPlace { draft: 0, block: 0 }, DraftPlace { draft: 0, block: 1 })
        );
        let full = packer.place(Some(0), 9, 3);
        let small = packer.place(Some(0), 2, 1);
        let below = packer.place(Some(full.draft), 5, 1);
        let next_root = packer.place(None, 1, 1);
        let beside = packer.place(Some(next_root.draft), 3, 1);
        let packed = packer.finish();
        let blocks: Vec<_> = [root, other, next_root, full, small, beside, below]
            .into_iter()
            .filter_map(|place| packed.block(place))
            .collect();
        // The second page of roots is the last of its layer, and small: small ones below share it.
        assert_eq!(blocks, [(0, 0), (0, 1), (1, 3), (2, 6), (1, 4), (1, 5), (3, 9)]);
        let sizes: Vec<_> = packed.pages.iter().map(|page| page.nodes).collect();
        assert_eq!(sizes, [10, 6, 9, 5]);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn every_block_has_its_number_and_no_page_is_too_large(
            pieces in prop::collection::vec((any::<prop::sample::Index>(), 1u32..8, 1u32..4), 1..80),
        ) {
            let mut packer = PagePacker::new(20);
            let mut places: Vec<(DraftPlace, u32)> = Vec::new();
            for (above, nodes, blocks) in &pieces {
                let above = above.index(places.len() + 1);
                let above = places.get(above).map(|(place, _)| place.draft);
                places.push((packer.place(above, *nodes, *blocks), *blocks));
            }
            let packed = packer.finish();
            let mut seen: Vec<u32> = Vec::new();
            for &(place, blocks) in &places {
                let (page, first) = packed.block(place).unwrap();
                let page = packed.pages[page as usize];
                prop_assert!(first >= page.first_block && first + blocks <= page.first_block + page.blocks);
                seen.extend(first..first + blocks);
            }
            seen.sort_unstable();
            let total: u32 = pieces.iter().map(|&(_, _, blocks)| blocks).sum();
            prop_assert_eq!(seen, (0..total).collect::<Vec<_>>());
            prop_assert!(packed.pages.iter().all(|page| page.nodes <= 20));
            let nodes: u32 = packed.pages.iter().map(|page| page.nodes).sum();
            prop_assert_eq!(nodes, pieces.iter().map(|&(_, nodes, _)| nodes).sum::<u32>());
            let mut block = 0;
            for page in &packed.pages {
                prop_assert_eq!(page.first_block, block);
                block += page.blocks;
            }
        }
    }
}
