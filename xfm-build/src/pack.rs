//! Which page every piece of a tree goes to: one look through the log from its end, before nodes are numbered.

use mergetree::{Cut, DraftPlace, PackedPages, PagePacker};
use scratch::{Piece, Spool, Store};

use crate::Error;
use crate::coarse::Coarse;
use crate::log::{LogEntry, LoggedChild, PieceSize};
use crate::names::NONE;
use crate::number::damaged;
use crate::progress::{Observer, Stage};

/// Takes pieces as they are met from the last collapse on, and puts them into pages.
///
/// This is done twice with the same pieces: first to find out how many blocks and nodes each page has, then to know of each
/// piece in which it is.
#[derive(Debug)]
pub(crate) struct Packer {
    packer: PagePacker,
    /// Nodes of a piece and pages at most; more can only come of damage, or of trees that no builder makes.
    piece_nodes: u32,
    max_drafts: u64,
}

impl Packer {
    pub fn new(piece_nodes: u32, page_nodes: u32, max_drafts: u64) -> Self {
        Self { packer: PagePacker::new(page_nodes), piece_nodes, max_drafts }
    }

    /// Puts a piece below a page, or among the roots.
    pub fn place(
        &mut self,
        order: u64,
        above: Option<u32>,
        PieceSize { nodes, blocks }: PieceSize,
    ) -> Result<DraftPlace, Error> {
        if nodes > self.piece_nodes || blocks == 0 || blocks > nodes {
            return Err(damaged(order, "a piece of a size that cannot be"));
        }
        if self.packer.num_drafts() as u64 >= self.max_drafts {
            return Err(damaged(order, "a tree too deep for its number of nodes"));
        }
        Ok(self.packer.place(above, nodes, blocks))
    }
}

/// Finds the pages of all pieces; log and sizes stay as they are.
pub(crate) fn pack(
    (log, sizes, store): (&Spool<LogEntry>, &Spool<PieceSize>, &mut Store),
    coarse: &Coarse,
    num_vertices: u32,
    mut packer: Packer,
    observer: &mut Observer<'_>,
) -> Result<PackedPages, Error> {
    // By name of a vertex the page of the node that is waited for.
    let mut pages = vec![NONE; num_vertices as usize];
    for root in &coarse.roots {
        let place = packer.place(0, None, root.size)?;
        *pages.get_mut(root.name as usize).ok_or_else(|| damaged(0, "a root without a name"))? =
            place.draft;
    }
    let mut sizes = Sizes { spool: sizes, piece: Piece::default(), nth: 0, left: 0 };
    let mut piece = Piece::default();
    let mut order = log.len();
    let mut nth = 0;
    while log.read_last(store, nth, &mut piece)? {
        nth += 1;
        Stage::Number.tell(0, log.len(), observer)?;
        for entry in piece.items().iter().rev() {
            order = order.checked_sub(1).ok_or_else(|| damaged(0, "too many entries"))?;
            let kept = pages.get_mut(entry.kept().index());
            let page = kept.map_or(NONE, |kept| std::mem::replace(kept, NONE));
            if page == NONE {
                return Err(damaged(order, "a node that nothing waits for"));
            }
            let [left, right] =
                entry.children().map_err(|()| damaged(order, "children that cannot be"))?;
            // The sizes of pieces come back in the order opposite to that in which they went.
            for (child, vertex) in [(right, entry.kept()), (left, entry.removed())] {
                let Some(LoggedChild { cut, .. }) = child else { continue };
                let page = match cut {
                    Cut::None | Cut::Block => page,
                    Cut::Page => {
                        let size = sizes.next(store)?;
                        let size = size.ok_or_else(|| damaged(order, "a piece without a size"))?;
                        packer.place(order, Some(page), size)?.draft
                    }
                };
                match pages.get_mut(vertex.index()) {
                    Some(place) if *place == NONE => *place = page,
                    _ => return Err(damaged(order, "a vertex that is removed twice")),
                }
            }
        }
    }
    piece.clear(store);
    sizes.piece.clear(store);
    Ok(packer.packer.finish())
}

/// The sizes of pieces, the last one first.
struct Sizes<'a> {
    spool: &'a Spool<PieceSize>,
    piece: Piece<PieceSize>,
    nth: usize,
    left: usize,
}

impl Sizes<'_> {
    fn next(&mut self, store: &mut Store) -> Result<Option<PieceSize>, scratch::Error> {
        if self.left == 0 {
            self.spool.read_last(store, self.nth, &mut self.piece)?;
            self.nth += 1;
            self.left = self.piece.items().len();
        }
        self.left = match self.left.checked_sub(1) {
            Some(left) => left,
            None => return Ok(None),
        };
        Ok(self.piece.items().get(self.left).copied())
    }
}
