//! Random use under tiny quotas, against a pager that is only a list of what was used when.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use common::Random;
use mergetree::{Node, NodeId, NodeStore, SlotId};
use proptest::prelude::*;
use xfm_format::{BlockId, XfmFile};
use xfm_pager::{Error, Pager, PagerOptions};

struct Sample {
    bytes: Vec<u8>,
    nodes: BTreeMap<NodeId, Node>,
    roots: BTreeSet<BlockId>,
    minimum: usize,
}

fn sample() -> &'static Sample {
    static SAMPLE: OnceLock<Sample> = OnceLock::new();
    SAMPLE.get_or_init(|| {
        let bytes = common::bytes(&common::torus(40), 96);
        let file = common::open(&bytes);
        let mut nodes = BTreeMap::new();
        let mut roots = BTreeSet::new();
        for page in 0..file.num_pages() {
            for block in file.read_page(page).unwrap().blocks() {
                let slots = (0..32).filter(|&slot| block.node(slot).is_some());
                let ids = slots.map(|slot| file.numbering().node(block.id, slot));
                nodes.extend(ids.zip(block.nodes.iter().copied()));
                if block.parent().is_none() {
                    roots.insert(block.id);
                }
            }
        }
        let minimum = minimum(file);
        Sample { bytes, nodes, roots, minimum }
    })
}

fn minimum(file: XfmFile) -> usize {
    match Pager::new(file, PagerOptions::with_quotas(0, 0)) {
        Err(Error::QuotaTooSmall { minimum, .. }) => minimum,
        other => panic!("{other:?}"),
    }
}

/// When each resident block was used last, and its split nodes.
#[derive(Default)]
struct Naive {
    frame: u32,
    used: BTreeMap<BlockId, u32>,
    split: BTreeSet<NodeId>,
}

impl Naive {
    fn is_split(&self, pager: &Pager, block: BlockId) -> bool {
        self.split.iter().any(|&id| pager.numbering().block(id) == block)
    }

    /// Takes over which blocks are gone; says that each of them was free to go.
    fn sync(
        &mut self,
        pager: &Pager,
        resident: &BTreeSet<BlockId>,
        unused_since: u32,
    ) -> Result<(), TestCaseError> {
        let gone: Vec<_> =
            self.used.keys().copied().filter(|block| !resident.contains(block)).collect();
        for block in gone {
            prop_assert!(!sample().roots.contains(&block), "root block {} went", block);
            prop_assert!(!self.is_split(pager, block), "split block {} went", block);
            prop_assert!(self.used[&block] < unused_since, "block {} went in use", block);
            self.used.remove(&block);
        }
        Ok(())
    }

    /// Blocks that are free to go.
    fn removable(&self, pager: &Pager, unused_since: u32) -> usize {
        let removable = |&(&block, &used): &(&BlockId, &u32)| {
            used < unused_since && !sample().roots.contains(&block) && !self.is_split(pager, block)
        };
        self.used.iter().filter(removable).count()
    }
}

/// The resident blocks, without looking at them through the pager, which would count as use.
fn resident(pager: &Pager) -> BTreeSet<BlockId> {
    pager.resident_blocks().collect()
}

fn run(seed: u64, steps: usize, soft: usize, hard: usize) -> Result<(), TestCaseError> {
    let sample = sample();
    let ids: Vec<NodeId> = sample.nodes.keys().copied().collect();
    let mut random = Random(seed);
    let options = PagerOptions::with_quotas(sample.minimum + soft, sample.minimum + hard);
    let hard_quota = options.hard_quota_bytes;
    let soft_quota = options.soft_quota_bytes.min(hard_quota);
    let mut pager = Pager::new(common::open(&sample.bytes), options).unwrap();
    let mut naive = Naive::default();
    naive.used.extend(sample.roots.iter().map(|&block| (block, 0)));
    for _ in 0..steps {
        let id = ids[random.below(ids.len().min(400))];
        let block = pager.numbering().block(id);
        let was_resident = naive.used.contains_key(&block);
        match random.below(12) {
            0..=5 => {
                let granted = pager.request(id, 1.0);
                let now = resident(&pager);
                naive.sync(&pager, &now, naive.frame.saturating_sub(1))?;
                prop_assert_eq!(granted, now.contains(&block));
                if granted {
                    // With others of its page.
                    for &other in &now {
                        if !naive.used.contains_key(&other) {
                            let page = |block| pager.file().block_page(block);
                            prop_assert_eq!(page(other), page(block));
                            naive.used.insert(other, naive.frame);
                        }
                    }
                    naive.used.insert(block, naive.frame);
                    let node = pager.node(id).copied();
                    let expected = Node { slot: node.and_then(|n| n.slot), ..sample.nodes[&id] };
                    prop_assert_eq!(node, Some(expected));
                } else {
                    prop_assert!(!was_resident, "a resident node was refused");
                    let removable = naive.removable(&pager, naive.frame.saturating_sub(1));
                    prop_assert_eq!(removable, 0, "refused with blocks to spare");
                    // A chunk of the arena and entries for 32 blocks, made at once, do not fit.
                    prop_assert!(
                        pager.resident_bytes() + 128 * 64 + 4096 > hard_quota,
                        "refused with room to spare"
                    );
                }
            }
            6 | 7 => {
                let node = pager.node(id);
                prop_assert_eq!(node.is_some(), was_resident);
                if was_resident {
                    naive.used.insert(block, naive.frame);
                }
            }
            8 | 9 if was_resident => {
                let slot = (random.below(3) > 0).then(|| SlotId::from_index(random.below(1000)));
                pager.set_slot(id, slot);
                prop_assert_eq!(pager.node(id).unwrap().slot, slot);
                naive.used.insert(block, naive.frame);
                if slot.is_some() {
                    naive.split.insert(id)
                } else {
                    naive.split.remove(&id)
                };
            }
            10 => {
                pager.begin_frame();
                let now = resident(&pager);
                naive.sync(&pager, &now, naive.frame)?;
                if pager.used_bytes() > soft_quota {
                    prop_assert_eq!(
                        naive.removable(&pager, naive.frame),
                        0,
                        "above the soft quota"
                    );
                }
                naive.frame += 1;
            }
            _ => {
                // Ids that are not there.
                prop_assert!(!pager.request(NodeId::new(u32::MAX - 1), 1.0));
                let hole = NodeId::new(block.get() << 4 | 15);
                prop_assert!(!pager.request(hole, 1.0));
                prop_assert_eq!(pager.node(hole), None);
                let now = resident(&pager);
                naive.sync(&pager, &now, naive.frame.saturating_sub(1))?;
                if now.contains(&block) {
                    for other in now {
                        naive.used.entry(other).or_insert(naive.frame);
                    }
                    naive.used.insert(block, naive.frame);
                }
            }
        }
        prop_assert_eq!(pager.validate(), Ok(()));
        let blocks: BTreeSet<_> = naive.used.keys().copied().collect();
        prop_assert_eq!(&blocks, &resident(&pager));
        prop_assert_eq!(pager.stats().resident_blocks, blocks.len());
    }
    let stats = pager.stats();
    prop_assert_eq!(
        stats.total.loads + stats.total.read_ahead - stats.total.evictions,
        stats.resident_blocks as u64
    );
    prop_assert!(pager.problems().is_empty());
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_use_under_tiny_quotas(
        seed in any::<u64>(),
        soft in 0usize..160_000,
        hard in 0usize..120_000,
    ) {
        run(seed, 500, soft, hard)?;
    }
}

#[test]
fn a_quota_below_the_minimum_is_refused_and_the_minimum_suffices() {
    let sample = sample();
    let least = PagerOptions::with_quotas(usize::MAX, sample.minimum);
    let mut pager = Pager::new(common::open(&sample.bytes), least).unwrap();
    assert_eq!(pager.options().soft_quota_bytes, sample.minimum);
    pager.validate().unwrap();
    for root in pager.base().clone().roots() {
        assert!(pager.request(root, 1.0));
    }
    for &id in sample.nodes.keys() {
        pager.request(id, 1.0);
    }
    pager.validate().unwrap();
    let error =
        Pager::new(common::open(&sample.bytes), PagerOptions::with_quotas(0, 1000)).unwrap_err();
    assert!(error.to_string().contains("the hard quota is 1000; raise it"), "{error}");
}
