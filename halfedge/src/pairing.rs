//! Half-edges gathered by the vertex they leave: the table behind building and repair.

use crate::HalfEdgeId;

/// Half-edges in buckets, one bucket per start vertex, by a counting sort.
pub(crate) struct Buckets<'a> {
    triangles: &'a [[u32; 3]],
    offsets: Vec<u32>,
    half_edges: Vec<HalfEdgeId>,
}

impl<'a> Buckets<'a> {
    pub(crate) fn by_start(num_vertices: usize, triangles: &'a [[u32; 3]]) -> Self {
        let starts = triangles.as_flattened();
        let mut offsets = vec![0u32; num_vertices + 1];
        for &v in starts {
            offsets[v as usize] += 1;
        }
        let mut sum = 0;
        for offset in &mut offsets {
            sum += *offset;
            *offset = sum;
        }
        let mut half_edges = vec![HalfEdgeId::new(0); starts.len()];
        // Backwards, so that every bucket is in order of half-edges when its offset has come down to its start.
        for (index, &v) in starts.iter().enumerate().rev() {
            let offset = &mut offsets[v as usize];
            *offset -= 1;
            half_edges[*offset as usize] = HalfEdgeId::from_index(index);
        }
        Self { triangles, offsets, half_edges }
    }

    pub(crate) fn num_vertices(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Half-edges out of a vertex, ascending.
    #[inline]
    pub(crate) fn leaving(&self, v: u32) -> &[HalfEdgeId] {
        let v = v as usize;
        &self.half_edges[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }

    /// Start and end of a half-edge.
    #[inline]
    pub(crate) fn edge(&self, h: HalfEdgeId) -> (u32, u32) {
        let starts = self.triangles.as_flattened();
        (starts[h.index()], starts[h.next().index()])
    }

    /// An edge that two half-edges run along in the same direction, if there is one.
    pub(crate) fn repeated_edge(&self) -> Option<(u32, u32)> {
        let mut ends = Vec::new();
        (0..self.num_vertices() as u32).find_map(|v| {
            ends.clear();
            ends.extend(self.leaving(v).iter().map(|&h| self.edge(h).1));
            ends.sort_unstable();
            ends.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| (v, pair[0]))
        })
    }
}
