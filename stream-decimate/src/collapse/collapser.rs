//! READ and collapse, until all is read, and then to the end.

use std::ops::ControlFlow;

use halfedge::{FaceId, VertexId};
use mesh_io::{Colour, Triangle};
use rayon::ThreadPool;

use crate::collapse::round::Rounds;
use crate::collapse::{
    CollapseOptions, CollapseReport, Collapsed, CollapsedFace, CollapsedMesh, CollapsedVertex,
};
use crate::finality::Finality;
use crate::insert::Inserter;
use crate::portion::{Portion, state};
use crate::reorder::reorder;
use crate::sealed::Sealed;
use crate::{Error, Observer, Progress};

/// Takes triangles, and tells collapses.
#[derive(Debug)]
pub(crate) struct Collapser {
    capacity: usize,
    most_vertices: usize,
    num_vertex_names: usize,
    base_triangles: usize,
    /// How much colours count.
    colour_weight: f32,
    pool: ThreadPool,
    portion: Portion,
    inserter: Inserter,
    rounds: Rounds,
    /// The axis and the coordinate below which every vertex in the buffer has had its last triangle.
    below: Option<(usize, f32)>,
    read: u64,
    peak: usize,
    done: Vec<Collapsed>,
}

impl Collapser {
    /// For triangles whose corners have colours, or for others.
    pub(crate) fn new(options: &CollapseOptions, has_colours: bool) -> Result<Self, Error> {
        options.check()?;
        let capacity = options.buffer_triangles;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.map_or(0, |n| n.get()))
            .build()
            .map_err(Error::Threads)?;
        // Memory that is not used is none.
        let mut portion = Portion::with_names(capacity * 9 / 16);
        portion.sealed = Sealed::default();
        if has_colours {
            portion = portion.with_colours();
        }
        let mut inserter = Inserter::default();
        inserter.begin(&mut portion, capacity.min(1 << 20) / 2);
        Ok(Self {
            capacity,
            most_vertices: options.most_vertices(),
            num_vertex_names: options.num_vertex_names() as usize,
            base_triangles: options.base_triangles,
            colour_weight: options.colour_weight,
            pool,
            portion,
            inserter,
            rounds: Rounds::new(),
            below: None,
            read: 0,
            peak: 0,
            done: Vec::new(),
        })
    }

    /// Takes triangles; whenever the buffer is full, collapses it to half.
    pub(crate) fn push<E: From<Error>>(
        &mut self,
        triangles: &[Triangle],
        colours: &[[Colour; 3]],
        finality: Finality<'_>,
        tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        let last: &[u8] = match finality {
            Finality::Corners(tags) => tags,
            _ => &[],
        };
        let mut at = 0;
        while at < triangles.len() {
            let room = (self.capacity - self.portion.num_triangles().min(self.capacity))
                .min(self.most_vertices.saturating_sub(self.portion.num_vertices()) / 3);
            if room == 0 {
                self.make_room(tell, observer)?;
                continue;
            }
            let end = triangles.len().min(at + room);
            let last = last.get(at..end).unwrap_or_default();
            let colours = colours.get(at..end).unwrap_or_default();
            let triangles = &triangles[at..end];
            self.inserter.insert_all(&mut self.portion, triangles, colours, last, self.read);
            self.read += (end - at) as u64;
            at = end;
        }
        if let Finality::Below { axis, coordinate } = finality {
            self.below = Some((axis, coordinate));
        }
        Ok(())
    }

    fn make_room<E: From<Error>>(
        &mut self,
        tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        self.peak = self.peak.max(self.portion.num_triangles());
        self.inserter.seal_final(&mut self.portion, self.below);
        let waiting = self.portion.num_waiting_triangles();
        if 2 * waiting > self.capacity || self.portion.num_vertices() > self.num_vertex_names {
            return Err(self.unsorted(waiting).into());
        }
        let goal = (self.capacity / 2).max(waiting + waiting / 2);
        self.collapse_to(goal, tell, observer)?;
        if 16 * self.portion.num_triangles() > 15 * self.capacity
            || 16 * self.portion.num_vertices() > 15 * self.most_vertices
        {
            return Err(self.unsorted(waiting).into());
        }
        self.inserter.begin(&mut self.portion, self.capacity / 4);
        Ok(())
    }

    fn unsorted(&self, waiting: usize) -> Error {
        Error::Unsorted { read: self.read, waiting: waiting as u64, buffer: self.capacity }
    }

    /// Collapses down to this number of triangles, or as far as that goes.
    fn collapse_to<E: From<Error>>(
        &mut self,
        goal: usize,
        tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        let Self { portion, pool, rounds, done, colour_weight, .. } = self;
        portion.settle();
        pool.install(|| reorder(portion));
        portion.scale_colours(*colour_weight);
        while portion.num_triangles() > goal {
            if 2 * portion.num_vertices() < portion.num_slots() {
                portion.compact();
            }
            let performed = pool.install(|| rounds.perform(portion, goal, done));
            for collapse in done.drain(..) {
                tell(&collapse)?;
            }
            if performed == 0 {
                break;
            }
            if observer(&self::progress(self.read, self.capacity, portion))
                == ControlFlow::Break(())
            {
                return Err(Error::Interrupted.into());
            }
        }
        Ok(())
    }

    /// Collapses what is left, and tells what remains.
    pub(crate) fn finish<E: From<Error>>(
        mut self,
        tell: &mut dyn FnMut(&Collapsed) -> Result<(), E>,
        observer: &mut Observer<'_>,
    ) -> Result<(CollapsedMesh, CollapseReport), E> {
        self.peak = self.peak.max(self.portion.num_triangles());
        for v in 0..self.portion.num_slots() as u32 {
            if self.portion.state(v) == state::OPEN {
                self.inserter.seal(&mut self.portion, v);
            }
        }
        if self.portion.num_vertices() > self.num_vertex_names {
            return Err(self.unsorted(0).into());
        }
        // Nothing is looked up any more.
        self.inserter.forget();
        self.collapse_to(self.base_triangles, tell, observer)?;
        let report = CollapseReport {
            input_triangles: self.read,
            repaired: self.inserter.repairs,
            peak_buffer_triangles: self.peak as u64,
        };
        Ok((self.rest(), report))
    }

    /// How far it is.
    pub(crate) fn progress(&self) -> Progress {
        self::progress(self.read, self.capacity, &self.portion)
    }

    fn rest(&self) -> CollapsedMesh {
        let portion = &self.portion;
        let mut mesh = CollapsedMesh::default();
        let name = |v: u32| VertexId::new(portion.identities[v as usize].name);
        let mut corners = Vec::new();
        for v in (0..portion.num_slots() as u32).filter(|&v| portion.state(v) != state::FREE) {
            mesh.vertices.push(CollapsedVertex {
                name: name(v),
                position: portion.position(v),
                normal: portion.identities[v as usize].normal.normalize_or_zero(),
                colour: portion.paints.get(v as usize).map(|paint| paint.colour),
            });
            let fans = portion.stars.fans(v);
            let tags = portion.stars.tags(v).iter().enumerate();
            corners.extend(tags.filter(|&(i, _)| !fans.is_last(i)).map(|(_, &h)| (h, name(v))));
        }
        // The three of a face come together.
        corners.sort_unstable_by_key(|&(h, _)| h);
        let faces = corners.chunks_exact(3).map(|face| CollapsedFace {
            name: FaceId::new(face[0].0 / 3),
            corners: [face[0].1, face[1].1, face[2].1],
        });
        mesh.faces.extend(faces);
        mesh
    }
}

fn progress(read: u64, capacity: usize, portion: &Portion) -> Progress {
    let buffered = portion.num_triangles() as u64;
    Progress {
        read,
        buffered,
        capacity: capacity as u64,
        resolution: buffered as f64 / (read.max(1)) as f64,
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::prelude::*;

    use super::*;
    use crate::messy::sheet;

    /// A colour that tells where it belongs.
    fn colour_at(p: glam::Vec3) -> Colour {
        let [a, b, c, d] = (p + glam::Vec3::ZERO)
            .to_array()
            .iter()
            .fold(7u32, |hash, c| (hash ^ c.to_bits()).wrapping_mul(0x9e37_79b1).rotate_left(9))
            .to_le_bytes();
        [a, b, c, d]
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..Default::default() })]

        #[test]
        fn the_buffer_holds_a_manifold_with_names_at_any_time(
            rows in 10usize..60,
            holes in 3usize..50,
            mess in prop::collection::vec(any::<usize>(), 0..40),
            buffer in 200usize..2000,
            coloured: bool,
        ) {
            let mut options = CollapseOptions::default();
            (options.buffer_triangles, options.base_triangles) = (buffer, 4);
            let mut collapser = Collapser::new(&options, coloured).unwrap();
            let (mut vertices, mut faces) = (0u64, 0u64);
            let mut count = |collapse: &Collapsed| {
                vertices += 1;
                faces += 1 + u64::from(collapse.reverse.is_some());
                assert_eq!(collapse.colour, coloured.then(|| colour_at(collapse.position)));
                assert!(collapse.removed.get() < options.num_vertex_names());
                assert!(collapse.half_edge.face().get() < options.num_face_names());
                Ok::<(), Error>(())
            };
            let go_on = &mut |_: &Progress| ControlFlow::Continue(());
            let input = sheet(rows, holes, &mess);
            for batch in input.chunks(50) {
                let colours: Vec<_> = batch.iter().map(|t| t.map(colour_at)).collect();
                let colours = if coloured { &colours[..] } else { &[] };
                match collapser.push(batch, colours, Finality::Unknown, &mut count, go_on) {
                    Ok(()) => {}
                    Err(Error::Unsorted { .. }) => return Ok(()),
                    Err(error) => panic!("{error}"),
                }
                prop_assert_eq!(collapser.portion.validate(), Ok(()));
                prop_assert!(collapser.portion.num_triangles() <= buffer);
            }
            let (rest, report) = match collapser.finish(&mut count, go_on) {
                Ok(finished) => finished,
                Err(Error::Unsorted { .. }) => return Ok(()),
                Err(error) => panic!("{error}"),
            };
            let repaired = report.repaired;
            let left_out = repaired.non_finite + repaired.degenerate + repaired.duplicate;
            prop_assert_eq!(report.input_triangles, input.len() as u64);
            prop_assert_eq!(faces + rest.faces.len() as u64 + left_out, report.input_triangles);
            prop_assert_eq!(repaired.recoloured, 0);
            for vertex in &rest.vertices {
                prop_assert_eq!(vertex.colour, coloured.then(|| colour_at(vertex.position)));
            }
            let names: HashSet<_> = rest.vertices.iter().map(|vertex| vertex.name).collect();
            prop_assert_eq!(names.len(), rest.vertices.len());
            prop_assert!(rest.faces.iter().flat_map(|face| face.corners).all(|v| names.contains(&v)));
        }
    }
}
