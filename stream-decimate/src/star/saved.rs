//! Stars in a checkpoint, and whether what comes out of one can be stars.

use scratch::{CheckpointError, CheckpointReader, CheckpointWriter};

use super::{INLINE, LAST, Stars, id};

/// What is wrong with them.
const STARS: CheckpointError = CheckpointError::Damaged("stars");

impl Stars {
    /// Writes all of them. Long ones follow in the order of their vertices: what numbers they have in memory means nothing.
    pub(crate) fn save(&self, out: &mut CheckpointWriter) -> Result<(), scratch::Error> {
        out.put("stars", &self.stars)?;
        out.put("tags", &self.tags)?;
        let long = || self.stars.iter().filter(|star| star.len as usize > INLINE);
        let count = long().map(|star| u64::from(star.len)).sum();
        let list = |star: &super::Star| star.entries[0] as usize;
        out.put_all("long stars", count, long().map(|star| &self.spill.lists[list(star)][..]))?;
        let count = if self.are_tagged { count } else { 0 };
        out.put_all("long tags", count, long().map(|star| &self.spill.tags[list(star)][..]))
    }

    /// Reads all of them, `most` at most, as tagged ones; no number in them has been looked at.
    pub(crate) fn restore(
        &mut self,
        from: &mut CheckpointReader,
        most: u64,
    ) -> Result<(), CheckpointError> {
        from.take("stars", most, &mut self.stars)?;
        from.take("tags", most, &mut self.tags)?;
        self.are_tagged = true;
        let count = self.stars.len();
        if self.tags.len() != count {
            return Err(STARS);
        }
        let mut lengths = Vec::new();
        for star in self.stars.iter_mut().filter(|star| star.len as usize > INLINE) {
            star.entries[0] = lengths.len() as u32;
            lengths.push(star.len as usize);
        }
        // No neighbour twice.
        if lengths.iter().any(|&len| len >= count) {
            return Err(STARS);
        }
        let all: u64 = lengths.iter().map(|&len| len as u64).sum();
        for (name, lists) in
            [("long stars", &mut self.spill.lists), ("long tags", &mut self.spill.tags)]
        {
            if from.begin::<u32>(name, all)? != all {
                return Err(STARS);
            }
            lists.clear();
            for &len in &lengths {
                let mut list = vec![0; len];
                from.read_items(&mut list)?;
                lists.push(list);
            }
            from.end()?;
        }
        self.spill.free.clear();
        Ok(())
    }
}

/// Where the neighbours of long stars stand in them, as a search through each of them would take too long.
pub(crate) struct LongStars<'a> {
    stars: &'a Stars,
    /// The neighbours of each in ascending order, and where they stand.
    sorted: Vec<Vec<(u32, u32)>>,
}

impl<'a> LongStars<'a> {
    pub(crate) fn new(stars: &'a Stars) -> Self {
        let sorted = |list: &Vec<u32>| {
            let mut sorted: Vec<_> = list.iter().map(|&entry| id(entry)).zip(0..).collect();
            sorted.sort_unstable();
            sorted
        };
        Self { stars, sorted: stars.spill.lists.iter().map(sorted).collect() }
    }

    fn sorted(&self, v: u32) -> Option<&[(u32, u32)]> {
        let star = self.stars.stars.get(v as usize)?;
        match star.len as usize {
            len if len <= INLINE => None,
            _ => self.sorted.get(star.entries[0] as usize).map(Vec::as_slice),
        }
    }

    /// Where a neighbour stands in the star of a vertex.
    pub(crate) fn position(&self, v: u32, neighbour: u32) -> Option<usize> {
        match self.sorted(v) {
            Some(sorted) => {
                let at = sorted.binary_search_by_key(&neighbour, |&(x, _)| x).ok()?;
                Some(sorted[at].1 as usize)
            }
            None => self.stars.fans(v).position(neighbour),
        }
    }

    /// Whether the star of `v` can be one among those of `count` vertices: its neighbours are others, none of them twice, and
    /// it is a ring or fans of two neighbours and more each.
    pub(crate) fn is_star(&self, v: u32, count: usize) -> bool {
        let fans = self.stars.fans(v);
        let list = fans.list;
        let distinct = match self.sorted(v) {
            Some(sorted) => sorted.windows(2).all(|pair| pair[0].0 != pair[1].0),
            None => {
                list.iter().enumerate().all(|(i, &x)| list[..i].iter().all(|&y| id(x) != id(y)))
            }
        };
        let are_others = list.iter().all(|&x| id(x) != v && (id(x) as usize) < count);
        let mut before = LAST;
        let mut ends_well = list.len() > 1;
        for &entry in list {
            // The last of a fan that is the first of it.
            ends_well &= before & LAST == 0 || entry & LAST == 0;
            before = entry;
        }
        let is_ring = before & LAST == 0 && list.iter().all(|&entry| entry & LAST == 0);
        distinct && are_others && ends_well && (is_ring || before & LAST != 0)
    }
}

#[cfg(test)]
impl Stars {
    /// Changes a number in a star, for tests of what is checked.
    pub(crate) fn change(&mut self, v: usize, at: usize, to: u32) {
        let star = &mut self.stars[v];
        let is_long = star.len as usize > INLINE;
        let list = star.entries[0] as usize;
        match at % 3 {
            0 if is_long => {
                let list = &mut self.spill.lists[list];
                let len = list.len();
                list[at / 3 % len] = to;
            }
            0 => star.entries[at / 3 % INLINE] = to,
            1 if is_long => {
                let list = &mut self.spill.tags[list];
                let len = list.len();
                list[at / 3 % len] = to;
            }
            1 => self.tags[v].0[at / 3 % INLINE] = to,
            _ if is_long => {}
            _ => star.len = to % (INLINE as u32 + 1),
        }
    }
}
