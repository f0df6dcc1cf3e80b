//! Whatever is in the log, it is numbered and written, or refused with an error; nothing panics, and nothing is left.

use std::ops::ControlFlow;

use bytemuck::Pod;
use scratch::{Piece, Spool, Store};

use crate::bucket::Buckets;
use crate::common::{Random, Sequence, link, plain, recycled, sheet, sweep};
use crate::{Error, LinkOptions, Linked, NumberOptions, Numbered};

fn sequence() -> Sequence {
    let shape = sheet(14, 14);
    recycled(&plain(&shape, &sweep(&shape, 100, 3, 3)), 2)
}

fn linked(sequence: &Sequence, folder: &std::path::Path) -> Linked {
    let mut options = LinkOptions::new(sequence.names);
    options.write.page_nodes = Some(64);
    options.write.levels = 3;
    options.memory_bytes = options.least_memory_bytes();
    link(sequence, folder, &options).unwrap()
}

fn number(linked: Linked) -> Result<Numbered, Error> {
    let options = NumberOptions { memory_bytes: linked.least_memory_bytes() };
    linked.number(&options, &mut |_| ControlFlow::Continue(()))
}

/// Changes a few records of a spool: bytes of them, or which one stands where.
fn change<T: Pod>(spool: &mut Spool<T>, store: &mut Store, random: &mut Random) {
    let (mut piece, mut records) = (Piece::default(), Vec::new());
    while spool.take_first(store, &mut piece).unwrap() {
        records.extend_from_slice(piece.items());
    }
    piece.clear(store);
    for _ in 0..1 + random.below(4) {
        if records.is_empty() {
            break;
        }
        let [i, j] = [(); 2].map(|()| random.below(records.len()));
        match random.below(8) {
            0 => records.swap(i, j),
            1 => records[i] = records[j],
            2 => drop(records.remove(i)),
            3 => records.insert(i, records[j]),
            _ => {
                let bytes = bytemuck::bytes_of_mut(&mut records[i]);
                let at = random.below(bytes.len());
                bytes[at] = match random.below(3) {
                    0 => bytes[at] ^ 1 << random.below(8),
                    1 => 0xff,
                    _ => bytes[at].wrapping_add(1),
                };
            }
        }
    }
    records.iter().for_each(|record| spool.push(store, record).unwrap());
}

#[test]
fn a_log_that_was_changed() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(1);
    let (mut refused, mut times) = (0, 0);
    while times < 3000 {
        let mut linked = linked(&sequence, folder.path());
        let Linked { log, sizes, store, .. } = &mut linked;
        match random.below(3) {
            0 => change(sizes, store, &mut random),
            _ => change(log, store, &mut random),
        }
        times += 1;
        match number(linked) {
            Err(Error::Damaged { .. } | Error::Record { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
            Ok(numbered) => match numbered.assemble_all() {
                Err(Error::Damaged { .. }) => refused += 1,
                Err(other) => panic!("{other}"),
                Ok(()) => {}
            },
        }
    }
    // Most changes are to positions, names and bounds, which have no meaning to the linker.
    assert!(refused > times / 4, "{refused}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn buckets_that_were_changed() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(1);
    let (mut refused, times) = (0, 3000);
    for _ in 0..times {
        let mut numbered = number(linked(&sequence, folder.path())).unwrap();
        let Numbered { buckets: Buckets { all, .. }, store, .. } = &mut numbered;
        assert!(all.len() > 2);
        let which = random.below(all.len());
        change(&mut all[which].nodes, store, &mut random);
        match numbered.assemble_all() {
            Err(Error::Damaged { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
            Ok(()) => {}
        }
    }
    assert!(refused > times / 4, "{refused}");
}

impl Numbered {
    /// All of writing but the file.
    fn assemble_all(mut self) -> Result<(), Error> {
        let numbering = self.buckets.numbering();
        let (mut assembled, mut pages) = (crate::assemble::Assembled::default(), Vec::new());
        for bucket in self.buckets.all {
            assembled.fill(&mut self.store, bucket, numbering)?;
            assembled.each_pages(&mut pages, |pages| {
                assert!(pages.iter().all(|page| page.num_blocks() > 0));
                Ok(())
            })?;
        }
        Ok(())
    }
}

#[test]
fn spools_of_one_store_hand_over_their_room() {
    // What was read of the log makes room for the buckets: little more than the log is ever in the file.
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let linked = linked(&sequence, folder.path());
    let log = linked.store.peak_file_bytes();
    let numbered = number(linked).unwrap();
    let buckets = numbered.buckets.all.len() as u64;
    assert!(numbered.scratch_bytes() <= log + buckets * numbered.store.chunk_bytes() as u64);
}
