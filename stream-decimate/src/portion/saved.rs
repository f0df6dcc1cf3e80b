//! The portion in a checkpoint, and whether what comes out of one can be one: everything that the work on it relies on is
//! looked at, so that nothing goes wrong later whatever was in the file.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use scratch::{CheckpointError, CheckpointReader, CheckpointWriter};

use super::{Portion, STATE, TAKEN, state};
use crate::names::{Free, Names};
use crate::star::LongStars;

/// What a portion can be at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Names of vertices and of faces.
    pub(crate) vertex_names: u32,
    pub(crate) face_names: u32,
    /// Collapses there have been.
    pub(crate) collapses: u64,
}

impl Portion {
    /// Bytes that [`save`](Self::save) writes for a vertex, with its name where that is free.
    pub(crate) const fn saved_vertex_bytes(has_colours: bool) -> u64 {
        64 + 32 + 1 + 4 + 4 + 2 * 64 + 4 + if has_colours { 8 } else { 0 }
    }
    /// And for a triangle's name where that is free.
    pub(crate) const SAVED_NAME_BYTES: u64 = 4;
    /// And for a triangle, if all stars are long.
    pub(crate) const SAVED_LONG_BYTES: u64 = 3 * 2 * 4;

    /// Writes all of it, but what was sealed on suspicion: where collapses are recorded, nothing is.
    pub(crate) fn save(&self, out: &mut CheckpointWriter) -> Result<(), scratch::Error> {
        out.put("vertices", &self.vertices)?;
        out.put("identities", &self.identities)?;
        out.put("flags", &self.flags)?;
        out.put("bounds", &self.bounds)?;
        out.put("waiting", &self.waiting)?;
        if self.has_colours {
            out.put("paints", &self.paints)?;
        }
        self.stars.save(out)?;
        if let Some(Names { vertices, faces }) = &self.names {
            out.put("used names", &[[vertices.used, faces.used]])?;
            out.put("free vertex names", &vertices.names)?;
            out.put("free face names", &faces.names)?;
        }
        Ok(())
    }

    /// Reads what was saved into a portion with names, and makes sure that it can be one.
    pub(crate) fn restore(
        &mut self,
        from: &mut CheckpointReader,
        limits: Limits,
    ) -> Result<(), CheckpointError> {
        let most = u64::from(limits.vertex_names);
        from.take("vertices", most, &mut self.vertices)?;
        from.take("identities", most, &mut self.identities)?;
        from.take("flags", most, &mut self.flags)?;
        from.take("bounds", most, &mut self.bounds)?;
        from.take("waiting", most, &mut self.waiting)?;
        if self.has_colours {
            from.take("paints", most, &mut self.paints)?;
        }
        self.stars.restore(from, most)?;
        let [vertices, faces] = from.take_one::<[u32; 2]>("used names")?;
        if vertices > limits.vertex_names || faces > limits.face_names.min(u32::MAX / 3) {
            return Err(CheckpointError::Damaged("names"));
        }
        let mut names = Names::default();
        from.take("free vertex names", vertices.into(), &mut names.vertices.names)?;
        from.take("free face names", faces.into(), &mut names.faces.names)?;
        (names.vertices.used, names.faces.used) = (vertices, faces);
        self.check(&names, limits.collapses).map_err(CheckpointError::Damaged)?;
        self.names = Some(names);
        Ok(())
    }

    /// Looks at everything, and counts what is free and how many triangles there are.
    fn check(&mut self, names: &Names, collapses: u64) -> Result<(), &'static str> {
        let count = self.vertices.len();
        let lengths =
            [self.identities.len(), self.flags.len(), self.bounds.len(), self.waiting.len()];
        let num_paints = if self.has_colours { count } else { 0 };
        if lengths != [count; 4] || self.stars.len() != count || self.paints.len() != num_paints {
            return Err("arrays");
        }
        let vertex_names = Bits::new(names.vertices.used as usize);
        let half_edges = Bits::new(3 * names.faces.used as usize);
        let long = LongStars::new(&self.stars);
        // First by themselves, so that it is safe to follow what is in them.
        (0..count as u32).into_par_iter().with_min_len(1024).try_for_each(|v| {
            if self.state(v) == state::FREE {
                let is_free = self.flags[v as usize] == state::FREE;
                return if is_free && self.stars.fans(v).len() == 0 {
                    Ok(())
                } else {
                    Err("stars")
                };
            }
            if !long.is_star(v, count) || !self.has_sound_state(v) {
                return Err("stars");
            }
            let identity = &self.identities[v as usize];
            if !vertex_names.add(identity.name) {
                return Err("names");
            }
            let area = self.paints.get(v as usize).map_or(0.0, |paint| paint.area);
            let sound = self.position(v).is_finite()
                && u64::from(identity.touched) <= collapses
                && area >= 0.0
                && area.is_finite();
            if sound { Ok(()) } else { Err("vertices") }
        })?;
        let num_corners = (0..count as u32)
            .into_par_iter()
            .with_min_len(1024)
            .map(|v| self.check_triangles(v, &long, &half_edges))
            .try_reduce(|| 0, |a, b| Ok(a + b))?;
        self.num_triangles = num_corners / 3;
        self.free = (0..count as u32).filter(|&v| self.state(v) == state::FREE).collect();
        // Every name that ever was is in use or free, and not both.
        let are_all = |free: &Free, in_use: usize| free.names.len() + in_use == free.used as usize;
        let is_free_face = |&face: &u32| {
            face < names.faces.used && (0..3).all(|corner| half_edges.add(3 * face + corner))
        };
        let sound = are_all(&names.vertices, self.num_vertices())
            && are_all(&names.faces, self.num_triangles)
            && names.vertices.names.iter().all(|&name| vertex_names.add(name))
            && names.faces.names.iter().all(is_free_face);
        if sound { Ok(()) } else { Err("names") }
    }

    fn has_sound_state(&self, v: u32) -> bool {
        let fans = self.stars.fans(v);
        let flags = self.flags[v as usize];
        flags & TAKEN == 0
            && match flags & STATE {
                state::OPEN => !fans.is_ring(),
                state::RING => fans.is_ring(),
                state::BOUNDARY => !fans.is_ring() && fans.num_fans() == 1,
                _ => false,
            }
    }

    /// That the triangles of a vertex are triangles of their other corners as well, and that the three half-edges of each are
    /// those of one face, which no other triangle has. How many there are.
    fn check_triangles(
        &self,
        v: u32,
        long: &LongStars<'_>,
        half_edges: &Bits,
    ) -> Result<usize, &'static str> {
        let fans = self.stars.fans(v);
        let tags = self.stars.tags(v);
        let mut count = 0;
        for i in (0..fans.len()).filter(|&i| !fans.is_last(i)) {
            let (a, b) = (fans.at(i), fans.at((i + 1) % fans.len()));
            let position = |p: u32, q: u32, r: u32| {
                let star = self.stars.fans(p);
                let at = long.position(p, q).filter(|&at| !star.is_last(at));
                at.filter(|&at| star.at((at + 1) % star.len()) == r)
            };
            let (Some(at), Some(_)) = (position(a, b, v), position(b, v, a)) else {
                return Err("triangles");
            };
            let (Some(&h), Some(&next)) = (tags.get(i), self.stars.tags(a).get(at)) else {
                return Err("triangles");
            };
            if !half_edges.add(h) || next != h / 3 * 3 + (h + 1) % 3 {
                return Err("names");
            }
            count += 1;
        }
        Ok(count)
    }
}

/// A set of small numbers that several threads add to.
struct Bits {
    words: Vec<AtomicU64>,
    count: usize,
}

impl Bits {
    /// For numbers below this.
    fn new(count: usize) -> Self {
        Self { words: (0..count.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(), count }
    }

    /// Adds a number; whether it is small enough and was not there.
    fn add(&self, number: u32) -> bool {
        let (at, bit) = (number as usize, 1 << (number % 64));
        at < self.count && self.words[at / 64].fetch_or(bit, Ordering::Relaxed) & bit == 0
    }
}
