//! What the reverse of each half-edge is in the finest mesh.

use halfedge::HalfEdgeMesh;
use mergetree::{HalfEdgeNames, Node, NodeId};
use scratch::{Piece, Scratch, Spool, Store, StoreOptions, Table};
use xfm_format::{Page, XfmFile};

use super::{Corner, Shares, damaged};
use crate::progress::{Progress, Unit};
use crate::{Error, interrupt};

/// All that linking needs.
pub(super) struct Links<'a> {
    pub file: &'a XfmFile,
    pub scratch: &'a Scratch,
    pub names: HalfEdgeNames,
    /// One more than the largest name.
    pub half_edges: u64,
    pub shares: Shares,
}

/// That a split of this order makes the second half-edge the reverse of the first: half-edge, order, reverse.
type Naming = [u32; 3];

/// What is known of a half-edge so far: the order of the split that said so, and its reverse.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    order: u32,
    corner: Corner,
}

/// Later than every split.
const BASE_ORDER: u32 = u32::MAX;

impl Links<'_> {
    /// The table of all half-edges by name, vertices not yet known, and the scratch space that this took.
    pub fn find(&self) -> Result<(Table<Corner>, u64), Error> {
        let num_buckets = self.half_edges.div_ceil(self.shares.bucket) as usize;
        let mut options = StoreOptions::default();
        options.chunk_bytes = self.shares.chunk_bytes;
        options.memory_bytes = self.shares.held;
        let mut store = Store::new(self.scratch, &options);
        let mut buckets: Vec<Spool<Naming>> =
            (0..num_buckets).map(|_| Spool::new(&store)).collect();
        // Of each page the bucket that its first and last half-edge are in.
        let mut pages: Vec<[u32; 2]> = Vec::with_capacity(self.file.num_pages());
        let progress =
            Progress::new("linking", Some(2 * self.file.num_pages() as u64), Unit::Items);
        self.each_page(0..self.file.num_pages(), |page| {
            progress.advance(1);
            let mut range = [u32::MAX, 0];
            each_node(self.file, page, |id, node| {
                let own = self.names.of_node(id, 0).get();
                let [first, last] =
                    [own, own + 5].map(|h| (u64::from(h) / self.shares.bucket) as u32);
                range = [range[0].min(first), range[1].max(last)];
                for (adjacent, k) in node.adjacent.iter().zip([1, 2, 4, 5]) {
                    let Some(adjacent) = adjacent else { continue };
                    let bucket = (u64::from(adjacent.get()) / self.shares.bucket) as usize;
                    let bucket = buckets.get_mut(bucket).ok_or_else(|| damaged(self.file))?;
                    bucket.push(&mut store, &[adjacent.get(), node.order, own + k])?;
                }
                Ok(())
            })?;
            pages.push(range);
            Ok(())
        })?;

        let options = self.shares.table(self.shares.linking);
        let mut table = Table::new(self.scratch, self.half_edges, &options);
        let base = self.base_corners()?;
        let mut known = Vec::new();
        let mut done = 0;
        for (number, mut bucket) in buckets.into_iter().enumerate() {
            let first = number as u64 * self.shares.bucket;
            let len = self.shares.bucket.min(self.half_edges - first) as usize;
            known.clear();
            known.resize(len, Known::default());
            let of_base = base.iter().skip(first.min(base.len() as u64) as usize);
            for (known, &corner) in known.iter_mut().zip(of_base) {
                *known = Known { order: BASE_ORDER, corner };
            }
            // Names grow with blocks, and blocks with pages.
            let number = number as u32;
            let begin = pages.partition_point(|&[_, last]| last < number);
            let end = pages.partition_point(|&[first, _]| first <= number);
            self.each_page(begin..end.max(begin), |page| {
                each_node(self.file, page, |id, node| self.put_own(id, node, first, &mut known))
            })?;
            progress.advance(end.saturating_sub(done) as u64);
            done = done.max(end);
            let mut piece = Piece::default();
            while bucket.take_first(&mut store, &mut piece)? {
                for &[half_edge, order, reverse] in piece.items() {
                    let known = &mut known[(u64::from(half_edge) - first) as usize];
                    if !known.corner.is_there() {
                        return Err(damaged(self.file));
                    }
                    if order < known.order {
                        *known = Known { order, corner: Corner::with_reverse(Some(reverse)) };
                    }
                }
            }
            piece.clear(&mut store);
            for (name, known) in (first..).zip(&known) {
                *table.get_mut(name)? = known.corner;
            }
            interrupt::check()?;
        }
        Ok((table, store.peak_file_bytes()))
    }

    /// The half-edges that a node brings, and what it says of them, as far as they are among those known from `first` on.
    fn put_own(
        &self,
        id: NodeId,
        node: &Node,
        first: u64,
        known: &mut [Known],
    ) -> Result<(), Error> {
        let own = self.names.of_node(id, 0).get();
        let [w, x, y, z] = node.adjacent.map(|h| h.map(halfedge::HalfEdgeId::get));
        let second = node.has_second_face();
        let reverses = [second.then_some(own + 3), w, x, Some(own), y, z];
        for (k, reverse) in (0..if second { 6 } else { 3 }).zip(reverses) {
            let at = u64::from(own + k).checked_sub(first).map(|at| at as usize);
            if let Some(known) = at.and_then(|at| known.get_mut(at)) {
                *known = Known { order: node.order, corner: Corner::with_reverse(reverse) };
            }
        }
        Ok(())
    }

    /// The half-edges of the coarsest mesh.
    fn base_corners(&self) -> Result<Vec<Corner>, Error> {
        let base = self.file.base();
        let mesh = HalfEdgeMesh::from_triangles(base.vertices.len(), &base.faces)
            .map_err(|source| Error::Base { file: self.file.path().to_owned(), source })?;
        let half_edges = (0..3 * base.faces.len() as u32).map(halfedge::HalfEdgeId::new);
        let reverse = |h| mesh.reverse(h).map(halfedge::HalfEdgeId::get);
        Ok(half_edges.map(|h| Corner::with_reverse(reverse(h))).collect())
    }

    fn each_page(
        &self,
        pages: std::ops::Range<usize>,
        act: impl FnMut(&Page) -> Result<(), Error>,
    ) -> Result<(), Error> {
        each_page(self.file, pages, act)
    }
}

/// Reads pages one after another, until Ctrl-C.
pub(super) fn each_page(
    file: &XfmFile,
    pages: std::ops::Range<usize>,
    mut act: impl FnMut(&Page) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut reader = file.page_reader()?;
    let mut page = Page::new();
    for number in pages {
        interrupt::check()?;
        file.read_page_into(number, &mut reader, &mut page)?;
        act(&page)?;
    }
    Ok(())
}

/// All nodes of a page in order, with their ids.
pub(super) fn each_node(
    file: &XfmFile,
    page: &Page,
    mut act: impl FnMut(NodeId, &Node) -> Result<(), Error>,
) -> Result<(), Error> {
    for block in page.blocks() {
        for (slot, node) in (0..).zip(block.nodes) {
            act(file.numbering().node(block.id, slot), node)?;
        }
    }
    Ok(())
}
