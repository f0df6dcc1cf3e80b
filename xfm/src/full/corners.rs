//! Which vertex each half-edge of the finest mesh begins at.

use mergetree::HalfEdgeNames;
use scratch::{Scratch, Table};
use xfm_format::XfmFile;

use super::links::{each_node, each_page};
use super::{Corner, Shares, damaged, next, previous};
use crate::Error;
use crate::progress::{Progress, Unit};

/// What there is besides the corners.
pub(super) struct Found {
    /// Vertices of the coarsest mesh that have faces; they are numbered first, in order.
    pub base_vertices: Vec<u32>,
    pub scratch_bytes: u64,
}

/// Gives every half-edge its vertex: the vertices of the coarsest mesh come first, then those of the nodes in order.
pub(super) fn find(
    file: &XfmFile,
    scratch: &Scratch,
    names: HalfEdgeNames,
    table: &mut Table<Corner>,
    shares: &Shares,
) -> Result<Found, Error> {
    let base = file.base();
    let mut is_used: Vec<bool> = base.vertices.iter().map(|vertex| vertex.root.is_some()).collect();
    for &corner in base.faces.as_flattened() {
        is_used[corner as usize] = true;
    }
    let mut base_vertices: Vec<u32> = (0..base.vertices.len() as u32).collect();
    base_vertices.retain(|&v| is_used[v as usize]);
    drop(is_used);

    // Of each node one more than the number of the vertex that it keeps.
    let ids = (file.num_blocks() as u64) << file.numbering().levels();
    let mut kept: Table<u32> = Table::new(scratch, ids, &shares.table(shares.other));
    let mut walk = Walk { file, names, table };
    let mut rootless = vec![0; base.vertices.len()];
    for (number, &v) in (1..).zip(&base_vertices) {
        match base.vertices[v as usize].root {
            Some(root) => *kept.get_mut(root.get().into())? = number,
            None => rootless[v as usize] = number,
        }
    }
    for (h, &v) in (0..).zip(base.faces.as_flattened()) {
        let number = std::mem::take(&mut rootless[v as usize]);
        if number > 0 {
            walk.around(h, number)?;
        }
    }
    drop(rootless);
    let mut number = base_vertices.len() as u32;
    let progress = Progress::new("walking", Some(file.num_pages() as u64), Unit::Items);
    each_page(file, 0..file.num_pages(), |page| {
        progress.advance(1);
        each_node(file, page, |id, node| {
            number += 1;
            let stays = kept.get(id.get().into())?;
            if stays == 0 {
                return Err(damaged(file));
            }
            for (child, vertex, k) in [(node.left, number, 0), (node.right, stays, 1)] {
                match child {
                    Some(child) => *kept.get_mut(child.get().into())? = vertex,
                    None => walk.around(names.of_node(id, k).get(), vertex)?,
                }
            }
            Ok(())
        })
    })?;
    Ok(Found { base_vertices, scratch_bytes: kept.peak_file_bytes() })
}

/// Goes around vertices.
struct Walk<'a> {
    file: &'a XfmFile,
    names: HalfEdgeNames,
    table: &'a mut Table<Corner>,
}

impl Walk<'_> {
    /// Makes `vertex` the beginning of this half-edge and of all others around it.
    ///
    /// Every half-edge has one beginning: so all walks together end, whatever is in the file.
    fn around(&mut self, first: u32, vertex: u32) -> Result<(), Error> {
        self.put(first, vertex)?;
        let mut h = first;
        loop {
            let previous = self.table.get(previous(self.names, h).into())?;
            match previous.reverse() {
                Some(reverse) if reverse == first => return Ok(()),
                Some(reverse) => h = reverse,
                None => break,
            }
            self.put(h, vertex)?;
        }
        // A boundary vertex: the other way from the first one.
        let mut h = first;
        while let Some(reverse) = self.table.get(h.into())?.reverse() {
            h = next(self.names, reverse);
            self.put(h, vertex)?;
        }
        Ok(())
    }

    fn put(&mut self, h: u32, vertex: u32) -> Result<(), Error> {
        let corner = self.table.get_mut(h.into())?;
        if !corner.is_there() || corner.vertex != 0 {
            return Err(damaged(self.file));
        }
        corner.vertex = vertex;
        Ok(())
    }
}
