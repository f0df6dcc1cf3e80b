//! READ and collapse, until all is read, and then to the end.

use std::ops::ControlFlow;

use halfedge::{FaceId, VertexId};
use mesh_io::{Colour, Triangle};
use rayon::ThreadPool;

use crate::collapse::round::Rounds;
use crate::collapse::{
    CollapseOptions, CollapseReport, CollapseState, Collapsed, CollapsedFace, CollapsedMesh,
    CollapsedVertex, Recorder,
};
use crate::finality::Finality;
use crate::insert::Inserter;
use crate::portion::{Portion, state};
use crate::reorder::reorder;
use crate::run::Arrived;
use crate::sealed::Sealed;
use crate::{Error, Observer, Progress};

/// Takes triangles, and tells collapses.
#[derive(Debug)]
pub(crate) struct Collapser {
    pub(super) capacity: usize,
    pub(super) most_vertices: usize,
    pub(super) num_vertex_names: usize,
    pub(super) base_triangles: usize,
    /// How much colours count.
    pub(super) colour_weight: f32,
    pub(super) pool: ThreadPool,
    pub(super) portion: Portion,
    pub(super) inserter: Inserter,
    pub(super) rounds: Rounds,
    /// The axis and the coordinate below which every vertex in the buffer has had its last triangle.
    pub(super) below: Option<(usize, f32)>,
    pub(super) read: u64,
    /// Checksum of what was read.
    pub(super) crc: u32,
    /// Collapses told so far.
    pub(super) told: u64,
    pub(super) peak: usize,
    /// Whether all is read, and every vertex has had its last triangle.
    pub(super) is_finishing: bool,
    done: Vec<Collapsed>,
}

/// A triangle adds no more vertices: three, and one for each of those that are split because it completes them.
const VERTICES_OF_TRIANGLE: usize = 6;

/// Goes on with a checksum of triangles and of the colours of their corners, if they have some.
pub(crate) fn crc_with(crc: u32, triangles: &[Triangle], colours: &[[Colour; 3]]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(crc);
    if colours.is_empty() {
        hasher.update(bytemuck::cast_slice(triangles));
    }
    // Both of each triangle together, so that it does not matter where batches end.
    for (triangle, colours) in triangles.iter().zip(colours) {
        hasher.update(bytemuck::bytes_of(triangle));
        hasher.update(colours.as_flattened());
    }
    hasher.finalize()
}

impl Collapser {
    pub(crate) fn new(options: &CollapseOptions) -> Result<Self, Error> {
        options.check()?;
        let capacity = options.buffer_triangles;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.map_or(0, |n| n.get()))
            .build()
            .map_err(Error::Threads)?;
        // Memory that is not used is none.
        let mut portion = Portion::with_names(capacity * 9 / 16);
        portion.sealed = Sealed::default();
        if options.colours {
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
            rounds: Rounds::default(),
            below: None,
            read: 0,
            crc: 0,
            told: 0,
            peak: 0,
            is_finishing: false,
            done: Vec::new(),
        })
    }

    /// Takes triangles; whenever the buffer is full, collapses it to half.
    pub(crate) fn push<E: From<Error>>(
        &mut self,
        Arrived { triangles, colours, finality }: Arrived<'_>,
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        let last: &[u8] = match finality {
            Finality::Corners(tags) => tags,
            _ => &[],
        };
        let mut at = 0;
        while at < triangles.len() {
            // Wherever one batch ends and the next begins, there is no room at the same triangle.
            let room = (self.capacity - self.portion.num_triangles().min(self.capacity)).min(
                self.most_vertices.saturating_sub(self.portion.num_vertices())
                    / VERTICES_OF_TRIANGLE,
            );
            if room == 0 {
                self.make_room(recorder, observer)?;
                continue;
            }
            let end = triangles.len().min(at + room);
            let last = last.get(at..end).unwrap_or_default();
            let colours = colours.get(at..end).unwrap_or_default();
            let triangles = &triangles[at..end];
            self.inserter.insert_all(&mut self.portion, triangles, colours, last, self.read);
            self.read += (end - at) as u64;
            self.crc = crc_with(self.crc, triangles, colours);
            at = end;
        }
        if let Finality::Below { axis, coordinate } = finality {
            self.below = Some((axis, coordinate));
        }
        Ok(())
    }

    fn make_room<E: From<Error>>(
        &mut self,
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        self.peak = self.peak.max(self.portion.num_triangles());
        self.inserter.seal_final(&mut self.portion, self.below);
        let waiting = self.portion.num_waiting_triangles();
        if 2 * waiting > self.capacity || self.portion.num_vertices() > self.num_vertex_names {
            return Err(self.unsorted(waiting).into());
        }
        let goal = (self.capacity / 2).max(waiting + waiting / 2);
        self.prepare();
        self.collapse_to(goal, recorder, observer)?;
        if 16 * self.portion.num_triangles() > 15 * self.capacity
            || 16 * self.portion.num_vertices() > 15 * self.most_vertices
        {
            return Err(self.unsorted(waiting).into());
        }
        self.begin_reading();
        self.offer_checkpoint(recorder)
    }

    /// Makes ready for more triangles; once more changes nothing.
    pub(super) fn begin_reading(&mut self) {
        self.inserter.begin(&mut self.portion, self.capacity / 4);
    }

    fn offer_checkpoint<E>(&mut self, recorder: &mut dyn Recorder<E>) -> Result<(), E> {
        match recorder.wants_checkpoint(self.checkpoint_bytes()) {
            true => recorder.checkpoint(&CollapseState(self)),
            false => Ok(()),
        }
    }

    fn unsorted(&self, waiting: usize) -> Error {
        Error::Unsorted { read: self.read, waiting: waiting as u64, buffer: self.capacity }
    }

    /// Makes ready for collapses.
    fn prepare(&mut self) {
        let Self { portion, pool, colour_weight, .. } = self;
        portion.settle();
        pool.install(|| reorder(portion));
        portion.scale_colours(*colour_weight);
    }

    /// Collapses down to this number of triangles, or as far as that goes.
    fn collapse_to<E: From<Error>>(
        &mut self,
        goal: usize,
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(), E> {
        while self.portion.num_triangles() > goal {
            let Self { portion, pool, rounds, done, .. } = self;
            if 2 * portion.num_vertices() < portion.num_slots() {
                portion.compact();
            }
            let performed = pool.install(|| rounds.perform(portion, goal, done));
            for collapse in done.drain(..) {
                recorder.tell(&collapse)?;
            }
            self.told += performed as u64;
            if performed == 0 {
                break;
            }
            if observer(&self.progress()) == ControlFlow::Break(()) {
                return Err(Error::Interrupted.into());
            }
            if self.is_finishing {
                self.offer_checkpoint(recorder)?;
            }
        }
        Ok(())
    }

    /// Collapses what is left, and tells what remains.
    pub(crate) fn finish<E: From<Error>>(
        mut self,
        recorder: &mut dyn Recorder<E>,
        observer: &mut Observer<'_>,
    ) -> Result<(CollapsedMesh, CollapseReport), E> {
        if !self.is_finishing {
            self.end_reading()?;
        }
        self.collapse_to(self.base_triangles, recorder, observer)?;
        let report = CollapseReport {
            input_triangles: self.read,
            input_crc: self.crc,
            repaired: self.inserter.repairs,
            peak_buffer_triangles: self.peak as u64,
        };
        Ok((self.rest(), report))
    }

    /// No triangle will come any more.
    fn end_reading(&mut self) -> Result<(), Error> {
        self.peak = self.peak.max(self.portion.num_triangles());
        for v in 0..self.portion.num_slots() as u32 {
            if self.portion.state(v) == state::OPEN {
                self.inserter.seal(&mut self.portion, v);
            }
        }
        if self.portion.num_vertices() > self.num_vertex_names {
            return Err(self.unsorted(0));
        }
        // Nothing is looked up any more.
        self.inserter.forget();
        self.prepare();
        self.is_finishing = true;
        Ok(())
    }

    /// How far it is.
    pub(crate) fn progress(&self) -> Progress {
        let buffered = self.portion.num_triangles() as u64;
        Progress {
            read: self.read,
            buffered,
            capacity: self.capacity as u64,
            resolution: buffered as f64 / (self.read.max(1)) as f64,
            ..Default::default()
        }
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

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::prelude::*;

    use super::*;
    use crate::messy::{colour_at, sheet};

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
            options.colours = coloured;
            let mut collapser = Collapser::new(&options).unwrap();
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
                let arrived =
                    Arrived { triangles: batch, colours: &colours, finality: Finality::Unknown };
                match collapser.push(arrived, &mut count, go_on) {
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
