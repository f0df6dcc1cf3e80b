//! What changes stars: triangles that come and go, and collapses.

use super::{Added, Fans, INLINE, Joint, LAST, Star, StarSlice, Tags, fans, id};

impl StarSlice<'_> {
    /// The fans of a vertex.
    #[inline]
    pub(crate) fn fans(&self, v: u32) -> Fans<'_> {
        fans(&self.stars[(v - self.base) as usize], self.spill.as_deref())
    }

    /// Whether a star of so many neighbours is too long to be handled here.
    #[inline]
    pub(crate) fn is_long(&self, neighbours: usize) -> bool {
        neighbours > INLINE && self.spill.is_none()
    }

    /// Number of neighbours of a vertex.
    #[inline]
    pub(crate) fn valence(&self, v: u32) -> usize {
        self.stars[(v - self.base) as usize].len as usize
    }

    /// Number of neighbours of all vertices.
    pub(crate) fn sum_of_lengths(&self) -> u32 {
        self.stars.iter().fold(0, |sum, star| sum.wrapping_add(star.len))
    }

    #[inline]
    fn star_mut(&mut self, v: u32) -> &mut Star {
        &mut self.stars[(v - self.base) as usize]
    }

    /// The list of a vertex, to be changed in place.
    #[inline]
    fn list_mut(&mut self, v: u32) -> &mut [u32] {
        let star = &mut self.stars[(v - self.base) as usize];
        let len = star.len as usize;
        if len <= INLINE {
            &mut star.entries[..len]
        } else {
            match &mut self.spill {
                Some(spill) => &mut spill.lists[star.entries[0] as usize],
                None => &mut [],
            }
        }
    }

    /// The tags of a vertex' list, to be changed in place; empty where there are none.
    #[inline]
    fn tags_mut(&mut self, v: u32) -> &mut [u32] {
        let at = (v - self.base) as usize;
        let Some(tags) = self.tags.get_mut(at) else { return &mut [] };
        let star = &self.stars[at];
        let len = star.len as usize;
        match &mut self.spill {
            _ if len <= INLINE => &mut tags.0[..len],
            Some(spill) => &mut spill.tags[star.entries[0] as usize],
            None => &mut [],
        }
    }

    /// The tag of the entry at an index; there have to be tags.
    #[inline]
    pub(crate) fn tag(&self, v: u32, index: usize) -> u32 {
        let at = (v - self.base) as usize;
        let star = &self.stars[at];
        match &self.spill {
            Some(spill) if star.len as usize > INLINE => {
                spill.tags[star.entries[0] as usize][index]
            }
            _ => self.tags[at].0[index],
        }
    }

    /// Puts `new` where `count` entries from `at` are now, and their tags, where there are some.
    fn splice(&mut self, v: u32, at: usize, count: usize, new: &[u32], new_tags: &[u32]) {
        let star = &mut self.stars[(v - self.base) as usize];
        let tags = self.tags.get_mut((v - self.base) as usize);
        let old_len = star.len as usize;
        let len = old_len - count + new.len();
        if old_len <= INLINE && len <= INLINE {
            star.entries.copy_within(at + count..old_len, at + new.len());
            star.entries[at..at + new.len()].copy_from_slice(new);
            if let Some(Tags(tags)) = tags {
                tags.copy_within(at + count..old_len, at + new.len());
                tags[at..at + new.len()].copy_from_slice(new_tags);
            }
        } else if let Some(spill) = &mut self.spill {
            let (mut list, mut list_tags) = if old_len <= INLINE {
                let tags = tags.as_ref().map_or(Vec::new(), |tags| tags.0[..old_len].to_vec());
                (star.entries[..old_len].to_vec(), tags)
            } else {
                let number = star.entries[0];
                spill.free.push(number);
                let number = number as usize;
                (std::mem::take(&mut spill.lists[number]), std::mem::take(&mut spill.tags[number]))
            };
            list.splice(at..at + count, new.iter().copied());
            if tags.is_some() {
                list_tags.splice(at..at + count, new_tags.iter().copied());
            }
            if len <= INLINE {
                star.entries[..len].copy_from_slice(&list);
                if let Some(Tags(tags)) = tags {
                    tags[..len].copy_from_slice(&list_tags);
                }
            } else {
                let number = spill.free.pop().unwrap_or_else(|| {
                    spill.lists.push(Vec::new());
                    spill.tags.push(Vec::new());
                    spill.lists.len() as u32 - 1
                });
                spill.lists[number as usize] = list;
                spill.tags[number as usize] = list_tags;
                star.entries[0] = number;
            }
        }
        star.len = len as u32;
    }

    #[inline]
    fn position(&self, v: u32, neighbour: u32) -> Option<usize> {
        self.fans(v).position(neighbour)
    }

    /// Puts an entry before those from `at` on.
    #[inline]
    fn insert(&mut self, v: u32, at: usize, entry: u32, tag: u32) {
        let star = &mut self.stars[(v - self.base) as usize];
        let len = star.len as usize;
        if len >= INLINE {
            return self.splice(v, at, 0, &[entry], &[tag]);
        }
        for i in (at..len).rev() {
            star.entries[i + 1] = star.entries[i];
        }
        star.entries[at] = entry;
        star.len += 1;
        if let Some(Tags(tags)) = self.tags.get_mut((v - self.base) as usize) {
            tags.copy_within(at..len, at + 1);
            tags[at] = tag;
        }
    }

    /// Adds the triangle `(v, a, b)` at its [joint](Fans::joint). Its half-edge at `v` is the tag, if there are some.
    #[inline]
    pub(crate) fn add(&mut self, v: u32, a: u32, b: u32, joint: Joint, tag: u32) -> Added {
        match (joint.end, joint.start) {
            (None, None) => {
                let end = self.valence(v);
                self.insert(v, end, a, tag);
                self.insert(v, end + 1, b | LAST, u32::MAX);
            }
            (Some(i), None) => {
                self.list_mut(v)[i] = a;
                if let Some(old) = self.tags_mut(v).get_mut(i) {
                    *old = tag;
                }
                self.insert(v, i + 1, b | LAST, u32::MAX);
            }
            (None, Some(j)) => self.insert(v, j, a, tag),
            (Some(i), Some(j)) => return self.close(v, a, [i, j], tag),
        }
        Added::Open
    }

    /// Joins the fan that ends with `a` at index `i` to the one that starts at index `j`, or closes it.
    fn close(&mut self, v: u32, a: u32, [i, j]: [usize; 2], tag: u32) -> Added {
        let list = self.list_mut(v);
        let start = list[..i].iter().rposition(|e| e & LAST != 0).map_or(0, |s| s + 1);
        list[i] = a;
        let (added, moved, by) = if start == j {
            // The others stay in front, the ring goes to the end, where the lack of a mark tells it.
            let added = if list.len() == i + 1 - j { Added::Ring } else { Added::RingAndOthers };
            (added, j..list.len(), i + 1 - j)
        } else {
            let end = j + list[j..].iter().position(|e| e & LAST != 0).unwrap_or(0);
            let (moved, by) =
                if j > i { (i + 1..end + 1, j - i - 1) } else { (j..i + 1, end + 1 - j) };
            (Added::Open, moved, by)
        };
        if added == Added::Ring {
            if let Some(old) = self.tags_mut(v).get_mut(i) {
                *old = tag;
            }
            return added;
        }
        list[moved.clone()].rotate_left(by);
        let tags = self.tags_mut(v);
        if !tags.is_empty() {
            tags[i] = tag;
            tags[moved].rotate_left(by);
        }
        added
    }

    /// Takes the fans but the last from a vertex, and returns the neighbours that stood in them, with their marks, and tags.
    /// The last fan is the ring, if there is one.
    pub(crate) fn take_all_but_last(&mut self, v: u32) -> [Vec<u32>; 2] {
        let list = self.fans(v).list;
        let body = &list[..list.len().saturating_sub(1)];
        let start = body.iter().rposition(|e| e & LAST != 0).map_or(0, |s| s + 1);
        let taken = list[..start].to_vec();
        let tags = self.tags_mut(v);
        let tags = tags[..start.min(tags.len())].to_vec();
        self.splice(v, 0, start, &[], &[]);
        [taken, tags]
    }

    /// Gives an empty star these fans, and puts `v` where `old` was in the stars of the neighbours.
    pub(crate) fn adopt(&mut self, v: u32, old: u32, [fans, tags]: &[Vec<u32>; 2]) {
        self.splice(v, 0, 0, fans, tags);
        for &entry in fans {
            self.rename(id(entry), old, v);
        }
    }

    /// Puts `new` where `old` was.
    #[inline]
    pub(crate) fn rename(&mut self, v: u32, old: u32, new: u32) {
        if let Some(i) = self.position(v, old) {
            let entry = &mut self.list_mut(v)[i];
            *entry = new | (*entry & LAST);
        }
    }

    /// Takes out a neighbour whose two triangles at `v` become one, or whose one triangle at an end of a fan goes: the one
    /// that also has `other`.
    #[inline]
    fn close_gap(&mut self, v: u32, neighbour: u32, other: u32) {
        if let Some(i) = self.position(v, neighbour) {
            let list = self.list_mut(v);
            let before = if i > 0 { i - 1 } else { list.len() - 1 };
            let goes_before = list[before] == other;
            if list[i] & LAST != 0 && i > 0 {
                list[i - 1] |= LAST;
            }
            let tags = self.tags_mut(v);
            if goes_before && !tags.is_empty() {
                tags[before] = tags[i];
            }
            self.splice(v, i, 1, &[], &[]);
        }
    }

    /// Collapses `v` into its neighbour `u` and empties the star of `v`.
    ///
    /// `v` is a ring, or one fan with `u` at one of its ends; the link condition holds.
    pub(crate) fn collapse(&mut self, v: u32, u: u32) {
        let star = *self.star_mut(v);
        let ring = self.fans(v).is_ring();
        let len = star.len as usize;
        let mut long = Vec::new();
        let entries: &[u32] = if len <= INLINE {
            &star.entries[..len]
        } else {
            long.extend_from_slice(self.fans(v).list);
            &long
        };
        let at = entries.iter().position(|&e| id(e) == u).unwrap_or(0);
        // The neighbours that `u` gets, in order, and those at both sides of them.
        let mut fan = [0; INLINE];
        let mut long_fan = Vec::new();
        let around: &mut [u32] = if len <= INLINE {
            &mut fan[..len]
        } else {
            long_fan.resize(len, 0);
            &mut long_fan
        };
        around.copy_from_slice(entries);
        for e in around.iter_mut() {
            *e = id(*e);
        }
        let (wings, between): ([Option<u32>; 2], &[u32]) = if ring {
            around.rotate_left(at);
            ([Some(around[1]), Some(around[len - 1])], &around[2..len - 1])
        } else if at == 0 {
            ([Some(around[1]), None], &around[2..])
        } else {
            ([None, Some(around[len - 2])], &around[..len - 2])
        };
        for &x in between {
            self.rename(x, v, u);
        }
        for wing in wings.into_iter().flatten() {
            self.close_gap(wing, v, u);
        }
        if !self.tags.is_empty() {
            self.hand_over_tags(v, u, wings[0]);
        }
        if between.is_empty() {
            self.close_gap(u, v, u);
        } else if let Some(i) = self.position(u, v) {
            let last = self.fans(u).list[i] & LAST;
            let mut marked = [0; INLINE];
            let mut long_marked = Vec::new();
            let marked: &mut [u32] = if between.len() <= INLINE {
                &mut marked[..between.len()]
            } else {
                long_marked.resize(between.len(), 0);
                &mut long_marked
            };
            marked.copy_from_slice(between);
            marked[between.len() - 1] |= last;
            let mut tags = [u32::MAX; INLINE];
            let mut long_tags = Vec::new();
            let tags: &mut [u32] = if self.tags.is_empty() {
                &mut []
            } else if between.len() <= INLINE {
                &mut tags[..between.len()]
            } else {
                long_tags.resize(between.len(), u32::MAX);
                &mut long_tags
            };
            for (tag, &x) in tags.iter_mut().zip(between) {
                *tag = self.position(v, x).map_or(u32::MAX, |i| self.tag(v, i));
            }
            self.splice(u, i, 1, marked, tags);
        }
        self.clear(v);
    }

    /// The triangle of `u` and the wing after it in the star of `v` is that of `v` and the wing from now on.
    fn hand_over_tags(&mut self, v: u32, u: u32, wing: Option<u32>) {
        let Some(wing) = wing else { return };
        if let (Some(at_v), Some(at_u)) = (self.position(v, wing), self.position(u, wing)) {
            let tag = self.tag(v, at_v);
            self.tags_mut(u)[at_u] = tag;
        }
    }

    /// Takes all triangles of `v` out of the mesh; calls `left` with each neighbour and whether it has triangles still.
    pub(crate) fn take_out(&mut self, v: u32, mut left: impl FnMut(u32, bool)) {
        let neighbours: Vec<u32> = self.fans(v).neighbours().collect();
        for x in neighbours {
            self.cut_out(x, v);
            left(x, self.valence(x) > 0);
        }
        self.clear(v);
    }

    /// Removes the one or two triangles of `x` that have `v` as a corner.
    fn cut_out(&mut self, x: u32, v: u32) {
        let Some(i) = self.position(x, v) else { return };
        if self.fans(x).is_ring() {
            let list = self.list_mut(x);
            list.rotate_left(i + 1);
            let len = list.len();
            list[len - 2] |= LAST;
            self.splice(x, len - 1, 1, &[], &[]);
            return;
        }
        let list = self.list_mut(x);
        let begins = i == 0 || list[i - 1] & LAST != 0;
        let ends = list[i] & LAST != 0;
        // What is left on either side may be a single neighbour, which is no fan.
        let lone_before = !begins && (i == 1 || list[i - 2] & LAST != 0);
        let lone_after = !ends && list[i + 1] & LAST != 0;
        if !begins && !lone_before {
            list[i - 1] |= LAST;
        }
        let from = i - usize::from(lone_before);
        let to = i + 1 + usize::from(lone_after);
        self.splice(x, from, to - from, &[], &[]);
    }

    /// Empties a star without a look at its neighbours.
    fn clear(&mut self, v: u32) {
        let star = *self.star_mut(v);
        if star.len as usize > INLINE
            && let Some(spill) = &mut self.spill
        {
            spill.lists[star.entries[0] as usize] = Vec::new();
            spill.tags[star.entries[0] as usize] = Vec::new();
            spill.free.push(star.entries[0]);
        }
        self.star_mut(v).len = 0;
    }
}
